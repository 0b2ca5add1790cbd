//! The codec of commands to a drive.

use super::config::Endpoint;
use crate::frame::{CanFrame, standard_id};
use crate::motor::{Form, Inquiry};
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
