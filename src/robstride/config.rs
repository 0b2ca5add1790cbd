//! The run mode, with what a user chooses for it.

use super::command::Command;
use super::{Feedback, Model, Register};
use crate::error::ConfigError;
use crate::math::wrap_pi;
use crate::motor::{Capabilities, Capability, Impedance, ImpedanceControl, Order, Target};
use crate::units::{Angle, AngularVelocity};
use crate::wire::mit;

/// A run mode of the drive. An [`ImpedanceControl`] is one too: the operation mode, in which the drive follows an impedance.
#[derive(Debug, Clone, Copy)]
pub struct Mode(Kind);

#[derive(Debug, Clone, Copy)]
enum Kind {
    Operation(ImpedanceControl),
    Position(Follower),
    Velocity(Follower),
    Current { limit_a: f32, nm_per_ampere: f32, effort: f32 },
}

impl From<ImpedanceControl> for Mode {
    fn from(control: ImpedanceControl) -> Self {
        Self(Kind::Operation(control))
    }
}

/// The angle of the shaft, where it has one, and the last feedback.
pub(super) type Seen<'a> = (Option<Angle>, &'a Feedback);

/// What the two modes with loops of the drive have in common: a velocity limit, and a current limit that is zero when the drive is
/// enabled, opens then, and falls with heat, by frames between the targets.
#[derive(Debug, Clone, Copy)]
struct Follower {
    velocity_limit: AngularVelocity,
    current_limit_a: f32,
    /// The current limit that the drive was told last.
    told_a: f32,
    turn: u8,
}

impl Follower {
    /// The current limit goes out again after 16 commands, for a frame may be lost; a new one with each second command.
    const PERIOD_MASK: u8 = 15;
    const CHANGE_MASK: u8 = 1;

    const fn new(velocity_limit: AngularVelocity, current_limit_a: f32) -> Self {
        Self { velocity_limit, current_limit_a, told_a: 0.0, turn: 0 }
    }

    fn check(&self, model: &Model) -> Result<(), ConfigError> {
        let (limit, most) = (self.velocity_limit.as_rad_per_s(), model.vmax_rad_per_s());
        ConfigError::check_limit("velocity limit in rad/s", limit, most)?;
        current_limit(self.current_limit_a, model)
    }

    /// Returns the target, or the current limit in its place: when that has changed, each second time at most.
    fn command(&mut self, share: f32, register: Register, target: f32) -> Command {
        let wanted = self.current_limit_a * share;
        self.turn = self.turn.wrapping_add(1);
        let has_changed = wanted.to_bits() != self.told_a.to_bits();
        let mask = if has_changed { Self::CHANGE_MASK } else { Self::PERIOD_MASK };
        if self.turn & mask != 1 {
            return Command::Write(register, target);
        }
        self.told_a = wanted;
        Command::Write(Register::CurrentLimit, wanted)
    }

    const fn reset(&mut self) {
        (self.told_a, self.turn) = (0.0, 0);
    }
}

impl Mode {
    /// The position mode that follows a position at once (RobStride: CSP, 5; CyberGear: 1): at most so fast, above 0 and at most the
    /// range of the model, and with at most this current in A, above 0 and at most that of the model.
    #[must_use]
    pub const fn position(velocity_limit: AngularVelocity, current_limit_a: f32) -> Self {
        Self(Kind::Position(Follower::new(velocity_limit, current_limit_a)))
    }

    /// The speed mode: the drive's own loop follows a velocity, with the limits of [`position`](Self::position).
    #[must_use]
    pub const fn velocity(velocity_limit: AngularVelocity, current_limit_a: f32) -> Self {
        Self(Kind::Velocity(Follower::new(velocity_limit, current_limit_a)))
    }

    /// The current mode: the torque is a current of at most so many A, above 0 and at most that of the model. The torque of an ampere at
    /// the output shaft, in Nm/A, is yours to measure: the manuals give it for effective currents, and do not say of which kind
    /// `iq_ref` is.
    #[must_use]
    pub const fn current(limit_a: f32, nm_per_ampere: f32) -> Self {
        Self(Kind::Current { limit_a, nm_per_ampere, effort: 0.0 })
    }

    /// What the drive reads as rest; `None` for a drive that only rests when it is disabled.
    pub(super) const fn rest(&self) -> Option<Command> {
        match self.0 {
            Kind::Operation(_) => Some(Command::Operation(mit::Command::REST)),
            Kind::Current { .. } => Some(Command::Write(Register::CurrentTarget, 0.0)),
            Kind::Position(_) | Kind::Velocity(_) => None,
        }
    }

    /// The target is a position of the drive, which has to be within the range of the feedback.
    pub(super) const fn needs_angle(&self) -> bool {
        matches!(self.0, Kind::Position(_))
    }

    /// Returns the value of `run_mode`.
    pub(super) const fn number(&self, model: &Model) -> u8 {
        match self.0 {
            Kind::Operation(_) => 0,
            Kind::Position(_) => model.position_mode(),
            Kind::Velocity(_) => 2,
            Kind::Current { .. } => 3,
        }
    }

