//! The codec of frames to a drive and from a drive.

use super::Model;
use super::model::RAD_PER_DEGREE;
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
#[inline]
pub(crate) fn is_command(data: &[u8; 8], limit: impl FnOnce() -> u16) -> bool {
    data[1] == 0 && has_fields_of_command(data, limit)
}

#[cold]
#[inline(never)]
fn has_fields_of_command(data: &[u8; 8], limit: impl FnOnce() -> u16) -> bool {
    let [code, _, a, b, c, d, e, f] = *data;
    match code {
        0xA1 => matches!([a, b, e, f], [0, 0, 0, 0]),
        0xA2 | 0xA4 => u16::from_le_bytes([a, b]) <= limit(),
        _ => matches!([a, b, c, d, e, f], [0, 0, 0, 0, 0, 0]),
    }
}

/// Returns the id of the frames of a drive.
pub(crate) fn id_of(ids: u16, id: u8) -> Id {
    standard_id(ids + u16::from(id))
}

/// Feedback of the rotor: the answer to a control command and to [`ReadFeedback`](super::Command::ReadFeedback).
///
/// ```text
/// byte 0             1                2 .. 3       4 .. 5         6 .. 7
/// 0x9C, 0xA1 .. A8 | temperature i8 | current i16 | velocity i16 | encoder u16
/// ```
///
/// # Examples
/// ```
/// use drivetrain::lk::Feedback;
///
/// let feedback = Feedback::decode(&[0x9C, 0x32, 0x64, 0x00, 0x0C, 0xFE, 0x00, 0xC0]).ok_or("no feedback")?;
/// assert_eq!((feedback.temperature_c, feedback.current, feedback.velocity_dps), (50, 100, -500));
/// assert_eq!(feedback.encoder, 0xC000); // 270° with 16 bits
/// assert_eq!(Feedback::decode(&[0x88, 0, 0, 0, 0, 0, 0, 0]), None); // the echo of "run"
/// # Ok::<(), &str>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Feedback {
    /// The temperature of the motor in °C.
    pub temperature_c: i8,
    /// The torque current in counts of the [series](super::Series::amperes_per_count).
    pub current: i16,
    /// The velocity of the rotor in °/s.
    pub velocity_dps: i16,
    /// The angle of the rotor in counts of the encoder.
    pub encoder: u16,
}

impl Feedback {
    /// Reads a feedback frame; `None` for any other frame.
    #[must_use]
    pub const fn decode(data: &[u8; 8]) -> Option<Self> {
        let [0x9C | 0xA1..=0xA8, temperature, a, b, c, d, e, f] = *data else { return None };
        Some(Self {
            temperature_c: temperature.cast_signed(),
            current: i16::from_le_bytes([a, b]),
            velocity_dps: i16::from_le_bytes([c, d]),
            encoder: u16::from_le_bytes([e, f]),
        })
    }

    /// Reads the answer to [`ReadAngle`](super::Command::ReadAngle): the angle of the rotor over its turns in 0.01°. `None` for any
    /// other frame.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::lk::Feedback;
    ///
    /// let one_turn_back = [0x92, 0x60, 0x73, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF];
    /// assert_eq!(Feedback::decode_angle(&one_turn_back), Some(-36_000));
    /// ```
    #[must_use]
    pub const fn decode_angle(data: &[u8; 8]) -> Option<i64> {
        let [0x92, a, b, c, d, e, f, g] = *data else { return None };
        Some(i64::from_le_bytes([0, a, b, c, d, e, f, g]) >> 8)
    }

    /// Returns the torque of the output shaft in Nm.
    #[must_use]
    pub const fn torque_nm(&self, model: &Model) -> f32 {
        self.current as f32 * model.torque_per_count()
    }

    /// Returns the velocity of the output shaft in rad/s.
    #[must_use]
    pub const fn velocity_rad_per_s(&self, model: &Model) -> f32 {
        self.velocity_dps as f32 * RAD_PER_DEGREE / model.gear()
    }

    /// Returns the angle of the rotor in 1/65536 of a turn; `None` if the encoder of the model does not have this value.
    pub(super) const fn phase(&self, model: &Model) -> Option<u16> {
        let bits = model.encoder_bits() as u32;
        if self.encoder as u32 >> bits == 0 { Some(self.encoder << (16 - bits)) } else { None }
    }
}

/// The state of a drive: the answer to [`ReadState`](super::Command::ReadState) and [`ClearErrors`](super::Command::ClearErrors).
///
/// ```text
/// byte 0         1                2 .. 3        4 .. 5        6                  7
/// 0x9A or 0x9B | temperature i8 | 0.01 V u16  | 0.01 A i16  | 0 on, 0x10 off   | errors
/// ```
///
/// | bit of the errors | |
/// |--:|---|
/// | 0 | supply too low |
/// | 1 | supply too high |
/// | 2 | driver too hot |
/// | 3 | motor too hot |
/// | 4 | current too high |
/// | 5 | short circuit |
/// | 6 | stalled |
/// | 7 | no input for longer than a time-out |
///
/// Drives with protocol V2.35 have bits 0 and 3 alone.
///
/// # Examples
/// ```
/// use drivetrain::lk::State;
///
/// let state = State::decode(&[0x9A, 0x23, 0x60, 0x09, 0x96, 0x00, 0x10, 0x09]).ok_or("no state")?;
/// assert_eq!((state.temperature_c, state.is_on, state.errors), (35, false, 0b1001));
/// assert!((state.supply_v - 24.0).abs() < 1e-3 && (state.supply_a - 1.5).abs() < 1e-3);
/// # Ok::<(), &str>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct State {
    /// The temperature of the motor in °C.
    pub temperature_c: i8,
    /// The voltage of the supply in V.
    pub supply_v: f32,
    /// The current of the supply in A; negative while the motor generates. The manual has no sign, so a current beyond 327 A
    /// reads negative.
    pub supply_a: f32,
    /// The drive follows commands, as after its supply came.
    pub is_on: bool,
    /// The errors, a bit each; 0 without an error.
    pub errors: u8,
}

impl State {
    /// Reads a state frame; `None` for any other frame. A frame without a voltage is a question read back.
    #[must_use]
    pub const fn decode(data: &[u8; 8]) -> Option<Self> {
        let [0x9A | 0x9B, temperature, a, b, c, d, state, errors] = *data else { return None };
        let supply = u16::from_le_bytes([a, b]);
        if supply == 0 {
            return None;
        }
        Some(Self {
            temperature_c: temperature.cast_signed(),
            supply_v: supply as f32 / 100.0,
            supply_a: i16::from_le_bytes([c, d]) as f32 / 100.0,
            is_on: state == 0,
            errors,
        })
    }
}
