//! The codec of frames from a drive: its feedback, and answers about registers.

use super::Register;
use crate::motor::Inquiry;
use crate::units::Angle;
use crate::wire::mit::{self, Ranges};

/// A report of a drive.
///
/// ```text
/// byte 0          1 ..  2    3 .. 5                    6       7
/// status 4 | id 4 | position | velocity 12 | torque 12 | driver | rotor temperature in °C
/// ```
///
/// # Examples
/// ```
/// use drivetrain::damiao::{Feedback, Model, Status};
///
/// let data = [0x13, 0x7F, 0xFF, 0x7F, 0xF7, 0xFF, 0x1F, 0x23];
/// let feedback = Feedback::decode(&data, Model::J4310.ranges()).ok_or("no status")?;
/// assert_eq!((feedback.status, feedback.id), (Status::Enabled, 3));
/// assert_eq!((feedback.driver_c, feedback.rotor_c), (31, 35));
/// assert!(feedback.measured.position_rad.abs() < 25.0 / 65_535.0);
/// # Ok::<(), &str>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Feedback {
    /// The state of the drive.
    pub status: Status,
    /// The lowest four bits of the drive's id.
    pub id: u8,
    /// Position, velocity and torque of the output shaft.
    pub measured: mit::Feedback,
    /// The position is at an end of its range, so the shaft is there or beyond.
    pub is_at_end: bool,
    /// The temperature of the driver's transistors in °C.
    pub driver_c: u8,
    /// The temperature of the rotor in °C.
    pub rotor_c: u8,
}

impl Feedback {
    /// Returns the angle of the output shaft; `None` at an end of the range.
    #[must_use]
    pub const fn angle(&self) -> Option<Angle> {
        if self.is_at_end { None } else { Some(Angle::from_radians(self.measured.position_rad)) }
    }

    /// Reads a feedback frame; `None` for an unknown status.
    #[must_use]
    pub const fn decode(data: &[u8; 8], ranges: &Ranges) -> Option<Self> {
        let [head, a, b, c, d, e, driver_c, rotor_c] = *data;
        let Some(status) = Status::of(head >> 4) else { return None };
        let is_at_end = matches!([a, b], [0, 0] | [0xFF, 0xFF]);
        let measured = ranges.decode_feedback(&[a, b, c, d, e]);
        Some(Self { status, id: head & 0xF, measured, is_at_end, driver_c, rotor_c })
    }
}

/// The state of a drive: the upper half of the first byte of its feedback.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub enum Status {
    /// 0: the drive gives no torque.
    Disabled = 0,
    /// 1: the drive follows commands.
    Enabled = 1,
    /// 8: the supply is above its limit.
    OverVoltage = 8,
    /// 9: the supply is below its limit.
    UnderVoltage = 9,
    /// 10: a phase had too much current.
    OverCurrent = 10,
    /// 11: the driver's transistors are too hot.
    DriverOverTemperature = 11,
    /// 12: the rotor is too hot.
    RotorOverTemperature = 12,
    /// 13: no command came within the register TIMEOUT.
    CommunicationLost = 13,
    /// 14: the motor was overloaded.
    Overload = 14,
}

impl Status {
    const fn of(nibble: u8) -> Option<Self> {
        Some(match nibble {
            0 => Self::Disabled,
            1 => Self::Enabled,
            8 => Self::OverVoltage,
            9 => Self::UnderVoltage,
            10 => Self::OverCurrent,
            11 => Self::DriverOverTemperature,
            12 => Self::RotorOverTemperature,
            13 => Self::CommunicationLost,
            14 => Self::Overload,
            _ => return None,
        })
    }

    /// Tells whether the drive has switched itself off because of an error, still to be cleared.
    #[must_use]
    pub const fn is_error(self) -> bool {
        !matches!(self, Self::Disabled | Self::Enabled)
    }

    /// Returns the number of the error; 0 without an error.
    #[must_use]
    pub const fn error_code(self) -> u8 {
        if self.is_error() { self as u8 } else { 0 }
    }
}

/// Reads the value in the answer to an inquiry; `None` for any other frame. The answer has the id of the feedback.
///
/// Only the register in question, of this drive, counts.
///
/// ```text
/// byte 0 .. 1    2                       3                4 ..  7
/// id, low first  0x33 read, 0x55 written register number  value, low first
/// ```
pub(super) fn value(data: &[u8; 8], id: u8, inquiry: Inquiry<Register>) -> Option<f32> {
    let (asked, register) = match inquiry {
        Inquiry::Read(register) => (0x33, register),
        Inquiry::Write(register, _) => (0x55, register),
        Inquiry::Store => return None,
    };
    let [low, high, verb, number, value @ ..] = *data;
    let is_answer = (low, high, verb, number) == (id, 0, asked, register.number());
    is_answer.then(|| register.form().value_of(value))
}

/// Tells whether a frame reads like an answer about a register of a drive, awaited or not: of a tool, or come twice.
///
/// If a disabled drive turns backward with nearly the largest velocity, at the lower end of its range, and so reports the same
/// bytes, the drive counts as silent.
pub(super) const fn is_answer(data: &[u8; 8], id: u8) -> bool {
    let [low, high, verb, number, ..] = *data;
    low == id && high == 0 && matches!(verb, 0x33 | 0x55 | 0xAA) && number <= LAST_REGISTER
}

/// The largest number of a register.
const LAST_REGISTER: u8 = 81;
