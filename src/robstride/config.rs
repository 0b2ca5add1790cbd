//! The run mode, with its parameters.

use super::codec::Command;
use super::{Model, Register};
use crate::error::ConfigError;
use crate::motor::{
    ControlMode, Goal, Impedance, ImpedanceControl, Order, Preparation, Shaft, Told, inside,
};
use crate::units::AngularVelocity;

/// A run mode of the drive. An [`ImpedanceControl`] is also a mode: in the operation mode the drive follows an impedance.
#[derive(Debug, Clone, Copy)]
pub struct Mode {
    pub(super) control: ControlMode,
    /// The largest current in A, of all modes but the operation mode.
    current_a: f32,
    nm_per_ampere: f32,
    /// The share in the last current limit sent to the drive: zero at enabling. The limit opens then, and falls with heat, by frames
    /// between the targets.
    limit: Told,
}

/// The values of `run_mode`; for positions the mode of the model replaces [`POSITION`].
const OPERATION: u8 = 0;
const POSITION: u8 = 1;
const VELOCITY: u8 = 2;
const CURRENT: u8 = 3;

/// The current limit goes out again after so many commands.
const PERIOD: u8 = 15;

impl From<ImpedanceControl> for Mode {
    fn from(control: ImpedanceControl) -> Self {
        Self::of(ControlMode::impedance(OPERATION, control), 1.0, 1.0)
    }
}

impl Mode {
    const fn of(control: ControlMode, current_a: f32, nm_per_ampere: f32) -> Self {
        Self { control, current_a, nm_per_ampere, limit: Told::ZERO }
    }

    /// The position mode without a profile (RobStride: CSP, 5; CyberGear: 1): at most so fast, above 0 and at most the
    /// range of the model, and with at most this current in A, above 0 and at most the current of the model.
    #[must_use]
    pub const fn position(velocity_limit: AngularVelocity, current_limit_a: f32) -> Self {
        Self::of(ControlMode::angle(POSITION, Some(velocity_limit), None), current_limit_a, 1.0)
    }

    /// The speed mode: the drive's own loop follows a velocity, with the limits of [`position`](Self::position).
    #[must_use]
    pub const fn velocity(velocity_limit: AngularVelocity, current_limit_a: f32) -> Self {
        Self::of(ControlMode::velocity(VELOCITY, Some(velocity_limit), None), current_limit_a, 1.0)
    }

    /// The current mode: the torque is a current of at most so many A, above 0 and at most the current of the model. The torque of an
    /// ampere at the output shaft, in Nm/A, is yours to measure: the manuals give values for effective currents, and leave open
    /// whether `iq_ref` is effective.
    #[must_use]
    pub const fn current(limit_a: f32, nm_per_ampere: f32) -> Self {
        Self::of(ControlMode::torque(CURRENT, limit_a * nm_per_ampere), limit_a, nm_per_ampere)
    }

    /// The command of rest; `None` for a drive that only rests when disabled.
    pub(super) const fn rest(&self) -> Option<Command> {
        match self.control.number {
            OPERATION => Some(Command::Operation(Impedance::FREE)),
            CURRENT => Some(Command::Write(Register::CurrentTarget, 0.0)),
            _ => None,
        }
    }

    /// Returns the value of `run_mode`.
    pub(super) const fn number(&self, model: &Model) -> u8 {
        if self.control.is_angle() { model.position_mode() } else { self.control.number }
    }

    /// # Errors
    /// A limit beyond the limits of the model.
    pub(super) fn check(&self, model: &Model) -> Result<(), ConfigError> {
        if !(self.nm_per_ampere > 1e-6 && self.nm_per_ampere.is_finite()) {
            return Err(ConfigError::NotPositive("nm_per_ampere"));
        }
        if !self.control.is_impedance() {
            ConfigError::check_limit("current limit in A", self.current_a, model.current_a())?;
        }
        let most_nm = if self.control.number == CURRENT { f32::MAX } else { model.tmax_nm() };
        self.control.check(model.vmax_rad_per_s(), 0.0, most_nm)
    }

    /// Returns the settings to be confirmed by the drive before enabling.
    pub(super) fn preparations(&self) -> [Option<Preparation<Register>>; 2] {
        let limit = |register, value| Some(Preparation::limit(register, value));
        let current = limit(Register::CurrentLimit, 0.0);
        match self.control.number {
            POSITION => [current, limit(Register::VelocityLimit, self.control.most_velocity())],
            VELOCITY => [current, None],
            CURRENT => [limit(Register::CurrentTarget, 0.0), None],
            _ => {
                let torque = self.control.torque_limit_nm();
                [torque.and_then(|nm| limit(Register::TorqueLimit, nm)), None]
            }
        }
    }

    /// Returns the command to the drive within the share of its largest effort; `None` to rest.
    pub(super) fn command(&mut self, order: Order, shaft: Shaft, model: &Model) -> Option<Command> {
        let goal = self.control.impedance_goal(order, || shaft, model.ranges(), 65_535)?;
        let share = order.share;
        Some(match goal {
            Goal::Impedance(command) => Command::Operation(command),
            Goal::Torque(torque_nm) if self.control.is_impedance() => {
                Command::Operation(Impedance::torque(torque_nm))
            }
            Goal::Torque(torque_nm) => {
                let limit = self.current_a * share;
                let current = (torque_nm / self.nm_per_ampere).min(limit).max(-limit);
                Command::Write(Register::CurrentTarget, current)
            }
            Goal::Velocity(velocity) => self.limited(share, Register::VelocityTarget, velocity),
            Goal::Way(way) => {
                let position = inside(shaft.0?.as_radians(), way, model.pmax_rad());
                self.limited(share, Register::PositionTarget, position)
            }
        })
    }

    /// Returns the target, or the current limit in its place.
    fn limited(&mut self, share: f32, register: Register, target: f32) -> Command {
        match self.limit.due(share, Told::FINE, PERIOD) {
            Some(share) => Command::Write(Register::CurrentLimit, self.current_a * share),
            None => Command::Write(register, target),
        }
    }

    /// Returns a target where the shaft is, for before the drive is enabled. In the operation mode an enabled drive follows the
    /// last command, a command of rest.
    pub(super) fn stay(&self, (angle, velocity): Shaft) -> Command {
        match (self.rest(), angle) {
            (Some(rest), _) => rest,
            (None, _) if !self.control.is_angle() => {
                Command::Write(Register::VelocityTarget, velocity.as_rad_per_s())
            }
            (None, Some(angle)) => Command::Write(Register::PositionTarget, angle.as_radians()),
            // Without an angle the limit of the current stays zero.
            (None, None) => Command::Write(Register::CurrentLimit, 0.0),
        }
    }

    pub(super) const fn reset(&mut self) {
        self.control.reset();
        self.limit = Told::ZERO;
    }
}
