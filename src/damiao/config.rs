//! The control modes, with what a user chooses for each.

use super::command::Command;
use super::{ConfigError, Feedback, Model};
use crate::control::{Cascade, PidConfig, TimeStep};
use crate::math::wrap_pi;
use crate::motor::{Capabilities, Capability, Impedance, Order, Target};
use crate::units::{Angle, AngularVelocity};
use crate::wire::mit;

/// The largest gains of the MIT fields, of every model.
const MOST_STIFFNESS: f32 = 500.0;
const MOST_DAMPING: f32 = 5.0;

/// A control mode of the drive: [`Mit`], [`PositionVelocity`], [`Velocity`] or [`ForcePosition`].
pub trait Mode: sealed::Mode {}

impl<M: sealed::Mode> Mode for M {}

pub(super) mod sealed {
    use super::{Capabilities, Command, ConfigError, Feedback, Model, Order};

    pub trait Mode: core::fmt::Debug + Copy {
        /// The value of the register `CTRL_MODE`.
        const NUMBER: u8;
        /// What is added to the id of the drive.
        const BASE: u16;
        /// What the drive reads as rest; `None` for a drive that only rests when it is disabled.
        const REST: Option<Command>;

        /// # Errors
        /// A limit that is not within the ranges of the model.
        fn check(&self, model: &Model) -> Result<(), ConfigError>;

        fn capabilities(&self) -> Capabilities;

        /// Returns what the drive is told and the share of its largest effort; `None` to rest.
        fn command(
            &mut self,
            order: Order,
            drive: &Feedback,
            model: &Model,
        ) -> Option<(Command, f32)>;

        /// Returns a target where the shaft is, for before the drive is enabled.
        fn stay(&self, drive: &Feedback) -> Option<Command>;

        fn reset(&mut self) {}
    }
}

/// MIT mode: the drive is a spring and a damper with a torque beside them.
///
/// The torque of every command keeps within the limit, at the position and velocity that the drive reported last: the position and
/// the velocity are sent so near that gains times what is left to go do not ask for more.
#[derive(Debug, Clone, Copy)]
pub struct Mit {
    torque_limit_nm: f32,
    gains: Option<(f32, f32)>,
    loops: Option<Cascade>,
}

impl Mit {
    /// Limits the torque, in Nm: above 0 and at most TMAX. Takes torques and [`Impedance`] as targets.
    #[must_use]
    pub const fn new(torque_limit_nm: f32) -> Self {
        Self { torque_limit_nm, gains: None, loops: None }
    }

    /// Has the drive itself follow velocities with a damping of 0 to 5 Nm s/rad, and angles with a stiffness of 0 to 500 Nm/rad
    /// beside it.
    ///
    /// # Errors
    /// [`ConfigError::Gain`] for a value outside.
    pub const fn with_gains(self, stiffness: f32, damping: f32) -> Result<Self, ConfigError> {
        if !(stiffness >= 0.0 && stiffness <= MOST_STIFFNESS) {
            return Err(ConfigError::Gain("stiffness", stiffness));
        }
        if !(damping >= 0.0 && damping <= MOST_DAMPING) {
            return Err(ConfigError::Gain("damping", damping));
        }
        Ok(Self { gains: Some((stiffness, damping)), ..self })
    }

    /// Has our own loops follow velocities and angles by a torque: from rad to rad/s, and from rad/s to Nm.
    ///
    /// # Errors
    /// As [`Cascade::new`].
    pub fn with_loops(
        self,
        position: PidConfig,
        speed: PidConfig,
    ) -> Result<Self, crate::control::ConfigError> {
        let limit = self.torque_limit_nm;
        Ok(Self { loops: Some(Cascade::new(position, speed.with_output_limit(limit))?), ..self })
    }

    /// Steps the loops; the output keeps within the limit.
    fn step_loops(&mut self, target: Target, drive: &Feedback, step: &TimeStep, limit: f32) -> f32 {
        let Some(loops) = &mut self.loops else { return 0.0 };
        let velocity = drive.measured.velocity_rad_per_s;
        let output = match target {
            Target::Angle(angle) => {
                let error = wrap_pi(angle.as_radians() - drive.measured.position_rad);
                loops.step(error, velocity, step)
            }
            Target::Velocity(target) => {
                loops.speed_mut().step(target.as_rad_per_s(), velocity, step)
            }
            _ => 0.0,
        };
        loops.speed_mut().keep_integral_between(-limit, limit);
        output.clamp(-limit, limit)
    }

    /// Returns the impedance that the drive itself follows to a target.
    fn impedance(&self, target: Target, drive: &Feedback) -> Option<Impedance> {
        let (stiffness, damping) = self.gains?;
        match target {
            Target::Velocity(velocity) => Some(Impedance { velocity, damping, ..Impedance::FREE }),
            Target::Angle(angle) => {
                let position = drive.measured.position_rad;
                let way = wrap_pi(angle.as_radians() - position);
                let angle = Angle::from_radians(position + way);
                Some(Impedance { angle, stiffness, damping, ..Impedance::FREE })
            }
            _ => None,
        }
    }
}

