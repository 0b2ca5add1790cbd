//! Errors of the configuration.

use crate::encoder::GearRatio;

/// A configuration that no drive has.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum ConfigError {
    /// An id other than 0 to 253.
    Id(u8),
    /// A parameter that has to be above zero and finite: its name, and the value.
    NotPositive(&'static str, f32),
    /// A current that is above its limit: of the model, at most 1000 A, or of rest, at most that of the model. In A.
    CurrentLimit(f32, f32),
    /// A largest velocity that is more than 16 777 216 electrical rpm: those.
    Speed(f32),
    /// A gear whose fraction, with the pole pairs, is too long to count the turns of the shaft exactly.
    Gear(GearRatio),
    /// A limit of the duty that is not above 0 and at most 1.
    Duty(f32),
    /// Gains or limits of a loop.
    Loop(crate::control::ConfigError),
}

impl core::fmt::Display for ConfigError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Id(id) => write!(f, "id {id}: 0 to 253 are allowed"),
            Self::NotPositive(name, value) => {
                write!(f, "{name} is {value}: above 0 and finite is allowed")
            }
            Self::CurrentLimit(current, limit) => {
                write!(f, "current of {current} A: above 0 and at most {limit} A is allowed")
            }
            Self::Speed(erpm) => {
                write!(f, "max_velocity is {erpm} electrical rpm: at most 16777216 are allowed")
            }
            Self::Gear(gear) => write!(
                f,
                "gear {}:{} with these pole pairs: take a shorter fraction",
                gear.rotor(),
                gear.output()
            ),
            Self::Duty(limit) => write!(f, "duty limit {limit}: above 0 and at most 1 is allowed"),
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
