//! Errors of the configuration.

use crate::time::Duration;

/// A configuration that no drive has.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum ConfigError {
    /// A node id above 62. A drive with 63 has no address yet.
    Node(u8),
    /// A velocity constant of a model that is not between 0.1 and 100000 rpm/V.
    VelocityConstant(f32),
    /// A gear ratio that is not between 0.001 and 100000.
    GearRatio(f32),
    /// A torque limit in Nm that is not above zero and finite.
    TorqueLimit(f32),
    /// A velocity limit in rad/s that is not above zero and finite.
    VelocityLimit(f32),
    /// An acceleration in rad/s² that is not above zero and finite.
    Acceleration(f32),
    /// A watchdog that is not between 10 ms and 10 s.
    Watchdog(Duration),
    /// Endpoints of a firmware that has none over CAN: 0.5.
    Endpoints,
}

impl core::fmt::Display for ConfigError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Node(node) => write!(f, "node id {node}: 0 to 62 are allowed"),
            Self::VelocityConstant(kv) => {
                write!(f, "velocity constant {kv} rpm/V: 0.1 to 100000 are allowed")
            }
            Self::GearRatio(ratio) => write!(f, "gear ratio {ratio}: 0.001 to 100000 are allowed"),
            Self::TorqueLimit(limit) => write!(f, "torque limit {limit} Nm: above 0 and finite"),
            Self::VelocityLimit(limit) => {
                write!(f, "velocity limit {limit} rad/s: above 0 and finite")
            }
            Self::Acceleration(limit) => {
                write!(f, "acceleration {limit} rad/s^2: above 0 and finite")
            }
            Self::Watchdog(time) => {
                write!(f, "watchdog of {} us: 10 ms to 10 s are allowed", time.as_micros())
            }
            Self::Endpoints => {
                f.write_str("endpoints: firmware 0.5 has none over CAN, set the watchdog by USB")
            }
        }
    }
}

impl core::error::Error for ConfigError {}
