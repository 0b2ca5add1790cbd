//! Controllers, filters and profiles: `f32`, no heap, the time as an argument.

mod actuator;
mod differentiator;
mod error;
mod filter;
mod number;
mod pid;
mod shaping;
mod step;
mod tuning;

pub use actuator::{PositionActuator, PositionActuatorConfig, SpeedActuator, SpeedActuatorConfig};
pub use differentiator::{LinearDifferentiator, OptimalDifferentiator, fhan};
pub use error::{ConfigError, ConfigFault};
pub use filter::{Biquad, LowPass, Median, MovingAverage};
pub use pid::{IncrementalPid, IncrementalPidConfig, Pid, PidConfig, Terms};
pub use shaping::{FeedForward, MotionLimits, Profile, ProfileState, SlewLimiter};
pub use step::TimeStep;
pub use tuning::{
    Gains, Oscillation, RelayTuner, RelayTunerConfig, StepMeasures, StepResponse, TuningRule,
};
