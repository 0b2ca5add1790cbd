//! The codec of commands to a drive.

use crate::frame::standard_id;
use embedded_can::Id;

/// A command to a drive, in the units of the wire: currents in counts, angles and velocities of the rotor.
///
/// # Examples
/// ```
/// use drivetrain::lk::Command;
///
/// assert_eq!(Command::Torque(100).encode(), [0xA1, 0, 0, 0, 0x64, 0, 0, 0]);
/// // To 360° with at most 360°/s.
/// assert_eq!(Command::Position(36_000, 360).encode(), [0xA4, 0, 0x68, 0x01, 0xA0, 0x8C, 0, 0]);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Command {
    /// Switches the drive off: no torque, and its turns and its last command are forgotten. The drive still answers.
    Off,
    /// Switches the drive on: the drive follows later commands.
    Run,
    /// A torque current in counts, -2048 to 2048.
    Torque(i16),
    /// A velocity in 0.01°/s, and the largest current in counts. Drives with protocol V2.35 read no limit there.
    Velocity(i32, u16),
    /// To an angle in 0.01° over the turns counted by the drive, with at most so many °/s.
    Position(i32, u16),
    /// Asks for [`Feedback`](super::Feedback).
    ReadFeedback,
    /// Asks for the angle of the rotor over its turns: [`Feedback::decode_angle`](super::Feedback::decode_angle).
    ReadAngle,
    /// Asks for the [`State`](super::State).
    ReadState,
    /// Clears the errors whose reason is gone, and asks for the [`State`](super::State).
    ClearErrors,
}

impl Command {
    /// A current without torque: the command of a motor at rest.
    pub const REST: Self = Self::Torque(0);

    /// Writes the data of a frame. A current beyond the range is sent as its end.
    #[must_use]
    pub const fn encode(self) -> [u8; 8] {
        let (code, limit, value) = match self {
            Self::Off => (0x80, 0, 0),
            Self::Run => (0x88, 0, 0),
            Self::Torque(current) => (0xA1, 0, within(current).cast_unsigned() as i32),
            Self::Velocity(velocity, limit) => (0xA2, limit, velocity),
            Self::Position(angle, limit) => (0xA4, limit, angle),
            Self::ReadAngle => (0x92, 0, 0),
            Self::ReadState => (0x9A, 0, 0),
            Self::ClearErrors => (0x9B, 0, 0),
            Self::ReadFeedback => (0x9C, 0, 0),
        };
        data_of(code, limit, value)
    }
}

/// Writes a first byte, a limit and a value.
pub(crate) const fn data_of(code: u8, limit: u16, value: i32) -> [u8; 8] {
    let ([a, b], [c, d, e, f]) = (limit.to_le_bytes(), value.to_le_bytes());
    [code, 0, a, b, c, d, e, f]
}

const fn within(current: i16) -> i16 {
    if current > 2_048 {
        2_048
    } else if current < -2_048 {
        -2_048
    } else {
        current
    }
}

/// Tells whether a frame reads like a command of a controller rather than like an answer. `limit` is the largest value sent by the motor
/// writes to bytes 2 and 3.
///
/// Byte 1 of a command is 0; in an answer a 0 there is a temperature of 0 °C.
pub(crate) const fn is_command(data: &[u8; 8], limit: u16) -> bool {
    let [code, first, a, b, c, d, e, f] = *data;
    first == 0
        && match code {
            0xA1 => matches!([a, b, e, f], [0, 0, 0, 0]),
            0xA2 | 0xA4 => u16::from_le_bytes([a, b]) <= limit,
            _ => matches!([a, b, c, d, e, f], [0, 0, 0, 0, 0, 0]),
        }
}

/// Returns the id of the frames of a drive.
pub(crate) fn id_of(ids: u16, id: u8) -> Id {
    standard_id(ids + u16::from(id))
}
