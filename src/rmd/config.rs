//! The control mode: that of `lk`, with the scales of the output shaft.

pub use crate::lk::Mode;
