/// An electric current. Positive drives the shaft counter-clockwise.
///
/// # Examples
/// ```
/// use drivetrain::units::Current;
///
/// assert_eq!(Current::from_milliamperes(500.0), Current::from_amperes(0.5));
/// ```
#[derive(Debug, Default, Clone, Copy, PartialEq, PartialOrd)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Current(f32);

super::linear!(Current);

impl Current {
    /// Takes amperes.
    #[must_use]
    pub const fn from_amperes(amperes: f32) -> Self {
        Self(amperes)
    }

    /// Takes milliamperes.
    #[must_use]
    pub const fn from_milliamperes(milliamperes: f32) -> Self {
        Self(milliamperes * 1e-3)
    }

    /// Returns amperes.
    #[must_use]
    pub const fn as_amperes(self) -> f32 {
        self.0
    }

    /// Returns milliamperes.
    #[must_use]
    pub const fn as_milliamperes(self) -> f32 {
        self.0 * 1e3
    }
}

/// A voltage. Positive drives the shaft counter-clockwise.
///
/// # Examples
/// ```
/// use drivetrain::units::Voltage;
///
/// assert_eq!(Voltage::from_volts(1.5).as_millivolts(), 1500.0);
/// ```
#[derive(Debug, Default, Clone, Copy, PartialEq, PartialOrd)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Voltage(f32);

super::linear!(Voltage);

impl Voltage {
    /// Takes volts.
    #[must_use]
    pub const fn from_volts(volts: f32) -> Self {
        Self(volts)
    }

    /// Takes millivolts.
    #[must_use]
    pub const fn from_millivolts(millivolts: f32) -> Self {
        Self(millivolts * 1e-3)
    }

    /// Returns volts.
    #[must_use]
    pub const fn as_volts(self) -> f32 {
        self.0
    }

    /// Returns millivolts.
    #[must_use]
    pub const fn as_millivolts(self) -> f32 {
        self.0 * 1e3
    }
}
