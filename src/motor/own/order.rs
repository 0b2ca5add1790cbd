//! The input of an own motor for one step.

use super::Impedance;
use crate::time::TimeStep;
use crate::units::{Angle, AngularVelocity};

/// A target of the output shaft. The target is finite, and of a kind among the motor's capabilities.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum Target {
    /// A torque in Nm; positive is counter-clockwise.
    Torque(f32),
    /// A velocity.
    Velocity(AngularVelocity),
    /// An angle, by the shortest way; the number of turns does not matter.
    Angle(Angle),
    /// A spring and a damper.
    Impedance(Impedance),
}

/// A target with its limits, for one step: see [`OwnMotor::control`](super::OwnMotor::control).
///
/// Destructure it, `let Order { target, share, step } = order;`: the compiler then warns if a field is not used.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Order {
    /// The target. While the output range opens, the angle of a position or of a spring moves from the measured angle to the
    /// requested one.
    pub target: Target,
    /// The share of the full output that is allowed, 0 to 1: the share rises from 0 after arming, and falls while the motor is warm
    /// or stalled. Keep the command within this share of its range, or multiply the gains of the drive by the share.
    pub share: f32,
    /// The time since the step before. Never on hold.
    pub step: TimeStep,
}
