//! Whole loops for one motor: filters and controllers in their order of use.
//!
//! ```text
//! SpeedActuator      speed -> low-pass -> PID -> low-pass -> output
//!
//! PositionActuator   angle -> low-pass -> PID (every n-th step) -> speed setpoint
//!                                                                     |
//!                    speed -> low-pass ------------------------> PID -+-> low-pass -> output
//! ```
//! The two PIDs of the latter are a [`Cascade`], used without filters by the motors of a bus.

mod cascade;
mod position;
mod speed;

pub use cascade::Cascade;
pub use position::PositionActuator;
pub use speed::SpeedActuator;

use super::error::positive;
use super::filter::LowPass;
use crate::error::ConfigError;
use crate::time::TimeStep;

/// An optional low-pass.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
struct OptionalFilter(Option<LowPass>);

impl OptionalFilter {
    /// Makes the filter, and names its cut-off in errors as this actuator does.
    const fn new(name: &'static str, cutoff_hz: f32) -> Result<Self, ConfigError> {
        match (positive(name, cutoff_hz), LowPass::new(cutoff_hz)) {
            (Ok(()), Ok(filter)) => Ok(Self(Some(filter))),
            (Err(error), _) | (_, Err(error)) => Err(error),
        }
    }

    /// Filters a finite value, by a time step that is not on hold.
    const fn pass(&mut self, value: f32, step: &TimeStep) -> f32 {
        match &mut self.0 {
            Some(filter) => filter.pass(value, step),
            None => value,
        }
    }

    /// Passes the next value as a first value.
    const fn reset(&mut self) {
        if let Some(filter) = &mut self.0 {
            filter.reset();
        }
    }
}
