//! The control modes, with what a user chooses for each.

use super::command::{Command, MOST_VELOCITY};
use super::{Feedback, Model};
use crate::error::ConfigError;
use crate::math::wrap_pi;
use crate::motor::{Capabilities, Capability, Impedance, ImpedanceControl, Order, Target};
use crate::units::AngularVelocity;
use crate::wire::mit;

/// A control mode of the drive: [`ImpedanceControl`] for MIT, [`PositionVelocity`], [`Velocity`] or [`ForcePosition`].
pub trait Mode: sealed::Mode {}

impl<M: sealed::Mode> Mode for M {}

pub(super) mod sealed {
    use super::{Capabilities, Command, Feedback, Model, Order};
    use crate::error::ConfigError;

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
        fn command(&mut self, order: Order, drive: &Feedback, model: &Model) -> Option<Command>;

        /// Returns a target where the shaft is, for before the drive is enabled.
        fn stay(&self, drive: &Feedback) -> Option<Command>;

        /// Returns the torque of the last command as a share of the largest; 0 where it is not known.
        fn effort(&self) -> f32 {
            0.0
        }

        fn reset(&mut self) {}
    }
}

/// MIT mode: the drive follows an impedance.
impl sealed::Mode for ImpedanceControl {
    const NUMBER: u8 = 1;
    const BASE: u16 = 0x000;
    const REST: Option<Command> = Some(Command::Mit(mit::Command::REST));

    fn check(&self, model: &Model) -> Result<(), ConfigError> {
        torque_limit(self.torque_limit_nm(), model)
    }

    fn capabilities(&self) -> Capabilities {
        Self::capabilities(self)
    }

    fn command(&mut self, order: Order, drive: &Feedback, model: &Model) -> Option<Command> {
        let velocity = AngularVelocity::from_rad_per_s(drive.measured.velocity_rad_per_s);
        let Impedance { angle, velocity, stiffness, damping, torque_nm } =
            self.step(order, drive.angle(), velocity, &model.most(), &model.count())?;
        Some(Command::Mit(mit::Command {
            position_rad: angle.as_radians(),
            velocity_rad_per_s: velocity.as_rad_per_s(),
            kp: stiffness,
            kd: damping,
            torque_nm,
        }))
    }

    /// A drive in MIT mode that is enabled follows the last command, which was rest.
    fn stay(&self, _drive: &Feedback) -> Option<Command> {
        None
    }

    fn effort(&self) -> f32 {
        Self::effort(self)
    }

    fn reset(&mut self) {
        Self::reset(self);
    }
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

    fn command(&mut self, order: Order, drive: &Feedback, model: &Model) -> Option<Command> {
        let position = position_of(&order, drive, model)?;
        let velocity = self.velocity_limit.as_rad_per_s() * order.share;
        Some(Command::PositionVelocity(position, velocity))
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
        let most = model.vmax_rad_per_s().min(MOST_VELOCITY);
        ConfigError::check_limit(VELOCITY, self.velocity_limit.as_rad_per_s(), most)?;
        torque_limit(self.torque_limit_nm, model)
    }

    fn capabilities(&self) -> Capabilities {
        Capabilities::of(&[Capability::Angle])
    }

    fn command(&mut self, order: Order, drive: &Feedback, model: &Model) -> Option<Command> {
        let position = position_of(&order, drive, model)?;
        let velocity = self.velocity_limit.as_rad_per_s();
        let torque = order.share * self.torque_limit_nm / model.tmax_nm();
        Some(Command::ForcePosition(position, velocity, torque))
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
    // At the very end a position is none any more.
    let end = model.pmax_rad() * 0.9995;
    Some((position + way).min(end).max(-end))
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

    fn command(&mut self, order: Order, _: &Feedback, _: &Model) -> Option<Command> {
        let Target::Velocity(velocity) = order.target else { return None };
        let limit = self.velocity_limit.as_rad_per_s();
        Some(Command::Velocity(velocity.as_rad_per_s().min(limit).max(-limit)))
    }

    fn stay(&self, drive: &Feedback) -> Option<Command> {
        Some(Command::Velocity(drive.measured.velocity_rad_per_s))
    }
}

const VELOCITY: &str = "velocity limit in rad/s";

fn torque_limit(limit_nm: f32, model: &Model) -> Result<(), ConfigError> {
    ConfigError::check_limit("torque limit in Nm", limit_nm, model.tmax_nm())
}

fn velocity_limit(limit: AngularVelocity, model: &Model) -> Result<(), ConfigError> {
    ConfigError::check_limit(VELOCITY, limit.as_rad_per_s(), model.vmax_rad_per_s())
}
