//! Checks of numbers from outside.

/// How far lengths and right angles of a matrix from outside may be off.
pub(super) const TOLERANCE: f32 = 1e-3;
