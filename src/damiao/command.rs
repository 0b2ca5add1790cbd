//! The codec of commands to a drive.

use super::Register;
use crate::frame::{CanFrame, standard_id};
use crate::motor::Inquiry;
use crate::wire::mit;

/// The id of the frames with questions for registers, for every drive.
pub(super) const REGISTERS: u16 = 0x7FF;

/// Clears an error of the drive. The drive stays disabled.
pub(super) const CLEAR_ERROR: [u8; 8] = [0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFB];

/// The largest velocity of a force-position command, in rad/s.
pub(super) const MOST_VELOCITY: f32 = 100.0;

/// A command of any of the four control modes, in units of the output shaft.
///
/// # Examples
/// ```
/// use drivetrain::damiao::{Command, Model};
///
/// let command = Command::ForcePosition(1.0, 2.0, 0.5); // rad, rad/s, share of the largest current
/// let data = command.encode(Model::J4310.ranges());
/// assert_eq!(data, [0x00, 0x00, 0x80, 0x3F, 200, 0, 0x88, 0x13]);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Command {
    /// A spring, a damper and a torque.
    Mit(mit::Command),
    /// To a position in rad, at most so fast, in rad/s.
    PositionVelocity(f32, f32),
    /// At a velocity in rad/s.
    Velocity(f32),
    /// To a position in rad, at most so fast, in rad/s up to 100, with at most this share of the largest current, 0 to 1.
    ForcePosition(f32, f32, f32),
}

impl Command {
    /// Writes the data of a frame. The ranges count for MIT alone.
    ///
    /// ```text
    /// position-velocity  position f32                | velocity f32    low byte first
    /// velocity           velocity f32                | 0
    /// force-position     position f32 | velocity u16 in 0.01 rad/s | current u16 in 1/10000
    /// ```
    #[must_use]
    pub fn encode(self, ranges: &mit::Ranges) -> [u8; 8] {
        match self {
            Self::Mit(command) => ranges.encode(&command),
            Self::PositionVelocity(position, velocity) => halves(position, velocity.to_le_bytes()),
            Self::Velocity(velocity) => halves(velocity, [0; 4]),
            Self::ForcePosition(position, velocity, share) => {
                let [a, b] = count(velocity.clamp(0.0, MOST_VELOCITY) * 100.0).to_le_bytes();
                let [c, d] = count(share.clamp(0.0, 1.0) * 10_000.0).to_le_bytes();
                halves(position, [a, b, c, d])
            }
        }
    }
}

fn halves(first: f32, [e, f, g, h]: [u8; 4]) -> [u8; 8] {
    let [a, b, c, d] = first.to_le_bytes();
    [a, b, c, d, e, f, g, h]
}

/// Truncates, as the drives do; NaN is zero.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "limited before")]
const fn count(value: f32) -> u16 {
    value as u16
}

/// Asks for feedback.
pub(super) fn refresh(id: u8) -> CanFrame {
    CanFrame::of(standard_id(REGISTERS), [id, 0, 0xCC, 0, 0, 0, 0, 0])
}

/// Asks about a register.
///
/// ```text
/// byte 0 .. 1    2                                              3                4 ..  7
/// id, low first  0x33 read, 0x55 write, 0xAA store, 0xCC feedback  register number  value, low first
/// ```
pub(super) fn inquiry(id: u8, inquiry: Inquiry<Register>) -> CanFrame {
    let (verb, number, value) = match inquiry {
        Inquiry::Read(register) => (0x33, register.number(), [0; 4]),
        Inquiry::Write(register, value) => {
            (0x55, register.number(), register.form().bytes_of(value))
        }
        Inquiry::Store => (0xAA, 1, [0; 4]),
    };
    let [a, b, c, d] = value;
    CanFrame::of(standard_id(REGISTERS), [id, 0, verb, number, a, b, c, d])
}
