//! The codec of frames to a drive and from a drive.

use super::{Model, Register};
use crate::frame::{CanFrame, extended_id};
use crate::motor::{Impedance, Inquiry, code_from};
use crate::units::Angle;
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
    Operation(Impedance),
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
            Self::Operation(command) => return operation(&command, model, id),
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

/// Writes the frame of an operation, apart from the other commands: it is the one of each tick.
pub(super) fn operation(command: &Impedance, model: &Model, id: u8) -> CanFrame {
    let (data, torque) = model.ranges().encode_wide(command);
    let [high, low] = torque.to_be_bytes();
    CanFrame::of(extended_id(u32::from_be_bytes([1, high, low, id])), data)
}

fn parameter(register: Register, [a, b, c, d]: [u8; 4]) -> [u8; 8] {
    let [low, high] = register.index().to_le_bytes();
    [low, high, 0, 0, a, b, c, d]
}

/// Returns the 29 bits of the id; `None` for 11 bits.
pub(super) fn raw_of(frame: &CanFrame) -> Option<u32> {
    frame.has_extended_id().then_some(frame.header() & ExtendedId::MAX.as_raw())
}

/// A report of a drive, part of each answer.
///
/// ```text
/// id     28 .. 24    23 .. 22    21 .. 16    15 ..  8    7 ..  0
///        2           mode        faults      motor       host
/// data   byte 0 .. 1 2 ..  3     4 .. 5   6 .. 7                   high byte first
///        position    velocity    torque   temperature in 0.1 °C
/// ```
///
/// # Examples
/// ```
/// use drivetrain::frame::CanFrame;
/// use drivetrain::robstride::{Feedback, Model, Status};
/// use embedded_can::ExtendedId;
///
/// let id = ExtendedId::new(0x0295_2C7F).ok_or("29 bits")?;
/// let frame = CanFrame::of(id, [0x80, 0x00, 0x80, 0x00, 0x80, 0x00, 0x00, 0xFA]);
/// let feedback = Feedback::decode(&frame, &Model::CYBERGEAR).ok_or("no feedback")?;
/// assert_eq!((feedback.id, feedback.status, feedback.faults), (0x2C, Status::Run, 0b01_0101));
/// assert_eq!(feedback.fault_code(), 16); // under-voltage, bit 16 of the id, is the lowest
/// assert_eq!(feedback.temperature_c, 25.0);
/// # Ok::<(), &str>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Feedback {
    /// The state of the drive.
    pub status: Status,
    /// Bits 16 to 21 of the id: under-voltage, over-current, over-temperature, magnetic encoder, stall (CyberGear: Hall encoder), not
    /// calibrated.
    pub faults: u8,
    /// The id of the drive.
    pub id: u8,
    /// Position, velocity and torque of the output shaft.
    pub measured: mit::Feedback,
    /// The position is at an end of its range, so the shaft is there or beyond.
    pub is_at_end: bool,
    /// The temperature in °C.
    pub temperature_c: f32,
}

impl Feedback {
    /// Reads a frame of feedback; `None` for any other frame, and for an unknown state.
    #[must_use]
    pub fn decode(frame: &CanFrame, model: &Model) -> Option<Self> {
        is_feedback(frame).then(|| Self::of(frame, model))
    }

    /// Reads a frame that is known to be feedback.
    #[inline(always)]
    pub(super) const fn of(frame: &CanFrame, model: &Model) -> Self {
        let [_, state, id, _] = frame.header().to_be_bytes();
        let [a, b, c, d, e, f, g, h] = *frame.bytes();
        Self {
            status: match state >> 6 {
                0 => Status::Reset,
                1 => Status::Calibration,
                _ => Status::Run,
            },
            faults: state & 0x3F,
            id,
            measured: model.ranges().decode_wide(&[a, b, c, d, e, f]),
            is_at_end: matches!([a, b], [0, 0] | [0xFF, 0xFF]),
            temperature_c: i16::from_be_bytes([g, h]) as f32 / 10.0,
        }
    }

    /// Returns the angle of the output shaft; `None` at an end of the range.
    #[must_use]
    pub const fn angle(&self) -> Option<Angle> {
        if self.is_at_end { None } else { Some(Angle::from_radians(self.measured.position_rad)) }
    }

    /// Returns the number of the lowest fault, 16 to 21 as the manual counts the bits of the id; 0 without a fault.
    #[must_use]
    pub const fn fault_code(&self) -> u8 {
        code_from(16, self.faults as u32)
    }
}

/// The state of a drive.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub enum Status {
    /// 0: the drive gives no torque.
    Reset = 0,
    /// 1: the drive calibrates itself, and turns.
    Calibration = 1,
    /// 2: the drive follows commands.
    Run = 2,
}

/// Tells whether a frame is feedback, with a known state.
pub(super) fn is_feedback(frame: &CanFrame) -> bool {
    let [kind, state, ..] = raw_of(frame).unwrap_or(0).to_be_bytes();
    kind == FEEDBACK && state >> 6 <= Status::Run as u8 && frame.length() == 8
}

/// The types of frames from a drive: feedback, a parameter, and its faults as the manual counts their bits.
const FEEDBACK: u8 = 2;
pub(super) const VALUE: u8 = 17;
pub(super) const FAULTS: u8 = 21;

/// Reads a frame other than feedback: its type, whether the drive knows the parameter in question, and the data.
pub(super) fn answer(frame: &CanFrame) -> Option<(u8, bool, [u8; 8])> {
    let (raw, data) = (raw_of(frame)?, *frame.bytes());
    let [kind, status, ..] = raw.to_be_bytes();
    // Its firmware, on the question of another node.
    let is_version = kind == FEEDBACK && matches!(data, [0x00, 0xC4, 0x56, ..]);
    let is_answer = frame.length() == 8 && (is_version || matches!(kind, VALUE | FAULTS));
    is_answer.then_some((kind, status == 0, data))
}

/// Returns the register with an index.
pub(super) fn register(index: u16) -> Option<Register> {
    Register::ALL.iter().copied().find(|register| register.index() == index)
}
