//! Replies of a joint.

use super::Register;
use crate::encoder::{Homing, Position};
use crate::motor::{Link, MotorName};
use crate::units::AngularVelocity;

const REPLY: u8 = 0x04;

/// Value of a register, as reported by a joint.
///
/// # Examples
/// ```
/// use drivetrain::snake::{Register, Reply};
///
/// let reply = Reply::decode(&[0x04, 0x07, 0xFF, 0xFF, 0xFF, 0xFF]).ok_or("no reply")?;
/// assert_eq!((reply.register(), reply.value()), (Register::ActualPosition, -1));
/// # Ok::<(), &str>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Reply {
    register: Register,
    value: i32,
}

impl Reply {
    /// Takes a register and its value.
    #[must_use]
    pub const fn new(register: Register, value: i32) -> Self {
        Self { register, value }
    }

    /// Takes the data of a reply; `None` unless the data has 6 bytes, begins with 4 and names a register.
    #[must_use]
    pub fn decode(data: &[u8]) -> Option<Self> {
        match *data {
            [REPLY, register, a, b, c, d] => {
                Some(Self::new(Register::from_raw(register)?, i32::from_be_bytes([a, b, c, d])))
            }
            _ => None,
        }
    }

    /// Returns the data of the reply.
    #[must_use]
    pub const fn encode(self) -> [u8; 6] {
        let [a, b, c, d] = self.value.to_be_bytes();
        [REPLY, self.register.as_raw(), a, b, c, d]
    }

    /// Returns the register.
    #[must_use]
    pub const fn register(self) -> Register {
        self.register
    }

    /// Returns the value of the register, as on the wire.
    #[must_use]
    pub const fn value(self) -> i32 {
        self.value
    }
}

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
