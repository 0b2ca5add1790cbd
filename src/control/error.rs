use core::fmt;

/// A parameter of a controller, filter or profile that cannot work.
///
/// # Examples
/// ```
/// use drivetrain::control::{Pid, PidConfig};
///
/// let reversed = PidConfig::new(1.0, 0.0, 0.0).with_output_range(5.0, -4.0);
/// let error = Pid::new(reversed).unwrap_err();
/// assert_eq!(error.parameter(), "output_range");
/// assert_eq!(error.to_string(), "output_range: the lower end must lie below the upper one");
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ConfigError {
    parameter: &'static str,
    fault: ConfigFault,
}

/// What is wrong with the parameter that a [`ConfigError`] names.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum ConfigFault {
    /// It is negative, NaN or infinite, and must be zero or more.
    Negative,
    /// It is zero, negative, NaN or infinite, and must be more than zero.
    NotPositive,
    /// Its lower end is not below its upper end, or one of them is NaN or infinite.
    Reversed,
    /// It is too fast for the time step: the result would overshoot or grow without bound.
    Unstable,
    /// It is NaN or infinite.
    NotFinite,
    /// It does not go together with another parameter.
    Conflict,
    /// It is where the change starts, so that there is none.
    NoChange,
    /// It is outside of the range that the documentation gives, where `f32` is not exact enough.
    OutOfRange,
}

impl ConfigError {
    pub(crate) const fn new(parameter: &'static str, fault: ConfigFault) -> Self {
        Self { parameter, fault }
    }

    /// Returns the name of the parameter, as it stands in the `with_*` method or the constructor.
    #[must_use]
    pub const fn parameter(&self) -> &'static str {
        self.parameter
    }

    /// Returns what is wrong with it.
    #[must_use]
    pub const fn fault(&self) -> ConfigFault {
        self.fault
    }
}

impl fmt::Display for ConfigError {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.parameter)?;
        formatter.write_str(match self.fault {
            ConfigFault::Negative => ": must be zero or more, and finite",
            ConfigFault::NotPositive => ": must be more than zero, and finite",
            ConfigFault::Reversed => ": the lower end must lie below the upper one",
            ConfigFault::Unstable => ": too fast for this time step",
            ConfigFault::NotFinite => ": must be finite",
            ConfigFault::Conflict => ": does not go together with another parameter",
            ConfigFault::NoChange => ": must differ from the start",
            ConfigFault::OutOfRange => ": outside of the range in which f32 is exact enough",
        })
    }
}

impl core::error::Error for ConfigError {}

/// `?` for a `const fn`.
macro_rules! check {
    ($result:expr) => {
        if let Err(error) = $result {
            return Err(error);
        }
    };
}
pub(crate) use check;

/// Refuses what is negative, NaN or infinite.
pub(crate) const fn not_negative(parameter: &'static str, value: f32) -> Result<(), ConfigError> {
    if value >= 0.0 && value.is_finite() {
        Ok(())
    } else {
        Err(ConfigError::new(parameter, ConfigFault::Negative))
    }
}

/// Refuses what is zero, negative, NaN or infinite.
pub(crate) const fn positive(parameter: &'static str, value: f32) -> Result<(), ConfigError> {
    if value > 0.0 && value.is_finite() {
        Ok(())
    } else {
        Err(ConfigError::new(parameter, ConfigFault::NotPositive))
    }
}

/// As [`positive`], for an option that is off when zero.
pub(crate) const fn off_or_positive(
    parameter: &'static str,
    value: f32,
) -> Result<(), ConfigError> {
    if value == 0.0 { Ok(()) } else { positive(parameter, value) }
}

/// Refuses what is NaN or infinite.
pub(crate) const fn finite(parameter: &'static str, value: f32) -> Result<(), ConfigError> {
    if value.is_finite() {
        Ok(())
    } else {
        Err(ConfigError::new(parameter, ConfigFault::NotFinite))
    }
}

/// Refuses the gains of a controller when one is negative, NaN or infinite.
pub(crate) const fn gains(kp: f32, ki: f32, kd: f32) -> Result<(), ConfigError> {
    check!(not_negative("kp", kp));
    check!(not_negative("ki", ki));
    not_negative("kd", kd)
}

/// Refuses an interval whose lower end is not below its upper end.
pub(crate) const fn ordered(
    parameter: &'static str,
    lower: f32,
    upper: f32,
) -> Result<(), ConfigError> {
    if lower < upper && lower.is_finite() && upper.is_finite() {
        Ok(())
    } else {
        Err(ConfigError::new(parameter, ConfigFault::Reversed))
    }
}

/// Refuses the ends of an output, and calls them what they were called: one limit, or a range.
pub(crate) const fn output_ends(lower: f32, upper: f32) -> Result<(), ConfigError> {
    if (-lower).to_bits() == upper.to_bits() {
        positive("output_limit", upper)
    } else {
        ordered("output_range", lower, upper)
    }
}
