//! The input of an own motor for one step.

use crate::control::TimeStep;
use crate::units::{Angle, AngularVelocity};

/// A target of the output shaft. It is finite, and of a kind that the motor's capabilities have.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum Target {
    /// A torque in Nm; positive is counter-clockwise.
    Torque(f32),
    /// A velocity.
    Velocity(AngularVelocity),
    /// An angle, by the shortest way; how many turns it has does not matter.
    Angle(Angle),
    /// A spring and a damper.
    Impedance(Impedance),
}

/// A spring and a damper at the output shaft, and a torque beside them: what a joint of an arm or a leg is given.
///
/// The torque is `stiffness * (angle - measured angle) + damping * (velocity - measured velocity) + torque`, within the limits
/// of the motor.
///
/// # Examples
/// ```
/// use drivetrain::motor::Impedance;
/// use drivetrain::units::Angle;
///
/// let hold = Impedance { angle: Angle::from_degrees(30.0), stiffness: 20.0, damping: 0.6, ..Impedance::FREE };
/// assert!(hold.is_finite() && hold.torque_nm == 0.0);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Impedance {
    /// The angle where the spring is at rest, in the range of the motor's own angle: turns count.
    pub angle: Angle,
    /// The velocity at which the damper is at rest.
    pub velocity: AngularVelocity,
    /// The stiffness of the spring in Nm/rad, not negative.
    pub stiffness: f32,
    /// The damping in Nm s/rad, not negative.
    pub damping: f32,
    /// The torque beside both, in Nm; positive is counter-clockwise: the weight of an arm, say.
    pub torque_nm: f32,
}

impl Impedance {
    /// Neither spring nor damper, and no torque.
    pub const FREE: Self = Self {
        angle: Angle::ZERO,
        velocity: AngularVelocity::ZERO,
        stiffness: 0.0,
        damping: 0.0,
        torque_nm: 0.0,
    };

    /// Tells whether each value is finite, and stiffness and damping are not negative.
    #[must_use]
    pub const fn is_finite(&self) -> bool {
        self.angle.is_finite()
            && self.velocity.is_finite()
            && self.stiffness.is_finite()
            && self.damping.is_finite()
            && self.torque_nm.is_finite()
            && self.stiffness >= 0.0
            && self.damping >= 0.0
    }
}

/// A target with its limits, for one step: see [`OwnMotor::control`](super::OwnMotor::control).
///
/// Destructure it, `let Order { target, share, step } = order;`: the compiler then warns if a field is not used.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Order {
    /// The target. While the output range opens, an angle, that of a spring too, moves from the measured angle to the one that
    /// was set.
    pub target: Target,
    /// The share of the full output that is allowed, 0 to 1: it rises from 0 after arming, and falls while the motor is warm
    /// or stalled. Keep the command within this share of its range, or multiply the gains of the drive by it.
    pub share: f32,
    /// The time since the step before. Never on hold.
    pub step: TimeStep,
}
