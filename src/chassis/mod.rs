//! From a motion of the body to wheel speeds and back, for every wheel layout.
//!
//! Axes, signs and units are those drawn in [`geometry`](crate::geometry): x forward, y left, counter-clockwise
//! positive. A positive wheel velocity rolls forward.
//!
//! | layout | wheels | inverse, forward |
//! |---|---|---|
//! | [`Mecanum`] | [`MecanumWheels`] | both roller mountings |
//!
//! A layout is made once from its dimensions; what cannot be driven is refused there with a [`GeometryError`].

mod error;
mod kinematics;
mod mecanum;
mod wheels;

pub use error::GeometryError;
pub use kinematics::{Kinematics, WheelSpeed};
pub use mecanum::{Mecanum, MecanumGeometry, RollerMounting};
pub use wheels::MecanumWheels;
