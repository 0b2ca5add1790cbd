//! The control modes, with what a user chooses for each.

use super::Model;
use super::model::RAD_PER_DEGREE;
use crate::error::ConfigError;
use crate::math::wrap_pi;
use crate::motor::{Capabilities, Capability, Impedance, ImpedanceControl, Order, Target};
use crate::units::{Angle, AngularVelocity};

/// A control mode: [`ImpedanceControl`] for torque frames, [`Velocity`] or [`PositionVelocity`].
pub trait Mode: sealed::Mode {}

impl<M: sealed::Mode> Mode for M {}

pub(super) mod sealed {
    use super::{Angle, AngularVelocity, Capabilities, Model, Order};
    use crate::error::ConfigError;

    /// Angle and velocity of the output shaft.
    pub(in crate::lk) type Shaft = (Option<Angle>, AngularVelocity);

    /// A goal of the output shaft.
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub enum Goal {
        /// A torque in Nm.
        Torque(f32),
        /// A velocity in rad/s, with the largest current in counts, 0 for none.
        Velocity(f32, u16),
        /// An angle so many rad away, with the largest velocity of the rotor in °/s.
        Way(f32, u16),
    }

    pub trait Mode: core::fmt::Debug + Copy {
        /// The first byte of the commands, and of the answers.
        const CODE: u8;
        /// The commands count from the angle that the drive has counted.
        const NEEDS_ANGLE: bool = false;

        /// # Errors
        /// A limit that is not within the ranges of the model.
        fn check(&self, model: &Model) -> Result<(), ConfigError>;

        fn capabilities(&self) -> Capabilities;

        /// Returns the largest value of bytes 2 and 3 of a command.
        fn limit(&self, model: &Model) -> u16 {
            _ = model;
            0
        }

        /// Returns the goal of a step; `None` to rest.
        fn goal(&mut self, order: Order, shaft: Shaft, model: &Model) -> Option<Goal>;

        /// Returns the torque of the last command as a share of the largest; 0 where it is not known.
        fn effort(&self) -> f32 {
            0.0
        }

        fn reset(&mut self) {}
    }
}

use sealed::{Goal, Shaft};

/// The largest angle, stiffness and damping of a torque that is calculated here.
const UNLIMITED: f32 = 1e9;

/// Torque frames: the drive follows a current, which is calculated here from torque, impedance, velocity or angle.
impl sealed::Mode for ImpedanceControl {
    const CODE: u8 = 0xA1;

    fn check(&self, model: &Model) -> Result<(), ConfigError> {
        torque_limit(self.torque_limit_nm(), model)
    }

    fn capabilities(&self) -> Capabilities {
        Self::capabilities(self)
    }

    fn goal(&mut self, order: Order, shaft: Shaft, model: &Model) -> Option<Goal> {
        let most = Impedance {
            angle: Angle::from_radians(UNLIMITED),
            velocity: AngularVelocity::from_rad_per_s(model.max_velocity()),
            stiffness: UNLIMITED,
            damping: UNLIMITED,
            torque_nm: self.torque_limit_nm(),
        };
        self.step(order, shaft.0, shaft.1, &most, &Impedance::FREE)?;
        Some(Goal::Torque(Self::effort(self) * self.torque_limit_nm()))
    }

    fn effort(&self) -> f32 {
        Self::effort(self)
    }

    fn reset(&mut self) {
        Self::reset(self);
    }
}

/// Position mode: the drive's own loops go to an angle over its turns, at most so fast.
#[derive(Debug, Clone, Copy)]
pub struct PositionVelocity {
    velocity_limit: AngularVelocity,
}

impl PositionVelocity {
    /// Limits the velocity: above 0 and at most what feedback tells, 572 rad/s at the rotor.
    #[must_use]
    pub const fn new(velocity_limit: AngularVelocity) -> Self {
        Self { velocity_limit }
    }
}

impl sealed::Mode for PositionVelocity {
    const CODE: u8 = 0xA4;
    const NEEDS_ANGLE: bool = true;

    fn check(&self, model: &Model) -> Result<(), ConfigError> {
        velocity_limit(self.velocity_limit, model)
    }

    fn capabilities(&self) -> Capabilities {
        Capabilities::of(&[Capability::Angle])
    }

    fn limit(&self, model: &Model) -> u16 {
        rotor_dps(self.velocity_limit.as_rad_per_s(), model)
    }

    fn goal(&mut self, order: Order, (angle, _): Shaft, model: &Model) -> Option<Goal> {
        let Target::Angle(target) = order.target else { return None };
        let way = wrap_pi((target - angle?).as_radians());
        let limit = rotor_dps(self.velocity_limit.as_rad_per_s() * order.share, model);
        Some(Goal::Way(way, limit))
    }
}

/// Velocity mode: the drive's own loop follows a velocity.
#[derive(Debug, Clone, Copy)]
pub struct Velocity {
    velocity_limit: AngularVelocity,
    torque_limit_nm: Option<f32>,
}

impl Velocity {
    /// Limits the velocity: above 0 and at most what feedback tells, 572 rad/s at the rotor.
    #[must_use]
    pub const fn new(velocity_limit: AngularVelocity) -> Self {
        Self { velocity_limit, torque_limit_nm: None }
    }

    /// Limits the torque too, in Nm, on drives that read the limit: protocol V2.35 has no field for it, and such a drive keeps to its
    /// own setting. The [share](Order::share) of an order lowers it.
    #[must_use]
    pub const fn with_torque_limit(self, limit_nm: f32) -> Self {
        Self { torque_limit_nm: Some(limit_nm), ..self }
    }

    fn counts(&self, share: f32, model: &Model) -> u16 {
        self.torque_limit_nm
            .map_or(0, |limit| at_least_one(limit * share / model.torque_per_count()))
    }
}

impl sealed::Mode for Velocity {
    const CODE: u8 = 0xA2;

    fn check(&self, model: &Model) -> Result<(), ConfigError> {
        velocity_limit(self.velocity_limit, model)?;
        self.torque_limit_nm.map_or(Ok(()), |limit| torque_limit(limit, model))
    }

    fn capabilities(&self) -> Capabilities {
        Capabilities::of(&[Capability::Velocity])
    }

    fn limit(&self, model: &Model) -> u16 {
        self.counts(1.0, model)
    }

    fn goal(&mut self, order: Order, _: Shaft, model: &Model) -> Option<Goal> {
        let Target::Velocity(velocity) = order.target else { return None };
        let limit = self.velocity_limit.as_rad_per_s();
        let velocity = velocity.as_rad_per_s().min(limit).max(-limit);
        Some(Goal::Velocity(velocity, self.counts(order.share, model)))
    }
}

fn rotor_dps(rad_per_s: f32, model: &Model) -> u16 {
    at_least_one(rad_per_s * model.gear() / RAD_PER_DEGREE)
}

/// Truncates to a limit of the wire: 0 would be none.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
fn at_least_one(value: f32) -> u16 {
    (value as u16).max(1)
}

fn torque_limit(limit_nm: f32, model: &Model) -> Result<(), ConfigError> {
    let (least, most) = (model.torque_per_count(), model.max_torque_nm());
    ConfigError::check_range("torque limit in Nm", limit_nm, least, most)
}

fn velocity_limit(limit: AngularVelocity, model: &Model) -> Result<(), ConfigError> {
    let most = model.max_velocity();
    ConfigError::check_limit("velocity limit in rad/s", limit.as_rad_per_s(), most)
}
