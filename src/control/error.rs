use core::fmt;

/// A parameter of a controller, filter, profile, tuner or motor that cannot work, by its name.
///
/// # Examples
/// ```
/// use drivetrain::control::{ConfigError, Pid, PidConfig};
///
/// let reversed = PidConfig::new(1.0, 0.0, 0.0).with_output_range(5.0, -4.0);
/// let error = Pid::new(reversed).unwrap_err();
/// assert_eq!(error, ConfigError::Reversed("output_range"));
/// assert_eq!(error.parameter(), "output_range");
/// assert_eq!(error.to_string(), "output_range: the lower end must lie below the upper one");
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum ConfigError {
    /// It is negative, NaN or infinite, and must be zero or more.
    Negative(&'static str),
    /// It is zero, negative, NaN or infinite, and must be more than zero.
    NotPositive(&'static str),
    /// Its lower end is not below its upper end, or one of them is NaN or infinite.
    Reversed(&'static str),
    /// It is too fast for the time step: the result would overshoot or grow without bound.
    Unstable(&'static str),
    /// It is NaN or infinite.
    NotFinite(&'static str),
    /// It is outside of the range that its documentation gives.
    Unusable(&'static str),
    /// It does not go together with another parameter.
    Conflict(&'static str),
    /// It is where the change starts, so that there is none.
    NoChange(&'static str),
    /// It is outside of the range that the documentation gives, where `f32` is not exact enough.
    OutOfRange(&'static str),
    /// A [`RelayTuner`](super::RelayTuner) saw no steady swing within this time: too small an amplitude, a bias that does not
    /// hold, or too much hysteresis.
    OutOfTime(&'static str),
    /// A half-period has fewer than [`RelayTuner::LEAST_SAMPLES`](super::RelayTuner::LEAST_SAMPLES) samples: take more of
    /// this, less amplitude or a faster loop.
    TooFewSamples(&'static str),
    /// The swing is no larger than this, or beyond `f32`, so that no gain follows from it.
    NoGain(&'static str),
}

impl ConfigError {
    /// Returns the name of the parameter, as it stands in the `with_*` method or the constructor.
    #[must_use]
    pub const fn parameter(&self) -> &'static str {
        match *self {
            Self::Negative(parameter)
            | Self::NotPositive(parameter)
            | Self::Reversed(parameter)
            | Self::Unstable(parameter)
            | Self::NotFinite(parameter)
            | Self::Unusable(parameter)
            | Self::Conflict(parameter)
            | Self::NoChange(parameter)
            | Self::OutOfRange(parameter)
            | Self::OutOfTime(parameter)
            | Self::TooFewSamples(parameter)
            | Self::NoGain(parameter) => parameter,
        }
    }
}

impl fmt::Display for ConfigError {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.parameter())?;
        formatter.write_str(match self {
            Self::Negative(_) => ": must be zero or more, and finite",
            Self::NotPositive(_) => ": must be more than zero, and finite",
            Self::Reversed(_) => ": the lower end must lie below the upper one",
            Self::Unstable(_) => ": too fast for this time step",
            Self::NotFinite(_) => ": must be finite",
            Self::Unusable(_) => " is not usable",
            Self::Conflict(_) => ": does not go together with another parameter",
            Self::NoChange(_) => ": must differ from the start",
            Self::OutOfRange(_) => ": outside of the range in which f32 is exact enough",
            Self::OutOfTime(_) => ": no steady swing within the time limit",
            Self::TooFewSamples(_) => ": fewer than 8 samples in half a period of the swing",
            Self::NoGain(_) => ": the swing is not larger than the hysteresis, or beyond f32",
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
    if value >= 0.0 && value.is_finite() { Ok(()) } else { Err(ConfigError::Negative(parameter)) }
}

/// Refuses what is zero, negative, NaN or infinite.
pub(crate) const fn positive(parameter: &'static str, value: f32) -> Result<(), ConfigError> {
    if value > 0.0 && value.is_finite() { Ok(()) } else { Err(ConfigError::NotPositive(parameter)) }
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
    if value.is_finite() { Ok(()) } else { Err(ConfigError::NotFinite(parameter)) }
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
        Err(ConfigError::Reversed(parameter))
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
