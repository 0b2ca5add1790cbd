//! The control modes: those of `lk`, with the scales of the output shaft.

pub use crate::lk::{Mode, PositionVelocity, Velocity};
