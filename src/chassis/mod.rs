//! From a motion of the body to wheel speeds and back, for every wheel layout.
//!
//! Axes, signs and units are those drawn in [`geometry`](crate::geometry): x forward, y left, counter-clockwise
//! positive. A positive wheel velocity rolls forward; on an omni wheel, along the direction it was given.
//!
//! | layout | wheels | remarks |
//! |---|---|---|
//! | [`Mecanum`] | [`MecanumWheels`] | both roller mountings |
//! | [`OmniThree`], [`OmniFour`] | [`OmniThreeWheels`], [`OmniFourWheels`] | positive rolls counter-clockwise |
//! | [`Omni`] | an array, as given | three and more wheels at any place, in any direction |
//! | [`Differential`] | [`DifferentialWheels`] | cannot move sideways |
//! | [`Swerve`] | an array, as given | [`SwerveSteering`] finds the shorter way and holds the angles |
//!
//! A layout is made once from its dimensions; what cannot be driven is refused there with a [`GeometryError`].
//! Where there are more wheels than unknowns, `forward` is the least-squares fit, and
//! [`slip_m_s`](Kinematics::slip_m_s) tells how far the wheels contradict each other.

mod base;
mod differential;
mod error;
mod kinematics;
mod least_squares;
mod limits;
mod mecanum;
mod mode;
mod odometry;
mod omni;
mod power;
mod power_buffer;
mod power_fit;
mod steering;
mod swerve;
mod wheels;

pub use base::{Chassis, ChassisStatus, MotionSource};
pub use differential::{Differential, DifferentialGeometry};
pub use error::GeometryError;
pub use kinematics::{Kinematics, WheelSpeed};
pub use limits::{ChassisLimits, LimitError};
pub use mecanum::{Mecanum, MecanumGeometry, RollerMounting};
pub use mode::{GimbalEdge, Mode, ModeConfig, ModeError, Modes, Spin, WithoutGimbal};
pub use odometry::Odometry;
pub use omni::{Omni, OmniFour, OmniThree, OmniWheel};
pub use power::{PowerCut, PowerError, PowerModel, WheelLoad};
pub use power_buffer::{BufferError, PowerBuffer};
pub use power_fit::PowerFit;
pub use steering::{SteeringConfig, SwerveSteering};
pub use swerve::{ModuleState, Swerve};
pub use wheels::{DifferentialWheels, MecanumWheels, OmniFourWheels, OmniThreeWheels};
