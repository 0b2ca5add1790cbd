//! The codec of frames from a drive.

use super::command::FAULT_CODE;

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
