/// Knowledge of the absolute angle of an output shaft.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Homing {
    /// The encoder sits on the output shaft: the angle is absolute from the first frame.
    Absolute,
    /// Geared, not zeroed yet: the position is relative to where the motor was at power-on.
    #[default]
    Relative,
    /// Geared and zeroed: the position is relative to the zero set.
    Homed,
    /// Was known, until a gap in the feedback left the number of turns in doubt.
    Uncertain,
}

impl Homing {
    /// Returns whether an absolute angle may be commanded.
    #[must_use]
    pub const fn is_known(self) -> bool {
        matches!(self, Self::Absolute | Self::Homed)
    }
}
