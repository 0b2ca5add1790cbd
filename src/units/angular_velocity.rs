use core::f32::consts::TAU;

/// An angular velocity; counter-clockwise is positive.
///
/// # Examples
/// ```
/// use drivetrain::units::AngularVelocity;
///
/// let no_load = AngularVelocity::from_rpm(482.0); // output shaft of an M3508
/// assert!((no_load.as_rad_per_s() - 50.475).abs() < 1e-3);
/// assert!((no_load.as_degrees_per_s() - 2892.0).abs() < 1e-3);
/// ```
#[derive(Debug, Default, Clone, Copy, PartialEq, PartialOrd)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct AngularVelocity(f32);

super::linear!(AngularVelocity);

impl AngularVelocity {
    /// Takes radians a second.
    #[must_use]
    pub const fn from_rad_per_s(rad_per_s: f32) -> Self {
        Self(rad_per_s)
    }

    /// Takes revolutions a minute.
    #[must_use]
    pub const fn from_rpm(rpm: f32) -> Self {
        Self(rpm * (TAU / 60.0))
    }

    /// Takes degrees a second.
    #[must_use]
    pub const fn from_degrees_per_s(degrees_per_s: f32) -> Self {
        Self(degrees_per_s * (TAU / 360.0))
    }

    /// Returns radians a second.
    #[must_use]
    pub const fn as_rad_per_s(self) -> f32 {
        self.0
    }

    /// Returns revolutions a minute.
    #[must_use]
    pub const fn as_rpm(self) -> f32 {
        self.0 * (60.0 / TAU)
    }

    /// Returns degrees a second.
    #[must_use]
    pub const fn as_degrees_per_s(self) -> f32 {
        self.0 * (360.0 / TAU)
    }
}
