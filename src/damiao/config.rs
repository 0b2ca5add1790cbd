//! The control mode, with what a user chooses for it.

use super::command::{Command, MOST_VELOCITY};
use super::{Feedback, Model};
use crate::error::ConfigError;
use crate::math::wrap_pi;
use crate::motor::{Capabilities, Capability, Impedance, ImpedanceControl, Order, Target};
use crate::units::AngularVelocity;
use crate::wire::mit;

/// A control mode of the drive. An [`ImpedanceControl`] is one too: MIT mode, in which the drive follows an impedance.
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
pub struct Mode(Kind);

#[derive(Debug, Clone, Copy)]
enum Kind {
    Impedance(ImpedanceControl),
    PositionVelocity(AngularVelocity),
    Velocity(AngularVelocity),
    ForcePosition(AngularVelocity, f32),
}

impl From<ImpedanceControl> for Mode {
    fn from(control: ImpedanceControl) -> Self {
        Self(Kind::Impedance(control))
    }
}

impl Mode {
    /// Position-velocity mode: the drive's own loops go to an angle, at most so fast: above 0 and at most VMAX.
    #[must_use]
    pub const fn position_velocity(velocity_limit: AngularVelocity) -> Self {
        Self(Kind::PositionVelocity(velocity_limit))
    }

    /// Velocity mode: the drive's own loop follows a velocity, at most so fast: above 0 and at most VMAX.
    #[must_use]
    pub const fn velocity(velocity_limit: AngularVelocity) -> Self {
        Self(Kind::Velocity(velocity_limit))
    }

    /// Force-position mode: the drive's own loops go to an angle, at most so fast, above 0 and at most VMAX and 100 rad/s, with at most
    /// this torque in Nm, above 0 and at most TMAX.
    #[must_use]
    pub const fn force_position(velocity_limit: AngularVelocity, torque_limit_nm: f32) -> Self {
        Self(Kind::ForcePosition(velocity_limit, torque_limit_nm))
    }

    /// The value of the register `CTRL_MODE`.
    pub(super) const fn number(&self) -> u8 {
        match self.0 {
            Kind::Impedance(_) => 1,
            Kind::PositionVelocity(_) => 2,
            Kind::Velocity(_) => 3,
            Kind::ForcePosition(..) => 4,
        }
    }

    /// What is added to the id of the drive.
    pub(super) const fn base(&self) -> u16 {
        (self.number() as u16 - 1) << 8
    }

    /// Tells whether a command of no gains and no torque is rest; a drive in another mode only rests when it is disabled.
    pub(super) const fn has_rest(&self) -> bool {
        matches!(self.0, Kind::Impedance(_))
    }

    /// # Errors
    /// A limit that is not within the ranges of the model.
    pub(super) fn check(&self, model: &Model) -> Result<(), ConfigError> {
        let torque = |limit| ConfigError::check_limit("torque limit in Nm", limit, model.tmax_nm());
        let velocity = |limit: AngularVelocity, most| {
            ConfigError::check_limit("velocity limit in rad/s", limit.as_rad_per_s(), most)
        };
        let vmax = model.vmax_rad_per_s();
        match self.0 {
            Kind::Impedance(control) => torque(control.torque_limit_nm()),
            Kind::PositionVelocity(limit) | Kind::Velocity(limit) => velocity(limit, vmax),
            Kind::ForcePosition(limit, torque_limit_nm) => {
                velocity(limit, vmax.min(MOST_VELOCITY))?;
                torque(torque_limit_nm)
            }
        }
    }

    pub(super) fn capabilities(&self) -> Capabilities {
        match &self.0 {
            Kind::Impedance(control) => control.capabilities(),
            Kind::PositionVelocity(_) | Kind::ForcePosition(..) => {
                Capabilities::of(&[Capability::Angle])
            }
            Kind::Velocity(_) => Capabilities::of(&[Capability::Velocity]),
        }
    }

    /// Returns what the drive is told within the share of its largest effort; `None` to rest.
    #[inline]
    pub(super) fn command(
        &mut self,
        order: Order,
        drive: &Feedback,
        model: &Model,
    ) -> Option<Command> {
        match (&mut self.0, order.target) {
            (Kind::Impedance(control), _) => {
                let velocity = AngularVelocity::from_rad_per_s(drive.measured.velocity_rad_per_s);
                let Impedance { angle, velocity, stiffness, damping, torque_nm } =
                    control.step(order, drive.angle(), velocity, &model.most(), &model.count())?;
                Some(Command::Mit(mit::Command {
                    position_rad: angle.as_radians(),
                    velocity_rad_per_s: velocity.as_rad_per_s(),
                    kp: stiffness,
                    kd: damping,
                    torque_nm,
                }))
            }
            (Kind::PositionVelocity(limit), Target::Angle(_)) => {
                let position = position_of(&order, drive, model)?;
                Some(Command::PositionVelocity(position, limit.as_rad_per_s() * order.share))
            }
            (Kind::ForcePosition(limit, torque_limit_nm), Target::Angle(_)) => {
                let position = position_of(&order, drive, model)?;
                let torque = order.share * *torque_limit_nm / model.tmax_nm();
                Some(Command::ForcePosition(position, limit.as_rad_per_s(), torque))
            }
            (Kind::Velocity(limit), Target::Velocity(velocity)) => {
                let limit = limit.as_rad_per_s();
                Some(Command::Velocity(velocity.as_rad_per_s().min(limit).max(-limit)))
            }
            _ => None,
        }
    }

    /// Returns a target where the shaft is, for before the drive is enabled. A drive in MIT mode that is enabled follows the last command,
    /// which was rest.
    pub(super) const fn stay(&self, drive: &Feedback) -> Option<Command> {
        let position = drive.measured.position_rad;
        match self.0 {
            Kind::Impedance(_) => None,
            Kind::PositionVelocity(_) => Some(Command::PositionVelocity(position, 0.0)),
            Kind::ForcePosition(..) => Some(Command::ForcePosition(position, 0.0, 0.0)),
            Kind::Velocity(_) => Some(Command::Velocity(drive.measured.velocity_rad_per_s)),
        }
    }

    /// Returns the torque of the last command as a share of the largest; 0 where it is not known.
    pub(super) fn effort(&self) -> f32 {
        if let Kind::Impedance(control) = &self.0 { control.effort() } else { 0.0 }
    }

    pub(super) fn reset(&mut self) {
        if let Kind::Impedance(control) = &mut self.0 {
            control.reset();
        }
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
