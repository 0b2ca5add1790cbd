//! The codec of frames from a drive.

use super::command::{ENDPOINT, ERRORS, ESTIMATES, HEARTBEAT};
use super::config::Endpoint;
use crate::motor::{Inquiry, lowest_bit};

/// The generation of the firmware, which decides the layout of a heartbeat.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Firmware {
    /// 0.5.1 to 0.5.6: ODrive v3.
    V0_5,
    /// 0.6: ODrive Pro, S1 and Micro.
    V0_6,
}

impl Firmware {
    /// Returns the numbers of the messages to the motor: estimates and heartbeat, for 0.6 also errors and endpoints; and the axis error
    /// of a stop that was requested over CAN.
    pub(super) const fn facts(self) -> (&'static [u8], u32) {
        match self {
            Self::V0_5 => (&[ESTIMATES, HEARTBEAT], 0x4000),
            Self::V0_6 => (&[ESTIMATES, HEARTBEAT, ERRORS, ENDPOINT], 0x0200_0000),
        }
    }
}

/// The encoder estimates of a drive: turns of the motor's shaft since power-on, and turns/s.
///
/// Firmware 0.5 reports zeros for a failed encoder; the heartbeat reports the failure within 100 ms.
///
/// # Examples
/// ```
/// use drivetrain::odrive::Feedback;
///
/// let data = [0x00, 0x00, 0x44, 0x41, 0x00, 0x00, 0x60, 0xC0];
/// let feedback = Feedback::decode(&data).ok_or("not finite")?;
/// assert_eq!((feedback.turns, feedback.turns_per_s), (12.25, -3.5));
/// # Ok::<(), &str>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Feedback {
    /// The position.
    pub turns: f32,
    /// The velocity.
    pub turns_per_s: f32,
}

impl Feedback {
    /// Reads the encoder estimates, message 0x09; `None` if a value is not finite.
    #[must_use]
    pub const fn decode(data: &[u8; 8]) -> Option<Self> {
        let (turns, turns_per_s) = words(data);
        let (turns, turns_per_s) = (f32::from_bits(turns), f32::from_bits(turns_per_s));
        let is_finite = turns.is_finite() && turns_per_s.is_finite();
        if is_finite { Some(Self { turns, turns_per_s }) } else { None }
    }
}

/// The state of an axis.
///
/// ```text
///       byte 0 .. 3        4        5                   6                7
/// 0.5   axis error u32   | state  | bit 0 motor error | bit 0 encoder  | bit 0 controller error, bit 7 done
/// 0.6   axis error u32   | state  | procedure result  | bit 0 done     | reserved
/// ```
///
/// # Examples
/// ```
/// use drivetrain::odrive::{Firmware, Heartbeat};
///
/// let data = [0, 0, 0, 0, 8, 0, 1, 0];
/// let pro = Heartbeat::decode(&data, Firmware::V0_6).ok_or("no heartbeat")?;
/// assert!(pro.state == Heartbeat::CLOSED_LOOP && pro.is_done && pro.error_code() == 0);
/// let v3 = Heartbeat::decode(&data, Firmware::V0_5).ok_or("no heartbeat")?;
/// assert_eq!((v3.is_done, v3.error_code()), (false, 34)); // the encoder has an error
/// # Ok::<(), &str>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Heartbeat {
    /// The errors of the axis, a bit each: other ones in 0.5 than in 0.6.
    pub axis_error: u32,
    /// The state: [`IDLE`](Self::IDLE), [`CLOSED_LOOP`](Self::CLOSED_LOOP), or the state of a calibration.
    pub state: u8,
    /// 0.5: whether motor, encoder and controller have errors.
    pub has_errors: [bool; 3],
    /// 0.6: how the last request for a state ended: 0 success, 1 busy, 14 not calibrated; 0 in 0.5.
    pub procedure_result: u8,
    /// The trajectory is done.
    pub is_done: bool,
}

impl Heartbeat {
    /// The axis gives no torque.
    pub const IDLE: u8 = 1;
    /// The axis follows commands.
    pub const CLOSED_LOOP: u8 = 8;

    /// Reads the heartbeat, message 0x01; `None` for a bit never set by the firmware.
    #[must_use]
    pub const fn decode(data: &[u8; 8], firmware: Firmware) -> Option<Self> {
        let [a, b, c, d, state, x, y, z] = *data;
        let (has_errors, procedure_result, is_done) = match firmware {
            Firmware::V0_5 if x > 1 || y > 1 || z & 0x7E != 0 => return None,
            Firmware::V0_5 => ([x == 1, y == 1, z & 1 == 1], 0, z & 0x80 != 0),
            Firmware::V0_6 => ([false; 3], x, y & 1 == 1),
        };
        let axis_error = u32::from_le_bytes([a, b, c, d]);
        Some(Self { axis_error, state, has_errors, procedure_result, is_done })
    }

    /// Returns the number of an error, 0 without an error: 1 to 32 for the lowest bit of the axis error, 33 to 35 for an error of
    /// motor, encoder or controller alone.
    #[must_use]
    pub const fn error_code(&self) -> u8 {
        match (self.axis_error, self.has_errors) {
            (0, [true, ..]) => 33,
            (0, [_, true, _]) => 34,
            (0, [.., true]) => 35,
            (error, _) => lowest_bit(error),
        }
    }
}

/// Reads two words, low byte first.
pub(super) const fn words(data: &[u8; 8]) -> (u32, u32) {
    let [a, b, c, d, e, f, g, h] = *data;
    (u32::from_le_bytes([a, b, c, d]), u32::from_le_bytes([e, f, g, h]))
}

/// Reads the value of an endpoint from the answer to a question, of 5 to 8 bytes; `None` for another endpoint.
///
/// ```text
/// byte 0   1 .. 2     3   4 ..
/// 0        endpoint   0   value, low byte first
/// ```
pub(super) fn endpoint_value(data: &[u8; 8], length: u8, asked: Inquiry<Endpoint>) -> Option<f32> {
    let [_, low, high, _, value @ ..] = *data;
    let Inquiry::Read((number, form, _)) = asked else { return None };
    (length > 4 && u16::from_le_bytes([low, high]) == number).then(|| form.value_of(value))
}