impl sealed::Mode for Mit {
    const NUMBER: u8 = 1;
    const BASE: u16 = 0x000;
    const REST: Option<Command> = Some(Command::Mit(mit::Command::REST));

    fn check(&self, model: &Model) -> Result<(), ConfigError> {
        torque_limit(self.torque_limit_nm, model)
    }

    fn capabilities(&self) -> Capabilities {
        let always = Capabilities::of(&[Capability::Torque, Capability::Impedance]);
        if self.gains.is_none() && self.loops.is_none() {
            return always;
        }
        always.with(Capability::Velocity).with(Capability::Angle)
    }

    fn command(
        &mut self,
        Order { target, share, step }: Order,
        drive: &Feedback,
        model: &Model,
    ) -> Option<(Command, f32)> {
        let limit = self.torque_limit_nm * share;
        let command = match target {
            Target::Torque(torque_nm) => mit::Command::torque(torque_nm.clamp(-limit, limit)),
            Target::Impedance(impedance) => limited(&impedance, drive, model, share, limit)?,
            Target::Velocity(_) | Target::Angle(_) if self.loops.is_some() => {
                if matches!(target, Target::Angle(_)) && drive.is_at_end {
                    return None;
                }
                mit::Command::torque(self.step_loops(target, drive, &step, limit))
            }
            Target::Velocity(_) | Target::Angle(_) => {
                limited(&self.impedance(target, drive)?, drive, model, share, limit)?
            }
        };
        let torque_nm = torque_of(&command, drive);
        Some((Command::Mit(command), torque_nm / self.torque_limit_nm))
    }

    /// A drive in MIT mode that is enabled follows the last command, which was rest.
    fn stay(&self, _drive: &Feedback) -> Option<Command> {
        None
    }

    fn reset(&mut self) {
        if let Some(loops) = &mut self.loops {
            loops.reset();
        }
    }
}

/// Returns the torque of a command at the shaft's present position and velocity, in Nm.
fn torque_of(command: &mit::Command, drive: &Feedback) -> f32 {
    command.kp * (command.position_rad - drive.measured.position_rad)
        + command.kd * (command.velocity_rad_per_s - drive.measured.velocity_rad_per_s)
        + command.torque_nm
}

/// Returns the command of an impedance whose gains are scaled by the share, and whose torque keeps within the limit: the torque
/// beside first, then the spring, then the damper. `None` if the position is needed and not known.
fn limited(
    impedance: &Impedance,
    drive: &Feedback,
    model: &Model,
    share: f32,
    limit: f32,
) -> Option<mit::Command> {
    let kp = share * impedance.stiffness.clamp(0.0, MOST_STIFFNESS);
    let kd = share * impedance.damping.clamp(0.0, MOST_DAMPING);
    if kp > 0.0 && drive.is_at_end {
        return None;
    }
    let torque_nm = impedance.torque_nm.clamp(-limit, limit);
    let (pmax, vmax) = (model.pmax_rad(), model.vmax_rad_per_s());
    let position = drive.measured.position_rad;
    let way = impedance.angle.as_radians().clamp(-pmax, pmax) - position;
    let position_rad = position + within(way, torque_nm, kp, limit);
    let spring_nm = torque_nm + kp * (position_rad - position);
    let velocity = drive.measured.velocity_rad_per_s;
    let change = impedance.velocity.as_rad_per_s().clamp(-vmax, vmax) - velocity;
    let velocity_rad_per_s = velocity + within(change, spring_nm, kd, limit);
    Some(mit::Command { position_rad, velocity_rad_per_s, kp, kd, torque_nm })
}

/// Returns the part of a difference whose torque, beside so much, keeps within the limit.
fn within(difference: f32, beside_nm: f32, gain: f32, limit: f32) -> f32 {
    if gain <= 0.0 {
        return 0.0;
    }
    difference.min((limit - beside_nm) / gain).max((-limit - beside_nm) / gain)
}

/// Position-velocity mode: the drive's own loops go to an angle, at most so fast.
#[derive(Debug, Clone, Copy)]
pub struct PositionVelocity {
    velocity_limit: AngularVelocity,
}

impl PositionVelocity {
    /// Limits the velocity: above 0 and at most VMAX.
    #[must_use]
    pub const fn new(velocity_limit: AngularVelocity) -> Self {
        Self { velocity_limit }
    }
}

impl sealed::Mode for PositionVelocity {
    const NUMBER: u8 = 2;
    const BASE: u16 = 0x100;
    const REST: Option<Command> = None;

