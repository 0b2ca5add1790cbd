//! The run modes, with what a user chooses for each.

use super::command::Command;
use super::{Feedback, Model, Register};
use crate::error::ConfigError;
use crate::math::wrap_pi;
use crate::motor::{Capabilities, Capability, Impedance, ImpedanceControl, Order, Target};
use crate::units::{Angle, AngularVelocity};
use crate::wire::mit;

/// A run mode of the drive: [`ImpedanceControl`] for the operation mode, [`Position`], [`Velocity`] or [`Current`].
pub trait Mode: sealed::Mode {}

impl<M: sealed::Mode> Mode for M {}

use sealed::Seen;

pub(super) mod sealed {
    use super::{Angle, Capabilities, Command, Feedback, Model, Order, Register};
    use crate::error::ConfigError;

    /// The angle of the shaft, where it has one, and the last feedback.
    pub(super) type Seen<'a> = (Option<Angle>, &'a Feedback);

    pub trait Mode: core::fmt::Debug + Copy {
        /// What the drive reads as rest; `None` for a drive that only rests when it is disabled.
        const REST: Option<Command>;
        /// The target is a position of the drive, which has to be within the range of the feedback.
        const NEEDS_ANGLE: bool = false;

        /// Returns the value of `run_mode`.
        fn number(&self, model: &Model) -> u8;

        /// # Errors
        /// A limit that is not within those of the model.
        fn check(&self, model: &Model) -> Result<(), ConfigError>;

        fn capabilities(&self) -> Capabilities;

        /// Returns what the drive has to confirm before it is enabled.
        fn preparation(&self, index: usize) -> Option<(Register, f32)>;

        /// Returns what the drive is told within the share of its largest effort; `None` to rest.
        fn command(&mut self, order: Order, drive: Seen, model: &Model) -> Option<Command>;

        /// Returns a target where the shaft is, for before the drive is enabled.
        fn stay(&self, drive: Seen) -> Command;

        /// Returns the torque of the last command as a share of the largest; 0 where it is not known.
        fn effort(&self) -> f32 {
            0.0
        }

        fn reset(&mut self) {}
    }
}

/// The operation mode: the drive follows an impedance.
impl sealed::Mode for ImpedanceControl {
    const REST: Option<Command> = Some(Command::Operation(mit::Command::REST));

    fn number(&self, _: &Model) -> u8 {
        0
    }

    fn check(&self, model: &Model) -> Result<(), ConfigError> {
        ConfigError::check_limit("torque limit in Nm", self.torque_limit_nm(), model.tmax_nm())
    }

    fn capabilities(&self) -> Capabilities {
        Self::capabilities(self)
    }

    fn preparation(&self, index: usize) -> Option<(Register, f32)> {
        (index == 0).then(|| (Register::TorqueLimit, self.torque_limit_nm()))
    }

    fn command(&mut self, order: Order, drive: Seen, model: &Model) -> Option<Command> {
        let (angle, drive) = drive;
        let velocity = AngularVelocity::from_rad_per_s(drive.measured.velocity_rad_per_s);
        let Impedance { angle, velocity, stiffness, damping, torque_nm } =
            self.step(order, angle, velocity, &model.most(), &model.count())?;
        Some(Command::Operation(mit::Command {
            position_rad: angle.as_radians(),
            velocity_rad_per_s: velocity.as_rad_per_s(),
            kp: stiffness,
            kd: damping,
            torque_nm,
        }))
    }

    /// A drive that is enabled follows the last command, which was rest.
    fn stay(&self, _: Seen) -> Command {
        Command::Operation(mit::Command::REST)
    }

    fn effort(&self) -> f32 {
        Self::effort(self)
    }

    fn reset(&mut self) {
        Self::reset(self);
    }
}

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

/// The position mode that follows a position at once (RobStride: CSP, 5; CyberGear: 1), at most so fast and with a limited current.
#[derive(Debug, Clone, Copy)]
pub struct Position(Follower);

impl Position {
    /// Limits the velocity, above 0 and at most the range of the model, and the current in A, above 0 and at most that of the model.
    #[must_use]
    pub const fn new(velocity_limit: AngularVelocity, current_limit_a: f32) -> Self {
        Self(Follower::new(velocity_limit, current_limit_a))
    }
}

impl sealed::Mode for Position {
    const REST: Option<Command> = None;
    const NEEDS_ANGLE: bool = true;

    fn number(&self, model: &Model) -> u8 {
        model.position_mode()
    }

    fn check(&self, model: &Model) -> Result<(), ConfigError> {
        self.0.check(model)
    }

    fn capabilities(&self) -> Capabilities {
        Capabilities::of(&[Capability::Angle])
    }

    fn preparation(&self, index: usize) -> Option<(Register, f32)> {
        match index {
            0 => Some((Register::CurrentLimit, 0.0)),
            1 => Some((Register::VelocityLimit, self.0.velocity_limit.as_rad_per_s())),
            _ => None,
        }
    }

