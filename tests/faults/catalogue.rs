//! All cases, file by file.

use crate::case::Case;
use crate::{
    arming, clocks, commands, drives, health, plausibility, receive, registration, timing, transmit,
};

pub(crate) const CATALOGUE: [&[Case]; 10] = [
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
];
