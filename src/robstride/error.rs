//! Errors of the configuration.

use super::Register;
use crate::time::Duration;
use crate::wire::mit::RangeError;

/// A configuration that no drive has.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum ConfigError {
    /// An id other than 1 to 127, or that of the host.
    Id(u8),
    /// A host id that is the id of the motor.
    HostId(u8),
    /// A range of the model.
    Range(RangeError),
    /// A torque limit that is not above zero and at most the range of the torque: the limit, and the range, in Nm.
    TorqueLimit(f32, f32),
    /// A velocity limit that is not above zero and at most the range of the velocity: the limit, and the range, in rad/s.
    VelocityLimit(f32, f32),
    /// A current limit that is not above zero and at most that of the model: both in A.
    CurrentLimit(f32, f32),
    /// A torque of an ampere that is not above zero and finite, in Nm/A.
    TorqueConstant(f32),
    /// A time-out of the drive that is not between 1 ms and 5 s.
    Timeout(Duration),
    /// A model whose drive has no time-out, or does not store parameters.
    Unsupported(&'static str),
    /// A parameter that is read only, or cannot hold the value.
    Register(Register, f32),
}

impl core::fmt::Display for ConfigError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Id(id) => write!(f, "id {id}: 1 to 127 are allowed, but for the id of the host"),
            Self::HostId(id) => write!(f, "host id {id}: another one than the motor's is needed"),
            Self::Range(error) => write!(f, "{error}"),
            Self::TorqueLimit(limit, most) => {
                write!(f, "torque limit {limit} Nm: above 0 and at most {most} Nm")
            }
            Self::VelocityLimit(limit, most) => {
                write!(f, "velocity limit {limit} rad/s: above 0 and at most {most} rad/s")
            }
            Self::CurrentLimit(limit, most) => {
                write!(f, "current limit {limit} A: above 0 and at most {most} A")
            }
            Self::TorqueConstant(value) => {
                write!(f, "{value} Nm for an ampere: above 0 and finite")
            }
            Self::Timeout(time) => {
                write!(f, "time-out of {} us: 1 ms to 5 s are allowed", time.as_micros())
            }
            Self::Unsupported(what) => write!(f, "a CyberGear has no {what}"),
            Self::Register(register, _) if !register.is_writable() => {
                write!(f, "parameter 0x{:X} ({register:?}) is read only", register.index())
            }
            Self::Register(register, value) => {
                write!(f, "parameter 0x{:X} ({register:?}) cannot hold {value}", register.index())
            }
        }
    }
}

impl core::error::Error for ConfigError {}
