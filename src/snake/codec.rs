//! The codec of frames to a drive and from a drive.

use super::Register;
use super::model::IDS;
use crate::encoder::{Homing, Position};
use crate::frame::CanFrame;
use crate::motor::{Link, MotorName};
use crate::units::AngularVelocity;
use embedded_can::{Frame, StandardId};

const WRITE: u8 = 0x01;
const READ: u8 = 0x03;
const REPLY: u8 = 0x04;

/// A frame of the controller.
///
/// # Examples
/// ```
/// use drivetrain::snake::{Command, Register};
///
/// let frame = |id, command: Command| command.frame(id).map(|frame| format!("{frame:?}"));
/// let go = frame(5, Command::Write(Register::Position, 131_072)); // two turns
/// assert_eq!(go.as_deref(), Some("005 [6] 01 0A 00 02 00 00"));
/// let enable = frame(12, Command::Write(Register::Enable, 1));
/// assert_eq!(enable.as_deref(), Some("00C [6] 01 10 00 00 00 01"));
/// let ask = frame(3, Command::Read(Register::ActualPosition));
/// assert_eq!(ask.as_deref(), Some("003 [2] 03 07"));
/// assert_eq!(frame(13, Command::Read(Register::ActualPosition)), None);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Command {
    /// Sets a register.
    Write(Register, i32),
    /// Requests a register.
    Read(Register),
}

impl Command {
    /// The frame that makes a joint safe.
    pub const DISABLE: Self = Self::Write(Register::Enable, 0);

    /// Builds the frame for a joint; `None` for an id outside 1 to 12.
    #[must_use]
    pub fn frame(self, id: u8) -> Option<CanFrame> {
        let address = StandardId::new(u16::from(id)).filter(|_| (1..=IDS).contains(&id))?;
        match self {
            Self::Write(register, value) => {
                let [a, b, c, d] = value.to_be_bytes();
                CanFrame::new(address, &[WRITE, register.as_raw(), a, b, c, d])
            }
            Self::Read(register) => CanFrame::new(address, &[READ, register.as_raw()]),
        }
    }

    /// Reads the data of a frame; `None` if the frame is not from a controller.
    #[must_use]
    pub fn decode(data: &[u8]) -> Option<Self> {
        match *data {
            [WRITE, register, a, b, c, d] => {
                Some(Self::Write(Register::from_raw(register)?, i32::from_be_bytes([a, b, c, d])))
            }
            [READ, register] => Some(Self::Read(Register::from_raw(register)?)),
            _ => None,
        }
    }

    /// Tells whether the command causes no motion: a read, a disable, a current of zero.
    #[must_use]
    pub const fn is_safe(self) -> bool {
        matches!(self, Self::Read(_) | Self::Write(Register::Enable | Register::Current, 0))
    }
}

impl Register {
    /// Takes the number on the wire.
    #[must_use]
    pub fn from_raw(raw: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|register| register.as_raw() == raw)
    }

    /// Returns the number on the wire.
    #[must_use]
    pub const fn as_raw(self) -> u8 {
        self as u8
    }

    /// Takes the data of a reply, and returns the register and its value as on the wire; `None` unless the data has 6 bytes, begins with 4
    /// and names a register.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::snake::Register;
    ///
    /// let reply = Register::from_reply(&[0x04, 0x07, 0xFF, 0xFF, 0xFF, 0xFF]);
    /// assert_eq!(reply, Some((Register::ActualPosition, -1)));
    /// assert_eq!(Register::ActualPosition.reply(-1), [0x04, 0x07, 0xFF, 0xFF, 0xFF, 0xFF]);
    /// ```
    #[must_use]
    pub fn from_reply(data: &[u8]) -> Option<(Self, i32)> {
        match *data {
            [REPLY, register, a, b, c, d] => {
                Some((Self::from_raw(register)?, i32::from_be_bytes([a, b, c, d])))
            }
            _ => None,
        }
    }

    /// Returns the data of a reply with the value of the register.
    #[must_use]
    pub const fn reply(self, value: i32) -> [u8; 6] {
        let [a, b, c, d] = value.to_be_bytes();
        [REPLY, self.as_raw(), a, b, c, d]
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
