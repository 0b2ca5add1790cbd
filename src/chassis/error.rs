//! Checks of dimensions and limits that all layouts have in common.

use crate::error::ConfigError;

/// Lets a length pass that is above zero and finite.
pub(super) const fn positive(length: f32, name: &'static str) -> Result<f32, ConfigError> {
    // Of a smaller one the reciprocal is not finite.
    if length >= f32::MIN_POSITIVE && length < f32::INFINITY {
        Ok(length)
    } else {
        Err(ConfigError::NotPositive(name))
    }
}

/// Lets a value pass that is finite and zero or more.
pub(super) fn not_negative(value: f32, name: &'static str) -> Result<f32, ConfigError> {
    if value.is_finite() && value >= 0.0 { Ok(value) } else { Err(ConfigError::Negative(name)) }
}
