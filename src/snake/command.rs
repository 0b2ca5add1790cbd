//! Frames of the controller.

use super::Register;
use super::model::IDS;
use crate::frame::CanFrame;
use embedded_can::{Frame, StandardId};

const WRITE: u8 = 0x01;
const READ: u8 = 0x03;

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
