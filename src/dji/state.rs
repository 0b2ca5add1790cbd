use super::{ErrorCode, Feedback};
use crate::encoder::{Homing, Position};
use crate::motor::{Conditions, Link, MotorName};
use crate::units::{AngularVelocity, Current};

/// What is known of a motor, at its output shaft.
///
/// The positive direction is counter-clockwise looking at the shaft, or the other one for a motor attached as
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
    /// What is known of the absolute angle.
    pub homing: Homing,
    /// Velocity of the output shaft.
    pub velocity: AngularVelocity,
    /// Torque current.
    pub current: Current,
    /// Torque at the output shaft in Nm, from the current and the torque constant.
    pub torque_nm: f32,
    /// Motor temperature in °C; `None` on C610, which has none.
    pub temperature_c: Option<i16>,
    /// What the ESC complains of.
    pub error: Option<ErrorCode>,
    /// Rotor counts in the direction of the shaft since the first frame (which counts its angle) or since zero was
    /// set; 8192 a turn, exact.
    pub rotor_counts: i64,
    /// How often a gap in the feedback left the number of rotor turns in doubt, saturating.
    pub ambiguous_gaps: u16,
    /// How often a target was NaN or infinite, saturating.
    pub refused_targets: u16,
    /// How often the motor was relaxed because no target came in time, saturating.
    pub forgotten_targets: u16,
    /// What is wrong with the motor.
    pub conditions: Conditions,
    /// Whether it is heard, as of the last update or frame.
    pub link: Link,
    /// The last frame as it came.
    pub feedback: Feedback,
}