    fn check(&self, model: &Model) -> Result<(), ConfigError> {
        velocity_limit(self.velocity_limit, model)
    }

    fn capabilities(&self) -> Capabilities {
        Capabilities::of(&[Capability::Angle])
    }

    fn command(&mut self, order: Order, drive: &Feedback, model: &Model) -> Option<(Command, f32)> {
        let position = position_of(&order, drive, model)?;
        let velocity = self.velocity_limit.as_rad_per_s() * order.share;
        Some((Command::PositionVelocity(position, velocity), 0.0))
    }

    fn stay(&self, drive: &Feedback) -> Option<Command> {
        Some(Command::PositionVelocity(drive.measured.position_rad, 0.0))
    }
}

/// Force-position mode: the drive's own loops go to an angle, at most so fast, with a limited torque.
#[derive(Debug, Clone, Copy)]
pub struct ForcePosition {
    velocity_limit: AngularVelocity,
    torque_limit_nm: f32,
}

impl ForcePosition {
    /// Limits the velocity, above 0 and at most VMAX and 100 rad/s, and the torque in Nm, above 0 and at most TMAX.
    #[must_use]
    pub const fn new(velocity_limit: AngularVelocity, torque_limit_nm: f32) -> Self {
        Self { velocity_limit, torque_limit_nm }
    }
}

impl sealed::Mode for ForcePosition {
    const NUMBER: u8 = 4;
    const BASE: u16 = 0x300;
    const REST: Option<Command> = None;

    fn check(&self, model: &Model) -> Result<(), ConfigError> {
        velocity_limit(self.velocity_limit, model)?;
        torque_limit(self.torque_limit_nm, model)
    }

    fn capabilities(&self) -> Capabilities {
        Capabilities::of(&[Capability::Angle])
    }

    fn command(&mut self, order: Order, drive: &Feedback, model: &Model) -> Option<(Command, f32)> {
        let position = position_of(&order, drive, model)?;
        let velocity = self.velocity_limit.as_rad_per_s();
        let torque = order.share * self.torque_limit_nm / model.tmax_nm();
        Some((Command::ForcePosition(position, velocity, torque), 0.0))
    }

    fn stay(&self, drive: &Feedback) -> Option<Command> {
        Some(Command::ForcePosition(drive.measured.position_rad, 0.0, 0.0))
    }
}

/// Returns the position nearest to the shaft's that has the target's angle, within the range of the drive.
fn position_of(order: &Order, drive: &Feedback, model: &Model) -> Option<f32> {
    let Target::Angle(angle) = order.target else { return None };
    if drive.is_at_end {
        return None;
    }
    let position = drive.measured.position_rad;
    let way = wrap_pi(angle.as_radians() - position);
    Some((position + way).clamp(-model.pmax_rad(), model.pmax_rad()))
}

/// Velocity mode: the drive's own loop follows a velocity.
#[derive(Debug, Clone, Copy)]
pub struct Velocity {
    velocity_limit: AngularVelocity,
}

impl Velocity {
    /// Limits the velocity: above 0 and at most VMAX.
    #[must_use]
    pub const fn new(velocity_limit: AngularVelocity) -> Self {
        Self { velocity_limit }
    }
}

impl sealed::Mode for Velocity {
    const NUMBER: u8 = 3;
    const BASE: u16 = 0x200;
    const REST: Option<Command> = None;

    fn check(&self, model: &Model) -> Result<(), ConfigError> {
        velocity_limit(self.velocity_limit, model)
    }

    fn capabilities(&self) -> Capabilities {
        Capabilities::of(&[Capability::Velocity])
    }

    fn command(&mut self, order: Order, _: &Feedback, _: &Model) -> Option<(Command, f32)> {
        let Target::Velocity(velocity) = order.target else { return None };
        let limit = self.velocity_limit.as_rad_per_s() * order.share;
        Some((Command::Velocity(velocity.as_rad_per_s().clamp(-limit, limit)), 0.0))
    }

    fn stay(&self, drive: &Feedback) -> Option<Command> {
        Some(Command::Velocity(drive.measured.velocity_rad_per_s))
    }
}

fn torque_limit(limit_nm: f32, model: &Model) -> Result<(), ConfigError> {
    let is_valid = limit_nm > 0.0 && limit_nm <= model.tmax_nm();
    if is_valid { Ok(()) } else { Err(ConfigError::TorqueLimit(limit_nm, model.tmax_nm())) }
}

fn velocity_limit(limit: AngularVelocity, model: &Model) -> Result<(), ConfigError> {
    let (limit, most) = (limit.as_rad_per_s(), model.vmax_rad_per_s());
    let is_valid = limit > 0.0 && limit <= most;
    if is_valid { Ok(()) } else { Err(ConfigError::VelocityLimit(limit, most)) }
}
