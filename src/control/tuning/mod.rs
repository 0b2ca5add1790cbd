//! Finding gains and judging them.
//!
//! 1. [`RelayTuner`] swings the plant between two output values and measures the response: [`RelayTuner::ultimate`].
//! 2. [`RelayTuner::pid`] calculates gains from the response by a [`TuningRule`] with a name and a source.
//! 3. [`StepResponse`] measures the loop with these gains.
//!
//! Where mass and wheels of a robot are known, [`WheelTuning`] reckons gains to begin with. Where the mechanism may be swung
//! through its range, an [`Identification`](crate::control::Identification) finds the plant, and with it gains of a stated margin.

mod relay;
mod rules;
mod step_response;
mod wheel;

pub use relay::RelayTuner;
pub use rules::TuningRule;
pub use step_response::StepResponse;
pub use wheel::WheelTuning;