    /// # Errors
    /// A limit that is not within those of the model.
    pub(super) fn check(&self, model: &Model) -> Result<(), ConfigError> {
        match &self.0 {
            Kind::Operation(control) => {
                let limit = control.torque_limit_nm();
                ConfigError::check_limit("torque limit in Nm", limit, model.tmax_nm())
            }
            Kind::Position(follower) | Kind::Velocity(follower) => follower.check(model),
            Kind::Current { limit_a, nm_per_ampere, .. } => {
                if !(*nm_per_ampere > 1e-6 && nm_per_ampere.is_finite()) {
                    return Err(ConfigError::NotPositive("nm_per_ampere"));
                }
                current_limit(*limit_a, model)
            }
        }
    }

    pub(super) fn capabilities(&self) -> Capabilities {
        match &self.0 {
            Kind::Operation(control) => control.capabilities(),
            Kind::Position(_) => Capabilities::of(&[Capability::Angle]),
            Kind::Velocity(_) => Capabilities::of(&[Capability::Velocity]),
            Kind::Current { .. } => Capabilities::of(&[Capability::Torque]),
        }
    }

    /// Returns what the drive has to confirm before it is enabled.
    pub(super) fn preparation(&self, index: usize) -> Option<(Register, f32)> {
        match (&self.0, index) {
            (Kind::Operation(control), 0) => {
                Some((Register::TorqueLimit, control.torque_limit_nm()))
            }
            (Kind::Position(_) | Kind::Velocity(_), 0) => Some((Register::CurrentLimit, 0.0)),
            (Kind::Position(follower), 1) => {
                Some((Register::VelocityLimit, follower.velocity_limit.as_rad_per_s()))
            }
            (Kind::Current { .. }, 0) => Some((Register::CurrentTarget, 0.0)),
            _ => None,
        }
    }

    /// Returns what the drive is told within the share of its largest effort; `None` to rest.
    pub(super) fn command(&mut self, order: Order, seen: Seen, model: &Model) -> Option<Command> {
        let (angle, drive) = seen;
        match (&mut self.0, order.target) {
            (Kind::Operation(control), _) => {
                let velocity = AngularVelocity::from_rad_per_s(drive.measured.velocity_rad_per_s);
                let Impedance { angle, velocity, stiffness, damping, torque_nm } =
                    control.step(order, angle, velocity, &model.most(), &model.count())?;
                Some(Command::Operation(mit::Command {
                    position_rad: angle.as_radians(),
                    velocity_rad_per_s: velocity.as_rad_per_s(),
                    kp: stiffness,
                    kd: damping,
                    torque_nm,
                }))
            }
            // The position nearest to the shaft's that has the target's angle, within the range of the feedback.
            (Kind::Position(follower), Target::Angle(target)) => {
                let angle = angle?;
                let way = wrap_pi((target - angle).as_radians());
                // At the very end a position is none any more.
                let end = model.pmax_rad() * 0.9995;
                let position = (angle.as_radians() + way).min(end).max(-end);
                Some(follower.command(order.share, Register::PositionTarget, position))
            }
            (Kind::Velocity(follower), Target::Velocity(velocity)) => {
                let end = follower.velocity_limit.as_rad_per_s();
                let velocity = velocity.as_rad_per_s().min(end).max(-end);
                Some(follower.command(order.share, Register::VelocityTarget, velocity))
            }
            (Kind::Current { limit_a, nm_per_ampere, effort }, Target::Torque(torque_nm)) => {
                let end = *limit_a * order.share;
                let current = (torque_nm / *nm_per_ampere).min(end).max(-end);
                *effort = current / *limit_a;
                Some(Command::Write(Register::CurrentTarget, current))
            }
            _ => None,
        }
    }

    /// Returns a target where the shaft is, for before the drive is enabled. In the operation mode a drive that is enabled follows the
    /// last command, which was rest.
    pub(super) const fn stay(&self, (angle, drive): Seen) -> Command {
        match (&self.0, angle) {
            (Kind::Operation(_), _) => Command::Operation(mit::Command::REST),
            (Kind::Position(_), Some(angle)) => {
                Command::Write(Register::PositionTarget, angle.as_radians())
            }
            // Without an angle the limit of the current stays zero.
            (Kind::Position(_), None) => Command::Write(Register::CurrentLimit, 0.0),
            (Kind::Velocity(_), _) => {
                Command::Write(Register::VelocityTarget, drive.measured.velocity_rad_per_s)
            }
            (Kind::Current { .. }, _) => Command::Write(Register::CurrentTarget, 0.0),
        }
    }

    /// Returns the torque of the last command as a share of the largest; 0 where it is not known.
    pub(super) fn effort(&self) -> f32 {
        match &self.0 {
            Kind::Operation(control) => control.effort(),
            Kind::Current { effort, .. } => *effort,
            Kind::Position(_) | Kind::Velocity(_) => 0.0,
        }
    }

    pub(super) fn reset(&mut self) {
        match &mut self.0 {
            Kind::Operation(control) => control.reset(),
            Kind::Position(follower) | Kind::Velocity(follower) => follower.reset(),
            Kind::Current { effort, .. } => *effort = 0.0,
        }
    }
}

fn current_limit(limit_a: f32, model: &Model) -> Result<(), ConfigError> {
    ConfigError::check_limit("current limit in A", limit_a, model.current_a())
}
