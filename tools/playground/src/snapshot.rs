//! The numbers and frames of one picture.

use crate::robot::Robot;
use drivetrain::dji::Feedback;
use drivetrain::frame::CanFrame;
use drivetrain::geometry::Pose2;
use drivetrain::sim::{Line, Sender, Simulation, Transmission};
use embedded_can::{Frame, Id};
use std::collections::VecDeque;
use std::fmt::Write;

/// So many frames are kept for the page.
const FRAMES: usize = 24;

/// Returns time in s, x, y in m, heading in rad, armed, switch, share of the bus that is busy, and for each wheel its target and its
/// measured speed in rad/s and its current in A; NaN where nothing fresh is known.
pub(crate) fn numbers(world: &Simulation, robot: &dyn Robot, is_switch_on: bool) -> Vec<f32> {
    #[expect(clippy::cast_possible_truncation, reason = "for a picture")]
    let narrow = |value: f64| value as f32;
    let flag = |is: bool| f32::from(u8::from(is));
    let chassis = world.chassis();
    let pose = chassis.map_or(Pose2::ORIGIN, |(pose, _)| pose);
    let mut numbers = vec![
        narrow(world.now().as_micros() as f64 * 1e-6),
        pose.x_m,
        pose.y_m,
        pose.angle.as_radians(),
        flag(robot.is_armed()),
        flag(is_switch_on),
        world.traffic(Line::Can1).load(),
    ];
    for wheel in robot.wheels() {
        let known = |value: Option<f32>| value.unwrap_or(f32::NAN);
        numbers.extend([wheel.target, known(wheel.measured), known(wheel.current_a)]);
    }
    numbers
}

/// The frames that passed: a hash of all, and the last of them.
pub(crate) struct Frames {
    hash: u64,
    last: VecDeque<Transmission>,
}

impl Frames {
    pub(crate) const fn new() -> Self {
        Self { hash: 0xCBF2_9CE4_8422_2325, last: VecDeque::new() }
    }

    pub(crate) const fn hash(&self) -> u64 {
        self.hash
    }

    pub(crate) fn take(&mut self, passed: &Transmission) {
        let frame = &passed.frame;
        let id = match frame.id() {
            Id::Standard(id) => id.as_raw().into(),
            Id::Extended(id) => id.as_raw() | 1 << 31,
        };
        let header = [passed.at.as_micros(), u64::from(id), frame.dlc() as u64];
        let bytes = header.iter().flat_map(|word| word.to_le_bytes());
        for byte in bytes.chain(frame.data().iter().copied()) {
            self.hash = (self.hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01B3);
        }
        if self.last.len() == FRAMES {
            self.last.pop_front();
        }
        self.last.push_back(*passed);
    }

    pub(crate) fn text(&self) -> String {
        let mut text = String::new();
        for passed in &self.last {
            let lost = if passed.delivered { "" } else { "  (lost)" };
            let micros = passed.at.as_micros();
            let (s, us) = (micros / 1_000_000, micros % 1_000_000);
            _ = writeln!(text, "{s}.{us:06}  {:?}  {}{lost}", passed.frame, meaning(passed));
        }
        text
    }
}

/// Says what a frame means: a command for each motor in A, or a motor's speed, current and temperature.
fn meaning(passed: &Transmission) -> String {
    let frame = &passed.frame;
    match (id(frame), passed.sender, <[u8; 8]>::try_from(frame.data())) {
        (Some(0x200), sender, Ok(data)) => {
            let words = data.chunks_exact(2).filter_map(|pair| <[u8; 2]>::try_from(pair).ok());
            let amperes = words.map(|word| f32::from(i16::from_be_bytes(word)) * 20.0 / 16_384.0);
            let list: Vec<String> = amperes.map(|amperes| format!("{amperes:.2}")).collect();
            let whose = if sender == Sender::Foreign { "SECOND MASTER " } else { "" };
            format!("{whose}command {} A", list.join(", "))
        }
        (Some(id @ 0x201..=0x208), _, Ok(data)) => match Feedback::decode(&data) {
            Some(feedback) => {
                let error = match feedback.error() {
                    0 => String::new(),
                    code => format!(", error {code}"),
                };
                format!(
                    "motor {}: {} rpm, {:.2} A, {} °C{error}",
                    id - 0x200,
                    feedback.rpm(),
                    f32::from(feedback.current()) * 20.0 / 16_384.0,
                    feedback.temperature(),
                )
            }
            None => "not valid".into(),
        },
        _ => String::new(),
    }
}

fn id(frame: &CanFrame) -> Option<u16> {
    match frame.id() {
        Id::Standard(id) => Some(id.as_raw()),
        Id::Extended(_) => None,
    }
}
