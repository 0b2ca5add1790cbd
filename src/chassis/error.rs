use crate::control::ConfigError;

/// Why a chassis or a part of it cannot be made: a dimension, a limit, a mode or a power model that cannot be used.
///
/// # Examples
/// ```
/// use drivetrain::chassis::{ChassisError, ChassisLimits, Differential};
///
/// let flat = Differential::new(0.1, 0.0);
/// assert_eq!(flat, Err(ChassisError::NotPositive("half_track_m")));
/// let slow = ChassisLimits::new().with_command_timeout(60.0).validate();
/// assert_eq!(slow.map_err(|error| error.to_string()), Err("command timeout must be at most 1 s".into()));
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum ChassisError {
    /// The named length must be above zero and finite.
    NotPositive(&'static str),
    /// The named limit must be above zero; an infinite one limits nothing.
    NotAboveZero(&'static str),
    /// The named value must be finite and zero or more.
    Negative(&'static str),
    /// The named value must be finite.
    NotFinite(&'static str),
    /// The named time must be at most 1 s.
    TooLong(&'static str),
    /// The wheels leave a direction of motion undetermined, or nearly: the named one, or several.
    ///
    /// That is when the condition number of their normal equations is above 1000: a motion then shows in the wheels with
    /// less than about 3 % of the strongest. A turn counts in m, at the mean distance of the wheels from the origin.
    Singular(&'static str),
    /// The swing of the rotor is larger than its base: it would change direction.
    SwingAboveBase,
    /// A parameter of the named loop.
    Loop(&'static str, ConfigError),
}

impl core::fmt::Display for ChassisError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::NotPositive(name) => write!(f, "{name} must be above zero and finite"),
            Self::NotAboveZero(name) => write!(f, "{name} must be above zero"),
            Self::Negative(name) => write!(f, "{name} must be finite and zero or more"),
            Self::NotFinite(name) => write!(f, "{name} must be finite"),
            Self::TooLong(name) => write!(f, "{name} must be at most 1 s"),
            Self::Singular(what) => write!(f, "the wheels do not determine {what}"),
            Self::SwingAboveBase => f.write_str("the rotor's swing is larger than its base"),
            Self::Loop(name, error) => write!(f, "{name}: {error}"),
        }
    }
}

impl core::error::Error for ChassisError {}

/// Lets a length pass that is above zero and finite.
pub(super) const fn positive(length: f32, name: &'static str) -> Result<f32, ChassisError> {
    // Of a smaller one the reciprocal is not finite.
    if length >= f32::MIN_POSITIVE && length < f32::INFINITY {
        Ok(length)
    } else {
        Err(ChassisError::NotPositive(name))
    }
}

/// Lets a value pass that is finite and zero or more.
pub(super) fn not_negative(value: f32, name: &'static str) -> Result<f32, ChassisError> {
    if value.is_finite() && value >= 0.0 { Ok(value) } else { Err(ChassisError::Negative(name)) }
}
