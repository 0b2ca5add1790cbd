//! The control mode, with its parameters.

use super::model::{RAD_PER_DEGREE, Scale};
use crate::error::ConfigError;
use crate::motor::{ControlMode, ImpedanceControl};
use crate::units::AngularVelocity;

/// A control mode of the drive. An [`ImpedanceControl`] is also a mode: torque frames, with a current
/// calculated here from torque, impedance, velocity or angle.
#[derive(Debug, Clone, Copy)]
pub struct Mode(pub(crate) ControlMode);

/// The first byte of the commands, and of the answers.
const TORQUE: u8 = 0xA1;
const VELOCITY: u8 = 0xA2;
const POSITION: u8 = 0xA4;

impl From<ImpedanceControl> for Mode {
    fn from(control: ImpedanceControl) -> Self {
        Self(ControlMode::impedance(TORQUE, control))
    }
}

impl Mode {
    /// Velocity mode: the drive's own loop follows a velocity, at most so fast: above 0 and at most the range of the feedback:
    /// 572 rad/s, of the rotor of `lk` and of the output shaft of `rmd`.
    #[must_use]
    pub const fn velocity(velocity_limit: AngularVelocity) -> Self {
        Self(ControlMode::velocity(VELOCITY, Some(velocity_limit), None))
    }

    /// Velocity mode with a limit of the torque in Nm too, on drives with a field for the limit: protocol V2.35 of `lk` has no such
    /// field, and such a drive keeps to its own setting. Motors of `rmd` refuse this mode. The [share](crate::motor::Order::share) of
    /// an order lowers the limit.
    #[must_use]
    pub const fn velocity_with_torque_limit(
        velocity_limit: AngularVelocity,
        torque_limit_nm: f32,
    ) -> Self {
        Self(ControlMode::velocity(VELOCITY, Some(velocity_limit), Some(torque_limit_nm)))
    }

    /// Position mode: the drive's own loops go to an angle over its turns, at most so fast: above 0 and at most the range of the feedback:
    /// 572 rad/s, of the rotor of `lk` and of the output shaft of `rmd`.
    #[must_use]
    pub const fn position_velocity(velocity_limit: AngularVelocity) -> Self {
        Self(ControlMode::angle(POSITION, Some(velocity_limit), None))
    }

    /// # Errors
    /// A limit beyond the ranges of the model.
    pub(crate) fn check(&self, scale: &Scale) -> Result<(), ConfigError> {
        let has_limit = self.0.number == VELOCITY && self.0.torque_limit_nm().is_some();
        ConfigError::check_support(
            !has_limit || scale.limits_torque,
            "torque limit of a velocity",
        )?;
        self.0.check(scale.max_velocity, scale.torque_per_count, scale.max_torque_nm)
    }

    /// Returns bytes 2 and 3 of a command within this share of the limits: the largest current in counts, or the largest velocity
    /// in °/s of the wire. 0 stands for no limit.
    pub(crate) fn limit(&self, share: f32, scale: &Scale) -> u16 {
        match self.0.number {
            VELOCITY => self
                .0
                .torque_limit_nm()
                .map_or(0, |limit| at_least_one(limit * share / scale.torque_per_count)),
            POSITION => at_least_one(self.0.most_velocity() * share * scale.gear / RAD_PER_DEGREE),
            _ => 0,
        }
    }
}

/// Truncates to a limit of the wire, at least 1: 0 would stand for no limit.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
fn at_least_one(value: f32) -> u16 {
    (value as u16).max(1)
}
