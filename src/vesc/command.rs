//! The codec of commands to a drive.

use crate::frame::{CanFrame, extended_id};
use embedded_can::Id;

/// The packet of a question, and of its answer: a short message of the drive's serial protocol.
pub(super) const SHORT_MESSAGE: u8 = 8;

/// The id of this program, the address of answers.
pub(super) const HOST: u8 = 254;

/// `COMM_GET_VALUES_SELECTIVE` for value 15, the fault code.
pub(super) const FAULT_CODE: [u8; 5] = [50, 0, 0, 0x80, 0];

/// A command of a drive, in the drive's own direction and at the rotor.
///
/// Sends a current of 0 for a value that is not finite: the shaft turns freely.
///
/// # Examples
/// ```
/// use drivetrain::vesc::Command;
///
/// // The example of the documentation of the firmware: 51 A for drive 23.
/// assert_eq!(format!("{:?}", Command::Current(51.0).frame(23)), "00000117 [4] 00 00 C7 38");
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Command {
    /// The share of the supply voltage, -1 to 1. A duty of 0 brakes.
    Duty(f32),
    /// The torque current in A. A current of 0 lets the shaft go.
    Current(f32),
    /// A current in A to brake a turning shaft; the sign has no effect.
    Brake(f32),
    /// The speed in electrical rpm. A speed of 0 lets the shaft go.
    Speed(f32),
    /// The position in degrees, 0 to 360.
    Position(f32),
    /// The current as a share of the drive's limit, -1 to 1.
    CurrentShare(f32),
    /// The brake current as a share of the drive's limit, 0 to 1.
    BrakeShare(f32),
    /// A current in A to hold the shaft in place, by a standing field.
    Handbrake(f32),
    /// The handbrake current as a share of the drive's limit, 0 to 1.
    HandbrakeShare(f32),
}

impl Command {
    /// A current of 0.
    pub const RELEASE: Self = Self::Current(0.0);

    /// Writes the frame for a drive: its value truncated to whole units, high byte first.
    #[must_use]
    pub fn frame(self, id: u8) -> CanFrame {
        let (packet, value, scale) = match self {
            Self::Duty(duty) => (0, duty.clamp(-1.0, 1.0), 1e5),
            Self::Current(current) => (1, current, 1e3),
            Self::Brake(current) => (2, current, 1e3),
            Self::Speed(speed) => (3, speed, 1.0),
            Self::Position(position) => (4, position, 1e6),
            Self::CurrentShare(share) => (10, share.clamp(-1.0, 1.0), 1e5),
            Self::BrakeShare(share) => (11, share.clamp(0.0, 1.0), 1e5),
            Self::Handbrake(current) => (12, current, 1e3),
            Self::HandbrakeShare(share) => (13, share.clamp(0.0, 1.0), 1e5),
        };
        let (packet, value) = if value.is_finite() { (packet, value * scale) } else { (1, 0.0) };
        CanFrame::of(extended(packet, id), whole(value).to_be_bytes())
    }
}

/// Asks a drive for its fault code.
pub(super) fn question(id: u8) -> CanFrame {
    let [command, a, b, c, d] = FAULT_CODE;
    CanFrame::of(extended(SHORT_MESSAGE, id), [HOST, 0, command, a, b, c, d])
}

pub(super) fn extended(packet: u8, id: u8) -> Id {
    extended_id(u32::from(packet) << 8 | u32::from(id))
}

#[expect(clippy::cast_possible_truncation, reason = "saturates")]
const fn whole(value: f32) -> i32 {
    value as i32
}
