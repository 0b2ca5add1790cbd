use crate::encoder::{Homing, Position};
use crate::motor::{Link, MotorName};
use crate::units::AngularVelocity;

/// State of a joint.
///
/// The positive direction is that of the drive, reversed for a joint attached as [`reversed`](super::Config::reversed). All counts
/// saturate.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct State {
    /// The joint.
    pub motor: MotorName,
    /// Turns and angle from the configured zero, or from the zero of the drive.
    pub position: Position,
    /// The position in pulses, 65536 a turn; wraps like the drive's own counter.
    pub pulses: i32,
    /// The position as reported by the drive.
    pub raw_pulses: i32,
    /// Knowledge of the zero.
    pub homing: Homing,
    /// The measured speed, polled less often than the position.
    pub velocity: AngularVelocity,
    /// The link, as of the last update or frame.
    pub link: Link,
    /// Whether the joint was commanded to move, and not disabled since.
    pub is_driven: bool,
    /// Requests not answered in time.
    pub unanswered: u32,
    /// Frames with the joint's id that are no reply.
    pub bad_replies: u32,
    /// Number of position changes larger than possible.
    pub position_jumps: u16,
    /// Number of times that the drive was found disabled after an enable.
    pub resets: u16,
    /// Number of NaN or infinite targets.
    pub refused_targets: u16,
    /// Number of expired targets, each of which relaxed the joint.
    pub forgotten_targets: u16,
}
