//! Errors of the configuration.

use crate::encoder::GearRatio;

/// A configuration that no drive has.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum ConfigError {
    /// An id other than 0 to 253.
    Id(u8),
    /// A parameter that is not above 0 and at most its limit: its name, the value and the limit.
    Range(&'static str, f32, f32),
    /// A gear whose fraction, with the pole pairs, is too long to count the turns of the shaft exactly.
    Gear(GearRatio),
    /// Gains or limits of a loop.
    Loop(crate::control::ConfigError),
}

impl core::fmt::Display for ConfigError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Id(id) => write!(f, "id {id}: 0 to 253 are allowed"),
            Self::Range(name, value, most) => {
                write!(f, "{name} is {value}: above 0 and at most {most} is allowed")
            }
            Self::Gear(gear) => {
                let (rotor, output) = (gear.rotor(), gear.output());
                write!(f, "gear {rotor}:{output} with these pole pairs: take a shorter fraction")
            }
            Self::Loop(error) => write!(f, "{error}"),
        }
    }
}

impl core::error::Error for ConfigError {}

impl From<crate::control::ConfigError> for ConfigError {
    fn from(error: crate::control::ConfigError) -> Self {
        Self::Loop(error)
    }
}

pub(super) fn within_range(name: &'static str, value: f32, most: f32) -> Result<(), ConfigError> {
    let is_valid = value > 0.0 && value <= most;
    if is_valid { Ok(()) } else { Err(ConfigError::Range(name, value, most)) }
}
