//! Whole loops for one motor: filters and controllers in the order in which they are used.
//!
//! ```text
//! SpeedActuator      speed -> low-pass -> PID -> low-pass -> output
//!
//! PositionActuator   angle -> low-pass -> PID (every n-th step) -> speed setpoint
//!                                                                     |
//!                    speed -> low-pass ------------------------> PID -+-> low-pass -> output
//! ```

mod position;
mod speed;

pub use position::{PositionActuator, PositionActuatorConfig};
pub use speed::{SpeedActuator, SpeedActuatorConfig};

use super::error::ConfigError;
use super::filter::LowPass;
use super::step::TimeStep;

/// Makes the filter, if one was asked for, and calls its cut-off by the name it has here.
const fn optional_filter(
    name: &'static str,
    cutoff_hz: Option<f32>,
) -> Result<Option<LowPass>, ConfigError> {
    match cutoff_hz {
        None => Ok(None),
        Some(cutoff_hz) => match LowPass::new(cutoff_hz) {
            Ok(filter) => Ok(Some(filter)),
            Err(error) => Err(ConfigError::new(name, error.fault())),
        },
    }
}

const fn through(filter: &mut Option<LowPass>, value: f32, step: &TimeStep) -> f32 {
    match filter {
        Some(filter) => filter.step(value, step),
        None => value,
    }
}

/// Lets the next value through a filter as if it were the first.
const fn restart(filter: &mut Option<LowPass>) {
    if let Some(filter) = filter {
        filter.reset();
    }
}
