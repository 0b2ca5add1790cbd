//! Joint motors: drives with a position loop of their own.

use super::Line;
use super::can::Mailboxes;
use super::esc::Random;
use super::motor::{MotorState, position, wrapped};
use crate::frame::CanFrame;
use crate::math::sqrt;
use crate::snake::{IDS, PULSES_PER_TURN, Register};
use crate::time::Duration;
use crate::units::{AngularVelocity, Current};
use embedded_can::{Frame, StandardId};

/// A joint to attach.
#[derive(Debug, Clone, Copy)]
pub(crate) struct JointConfig {
    pub(crate) id: u8,
    pub(crate) line: Line,
    /// Where its counter stands at the start, in pulses.
    pub(crate) position: Option<i32>,
    /// The least time until an answer.
    pub(crate) latency: Duration,
}

impl JointConfig {
    pub(crate) const fn new(line: Line, id: u8, position: Option<i32>) -> Self {
        Self { id, line, position, latency: Duration::from_micros(150) }
    }
}

/// The longest delay of a reply beyond the least. An estimate.
const JITTER_NS: u32 = 100_000;
/// The shaft follows the profile with this time constant. An estimate.
const LAG_S: f32 = 0.002;
/// Deceleration of a disabled shaft by friction, in pulses a second²: 20 turns a second². An estimate.
const FRICTION: f32 = 20.0 * PULSES_PER_TURN as f32;

/// The drive of a joint, and its shaft.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Drive {
    pub(crate) config: JointConfig,
    pub(crate) mailboxes: Mailboxes,
    random: Random,
    registers: Registers,
    powered: bool,
    /// In pulses; f64 keeps fractions over many turns.
    shaft: f64,
    velocity: f32,
    profile: f64,
    profile_velocity: f32,
    /// Where the shaft was when the counter started.
    zero: f64,
    /// The request, and the time of its answer.
    due: Option<(u64, Register)>,
    replies: u32,
    pub(crate) collisions: u32,
}

/// As written last; a drive starts with nothing.
#[derive(Debug, Default, Clone, Copy)]
struct Registers {
    current: i32,
    speed: i32,
    position: i32,
    acceleration: i32,
    deceleration: i32,
    mode: i32,
    enable: i32,
}

impl Registers {
    fn place(&mut self, register: Register) -> Option<&mut i32> {
        Some(match register {
            Register::ActualSpeed | Register::ActualPosition => return None,
            Register::Current => &mut self.current,
            Register::Speed => &mut self.speed,
            Register::Position => &mut self.position,
            Register::Acceleration => &mut self.acceleration,
            Register::Deceleration => &mut self.deceleration,
            Register::Mode => &mut self.mode,
            Register::Enable => &mut self.enable,
        })
    }

    const fn moves(&self) -> bool {
        self.enable == 1 && self.mode == 1 && self.current > 0
    }
}

impl Drive {
    /// Takes its place in the world: `index` picks the stream of chance. `None` when there is no such id.
    pub(crate) fn new(config: JointConfig, seed: u64, index: u64) -> Option<Self> {
        if !(1..=IDS).contains(&config.id) {
            return None;
        }
        let mut random = Random::new(seed, (1 << 40) + index);
        let drawn =
            random.below(PULSES_PER_TURN.unsigned_abs()).cast_signed() - PULSES_PER_TURN / 2;
        let shaft = f64::from(config.position.unwrap_or(drawn));
        Some(Self {
            config,
            mailboxes: Mailboxes::new(),
            random,
            registers: Registers::default(),
            powered: true,
            shaft,
            velocity: 0.0,
            profile: shaft,
            profile_velocity: 0.0,
            zero: 0.0,
            due: None,
            replies: 0,
            collisions: 0,
        })
    }

    /// Takes a frame from the bus.
    pub(crate) fn receive(&mut self, frame: &CanFrame, now_ns: u64) {
        if !self.powered || frame.header() != u32::from(self.config.id) {
            return;
        }
        match *frame.data() {
            [0x01, register, a, b, c, d] => {
                let place = Register::from_raw(register).and_then(|r| self.registers.place(r));
                if let Some(place) = place {
                    *place = i32::from_be_bytes([a, b, c, d]);
                }
            }
            [0x03, register] => {
                let latency_ns = self.config.latency.as_micros().saturating_mul(1_000);
                let jitter_ns = u64::from(self.random.below(JITTER_NS));
                let at_ns = now_ns.saturating_add(latency_ns).saturating_add(jitter_ns);
                self.due = Register::from_raw(register).map(|register| (at_ns, register));
            }
            _ => {}
        }
    }

