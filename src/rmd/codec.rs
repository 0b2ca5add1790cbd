//! The codec of frames to a drive and from a drive.

use super::Model;
use super::model::AMPERES_PER_COUNT;
use crate::lk;
use crate::lk::codec::data_of;

/// A command to a drive, in the units of the wire: currents in 0.01 A, angles and velocities of the output shaft.
///
/// # Examples
/// ```
/// use drivetrain::rmd::Command;
///
/// // The examples of the manual V4.2: -1 A; to -360° with at most 500°/s; a time-out of 1 s.
/// assert_eq!(Command::Torque(-100).encode(), [0xA1, 0, 0, 0, 0x9C, 0xFF, 0, 0]);
/// assert_eq!(Command::Position(-36_000, 500).encode(), [0xA4, 0, 0xF4, 0x01, 0x60, 0x73, 0xFF, 0xFF]);
/// assert_eq!(Command::SetTimeout(1_000).encode(), [0xB3, 0, 0, 0, 0xE8, 0x03, 0, 0]);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Command {
    /// Switches the output off and leaves each control mode.
    Off,
    /// Stops the shaft. The drive then holds the shaft: no rest.
    Stop,
    /// Releases the holding brake.
    ReleaseBrake,
    /// Applies the holding brake.
    LockBrake,
    /// Starts the program of the drive anew, which takes more than a second. The drive does not answer.
    Reset,
    /// A torque current in 0.01 A. A torque does not release the holding brake.
    Torque(i16),
    /// A velocity in 0.01°/s.
    Velocity(i32),
    /// To an angle in 0.01° from the zero of the drive, turns count, with at most so many °/s; 0 for no limit.
    Position(i32, u16),
    /// Asks for [`Feedback`](super::Feedback).
    ReadFeedback,
    /// Asks for the angle of the output shaft: [`Feedback::decode_angle`](super::Feedback::decode_angle).
    ReadAngle,
    /// Asks for the [`State`](super::State).
    ReadState,
    /// Sets the time without a frame in ms after which the drive switches itself off and locks its brake; 0 for never. The drive
    /// keeps the time in its flash memory, and flash memory wears.
    SetTimeout(u32),
}

impl Command {
    /// A current without torque: the command of a motor at rest.
    pub const REST: Self = Self::Torque(0);

    /// Writes the data of a frame.
    #[must_use]
    pub const fn encode(self) -> [u8; 8] {
        let (code, limit, value) = match self {
            Self::Off => (0x80, 0, 0),
            Self::Stop => (0x81, 0, 0),
            Self::ReleaseBrake => (0x77, 0, 0),
            Self::LockBrake => (0x78, 0, 0),
            Self::Reset => (0x76, 0, 0),
            Self::Torque(current) => (0xA1, 0, current.cast_unsigned() as i32),
            Self::Velocity(velocity) => (0xA2, 0, velocity),
            Self::Position(angle, limit) => (0xA4, limit, angle),
            Self::ReadFeedback => (0x9C, 0, 0),
            Self::ReadAngle => (0x92, 0, 0),
            Self::ReadState => (0x9A, 0, 0),
            Self::SetTimeout(ms) => (0xB3, 0, ms.cast_signed()),
        };
        data_of(code, limit, value)
    }
}

/// Feedback of the output shaft: the answer to a control command and to [`ReadFeedback`](super::Command::ReadFeedback).
///
/// ```text
/// byte 0               1                2 .. 3              4 .. 5             6 .. 7
/// 0x9C, 0xA1, 2, 4, 8 | temperature i8 | current 0.01 A i16 | velocity °/s i16 | angle ° i16
/// ```
///
/// # Examples
/// ```
/// use drivetrain::rmd::Feedback;
///
/// // An example of the manual V4.2.
/// let feedback = Feedback::decode(&[0xA1, 0x32, 0x9C, 0xFF, 0x0C, 0xFE, 0xD3, 0xFF]).ok_or("no feedback")?;
/// assert_eq!((feedback.temperature_c, feedback.current), (50, -100));
/// assert_eq!((feedback.velocity_dps, feedback.angle_deg), (-500, -45));
/// # Ok::<(), &str>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Feedback {
    /// The temperature of the motor in °C.
    pub temperature_c: i8,
    /// The torque current in 0.01 A.
    pub current: i16,
    /// The velocity in °/s.
    pub velocity_dps: i16,
    /// The angle in °, turns count.
    pub angle_deg: i16,
}

