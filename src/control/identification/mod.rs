//! Identification: the plant of a motor on its mechanism from a run, and gains from that plant.
//!
//! 1. [`Excitation`] swings the mechanism within limits of effort, speed and way.
//! 2. [`Identification`] takes effort and speed of each tick, and returns a [`Plant`] or an [`IdentificationError`].
//! 3. [`Plant::speed_loop`] and [`Plant::position_loop`] calculate gains from a bandwidth and a phase margin.
//!
//! The power model of a chassis is identified by [`PowerFit`](crate::chassis::PowerFit).

mod error;
mod estimator;
mod excitation;
mod plant;
mod regression;

pub use error::IdentificationError;
pub use estimator::Identification;
pub use excitation::Excitation;
pub use plant::Plant;