    /// Returns when the next reply is due.
    pub(crate) fn due(&self) -> Option<u64> {
        self.due.map(|(at_ns, _)| at_ns)
    }

    /// Hands the due reply to the bus, unless a fault suppresses it.
    pub(crate) fn reply(&mut self, silent: bool) {
        let Some((_, register)) = self.due.take() else { return };
        let value = match register {
            Register::ActualPosition => wrapped(nearest(self.shaft - self.zero)),
            Register::ActualSpeed => wrapped(nearest(self.velocity.into())),
            other => self.registers.place(other).copied().unwrap_or(0),
        };
        let [a, b, c, d] = value.to_be_bytes();
        let frame = StandardId::new(u16::from(self.config.id))
            .and_then(|id| CanFrame::new(id, &[0x04, register.as_raw(), a, b, c, d]));
        if let Some(frame) = frame.filter(|_| !silent && self.powered) {
            self.replies = self.replies.saturating_add(1);
            _ = self.mailboxes.offer(frame);
        }
    }

    /// Gives or removes the supply. A fresh start forgets everything, and counts from the present angle.
    pub(crate) fn set_powered(&mut self, powered: bool) {
        if powered && !self.powered {
            self.registers = Registers::default();
            self.zero = self.shaft;
        }
        if !powered {
            self.mailboxes.clear();
            self.due = None;
        }
        self.powered = powered;
    }

    /// Moves the shaft by one step.
    pub(crate) fn step(&mut self, dt_s: f32) {
        if !self.powered || !self.registers.moves() {
            let loss = FRICTION * dt_s;
            self.velocity = if self.velocity.abs() <= loss {
                0.0
            } else {
                self.velocity - loss.copysign(self.velocity)
            };
            self.shaft += f64::from(self.velocity * dt_s);
            self.profile = self.shaft;
            self.profile_velocity = self.velocity;
            return;
        }
        self.step_profile(dt_s);
        let before = self.shaft;
        self.shaft += (self.profile - before) * f64::from(dt_s / (LAG_S + dt_s));
        self.velocity = narrow(self.shaft - before) / dt_s;
    }

    /// Goes on to the target: speeds up, keeps its speed, and brakes in time.
    fn step_profile(&mut self, dt_s: f32) {
        let way = narrow(f64::from(self.registers.position) + self.zero - self.profile);
        let (faster, slower) = (
            self.registers.acceleration.max(0) as f32 * dt_s,
            self.registers.deceleration.max(0) as f32 * dt_s,
        );
        if way.abs() <= 1.0 && self.profile_velocity.abs() <= 2.0 * slower {
            self.profile += f64::from(way);
            self.profile_velocity = 0.0;
            return;
        }
        let braking = sqrt(2.0 * way.abs() * slower / dt_s) - 0.5 * slower;
        let fastest = self.registers.speed.max(0) as f32;
        // No further than the target in this step.
        let wanted = braking.max(0.0).min(fastest).min(way.abs() / dt_s).copysign(way);
        let change = wanted - self.profile_velocity;
        let speeds_up = wanted.abs() > self.profile_velocity.abs();
        let limit = if speeds_up { faster } else { slower };
        self.profile_velocity +=
            if change.abs() <= limit { change } else { limit.copysign(change) };
        self.profile += f64::from(self.profile_velocity * dt_s);
    }

    /// Returns the true state.
    pub(crate) fn state(&self) -> MotorState {
        let turns_per_s = self.velocity / PULSES_PER_TURN as f32;
        MotorState {
            position: position(self.shaft / f64::from(PULSES_PER_TURN)),
            velocity: AngularVelocity::from_rpm(turns_per_s * 60.0),
            current: Current::from_amperes(f32::NAN),
            torque_nm: f32::NAN,
            power_w: f32::NAN,
            temperature_c: f32::NAN,
            encoder_counts: nearest(self.shaft),
            drive_counts: wrapped(nearest(self.shaft - self.zero)),
            command: self.registers.position,
            is_enabled: self.powered && self.registers.moves(),
            replies: self.replies,
            collisions: self.collisions,
        }
    }
}

#[expect(clippy::cast_possible_truncation, reason = "a distance of some turns")]
const fn narrow(pulses: f64) -> f32 {
    pulses as f32
}

