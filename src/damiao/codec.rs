//! The codec of frames to a drive and from a drive.

use super::Register;
use crate::frame::{CanFrame, standard_id};
use crate::motor::Impedance;
use crate::motor::{Inquiry, Shaft};
use crate::units::Angle;
use crate::wire::mit;
use crate::wire::mit::Ranges;

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
    Mit(Impedance),
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

    /// Reads angle and velocity alone.
    #[inline]
    pub(super) const fn shaft(data: &[u8; 8], ranges: &Ranges) -> Shaft {
        let [_, a, b, c, d, e, ..] = *data;
        let measured = ranges.decode_feedback(&[a, b, c, d, e]);
        let is_at_end = is_end([a, b]);
        let angle = if is_at_end { None } else { Some(Angle::from_radians(measured.position_rad)) };
        (angle, measured.velocity())
    }

    /// Reads a feedback frame; `None` for an unknown status.
    #[must_use]
    #[inline]
    pub const fn decode(data: &[u8; 8], ranges: &Ranges) -> Option<Self> {
        let [head, a, b, c, d, e, driver_c, rotor_c] = *data;
        let Some(status) = Status::of(head >> 4) else { return None };
        let is_at_end = is_end([a, b]);
        let measured = ranges.decode_feedback(&[a, b, c, d, e]);
        Some(Self { status, id: head & 0xF, measured, is_at_end, driver_c, rotor_c })
    }
}

const fn is_end(position: [u8; 2]) -> bool {
    matches!(position, [0, 0] | [0xFF, 0xFF])
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
    pub(super) const fn of(nibble: u8) -> Option<Self> {
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
