//! Every entry that arms, with every reason to refuse it; and what of the time before an arming must not count after it.

#![cfg(test)]

mod again;
mod dji;
mod engage;
mod joints;
mod own;
mod parts;
#[cfg(feature = "hal")]
mod pins;
mod runner;

use drivetrain::time::Instant;

fn at_ms(ms: u64) -> Instant {
    Instant::from_micros(ms * 1_000)
}

/// For so long, in ms, nobody asks for arming after something was relaxed or refused.
const PAUSE_MS: u64 = 150;
/// For so long, in ms, another node is remembered.
const RIVAL_MS: u64 = 1_100;
