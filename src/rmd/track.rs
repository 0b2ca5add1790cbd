//! The angle between two answers to the question for it.

use crate::lk::bus::whole;

/// The angle of the output shaft between two answers, in 0.01°.
#[derive(Debug, Clone, Copy)]
pub(super) struct Track {
    /// The last answer, and the angle of the feedback then, in °.
    read: i32,
    degrees: i16,
    /// The way since, by the velocity.
    way: f32,
}

impl Track {
    pub(super) const fn new(read: i32, degrees: i16) -> Self {
        Self { read, degrees, way: 0.0 }
    }

    /// Moves on by a way, within a degree of what feedback says.
    pub(super) fn advance(&mut self, way: f32, degrees: i16) {
        let moved = 100.0 * f32::from(degrees.wrapping_sub(self.degrees));
        self.way = (self.way + way).min(moved + 100.0).max(moved - 100.0);
    }

    /// Tells whether an angle is more than half a turn away.
    pub(super) fn is_far_from(&self, angle: i32) -> bool {
        (i64::from(angle) - self.counts()).abs() > 18_000
    }

    pub(super) fn counts(&self) -> i64 {
        i64::from(self.read) + i64::from(whole(self.way))
    }

    pub(super) const fn turns(&self) -> f32 {
        (self.read as f32 + self.way) / 36_000.0
    }
}
