//! The control mode and the endpoints, with their parameters.

use crate::error::ConfigError;
use crate::motor::{ControlMode, Form, ImpedanceControl};

/// A control mode of the drive. An [`ImpedanceControl`] is also a mode: torque mode, where the drive follows a torque
/// computed here for each cycle by gains or loops.
#[derive(Debug, Clone, Copy)]
pub struct Mode {
    pub(super) control: ControlMode,
    pub(super) input: u8,
    /// Of a trajectory, in rad/s².
    pub(super) acceleration: Option<f32>,
}

/// Control modes.
pub(super) const TORQUE: u8 = 1;
const VELOCITY: u8 = 2;
pub(super) const POSITION: u8 = 3;

/// Input modes.
const PASSTHROUGH: u8 = 1;
const FILTER: u8 = 3;
const TRAJECTORY: u8 = 5;

impl From<ImpedanceControl> for Mode {
    fn from(control: ImpedanceControl) -> Self {
        Self::of(ControlMode::impedance(TORQUE, control), PASSTHROUGH)
    }
}

impl Mode {
    const fn of(control: ControlMode, input: u8) -> Self {
        Self { control, input, acceleration: None }
    }

    /// Velocity mode: the drive's own loop follows a velocity, with at most this torque of the output shaft in Nm, above 0: the drive
    /// gets the current limit of this torque.
    #[must_use]
    pub const fn velocity(torque_limit_nm: f32) -> Self {
        Self::of(ControlMode::velocity(VELOCITY, None, Some(torque_limit_nm)), PASSTHROUGH)
    }

    /// Position mode: the drive's own loops go to an angle by the shortest way, with at most this torque of the output shaft in Nm,
    /// above 0. Each target is followed at once, up to the velocity limit of the motor.
    #[must_use]
    pub const fn position(torque_limit_nm: f32) -> Self {
        Self::of(ControlMode::angle(POSITION, None, Some(torque_limit_nm)), PASSTHROUGH)
    }

    /// As [`position`](Self::position), and the drive smooths each target with its second-order filter, whose `input_filter_bandwidth` is
    /// a setting of the drive.
    #[must_use]
    pub const fn position_with_filter(torque_limit_nm: f32) -> Self {
        Self { input: FILTER, ..Self::position(torque_limit_nm) }
    }

    /// As [`position`](Self::position), and the drive plans a trajectory to each target: at most as fast as the velocity limit of the
    /// motor, with this acceleration and deceleration of the output shaft in rad/s², above 0.
    #[must_use]
    pub const fn position_with_trajectory(torque_limit_nm: f32, acceleration: f32) -> Self {
        let acceleration = Some(acceleration);
        Self { input: TRAJECTORY, acceleration, ..Self::position(torque_limit_nm) }
    }

    /// # Errors
    /// A limit that is not above zero and finite.
    pub(super) fn check(&self) -> Result<(), ConfigError> {
        self.control.check(f32::MAX, 0.0, f32::MAX)?;
        self.acceleration.map_or(Ok(()), |limit| {
            ConfigError::check_limit("acceleration in rad/s^2", limit, f32::MAX)
        })
    }
}

/// Number and form of an endpoint: a setting of the drive.
pub(super) type Endpoint = (u16, Form);

/// The numbers of endpoints of a drive with firmware 0.6, from the `flat_endpoints.json` of exactly its version: the numbers differ from
/// version to version.
///
/// With them a motor sets the drive's watchdog and reads its modes back before enabling the drive.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Endpoints {
    /// `axis0.controller.config.control_mode`, one byte.
    pub control_mode: u16,
    /// `axis0.controller.config.input_mode`, one byte.
    pub input_mode: u16,
    /// `axis0.config.watchdog_timeout`, a float in s.
    pub watchdog_timeout: u16,
    /// `axis0.config.enable_watchdog`, a bool.
    pub enable_watchdog: u16,
}

impl Endpoints {
    /// Returns the expected value of each endpoint, for a mode and a watchdog in s.
    pub(super) const fn values(&self, mode: &Mode, watchdog_s: f32) -> [(Endpoint, f32); 4] {
        [
            ((self.control_mode, Form::U8), mode.control.number as f32),
            ((self.input_mode, Form::U8), mode.input as f32),
            ((self.watchdog_timeout, Form::F32), watchdog_s),
            ((self.enable_watchdog, Form::U8), 1.0),
        ]
    }
}
