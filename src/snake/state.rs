use crate::encoder::{Homing, Position};
use crate::motor::{Link, MotorName};
use crate::units::AngularVelocity;

/// What is known of a joint.
///
/// The positive direction is that of the drive, or the other one for a joint attached as
/// [`reversed`](super::Config::reversed). All counts saturate.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct State {
    /// The joint.
    pub motor: MotorName,
    /// Turns and angle from the zero that was set, or from that of the drive.
    pub position: Position,
    /// The same in pulses, 65536 a turn; wraps as the drive's own counter does.
    pub pulses: i32,
    /// The position as the drive reported it.
    pub raw_pulses: i32,
    /// What is known of the zero.
    pub homing: Homing,
    /// The measured speed, polled less often than the position.
    pub velocity: AngularVelocity,
    /// Whether it is heard, as of the last update or frame.
    pub link: Link,
    /// Whether it was told to move, and not to relax since.
    pub is_driven: bool,
    /// Requests that were not answered in time.
    pub unanswered: u32,
    /// Frames with its id that are no reply.
    pub bad_replies: u32,
    /// How often the position went further than the joint can.
    pub position_jumps: u16,
    /// How often the drive was found disabled although it had been enabled.
    pub resets: u16,
    /// How often a target was NaN or infinite.
    pub refused_targets: u16,
    /// How often the joint was relaxed because no target came in time.
    pub forgotten_targets: u16,
}
