//! Controllers, filters and profiles: `f32`, no heap, the time as an argument.

mod differentiator;
mod error;
mod number;
mod pid;
mod step;

pub use differentiator::{LinearDifferentiator, OptimalDifferentiator, fhan};
pub use error::{ConfigError, ConfigFault};
pub use pid::{IncrementalPid, IncrementalPidConfig, Pid, PidConfig, Terms};
pub use step::TimeStep;
