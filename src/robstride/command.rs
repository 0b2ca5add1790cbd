//! The codec of commands to a drive.

use super::{Model, Register};
use crate::frame::{CanFrame, extended_id};
use crate::motor::Inquiry;
use crate::wire::mit;
use embedded_can::ExtendedId;

/// A frame to a drive, in units of the output shaft.
///
/// ```text
/// id     28 .. 24    23 ..  8                         7 ..  0
/// 1      operation   torque                           motor      position, velocity, kp, kd: 16 bits each, high byte first
/// 3      enable      host                             motor
/// 4      disable     host                             motor      byte 0: 1 clears faults
/// 6      set zero    host                             motor      byte 0: 1
/// 7      set id      new id in 23 .. 16, host         motor      byte 0: 1
/// 17     read        host                             motor      index 16, low byte first
/// 18     write       host                             motor      index 16 | 0 | value 32, low byte first
/// 22     store       host                             motor      1 to 8
/// ```
///
/// # Examples
/// ```
/// use drivetrain::robstride::{Command, Model, Register};
///
/// let frame = Command::Write(Register::VelocityTarget, 10.0).encode(&Model::RS00, 0xFD, 127);
/// assert_eq!(format!("{frame:?}"), "1200FD7F [8] 0A 70 00 00 00 00 20 41");
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Command {
    /// A spring, a damper and a torque.
    Operation(mit::Command),
    /// Follows commands from now on.
    Enable,
    /// Gives no torque from now on.
    Disable,
    /// The same, and forgets its faults.
    ClearFaults,
    /// Makes the present position zero: on a CyberGear until the supply is lost.
    SetZero,
    /// Takes another id at once.
    SetId(u8),
    /// Asks for a parameter.
    Read(Register),
    /// Sets a parameter until the supply is lost.
    Write(Register, f32),
    /// Keeps the parameters over a loss of the supply. **A CyberGear reads this frame as another bit rate.**
    Store,
}

impl Command {
    pub(super) const fn of(inquiry: Inquiry<Register>) -> Self {
        match inquiry {
            Inquiry::Read(register) => Self::Read(register),
            Inquiry::Write(register, value) => Self::Write(register, value),
            Inquiry::Store => Self::Store,
        }
    }

    /// Writes the frame of a host to a motor.
    #[must_use]
    pub fn encode(self, model: &Model, host: u8, id: u8) -> CanFrame {
        let one = [1, 0, 0, 0, 0, 0, 0, 0];
        let (kind, middle, data) = match self {
            Self::Operation(command) => {
                let (data, torque) = model.ranges().encode_wide(&command);
                (1, torque.to_be_bytes(), data)
            }
            Self::Enable => (3, [0, host], [0; 8]),
            Self::Disable => (4, [0, host], [0; 8]),
            Self::ClearFaults => (4, [0, host], one),
            Self::SetZero => (6, [0, host], one),
            Self::SetId(new) => (7, [new, host], one),
            Self::Read(register) => (17, [0, host], parameter(register, [0; 4])),
            Self::Write(register, value) => {
                (18, [0, host], parameter(register, register.form().bytes_of(value)))
            }
            Self::Store => (22, [0, host], [1, 2, 3, 4, 5, 6, 7, 8]),
        };
        let [high, low] = middle;
        CanFrame::of(extended_id(u32::from_be_bytes([kind, high, low, id])), data)
    }
}

fn parameter(register: Register, [a, b, c, d]: [u8; 4]) -> [u8; 8] {
    let [low, high] = register.index().to_le_bytes();
    [low, high, 0, 0, a, b, c, d]
}

/// Returns the 29 bits of the id; `None` for 11 bits.
pub(super) fn raw_of(frame: &CanFrame) -> Option<u32> {
    frame.has_extended_id().then_some(frame.header() & ExtendedId::MAX.as_raw())
}