impl Feedback {
    /// Reads a feedback frame; `None` for any other frame.
    #[must_use]
    pub const fn decode(data: &[u8; 8]) -> Option<Self> {
        let [0x9C | 0xA1 | 0xA2 | 0xA4 | 0xA8, ..] = *data else { return None };
        let Some(lk::Feedback { temperature_c, current, velocity_dps, encoder }) =
            lk::Feedback::decode(data)
        else {
            return None;
        };
        Some(Self { temperature_c, current, velocity_dps, angle_deg: encoder.cast_signed() })
    }

    /// Reads the answer to [`ReadAngle`](super::Command::ReadAngle): the angle of the output shaft over its turns in 0.01°. `None`
    /// for any other frame.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::rmd::Feedback;
    ///
    /// assert_eq!(Feedback::decode_angle(&[0x92, 0, 0, 0, 0xA0, 0x8C, 0, 0]), Some(36_000)); // manual V4.2
    /// ```
    #[must_use]
    pub const fn decode_angle(data: &[u8; 8]) -> Option<i32> {
        let [0x92, _, _, _, a, b, c, d] = *data else { return None };
        Some(i32::from_le_bytes([a, b, c, d]))
    }

    /// Returns the torque of the output shaft in Nm.
    #[must_use]
    pub const fn torque_nm(&self, model: &Model) -> f32 {
        self.current as f32 * AMPERES_PER_COUNT * model.torque_constant()
    }
}

/// The state of a drive: the answer to [`ReadState`](super::Command::ReadState).
///
/// ```text
/// byte 0   1                2   3              4 .. 5         6 .. 7
/// 0x9A   | temperature i8 | – | brake, 1 open | 0.1 V u16   | errors u16
/// ```
///
/// | bit of the errors | | goes away |
/// |--:|---|---|
/// | 0x0002 | stalled | by a reset |
/// | 0x0004 | supply too low | by itself |
/// | 0x0008 | supply too high | by itself |
/// | 0x0010 | current too high | by a reset |
/// | 0x0040 | power too high | by itself |
/// | 0x0080 | calibration not written | by a reset |
/// | 0x0100 | too fast | by itself |
/// | 0x0800 | driver too hot (V4.4) | by itself |
/// | 0x1000 | motor too hot | by itself |
/// | 0x2000 | encoder not calibrated | by itself; by a reset with V4.4 |
/// | 0x4000 | encoder (V4.4) | by a reset |
///
/// # Examples
/// ```
/// use drivetrain::rmd::State;
///
/// // The example of the manual V4.2.
/// let state = State::decode(&[0x9A, 0x32, 0, 1, 0xE5, 1, 4, 0]).ok_or("no state")?;
/// assert_eq!((state.temperature_c, state.is_brake_open, state.errors), (50, true, 4));
/// assert!((state.supply_v - 48.5).abs() < 1e-3);
/// # Ok::<(), &str>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct State {
    /// The temperature of the motor in °C.
    pub temperature_c: i8,
    /// The holding brake was told to be open. Newer drives report here whether they run.
    pub is_brake_open: bool,
    /// The voltage of the supply in V.
    pub supply_v: f32,
    /// The errors, a bit each; 0 without an error.
    pub errors: u16,
}

impl State {
    /// Reads a state frame; `None` for any other frame. A frame of zeros is a question sent back.
    #[must_use]
    pub const fn decode(data: &[u8; 8]) -> Option<Self> {
        let [0x9A, temperature, spare, brake, a, b, c, d] = *data else { return None };
        if let [0, 0, 0, 0, 0, 0, 0] = [temperature, spare, brake, a, b, c, d] {
            return None;
        }
        let supply = u16::from_le_bytes([a, b]);
        Some(Self {
            temperature_c: temperature.cast_signed(),
            is_brake_open: brake != 0,
            supply_v: supply as f32 / 10.0,
            errors: u16::from_le_bytes([c, d]),
        })
    }
}
