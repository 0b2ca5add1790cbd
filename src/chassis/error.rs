//! Checks of dimensions and limits shared by all layouts.

use crate::error::ConfigError;

/// Accepts a length above zero and finite.
pub(super) const fn positive(length: f32, name: &'static str) -> Result<f32, ConfigError> {
    // The reciprocal of a smaller length is not finite.
    if length >= f32::MIN_POSITIVE && length < f32::INFINITY {
        Ok(length)
    } else {
        Err(ConfigError::NotPositive(name))
    }
}

/// Accepts a finite value of zero or more.
pub(super) fn not_negative(value: f32, name: &'static str) -> Result<f32, ConfigError> {
    if value.is_finite() && value >= 0.0 { Ok(value) } else { Err(ConfigError::Negative(name)) }
}
