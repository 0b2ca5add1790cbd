//! All cases, file by file.

use crate::case::Case;
use crate::{
    arming, clocks, commands, drives, health, odrive, plausibility, receive, registration, rmd,
    robstride, timing, transmit,
};

pub(crate) const CATALOGUE: [&[Case]; 13] = [
    receive::CASES,
    plausibility::CASES,
    timing::CASES,
    clocks::CASES,
    commands::CASES,
    arming::CASES,
    registration::CASES,
    transmit::CASES,
    health::CASES,
    drives::CASES,
    odrive::CASES,
    robstride::CASES,
    rmd::CASES,
];
