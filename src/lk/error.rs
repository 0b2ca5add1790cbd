//! Errors of the configuration: those of `rmd` too.

use crate::time::Duration;

/// A configuration that no drive has.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum ConfigError {
    /// An id other than 1 to 32.
    Id(u8),
    /// A gear of a model that is not between 1 and 1000.
    Gear(f32),
    /// A torque constant of a model that is not between 0.001 and 1000 Nm/A.
    TorqueConstant(f32),
    /// Bits of the encoder other than 14 to 16.
    EncoderBits(u8),
    /// A torque limit that is less than a count of current or more than the largest current gives: the limit, and both ends, in Nm.
    TorqueLimit(f32, f32, f32),
    /// A velocity limit that is not above zero and at most what feedback tells: the limit, and the end, in rad/s.
    VelocityLimit(f32, f32),
    /// A torque limit of a velocity, which the commands of the drive have no field for.
    NoTorqueLimit,
    /// A largest current of a model that is not between 0.01 and 327 A.
    Current(f32),
    /// A time-out of the drive that is not between 10 ms and 60 s.
    Timeout(Duration),
}

impl core::fmt::Display for ConfigError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Id(id) => write!(f, "id {id}: 1 to 32 are allowed"),
            Self::Gear(gear) => write!(f, "gear {gear}: 1 to 1000 are allowed"),
            Self::TorqueConstant(constant) => {
                write!(f, "torque constant {constant} Nm/A: 0.001 to 1000 are allowed")
            }
            Self::EncoderBits(bits) => write!(f, "{bits} bits of the encoder: 14 to 16 are sent"),
            Self::TorqueLimit(limit, least, most) => {
                write!(f, "torque limit {limit} Nm: {least} to {most} Nm are allowed")
            }
            Self::VelocityLimit(limit, most) => {
                write!(f, "velocity limit {limit} rad/s: above 0 and at most {most} rad/s")
            }
            Self::NoTorqueLimit => {
                write!(
                    f,
                    "torque limit of a velocity: the commands of this drive have no field for it"
                )
            }
            Self::Current(current) => {
                write!(f, "largest current {current} A: 0.01 to 327 A are allowed")
            }
            Self::Timeout(time) => {
                write!(f, "time-out of {} us: 10 ms to 60 s are allowed", time.as_micros())
            }
        }
    }
}

impl core::error::Error for ConfigError {}
