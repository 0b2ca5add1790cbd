//! All cases, file by file.

use crate::case::Case;
use crate::{commands, health, plausibility, receive, registration, timing, transmit};

pub(crate) const CATALOGUE: [&[Case]; 7] = [
    receive::CASES,
    plausibility::CASES,
    timing::CASES,
    commands::CASES,
    registration::CASES,
    transmit::CASES,
    health::CASES,
];
