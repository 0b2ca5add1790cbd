//! The control mode, with what a user chooses for it.

use super::model::{RAD_PER_DEGREE, Scale};
use crate::error::ConfigError;
use crate::math::wrap_pi;
use crate::motor::{Capabilities, Capability, Impedance, ImpedanceControl, Order, Target};
use crate::units::{Angle, AngularVelocity};

/// A control mode of the drive. An [`ImpedanceControl`] is one too: torque frames, in which the drive follows a current that is
/// calculated here from torque, impedance, velocity or angle.
#[derive(Debug, Clone, Copy)]
pub struct Mode(Kind);

#[derive(Debug, Clone, Copy)]
enum Kind {
    Torque(ImpedanceControl),
    /// With the limit of the torque in Nm, where there is one.
    Velocity(AngularVelocity, Option<f32>),
    Position(AngularVelocity),
}

impl From<ImpedanceControl> for Mode {
    fn from(control: ImpedanceControl) -> Self {
        Self(Kind::Torque(control))
    }
}

/// Angle and velocity of the output shaft.
pub(crate) type Shaft = (Option<Angle>, AngularVelocity);

/// A goal of the output shaft.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Goal {
    /// A torque in Nm.
    Torque(f32),
    /// A velocity in rad/s, with the largest current in counts, 0 for none.
    Velocity(f32, u16),
    /// An angle so many rad away, with the largest velocity in °/s of the wire.
    Way(f32, u16),
}

/// The largest angle, stiffness and damping of a torque that is calculated here.
const UNLIMITED: f32 = 1e9;

impl Mode {
    /// Velocity mode: the drive's own loop follows a velocity, at most so fast: above 0 and at most what feedback tells: 572 rad/s, of
    /// the rotor of `lk` and of the output shaft of `rmd`.
    #[must_use]
    pub const fn velocity(velocity_limit: AngularVelocity) -> Self {
        Self(Kind::Velocity(velocity_limit, None))
    }

    /// Velocity mode with a limit of the torque in Nm too, on drives that read the limit: protocol V2.35 of `lk` has no field for it, and
    /// such a drive keeps to its own setting. Motors of `rmd` refuse it. The [share](Order::share) of an order lowers it.
    #[must_use]
    pub const fn velocity_with_torque_limit(
        velocity_limit: AngularVelocity,
        torque_limit_nm: f32,
    ) -> Self {
        Self(Kind::Velocity(velocity_limit, Some(torque_limit_nm)))
    }

    /// Position mode: the drive's own loops go to an angle over its turns, at most so fast: above 0 and at most what feedback tells:
    /// 572 rad/s, of the rotor of `lk` and of the output shaft of `rmd`.
    #[must_use]
    pub const fn position_velocity(velocity_limit: AngularVelocity) -> Self {
        Self(Kind::Position(velocity_limit))
    }

    /// The first byte of the commands, and of the answers.
    pub(crate) const fn code(&self) -> u8 {
        match self.0 {
            Kind::Torque(_) => 0xA1,
            Kind::Velocity(..) => 0xA2,
            Kind::Position(_) => 0xA4,
        }
    }

    /// The commands count from the angle that the drive has counted.
    pub(crate) const fn needs_angle(&self) -> bool {
        matches!(self.0, Kind::Position(_))
    }

    /// # Errors
    /// A limit that is not within the ranges of the model.
    pub(crate) fn check(&self, scale: &Scale) -> Result<(), ConfigError> {
        let torque = |limit| {
            let (least, most) = (scale.torque_per_count, scale.max_torque_nm);
            ConfigError::check_range("torque limit in Nm", limit, least, most)
        };
        match self.0 {
            Kind::Torque(control) => torque(control.torque_limit_nm()),
            Kind::Velocity(limit, torque_limit_nm) => {
                velocity_limit(limit, scale)?;
                if torque_limit_nm.is_some() && !scale.limits_torque {
                    return Err(ConfigError::Unsupported("torque limit of a velocity"));
                }
                torque_limit_nm.map_or(Ok(()), torque)
            }
            Kind::Position(limit) => velocity_limit(limit, scale),
        }
    }

    pub(crate) fn capabilities(&self) -> Capabilities {
        match &self.0 {
            Kind::Torque(control) => control.capabilities(),
            Kind::Velocity(..) => Capabilities::of(&[Capability::Velocity]),
            Kind::Position(_) => Capabilities::of(&[Capability::Angle]),
        }
    }

    /// Returns the largest value of bytes 2 and 3 of a command.
    pub(crate) fn limit(&self, scale: &Scale) -> u16 {
        match self.0 {
            Kind::Torque(_) => 0,
            Kind::Velocity(_, torque_limit_nm) => counts(torque_limit_nm, 1.0, scale),
            Kind::Position(limit) => rotor_dps(limit.as_rad_per_s(), scale),
        }
    }

    /// Returns the goal of a step; `None` to rest.
    pub(crate) fn goal(&mut self, order: Order, shaft: Shaft, scale: &Scale) -> Option<Goal> {
        match (&mut self.0, order.target) {
            (Kind::Torque(control), _) => {
                let most = Impedance {
                    angle: Angle::from_radians(UNLIMITED),
                    velocity: AngularVelocity::from_rad_per_s(scale.max_velocity),
                    stiffness: UNLIMITED,
                    damping: UNLIMITED,
                    torque_nm: control.torque_limit_nm(),
                };
                control.step(order, shaft.0, shaft.1, &most, &Impedance::FREE)?;
                Some(Goal::Torque(control.effort() * control.torque_limit_nm()))
            }
            (Kind::Velocity(limit, torque_limit_nm), Target::Velocity(velocity)) => {
                let limit = limit.as_rad_per_s();
                let velocity = velocity.as_rad_per_s().min(limit).max(-limit);
                Some(Goal::Velocity(velocity, counts(*torque_limit_nm, order.share, scale)))
            }
            (Kind::Position(limit), Target::Angle(target)) => {
                let way = wrap_pi((target - shaft.0?).as_radians());
                Some(Goal::Way(way, rotor_dps(limit.as_rad_per_s() * order.share, scale)))
            }
            _ => None,
        }
    }

    /// Returns the torque of the last command as a share of the largest; 0 where it is not known.
    pub(crate) fn effort(&self) -> f32 {
        if let Kind::Torque(control) = &self.0 { control.effort() } else { 0.0 }
    }

    pub(crate) fn reset(&mut self) {
        if let Kind::Torque(control) = &mut self.0 {
            control.reset();
        }
    }
}

/// Returns the share of a limit of the torque in counts of current; 0 for none.
fn counts(torque_limit_nm: Option<f32>, share: f32, scale: &Scale) -> u16 {
    torque_limit_nm.map_or(0, |limit| at_least_one(limit * share / scale.torque_per_count))
}

fn rotor_dps(rad_per_s: f32, scale: &Scale) -> u16 {
    at_least_one(rad_per_s * scale.gear / RAD_PER_DEGREE)
}

/// Truncates to a limit of the wire: 0 would be none.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
fn at_least_one(value: f32) -> u16 {
    (value as u16).max(1)
}

fn velocity_limit(limit: AngularVelocity, scale: &Scale) -> Result<(), ConfigError> {
    let most = scale.max_velocity;
    ConfigError::check_limit("velocity limit in rad/s", limit.as_rad_per_s(), most)
}
