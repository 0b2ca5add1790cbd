use core::f32::consts::TAU;

/// An angle; counter-clockwise is positive. Any `f32`, not reduced to one turn.
///
/// # Examples
/// ```
/// use drivetrain::units::Angle;
///
/// let quarter = Angle::from_counts(2048, 8192);
/// assert_eq!(quarter.as_degrees(), 90.0);
/// assert_eq!(quarter.as_turns(), 0.25);
/// ```
#[derive(Debug, Default, Clone, Copy, PartialEq, PartialOrd)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Angle(f32);

super::linear!(Angle);

impl Angle {
    /// Takes radians.
    #[must_use]
    pub const fn from_radians(radians: f32) -> Self {
        Self(radians)
    }

    /// Takes degrees.
    #[must_use]
    pub const fn from_degrees(degrees: f32) -> Self {
        Self(degrees * (TAU / 360.0))
    }

    /// Takes turns.
    #[must_use]
    pub const fn from_turns(turns: f32) -> Self {
        Self(turns * TAU)
    }

    /// Takes encoder counts and the number of counts in a turn. A count above 2^24 is rounded.
    #[must_use]
    pub const fn from_counts(counts: i32, counts_per_turn: u16) -> Self {
        Self::from_turns(counts as f32 / counts_per_turn as f32)
    }

    /// Returns radians.
    #[must_use]
    pub const fn as_radians(self) -> f32 {
        self.0
    }

    /// Returns degrees.
    #[must_use]
    pub const fn as_degrees(self) -> f32 {
        self.0 * (360.0 / TAU)
    }

    /// Returns turns.
    #[must_use]
    pub const fn as_turns(self) -> f32 {
        self.0 * (1.0 / TAU)
    }
}
