//! Parameter checks shared by controllers, filters and tuners.

use crate::error::ConfigError;
pub(crate) use crate::error::check;

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
