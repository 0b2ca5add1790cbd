use super::{ErrorCode, Feedback};
use crate::encoder::{Homing, Position};
use crate::motor::{Conditions, Link, MotorName};
use crate::units::{AngularVelocity, Current};

/// State of a motor, at its output shaft.
///
/// The positive direction is counter-clockwise looking at the shaft, reversed for a motor attached as
/// [`reversed`](super::Config::reversed).
///
/// Takes 72 bytes on a Cortex-M4F (`docs/figures.md`).
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct State {
    /// The motor.
    pub motor: MotorName,
    /// Turns and angle of the output shaft; relative to power-on or absolute: see [`homing`](Self::homing).
    pub position: Position,
    /// Knowledge of the absolute angle.
    pub homing: Homing,
    /// Velocity of the output shaft.
    pub velocity: AngularVelocity,
    /// Torque current.
    pub current: Current,
    /// Torque at the output shaft in Nm, from the current and the torque constant.
    pub torque_nm: f32,
    /// Motor temperature in °C; `None` on C610, which has no sensor.
    pub temperature_c: Option<i16>,
    /// The reported error of the ESC.
    pub error: Option<ErrorCode>,
    /// Rotor counts in the direction of the shaft since the first frame (which counts its angle) or since the last setting of zero; 8192 a
    /// turn, exact.
    pub rotor_counts: i64,
    /// Number of feedback gaps that left the number of rotor turns in doubt, saturating.
    pub ambiguous_gaps: u16,
    /// Number of NaN or infinite targets, saturating.
    pub refused_targets: u16,
    /// Number of expired targets, each of which relaxed the motor; saturating.
    pub forgotten_targets: u16,
    /// The conditions that hold.
    pub conditions: Conditions,
    /// The link, as of the last update or frame.
    pub link: Link,
    /// The last frame as received.
    pub feedback: Feedback,
}
