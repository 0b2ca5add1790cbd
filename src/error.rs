//! The error of every configuration: the parameter, its value, its limits.
//!
//! A controller, a chassis, a gear, a transform and a motor of any family are all refused with one type, so a program needs one
//! error type too:
//!
//! ```
//! use drivetrain::control::{Pid, PidConfig};
//! use drivetrain::damiao::{Mode, Model, Motor};
//! use drivetrain::encoder::GearRatio;
//! use drivetrain::error::ConfigError;
//! use drivetrain::units::AngularVelocity;
//!
//! fn wire() -> Result<(), ConfigError> {
//!     let _speed = Pid::new(PidConfig::new(0.02, 0.2, 0.0))?;
//!     let _gear = GearRatio::new(36, 1)?;
//!     let mode = Mode::velocity(AngularVelocity::from_rad_per_s(60.0));
//!     let _wheel = Motor::new(Model::H6215, 2, mode)?; // its largest velocity is 45 rad/s
//!     Ok(())
//! }
//! let text = wire().map_err(|error| error.to_string());
//! assert_eq!(text, Err("velocity limit in rad/s 60: above 0 and at most 45 is allowed".into()));
//! ```

use core::fmt;

/// An invalid parameter, by its name; with the value and its limits if these are numbers.
///
/// # Examples
/// ```
/// use drivetrain::control::{Pid, PidConfig};
/// use drivetrain::error::ConfigError;
///
/// let reversed = PidConfig::new(1.0, 0.0, 0.0).with_output_range(5.0, -4.0);
/// let error = Pid::new(reversed).unwrap_err();
/// assert_eq!(error, ConfigError::Reversed("output_range"));
/// assert_eq!(error.parameter(), "output_range");
/// assert_eq!(error.to_string(), "output_range: the lower end must lie below the upper end");
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum ConfigError {
    /// The value is negative, NaN or infinite, and must be zero or more.
    Negative(&'static str),
    /// The value is zero, negative, NaN or infinite, and must be more than zero.
    NotPositive(&'static str),
    /// The value is zero, negative or NaN, and must be more than zero; an infinite limit limits nothing.
    NotAboveZero(&'static str),
    /// The lower end is not below the upper end, or an end is NaN or infinite.
    Reversed(&'static str),
    /// The value is too fast for the time step: the result would overshoot or grow without bound.
    Unstable(&'static str),
    /// The value is NaN or infinite.
    NotFinite(&'static str),
    /// The value is outside of the documented range.
    Unusable(&'static str),
    /// The parameter excludes another parameter.
    Conflict(&'static str),
    /// The value equals the start of the change, so there is no change.
    NoChange(&'static str),
    /// The value is outside of the documented range, where `f32` is not exact enough.
    OutOfRange(&'static str),
    /// A [`RelayTuner`](crate::control::RelayTuner) saw no steady swing within this time: too small an amplitude, a bias that
    /// does not hold, or too much hysteresis.
    OutOfTime(&'static str),
    /// A half-period has fewer than [`RelayTuner::LEAST_SAMPLES`](crate::control::RelayTuner::LEAST_SAMPLES) samples: take more of
    /// this, less amplitude or a faster loop.
    TooFewSamples(&'static str),
    /// The swing is no larger than this, or beyond `f32`, so it gives no gain.
    NoGain(&'static str),
    /// The wheels leave a direction of motion undetermined, or nearly: the named direction, or several.
    ///
    /// The condition number of their normal equations is then above 1000: a motion shows in the wheels with less than
    /// about 3 % of the strongest. A turn counts in m, at the mean distance of the wheels from the origin.
    Singular(&'static str),
    /// A mode of the plant that does not decay by itself is not reached, not seen or not weighted by this matrix, so that no gain
    /// makes the loop stable; or the entries are so far apart that the precision of the calculation does not suffice.
    NotStabilizable(&'static str),
    /// A loop, by its name, and its invalid parameter.
    Loop(&'static str, &'static str),
    /// The model, or its firmware, does not have the parameter.
    Unsupported(&'static str),
    /// A register not open for writing.
    ReadOnly(&'static str),
    /// A register, and a value outside of its range.
    CannotHold(&'static str, f32),
    /// A counter whose frequency has no ratio to 1 MHz within 32 bits.
    Ratio {
        /// The given frequency, in Hz.
        ticks_per_second: u32,
    },
    /// A value outside of `least` to `most`.
    Range {
        /// The name of the parameter, with its unit.
        parameter: &'static str,
        /// The given value.
        value: f32,
        /// The least allowed value.
        least: f32,
        /// The largest allowed value.
        most: f32,
    },
    /// A limit outside of the range above 0 and up to `most`.
    Limit {
        /// The name of the parameter, with its unit.
        parameter: &'static str,
        /// The given value.
        value: f32,
        /// The largest allowed value.
        most: f32,
    },
}

impl ConfigError {
    /// Returns the name of the parameter, as in the `with_*` method or the constructor.
    #[must_use]
    pub const fn parameter(&self) -> &'static str {
        match *self {
            Self::Ratio { .. } => "ticks_per_second",
            Self::Negative(parameter)
            | Self::NotPositive(parameter)
            | Self::NotAboveZero(parameter)
            | Self::Reversed(parameter)
            | Self::Unstable(parameter)
            | Self::NotFinite(parameter)
            | Self::Unusable(parameter)
            | Self::Conflict(parameter)
            | Self::NoChange(parameter)
            | Self::OutOfRange(parameter)
            | Self::OutOfTime(parameter)
            | Self::TooFewSamples(parameter)
            | Self::NoGain(parameter)
            | Self::Singular(parameter)
            | Self::NotStabilizable(parameter)
            | Self::Loop(_, parameter)
            | Self::Unsupported(parameter)
            | Self::ReadOnly(parameter)
            | Self::CannotHold(parameter, _)
            | Self::Range { parameter, .. }
            | Self::Limit { parameter, .. } => parameter,
        }
    }

    /// Refuses what is not supported.
    pub(crate) const fn check_support(
        is_supported: bool,
        parameter: &'static str,
    ) -> Result<(), Self> {
        if is_supported { Ok(()) } else { Err(Self::Unsupported(parameter)) }
    }

    /// Refuses a value that excludes another.
    pub(crate) const fn check_conflict(
        conflicts: bool,
        parameter: &'static str,
    ) -> Result<(), Self> {
        if conflicts { Err(Self::Conflict(parameter)) } else { Ok(()) }
    }

    /// Accepts a limit above 0 and at most `most`.
    pub(crate) const fn check_limit(
        parameter: &'static str,
        value: f32,
        most: f32,
    ) -> Result<(), Self> {
        let is_valid = value > 0.0 && value <= most;
        if is_valid { Ok(()) } else { Err(Self::Limit { parameter, value, most }) }
    }

    /// Accepts a value from `least` to `most`.
    pub(crate) const fn check_range(
        parameter: &'static str,
        value: f32,
        least: f32,
        most: f32,
    ) -> Result<(), Self> {
        let is_valid = value >= least && value <= most;
        if is_valid { Ok(()) } else { Err(Self::Range { parameter, value, least, most }) }
    }

    /// Returns the microseconds of a time from `least` to `most`, both in microseconds; `None` is longer than any.
    pub(crate) const fn check_micros(
        parameter: &'static str,
        micros: Option<u32>,
        least: u32,
        most: u32,
    ) -> Result<u32, Self> {
        match micros {
            Some(micros) if micros >= least && micros <= most => return Ok(micros),
            _ => {}
        }
        let value = match micros {
            Some(micros) => micros as f32,
            None => f32::INFINITY,
        };
        Err(Self::Range { parameter, value, least: least as f32, most: most as f32 })
    }
}

impl fmt::Display for ConfigError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let parameter = self.parameter();
        f.write_str(match self {
            Self::Range { value, least, most, .. } => {
                return write!(f, "{parameter} {value}: {least} to {most} are allowed");
            }
            Self::Limit { value, most, .. } if *most >= f32::MAX => {
                return write!(f, "{parameter} {value}: must be above 0 and finite");
            }
            Self::Limit { value, most, .. } => {
                return write!(f, "{parameter} {value}: above 0 and at most {most} is allowed");
            }
            Self::Ratio { ticks_per_second } => {
                return write!(
                    f,
                    "a counter of {ticks_per_second} Hz has no exact ratio to 1 MHz that fits 32 bits: use a rounder frequency"
                );
            }
            Self::CannotHold(_, value) => return write!(f, "{parameter} cannot hold {value}"),
            Self::Loop(name, _) => return write!(f, "{name}: {parameter} is not usable"),
            Self::Singular("b") => return f.write_str("b: two inputs move the states in the same way, or one moves none"),
            Self::Singular(_) => return write!(f, "the wheels do not determine {parameter}"),
            _ => parameter,
        })?;
        f.write_str(match self {
            Self::Negative(_) => ": must be zero or more, and finite",
            Self::NotPositive(_) => ": must be more than zero, and finite",
            Self::NotAboveZero(_) => ": must be more than zero",
            Self::Reversed(_) => ": the lower end must lie below the upper end",
            Self::Unstable("h0") => ": a value below 1.25 times the longest step would overshoot",
            Self::Unstable("gain") => ": the loop with this gain does not decay",
            Self::Unstable(_) => ": too fast for this time step",
            Self::NotFinite(_) => ": must be finite",
            Self::Unusable(_) => " is not usable",
            Self::Conflict(_) => ": excludes another parameter, remove one of the two",
            Self::NoChange(_) => ": must differ from the start",
            Self::OutOfRange(_) => ": outside of the range in which f32 is exact enough",
            Self::OutOfTime(_) => ": no steady swing within the time limit",
            Self::TooFewSamples(_) => ": fewer than 8 samples in half a period of the swing",
            Self::NoGain(_) => ": the swing is not larger than the hysteresis, or beyond f32",
            Self::NotStabilizable(_) => ": leaves a mode that no gain makes stable",
            Self::Unsupported(_) => ": not available for this model, its mode or its firmware",
            Self::ReadOnly(_) => " is read only",
            _ => "",
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

/// Refuses a negative, NaN or infinite value.
pub(crate) const fn not_negative(parameter: &'static str, value: f32) -> Result<(), ConfigError> {
    if value >= 0.0 && value.is_finite() { Ok(()) } else { Err(ConfigError::Negative(parameter)) }
}

/// Refuses a zero, negative, NaN or infinite value.
pub(crate) const fn positive(parameter: &'static str, value: f32) -> Result<(), ConfigError> {
    if value > 0.0 && value.is_finite() { Ok(()) } else { Err(ConfigError::NotPositive(parameter)) }
}

/// As [`positive`], for an option that zero turns off.
pub(crate) const fn off_or_positive(
    parameter: &'static str,
    value: f32,
) -> Result<(), ConfigError> {
    if value == 0.0 { Ok(()) } else { positive(parameter, value) }
}

/// Refuses a NaN or infinite value.
pub(crate) const fn finite(parameter: &'static str, value: f32) -> Result<(), ConfigError> {
    if value.is_finite() { Ok(()) } else { Err(ConfigError::NotFinite(parameter)) }
}

/// Refuses the gains of a controller when a gain is negative, NaN or infinite.
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

/// Refuses invalid ends of an output, and names them as they were given: one limit, or a range.
pub(crate) const fn output_ends(lower: f32, upper: f32) -> Result<(), ConfigError> {
    if (-lower).to_bits() == upper.to_bits() {
        positive("output_limit", upper)
    } else {
        ordered("output_range", lower, upper)
    }
}