    /// Goes to the position nearest to the shaft's that has the target's angle, within the range of the feedback.
    fn command(&mut self, order: Order, (angle, _): Seen, model: &Model) -> Option<Command> {
        let (Target::Angle(target), Some(angle)) = (order.target, angle) else { return None };
        let way = wrap_pi((target - angle).as_radians());
        // At the very end a position is none any more.
        let end = model.pmax_rad() * 0.9995;
        let position = (angle.as_radians() + way).min(end).max(-end);
        Some(self.0.command(order.share, Register::PositionTarget, position))
    }

    /// Without an angle the limit of the current stays zero.
    fn stay(&self, (angle, _): Seen) -> Command {
        let Some(angle) = angle else { return Command::Write(Register::CurrentLimit, 0.0) };
        Command::Write(Register::PositionTarget, angle.as_radians())
    }

    fn reset(&mut self) {
        self.0.reset();
    }
}

/// The speed mode: the drive's own loop follows a velocity, with a limited current.
#[derive(Debug, Clone, Copy)]
pub struct Velocity(Follower);

impl Velocity {
    /// Limits the velocity, above 0 and at most the range of the model, and the current in A, above 0 and at most that of the model.
    #[must_use]
    pub const fn new(velocity_limit: AngularVelocity, current_limit_a: f32) -> Self {
        Self(Follower::new(velocity_limit, current_limit_a))
    }
}

impl sealed::Mode for Velocity {
    const REST: Option<Command> = None;

    fn number(&self, _: &Model) -> u8 {
        2
    }

    fn check(&self, model: &Model) -> Result<(), ConfigError> {
        self.0.check(model)
    }

    fn capabilities(&self) -> Capabilities {
        Capabilities::of(&[Capability::Velocity])
    }

    fn preparation(&self, index: usize) -> Option<(Register, f32)> {
        (index == 0).then_some((Register::CurrentLimit, 0.0))
    }

    fn command(&mut self, order: Order, _: Seen, _: &Model) -> Option<Command> {
        let Target::Velocity(velocity) = order.target else { return None };
        let end = self.0.velocity_limit.as_rad_per_s();
        let velocity = velocity.as_rad_per_s().min(end).max(-end);
        Some(self.0.command(order.share, Register::VelocityTarget, velocity))
    }

    fn stay(&self, (_, drive): Seen) -> Command {
        Command::Write(Register::VelocityTarget, drive.measured.velocity_rad_per_s)
    }

    fn reset(&mut self) {
        self.0.reset();
    }
}

/// The current mode: the torque is a current.
#[derive(Debug, Clone, Copy)]
pub struct Current {
    limit_a: f32,
    nm_per_ampere: f32,
    effort: f32,
}

impl Current {
    /// Limits the current in A, above 0 and at most that of the model. The torque of an ampere at the output shaft, in Nm/A, is
    /// yours to measure: the manuals give it for effective currents, and do not say of which kind `iq_ref` is.
    #[must_use]
    pub const fn new(limit_a: f32, nm_per_ampere: f32) -> Self {
        Self { limit_a, nm_per_ampere, effort: 0.0 }
    }
}

impl sealed::Mode for Current {
    const REST: Option<Command> = Some(Command::Write(Register::CurrentTarget, 0.0));

    fn number(&self, _: &Model) -> u8 {
        3
    }

    fn check(&self, model: &Model) -> Result<(), ConfigError> {
        if !(self.nm_per_ampere > 1e-6 && self.nm_per_ampere.is_finite()) {
            return Err(ConfigError::NotPositive("nm_per_ampere"));
        }
        current_limit(self.limit_a, model)
    }

    fn capabilities(&self) -> Capabilities {
        Capabilities::of(&[Capability::Torque])
    }

    fn preparation(&self, index: usize) -> Option<(Register, f32)> {
        (index == 0).then_some((Register::CurrentTarget, 0.0))
    }

    fn command(&mut self, order: Order, _: Seen, _: &Model) -> Option<Command> {
        let Target::Torque(torque_nm) = order.target else { return None };
        let end = self.limit_a * order.share;
        let current = (torque_nm / self.nm_per_ampere).min(end).max(-end);
        self.effort = current / self.limit_a;
        Some(Command::Write(Register::CurrentTarget, current))
    }

    fn stay(&self, _: Seen) -> Command {
        Command::Write(Register::CurrentTarget, 0.0)
    }

    fn effort(&self) -> f32 {
        self.effort
    }

    fn reset(&mut self) {
        self.effort = 0.0;
    }
}

fn current_limit(limit_a: f32, model: &Model) -> Result<(), ConfigError> {
    ConfigError::check_limit("current limit in A", limit_a, model.current_a())
}
