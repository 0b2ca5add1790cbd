//! Controllers, filters and profiles for the loops of a robot: `f32`, no heap, the time as an argument.
//!
//! # Which one?
//! | loop or task | use | start with |
//! |---|---|---|
//! | wheel or shooter speed | [`SpeedActuator`], or [`Pid`] alone | PI, output and integral limit, `with_feed_forward` |
//! | speed, and the setpoint jumps | [`Pid`] | `with_tracking`; `with_incremental_form` where gains change on the way |
//! | arm or lift position | [`PositionActuator`] | P over PI, the angle loop's output limit is the speed limit |
//! | gimbal or swerve angle | [`PositionActuator`] | `with_period(360.0)`: the shortest way round |
//! | the same, with an error from integers | [`PositionActuator::step_error`] | the measured speed is the rate |
//! | heading of a chassis | [`Pid`] | PD with `with_period`, `with_dead_band` |
//! | a target from a stick or another computer | [`SlewLimiter`], [`Differentiator::optimal`] | the acceleration the mechanism can take |
//! | a move from A to B | [`Profile`] and [`Plant::effort`] | trapezoid; [`MotionLimits::with_jerk`] when it shakes |
//! | a move from any state, to a target that moves, or of several axes in step | [`Motion`], [`MotionFollower`], [`Motions`] | limits of velocity, acceleration and jerk that the mechanism can take |
//! | a noisy measurement | [`LowPass`]; [`Biquad`] when that is not steep enough | a cut-off of ten times the loop's bandwidth |
//! | a resonance | [`Biquad::notch`] | its frequency, q = 2 |
//! | single wrong samples | the median of a [`Window`] of 3 | |
//! | a disturbance of a known period | the mean of a [`Window`] of that many samples | |
//! | the rate of a noisy signal | [`Differentiator`] | |
//! | what pushes, brakes or blocks a shaft; a speed with less noise and no lag | [`LoadObserver`] | a bandwidth of 200 rad/s |
//! | several states at once: a pendulum, a balancing robot, an arm with its load | [`state_space::LinearQuadraticRegulator`], [`state_space::KalmanFilter`] | a model, and the largest error and effort that are acceptable |
//! | gains for the wheels of a robot | [`WheelTuning`] | its mass, the radius and the number of its wheels |
//! | kS, kV, kA and delay of a motor on its mechanism, and gains by bandwidth and phase margin | [`Excitation`] and [`Identification`], then [`Plant::speed_loop`] | half of the effort that the mechanism can take, and 60 degrees |
//! | gains for an unknown plant | [`RelayTuner`], then [`StepResponse`] | [`TuningRule::TyreusLuybenPi`] |
//!
//! # Common behaviour
//! * Time is `dt_s`, seconds since the call before. A `dt_s` that is zero, negative, NaN or infinite changes nothing. Each
//!   type states the effect of a very long `dt_s`; for the controllers see [`TimeStep`](crate::time::TimeStep).
//! * If a setpoint or measurement is NaN or infinite, the last output is returned and the sample is counted. The next good
//!   sample works as if the bad sample had not come, except that the D of a controller rests in it, since the time between is
//!   longer than one step.
//! * Limits, gains and frequencies are checked once, by the constructor; a [`ConfigError`](crate::error::ConfigError) names the
//!   invalid parameter. A check by arithmetic alone is `const`, so a bad constant does not compile.
//! * Nothing panics, and every stored value is finite.
//!
//! Signs: an output grows with `setpoint - measurement`; a positive `kd` damps. Units are the caller's; gains are per second.
//!
//! ```
//! use drivetrain::control::{Pid, PidConfig};
//! use drivetrain::time::TimeStep;
//!
//! let speed = PidConfig::new(2.0, 2.5, 0.0).with_output_limit(20.0).with_integral_limit(10.0);
//! let mut wheel = Pid::new(speed)?;
//! assert_eq!(wheel.step(14.0, 10.0, &TimeStep::of(0.001)), 8.0); // A for rad/s: 2 times 4
//! # Ok::<(), drivetrain::error::ConfigError>(())
//! ```

mod actuator;
mod differentiator;
mod filter;
mod identification;
mod matrix;
mod motion;
mod number;
mod observer;
mod pid;
mod shaping;
pub mod state_space;
mod tuning;

pub use actuator::{PositionActuator, SpeedActuator};
pub use differentiator::{Differentiator, fhan};
pub use filter::{Biquad, LowPass, Window};
pub use identification::{Excitation, Identification, IdentificationError, Plant};
pub(crate) use matrix::solved;
pub use motion::{Motion, MotionFollower, Motions};
pub use observer::LoadObserver;

pub(crate) use pid::ErrorPid;
pub use pid::{Pid, PidConfig};
pub use shaping::{MotionLimits, Profile, ProfileState, SlewLimiter};
pub use tuning::{RelayTuner, StepResponse, TuningRule, WheelTuning};