#[expect(clippy::cast_possible_truncation, reason = "saturates")]
fn nearest(pulses: f64) -> i64 {
    (pulses + 0.5_f64.copysign(pulses)) as i64
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEP: f32 = 1e-4;

    fn drive() -> Drive {
        let mut drive = Drive::new(JointConfig::new(Line::Can1, 2, Some(0)), 1, 0).unwrap();
        for (register, value) in [
            (0x0F, 1),
            (0x08, 2_000),
            (0x09, 65_536),
            (0x0B, 655_360),
            (0x0C, 327_680),
            (0x0A, 65_536),
            (0x10, 1),
        ] {
            write(&mut drive, register, value);
        }
        drive
    }

    fn frame(data: &[u8]) -> CanFrame {
        CanFrame::new(StandardId::new(2).unwrap(), data).unwrap()
    }

    fn write(drive: &mut Drive, register: u8, value: i32) {
        let [a, b, c, d] = value.to_be_bytes();
        drive.receive(&frame(&[1, register, a, b, c, d]), 0);
    }

    fn steps(drive: &mut Drive, count: u32) {
        (0..count).for_each(|_| drive.step(STEP));
    }

    #[test]
    fn the_profile_keeps_its_limits_and_ends_at_the_target() {
        let mut drive = drive();
        let (mut before, mut fastest) = (0.0_f32, 0.0_f32);
        for _ in 0..20_000 {
            drive.step(STEP);
            let change = drive.profile_velocity - before;
            let limit = if change > 0.0 { 655_360.0 } else { 327_680.0 };
            // The last step onto the target may be a little harder.
            assert!(change.abs() <= limit * STEP * 2.1, "{change}");
            before = drive.profile_velocity;
            fastest = fastest.max(before);
        }
        assert!((fastest - 65_536.0).abs() < 1.0);
        assert!(drive.state().encoder_counts == 65_536 && drive.velocity.abs() < 1.0);
        // 0.1 s up and 0.2 s down at 1 turn/s: a turn takes 1.15 s.
        let mut again = self::drive();
        steps(&mut again, 11_000);
        assert!(again.state().encoder_counts < 65_500);
        steps(&mut again, 800);
        assert!(again.state().encoder_counts >= 65_530);
    }

    #[test]
    fn a_target_behind_is_reached_from_full_speed_without_a_jump() {
        let mut drive = drive();
        steps(&mut drive, 3_000);
        write(&mut drive, 0x0A, -65_536);
        let mut before = drive.state().encoder_counts;
        for _ in 0..40_000 {
            drive.step(STEP);
            let now = drive.state().encoder_counts;
            assert!((now - before).abs() <= 8);
            before = now;
        }
        assert_eq!(before, -65_536);
    }

    #[test]
    fn a_drive_without_enable_mode_or_current_only_coasts() {
        for register in [0x10, 0x0F, 0x08] {
            let mut drive = drive();
            steps(&mut drive, 3_000);
            write(&mut drive, register, 0);
            steps(&mut drive, 1_000);
            let rest = drive.state().encoder_counts;
            steps(&mut drive, 1_000);
            assert_eq!((drive.state().encoder_counts, drive.state().is_enabled), (rest, false));
        }
    }

    #[test]
    fn replies_have_the_register_that_was_asked_for_after_the_latency() {
        let mut drive = drive();
        drive.receive(&frame(&[3, 0x0B]), 1_000_000);
        let due = drive.due().unwrap();
        assert!((1_150_000..1_250_000).contains(&due), "{due}");
        drive.reply(false);
        let reply = drive.mailboxes.candidate().unwrap();
        assert_eq!(reply.data(), [4, 0x0B, 0x00, 0x0A, 0x00, 0x00]);
        drive.receive(&frame(&[3, 0x0D]), 0); // no such register: no answer
        assert_eq!(drive.due(), None);
    }

    #[test]
    fn a_joint_without_supply_forgets_registers_and_zero() {
        let mut drive = drive();
        steps(&mut drive, 5_000);
        drive.set_powered(false);
        drive.receive(&frame(&[3, 7]), 0);
        assert_eq!((drive.due(), drive.state().is_enabled), (None, false));
        steps(&mut drive, 2_000);
        let rest = drive.state().encoder_counts;
        drive.set_powered(true);
        drive.receive(&frame(&[3, 7]), 0);
        drive.reply(false);
        assert_eq!(drive.mailboxes.candidate().unwrap().data(), [4, 7, 0, 0, 0, 0]);
        assert_eq!((drive.state().encoder_counts, drive.state().is_enabled), (rest, false));
    }
}
