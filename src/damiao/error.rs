//! Errors of the configuration.

use super::Register;
use crate::time::Duration;
use crate::wire::mit::RangeError;

/// A configuration that no drive has.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum ConfigError {
    /// An id other than 1 to 15: a feedback frame has four bits for it.
    Id(u16),
    /// A master id other than 0 to 0x7FE that is not the id of a command of this motor.
    MasterId(u16),
    /// A range of the model.
    Range(RangeError),
    /// A torque limit that is not above zero and at most TMAX: the limit, and TMAX, in Nm.
    TorqueLimit(f32, f32),
    /// A velocity limit that is not above zero and at most VMAX: the limit, and VMAX, in rad/s.
    VelocityLimit(f32, f32),
    /// A time-out of the drive that is not between 1 ms and 60 s.
    Timeout(Duration),
    /// A register that is read only, or cannot hold the value.
    Register(Register, f32),
}

impl core::fmt::Display for ConfigError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Id(id) => write!(f, "id {id}: 1 to 15 are allowed"),
            Self::MasterId(id) => {
                write!(f, "master id 0x{id:X}: 0 to 0x7FE are allowed, but for the id of a command")
            }
            Self::Range(error) => write!(f, "{error}"),
            Self::TorqueLimit(limit, most) => {
                write!(f, "torque limit {limit} Nm: above 0 and at most TMAX, {most} Nm")
            }
            Self::VelocityLimit(limit, most) => {
                write!(f, "velocity limit {limit} rad/s: above 0 and at most VMAX, {most} rad/s")
            }
            Self::Register(register, _) if !register.is_writable() => {
                write!(f, "register {} ({register:?}) is read only", register.number())
            }
            Self::Register(register, value) => {
                write!(f, "register {} ({register:?}) cannot hold {value}", register.number())
            }
            Self::Timeout(time) => {
                write!(f, "time-out of {} us: 1 ms to 60 s are allowed", time.as_micros())
            }
        }
    }
}

impl core::error::Error for ConfigError {}
