//! The codec of frames to a drive and from a drive.

use crate::frame::{CanFrame, standard_id};
use crate::motor::{Form, Inquiry, lowest_bit};
use embedded_can::{Frame, Id};

/// The number of the heartbeat.
pub(super) const HEARTBEAT: u8 = 0x01;
/// The number of the drive's errors, in 0.6.
pub(super) const ERRORS: u8 = 0x03;
/// The number of a question about an endpoint, in 0.6.
pub(super) const ASK_ENDPOINT: u8 = 0x04;
/// The number of the answer about an endpoint, in 0.6.
pub(super) const ENDPOINT: u8 = 0x05;
/// The number of the encoder estimates.
pub(super) const ESTIMATES: u8 = 0x09;

/// Number and form of an endpoint, a setting of the drive, and its place among the [names](super::Endpoints::NAMES).
pub(super) type Endpoint = (u16, Form, u8);

/// A command to a drive, in units of the motor's shaft: turns, turns/s, Nm, A.
///
/// ```text
///        byte 0 .. 3                 4 .. 7             low byte first
/// 0x02   -                                              stop, with an error
/// 0x07   axis state u32
/// 0x0B   control mode u32          | input mode u32
/// 0x0C   position f32              | velocity i16, torque i16, both in 1/1000
/// 0x0D   velocity f32              | torque f32
/// 0x0E   torque f32
/// 0x0F   velocity limit f32        | current limit f32
/// 0x11   velocity of trajectories f32
/// 0x12   their acceleration f32    | deceleration f32
/// 0x18   0                                              clear errors, without blinking
/// ```
///
/// # Examples
/// ```
/// use drivetrain::odrive::Command;
///
/// let frame = Command::Position(1.5, 0.5, -0.1).frame(1);
/// assert_eq!(format!("{frame:?}"), "02C [8] 00 00 C0 3F F4 01 9C FF");
/// assert_eq!(format!("{:?}", Command::AxisState(8).frame(1)), "027 [4] 08 00 00 00");
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Command {
    /// Disarms the drive. The drive then has the error "stop requested".
    Stop,
    /// Requests a state of the axis: 1 idle, 8 closed loop.
    AxisState(u32),
    /// Sets control mode (1 torque, 2 velocity, 3 position) and input mode (1 passthrough, 3 filter, 5 trajectory).
    ControllerMode(u32, u32),
    /// Sets a position, a velocity beside it and a torque beside both.
    Position(f32, f32, f32),
    /// Sets a velocity and a torque beside it.
    Velocity(f32, f32),
    /// Sets a torque.
    Torque(f32),
    /// Limits velocity and current.
    Limits(f32, f32),
    /// Sets the velocity of trajectories.
    TrajectoryVelocity(f32),
    /// Sets acceleration and deceleration of trajectories, in turns/s².
    TrajectoryAcceleration(f32, f32),
    /// Clears the errors of the drive: in 0.5 those of both axes.
    ClearErrors,
}

impl Command {
    pub(super) const IDLE: Self = Self::AxisState(super::Heartbeat::IDLE as u32);

    /// Writes the frame for a node, 0 to 63; the upper bits of a larger number are left out.
    #[must_use]
    pub fn frame(self, node: u8) -> CanFrame {
        let (number, first, second) = match self {
            Self::Stop => return CanFrame::of(id(node, 0x02), []),
            Self::ClearErrors => return CanFrame::of(id(node, 0x18), [0]),
            Self::AxisState(state) => (0x07, state, None),
            Self::ControllerMode(control, input) => (0x0B, control, Some(input)),
            Self::Position(position, velocity, torque) => {
                let beside = thousandths(velocity) | thousandths(torque) << 16;
                (0x0C, position.to_bits(), Some(beside))
            }
            Self::Velocity(velocity, torque) => (0x0D, velocity.to_bits(), Some(torque.to_bits())),
            Self::Torque(torque) => (0x0E, torque.to_bits(), None),
            Self::Limits(velocity, current) => (0x0F, velocity.to_bits(), Some(current.to_bits())),
            Self::TrajectoryVelocity(limit) => (0x11, limit.to_bits(), None),
            Self::TrajectoryAcceleration(up, down) => (0x12, up.to_bits(), Some(down.to_bits())),
        };
        let ([a, b, c, d], id) = (first.to_le_bytes(), id(node, number));
        match second.map(u32::to_le_bytes) {
            Some([e, f, g, h]) => CanFrame::of(id, [a, b, c, d, e, f, g, h]),
            None => CanFrame::of(id, [a, b, c, d]),
        }
    }
}

/// Returns an `i16` in 1/1000 as the lower half of a word. Rounds to nearest and saturates; NaN is zero.
#[expect(clippy::cast_possible_truncation, reason = "saturates")]
fn thousandths(value: f32) -> u32 {
    let scaled = value * 1_000.0;
    u32::from(((scaled + 0.5_f32.copysign(scaled)) as i16).cast_unsigned())
}

/// Asks for a message: a remote frame with its id and length.
pub(super) fn request(node: u8, number: u8) -> CanFrame {
    let id = id(node, number);
    CanFrame::new_remote(id, 8).unwrap_or_else(|| CanFrame::of(id, []))
}

/// Returns the frame of a question about an endpoint: the value is read, or written in 1 or 4 bytes.
///
/// ```text
/// byte 0            1 .. 2       3   4 ..
/// 0 read, 1 write   endpoint     0   value, low byte first
/// ```
pub(super) fn endpoint(node: u8, asked: Inquiry<Endpoint>) -> Option<CanFrame> {
    let (number, form, _) = asked.setting()?;
    let ([low, high], id) = (number.to_le_bytes(), id(node, ASK_ENDPOINT));
    let value =
        if let Inquiry::Write(_, value) = asked { Some(form.bytes_of(value)) } else { None };
    Some(match (value, form) {
        (None, _) => CanFrame::of(id, [0, low, high, 0]),
        (Some([a, b, c, d]), Form::F32) => CanFrame::of(id, [1, low, high, 0, a, b, c, d]),
        (Some([a, ..]), _) => CanFrame::of(id, [1, low, high, 0, a]),
    })
}

/// Returns the id of a message: `node * 32 + number`.
pub(super) fn id(node: u8, number: u8) -> Id {
    standard_id(u16::from(node & 0x3F) << 5 | u16::from(number & 0x1F))
}

/// Returns the number of a message.
pub(super) fn number_of(frame: &CanFrame) -> u8 {
    (frame.header() & 0x1F) as u8
}

/// Numbers of the commands, claimed in each mode of the motor: firmware 0.5 takes a torque from each target, also in torque mode, and
/// feeds its watchdog by each frame. The last is a command of motors with endpoints only.
pub(super) const COMMANDS: [u8; 11] =
    [0x02, 0x07, 0x0B, 0x0C, 0x0D, 0x0E, 0x0F, 0x11, 0x12, 0x18, ASK_ENDPOINT];

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
