//! The codec of frames to a drive and from a drive.

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

/// The last values reported by a drive, in its own direction and at the rotor. Each is `None` before the first such frame.
///
/// # Examples
/// ```
/// use drivetrain::vesc::Feedback;
///
/// let mut feedback = Feedback::default();
/// assert!(feedback.take(9, &[0x00, 0x00, 0x2E, 0xE0, 0x00, 0x37, 0x00, 0xFA])); // status 1
/// assert_eq!((feedback.erpm, feedback.current_a, feedback.duty), (Some(12_000), Some(5.5), Some(0.25)));
/// assert_eq!(feedback.tachometer, None); // status 5 has not come
/// ```
#[derive(Debug, Default, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Feedback {
    /// The speed in electrical rpm (status 1).
    pub erpm: Option<i32>,
    /// The torque current in A (status 1).
    pub current_a: Option<f32>,
    /// The share of the supply voltage, -1 to 1 (status 1).
    pub duty: Option<f32>,
    /// The used charge and the charge fed back, in Ah (status 2).
    pub charge_ah: Option<[f32; 2]>,
    /// The used energy and the energy fed back, in Wh (status 3).
    pub energy_wh: Option<[f32; 2]>,
    /// The temperature of the driver's transistors in °C (status 4).
    pub driver_c: Option<f32>,
    /// The temperature of the motor in °C (status 4). A drive without a sensor also reports some number.
    pub motor_c: Option<f32>,
    /// The current from the supply in A (status 4).
    pub input_a: Option<f32>,
    /// The position of the drive's position loop in degrees, 0 to 360 (status 4): of an encoder, else of the electrical angle.
    pub position_deg: Option<f32>,
    /// Sixths of electrical turns since the drive has started (status 5). The count wraps as an `i32`.
    pub tachometer: Option<i32>,
    /// The supply in V (status 5).
    pub supply_v: Option<f32>,
    /// Three inputs in V, and the servo input, -1 to 1 (status 6).
    pub inputs: Option<[f32; 4]>,
    /// The fault code, 0 without a fault: the answer to a question. `mc_fault_code` in `datatypes.h` of the firmware has the numbers.
    pub fault: Option<u8>,
}

impl Feedback {
    /// Takes a status frame: bits 8 to 15 of its id, and its data. Returns `false`, and takes nothing, if the packet is no status or
    /// has another length than 8; status 5 of older firmware has 6.
    #[inline]
    pub fn take(&mut self, packet: u8, data: &[u8]) -> bool {
        match (packet, data) {
            (9, &[a, b, c, d, e, f, g, h]) => {
                self.erpm = Some(i32::from_be_bytes([a, b, c, d]));
                self.current_a = Some(short([e, f]) / 10.0);
                self.duty = Some(short([g, h]) / 1_000.0);
            }
            (14, &[a, b, c, d, e, f, g, h]) => {
                self.charge_ah = Some([[a, b, c, d], [e, f, g, h]].map(long));
            }
            (15, &[a, b, c, d, e, f, g, h]) => {
                self.energy_wh = Some([[a, b, c, d], [e, f, g, h]].map(long));
            }
            (16, &[a, b, c, d, e, f, g, h]) => {
                self.driver_c = Some(short([a, b]) / 10.0);
                self.motor_c = Some(short([c, d]) / 10.0);
                self.input_a = Some(short([e, f]) / 10.0);
                self.position_deg = Some(short([g, h]) / 50.0);
            }
            (27, &[a, b, c, d, e, f] | &[a, b, c, d, e, f, _, _]) => {
                self.tachometer = Some(i32::from_be_bytes([a, b, c, d]));
                self.supply_v = Some(short([e, f]) / 10.0);
            }
            (58, &[a, b, c, d, e, f, g, h]) => {
                let inputs = [[a, b], [c, d], [e, f], [g, h]];
                self.inputs = Some(inputs.map(|input| short(input) / 1_000.0));
            }
            _ => return false,
        }
        true
    }
}

/// Reads the fault code in an answer of a drive; `None` for any other frame.
pub(super) fn fault(data: &[u8], id: u8) -> Option<u8> {
    let &[from, 1, a, b, c, d, e, fault] = data else { return None };
    (from == id && [a, b, c, d, e] == FAULT_CODE).then_some(fault)
}

fn short(bytes: [u8; 2]) -> f32 {
    i16::from_be_bytes(bytes).into()
}

fn long(bytes: [u8; 4]) -> f32 {
    i32::from_be_bytes(bytes) as f32 / 10_000.0
}
