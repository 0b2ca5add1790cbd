//! The other side of the robot's cables, simulated: referee system with its buffer, capacitor and its controller.
//!
//! The controller is that of `wire::supercap::hkust`. It draws 2 % more from the supply than it is told, follows a change with a lag of
//! 5 ms, and loses 5 % in each direction: the buffer has to bear what it does not regulate exactly.

use drivetrain::frame::CanFrame;
use drivetrain::sim::SerialLine;
use drivetrain::time::Instant;
use drivetrain::wire::EncodeError;
use drivetrain::wire::referee::encode;
use drivetrain::wire::supercap::hkust::STATE_ID;

pub(crate) const LIMIT_W: u16 = 60;
pub(crate) const BUFFER_J: f32 = 60.0;
pub(crate) const CAPACITOR_J: f32 = 2_000.0;

const EXCESS: f32 = 1.02;
const LAG_S: f32 = 0.005;
const EFFICIENCY: f32 = 0.95;
const MOST_CHARGE_W: f32 = 120.0;
const MOST_DISCHARGE_W: f32 = 180.0;

#[derive(Debug)]
pub(crate) struct Supply {
    /// Of the referee system, and of the capacitor.
    pub(crate) buffer_j: f32,
    pub(crate) capacitor_j: f32,
    /// What the chassis takes, and what the referee system sees of it.
    pub(crate) chassis_w: f32,
    pub(crate) supply_w: f32,
    /// From the capacitor to the chassis.
    discharge_w: f32,
    told: (bool, f32),
    serial: SerialLine,
    ms: u32,
}

impl Supply {
    pub(crate) fn new() -> Self {
        Self {
            buffer_j: BUFFER_J,
            capacitor_j: 0.42 * CAPACITOR_J,
            chassis_w: 0.0,
            supply_w: 0.0,
            discharge_w: 0.0,
            told: (false, 0.0),
            serial: SerialLine::new(115_200, 1),
            ms: 0,
        }
    }

    /// Takes the data of a command frame to the controller.
    pub(crate) fn tell(&mut self, data: [u8; 8]) {
        let [flags, low, high, ..] = data;
        self.told = (flags & 1 != 0, f32::from(u16::from_le_bytes([low, high])));
    }

    /// Goes on by 1 ms, in which the chassis takes so much. Returns a frame of the controller, each 10 ms.
    pub(crate) fn step(
        &mut self,
        chassis_w: f32,
        now: Instant,
    ) -> Result<Option<CanFrame>, EncodeError> {
        const DT_S: f32 = 1e-3;
        let (is_on, limit_w) = self.told;
        let wanted = if is_on { chassis_w - EXCESS * limit_w } else { 0.0 };
        let most = if self.capacitor_j > 0.0 { MOST_DISCHARGE_W } else { 0.0 };
        let least = if self.capacitor_j < CAPACITOR_J { -MOST_CHARGE_W } else { 0.0 };
        self.discharge_w += (wanted - self.discharge_w) * DT_S / (LAG_S + DT_S);
        self.discharge_w = self.discharge_w.clamp(least, most);
        let loss = if self.discharge_w > 0.0 { 1.0 / EFFICIENCY } else { EFFICIENCY };
        self.capacitor_j =
            (self.capacitor_j - self.discharge_w * loss * DT_S).clamp(0.0, CAPACITOR_J);
        (self.chassis_w, self.supply_w) = (chassis_w, chassis_w - self.discharge_w);
        self.buffer_j =
            (self.buffer_j + (f32::from(LIMIT_W) - self.supply_w) * DT_S).clamp(0.0, BUFFER_J);
        self.ms += 1;
        if self.ms.is_multiple_of(100) {
            self.report(now)?;
        }
        Ok(if self.ms.is_multiple_of(10) { self.state() } else { None })
    }

    /// State and buffer, as the referee system sends them ten times a second.
    fn report(&mut self, now: Instant) -> Result<(), EncodeError> {
        let [low, high] = LIMIT_W.to_le_bytes();
        let state = [3, 1, 200, 0, 200, 0, 40, 0, 100, 0, low, high, 0b111];
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 60 J")]
        let [low, high] = (self.buffer_j as u16).to_le_bytes();
        let power = [0, 0, 0, 0, 0, 0, 0, 0, low, high, 0, 0, 0, 0];
        for (command, data) in [(0x0201, &state[..]), (0x0202, &power)] {
            let mut frame = [0; 32];
            self.serial.send(encode(command, 0, data, &mut frame)?, now);
        }
        Ok(())
    }

    fn state(&self) -> Option<CanFrame> {
        let [a, b, c, d] = self.chassis_w.to_le_bytes();
        let [low, high] = 200_u16.to_le_bytes();
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 255")]
        let share = (255.0 * self.capacitor_j / CAPACITOR_J) as u8;
        let off = if self.told.0 { 0 } else { 0x80 };
        CanFrame::standard(STATE_ID, [off, a, b, c, d, low, high, share])
    }

    /// What came over the serial line of the referee system by now.
    pub(crate) fn receive<'a>(&mut self, now: Instant, buffer: &'a mut [u8]) -> &'a [u8] {
        self.serial.receive(now, buffer)
    }
}
