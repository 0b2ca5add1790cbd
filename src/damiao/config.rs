//! The control mode, with its parameters.

use super::codec::{Command, MOST_VELOCITY};
use super::{Feedback, Model};
use crate::error::ConfigError;
use crate::motor::{ControlMode, ImpedanceControl};
use crate::units::AngularVelocity;

/// A control mode of the drive. An [`ImpedanceControl`] is also a mode: MIT mode, where the drive follows an impedance.
///
/// # Examples
/// ```
/// use drivetrain::damiao::{Mode, Model, Motor};
/// use drivetrain::motor::ImpedanceControl;
/// use drivetrain::units::AngularVelocity;
///
/// // Motors in different modes have one type.
/// let fastest = AngularVelocity::from_rpm(60.0);
/// let motors = [
///     Motor::new(Model::J4310, 1, ImpedanceControl::new(3.0)?.with_gains(20.0, 0.6)?)?,
///     Motor::new(Model::J4310, 2, Mode::force_position(fastest, 3.0))?,
///     Motor::new(Model::H6215, 3, Mode::velocity(fastest))?,
/// ];
/// # let _ = motors;
/// # Ok::<(), drivetrain::error::ConfigError>(())
/// ```
#[derive(Debug, Clone, Copy)]
pub struct Mode(pub(super) ControlMode);

/// The values of the register `CTRL_MODE`.
const MIT: u8 = 1;
const POSITION_VELOCITY: u8 = 2;
const VELOCITY: u8 = 3;
const FORCE_POSITION: u8 = 4;

impl From<ImpedanceControl> for Mode {
    fn from(control: ImpedanceControl) -> Self {
        Self(ControlMode::impedance(MIT, control))
    }
}

impl Mode {
    /// Position-velocity mode: the drive's own loops go to an angle, at most so fast: above 0 and at most VMAX.
    #[must_use]
    pub const fn position_velocity(velocity_limit: AngularVelocity) -> Self {
        Self(ControlMode::angle(POSITION_VELOCITY, Some(velocity_limit), None))
    }

    /// Velocity mode: the drive's own loop follows a velocity, at most so fast: above 0 and at most VMAX.
    #[must_use]
    pub const fn velocity(velocity_limit: AngularVelocity) -> Self {
        Self(ControlMode::velocity(VELOCITY, Some(velocity_limit), None))
    }

    /// Force-position mode: the drive's own loops go to an angle, at most so fast, above 0 and at most VMAX and 100 rad/s, with at most
    /// this torque in Nm, above 0 and at most TMAX.
    #[must_use]
    pub const fn force_position(velocity_limit: AngularVelocity, torque_limit_nm: f32) -> Self {
        Self(ControlMode::angle(FORCE_POSITION, Some(velocity_limit), Some(torque_limit_nm)))
    }

    /// The number added to the id of the drive.
    pub(super) const fn base(&self) -> u16 {
        (self.0.number as u16 - 1) << 8
    }

    /// # Errors
    /// A limit beyond the ranges of the model.
    pub(super) fn check(&self, model: &Model) -> Result<(), ConfigError> {
        let is_packed = self.0.number == FORCE_POSITION;
        let vmax = if is_packed { MOST_VELOCITY } else { f32::INFINITY };
        self.0.check(vmax.min(model.vmax_rad_per_s()), 0.0, model.tmax_nm())
    }

    /// Returns a command to go to a position of the drive, within the share of the largest effort.
    pub(super) fn toward(&self, position: f32, share: f32, model: &Model) -> Command {
        let limit = self.0.most_velocity();
        match self.0.torque_limit_nm() {
            Some(torque_nm) => {
                Command::ForcePosition(position, limit, share * torque_nm / model.tmax_nm())
            }
            None => Command::PositionVelocity(position, limit * share),
        }
    }

    /// Returns a target where the shaft is, for before the drive is enabled. An enabled drive in MIT mode follows the last command,
    /// a command of rest.
    pub(super) const fn stay(&self, drive: &Feedback) -> Option<Command> {
        let position = drive.measured.position_rad;
        match self.0.number {
            POSITION_VELOCITY => Some(Command::PositionVelocity(position, 0.0)),
            FORCE_POSITION => Some(Command::ForcePosition(position, 0.0, 0.0)),
            VELOCITY => Some(Command::Velocity(drive.measured.velocity_rad_per_s)),
            _ => None,
        }
    }
}
