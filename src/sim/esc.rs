use super::can::Mailboxes;
use super::motor::{MotorConfig, MotorState, position, wrapped};
use super::rotor::{Drive, Rotor};
use crate::dji::Facts;
use crate::frame::CanFrame;
use crate::motor::Capability;
use crate::units::{AngularVelocity, Current};

/// A seeded clock is at most this far off, in millionths: a common crystal. An estimate.
const CLOCK_PPM: u32 = 50;

/// Effects of faults on the feedback of one ESC.
#[derive(Debug, Default, Clone, Copy, PartialEq)]
pub(crate) struct Tampering {
    pub(crate) silent: bool,
    pub(crate) stuck: bool,
    pub(crate) frozen: bool,
    pub(crate) angle: Option<u16>,
    pub(crate) error: u8,
    pub(crate) length: Option<u8>,
}

/// An ESC with its motor: takes command slots from the wire, and sends feedback by a clock of its own.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Esc {
    pub(crate) config: MotorConfig,
    facts: &'static Facts,
    command_raw: i16,
    command_id: u16,
    slot: u8,
    pub(crate) rotor: Rotor,
    pub(crate) mailboxes: Mailboxes,
    random: Random,
    period_ns: u64,
    /// The ideal time of the next frame by the ESC's own clock.
    grid_ns: u64,
    /// The same with jitter.
    due_ns: u64,
    /// Set while there is no supply: whether the angle is then forgotten.
    loss: Option<bool>,
    command: i16,
    commanded_ns: u64,
    /// Counts subtracted from the angle in its frame.
    zero: i64,
    /// The feedback as last sent.
    sent: [u8; 8],
    /// Feedback frames.
    replies: u32,
}

impl Esc {
    /// Takes its place in the world: `index` picks the stream of chance. `None` when the model has no such id.
    pub(crate) fn new(config: MotorConfig, seed: u64, index: u64, now_ns: u64) -> Option<Self> {
        let facts = config.model.facts();
        let (command_id, slot) = facts.place(config.id)?;
        let mut random = Random::new(seed, 2 * index + 1);
        let angle = random.below(8192);
        let period_ns = config.period.as_micros() * 1_000;
        let phase = random.below(u32::try_from(period_ns).unwrap_or(u32::MAX));
        let ppm = i64::from(random.below(2 * CLOCK_PPM + 1)) - i64::from(CLOCK_PPM);
        let ppm = config.clock_ppm.map_or(ppm, i64::from);
        let too_long_ns = ppm * i64::from(config.period.micros_u32().unwrap_or(u32::MAX)) / 1_000;
        let angle = config.rotor_angle.or(u16::try_from(angle).ok()).unwrap_or(0);
        let mut esc = Self {
            config,
            facts,
            command_raw: if config.legacy_full_scale { 30_000 } else { facts.command_raw },
            command_id,
            slot,
            rotor: Rotor::new(&config, angle),
            mailboxes: Mailboxes::new(),
            random,
            period_ns: period_ns.saturating_add_signed(too_long_ns),
            grid_ns: now_ns + u64::from(phase),
            due_ns: 0,
            loss: None,
            command: 0,
            commanded_ns: now_ns,
            zero: 0,
            sent: [0; 8],
            replies: 0,
        };
        esc.due_ns = esc.next_due();
        Some(esc)
    }

    /// Gives the supply (`None`) or removes it, with or without the zero of the angle. A fresh start forgets the
    /// command and begins at another phase.
    pub(crate) fn set_powered(&mut self, loss: Option<bool>, now_ns: u64) {
        match (self.loss, loss) {
            (Some(forgets_angle), None) => {
                self.command = 0;
                self.grid_ns = now_ns + u64::from(self.random.below(1_000_000));
                self.due_ns = self.next_due();
                if forgets_angle {
                    self.zero = self.rotor.counts(0.0);
                }
            }
            (None, Some(_)) => self.mailboxes.clear(),
            _ => {}
        }
        self.loss = loss;
    }

    /// Takes a frame from the bus.
    pub(crate) fn receive(&mut self, frame: &CanFrame, now_ns: u64) {
        if self.loss.is_some()
            || frame.header() != u32::from(self.command_id)
            || frame.length() != 8
        {
            return;
        }
        let word = frame.bytes().chunks_exact(2).nth(usize::from(self.slot));
        if let Some([high, low]) = word {
            let raw = i16::from_be_bytes([*high, *low]);
            self.command = raw.clamp(-self.command_raw, self.command_raw);
            self.commanded_ns = now_ns;
        }
    }

    /// Moves the winding's current by one step.
    pub(crate) fn step_current(&mut self, now_ns: u64, dt_s: f32) {
        if let Some(limit) = self.config.command_timeout {
            let silence_us = now_ns.saturating_sub(self.commanded_ns) / 1_000;
            if silence_us > limit.as_micros() {
                self.command = 0;
            }
        }
        let share = f32::from(self.command) / f32::from(self.command_raw);
        let value = share * self.facts.command_full_scale;
        let drive = match (self.loss.is_none(), self.facts.control) {
            (false, _) => Drive::Open,
            (true, Capability::Voltage) => Drive::Volts(value),
            (true, _) => Drive::Amperes(value),
        };
        self.rotor.step_current(drive, dt_s);
    }

    /// Returns when the next feedback frame is due; `None` without a supply.
    pub(crate) fn due(&self) -> Option<u64> {
        self.loss.is_none().then_some(self.due_ns)
    }

    /// Builds the due feedback frame, `since_step_s` after the last step of the motor. `None` when a fault suppresses
    /// the frame.
    pub(crate) fn feedback(
        &mut self,
        since_step_s: f32,
        tampering: &Tampering,
    ) -> Option<CanFrame> {
        self.grid_ns += self.period_ns;
        self.due_ns = self.next_due();
        if tampering.silent {
            return None;
        }
        let [mut angle_high, mut angle_low, mut speed_high, mut speed_low, ..] = self.sent;
        if !tampering.stuck {
            [angle_high, angle_low] = self.angle(since_step_s).to_be_bytes();
            [speed_high, speed_low] =
                nearest_i16(self.rotor.rotor_rpm() + self.noise_rpm()).to_be_bytes();
        }
        let scale = f32::from(self.facts.current_raw) / self.facts.current_full_scale_a;
        let [current_high, current_low] = nearest_i16(self.rotor.current() * scale).to_be_bytes();
        let live = [
            angle_high,
            angle_low,
            speed_high,
            speed_low,
            current_high,
            current_low,
            if self.facts.has_temperature { nearest_u8(self.rotor.temperature()) } else { 0 },
            tampering.error,
        ];
        if !tampering.frozen {
            self.sent = live;
        }
        let mut data = self.sent;
        if let (Some(angle), [high, low, ..]) = (tampering.angle, &mut data) {
            [*high, *low] = angle.to_be_bytes();
        }
        self.replies = self.replies.saturating_add(1);
        let id = self.facts.feedback_base + u16::from(self.config.id);
        let frame = CanFrame::standard(id, data)?;
        match tampering.length {
            Some(length) => {
                use embedded_can::Frame;
                CanFrame::new(frame.id(), data.get(..usize::from(length))?)
            }
            None => Some(frame),
        }
    }

    /// Draws when the next frame leaves: up to the jitter after its ideal time.
    fn next_due(&mut self) -> u64 {
        let jitter_ns = self.config.jitter.micros_u32().unwrap_or(0).saturating_mul(1_000);
        self.grid_ns + u64::from(self.random.below(jitter_ns))
    }

    /// Draws the error of the next speed in rpm of the rotor.
    fn noise_rpm(&mut self) -> f32 {
        let most = self.config.speed_noise_rpm;
        if most > 0.0 { self.random.within(most) } else { 0.0 }
    }

    fn angle(&self, since_step_s: f32) -> u16 {
        let counts = self.rotor.counts(since_step_s).wrapping_sub(self.zero);
        u16::try_from(counts & 0x1FFF).unwrap_or(0)
    }

    /// Returns the true state, `since_step_s` after the last step of the motor.
    pub(crate) fn state(&self, since_step_s: f32) -> MotorState {
        let encoder_counts = self.rotor.counts(since_step_s);
        MotorState {
            position: position(self.rotor.shaft_turns(since_step_s)),
            velocity: AngularVelocity::from_rad_per_s(self.rotor.velocity()),
            current: Current::from_amperes(self.rotor.current()),
            torque_nm: self.rotor.torque_nm(),
            power_w: self.rotor.power_w(),
            temperature_c: self.rotor.temperature(),
            encoder_counts,
            drive_counts: wrapped(encoder_counts.wrapping_sub(self.zero)),
            command: self.command.into(),
            is_enabled: self.loss.is_none(),
            replies: self.replies,
            collisions: 0,
        }
    }
}

#[expect(clippy::cast_possible_truncation, reason = "rounds half away from zero, and saturates")]
fn nearest_i16(value: f32) -> i16 {
    (value + 0.5_f32.copysign(value)) as i16
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "rounds, and saturates"
)]
fn nearest_u8(value: f32) -> u8 {
    (value + 0.5) as u8
}

/// A small reproducible source of chance: the same seed and stream, the same numbers on every target.
///
/// The generator is PCG32 (XSH-RR): M. E. O'Neill, "PCG: A Family of Simple Fast Space-Efficient Statistically
/// Good Algorithms for Random Number Generation" (2014), section 6.3.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Random {
    state: u64,
    increment: u64,
}

const MULTIPLIER: u64 = 6_364_136_223_846_793_005;

impl Random {
    /// Seeds one of 2^63 streams; numbers of different streams are independent.
    pub(crate) const fn new(seed: u64, stream: u64) -> Self {
        let increment = (stream << 1) | 1;
        let first = increment.wrapping_add(seed).wrapping_mul(MULTIPLIER).wrapping_add(increment);
        Self { state: first, increment }
    }

    #[expect(clippy::cast_possible_truncation, reason = "the generator takes parts of the state")]
    pub(crate) const fn next_u32(&mut self) -> u32 {
        let old = self.state;
        self.state = old.wrapping_mul(MULTIPLIER).wrapping_add(self.increment);
        let mixed = (((old >> 18) ^ old) >> 27) as u32;
        mixed.rotate_right((old >> 59) as u32)
    }

    /// Returns a number below `bound`; 0 for the bound 0. Its bias is below one in 2^32 / `bound`.
    pub(crate) const fn below(&mut self, bound: u32) -> u32 {
        ((self.next_u32() as u64 * bound as u64) >> 32) as u32
    }

    /// Returns a number within ±`most`, evenly distributed.
    pub(crate) fn within(&mut self, most: f32) -> f32 {
        // 24 bits are exact in f32.
        let drawn = (self.next_u32() >> 8) as f32 * (1.0 / 8_388_608.0);
        most * (drawn - 1.0)
    }

    /// Tells yes with the given probability: never at 0 and below, always at 1 and above, never for NaN.
    pub(crate) fn chance(&mut self, probability: f32) -> bool {
        // 24 bits are exact in f32.
        let drawn = (self.next_u32() >> 8) as f32 * (1.0 / 16_777_216.0);
        drawn < probability
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim::motor::Model;
    use crate::time::Duration;
    use embedded_can::Frame;

    const STEP: f32 = 1e-4;

    fn esc(model: Model, id: u8) -> Esc {
        Esc::new(MotorConfig::new(model, id).with_rotor_angle(100), 1, 0, 0).unwrap()
    }

    fn command(id: u16, slot: usize, raw: i16) -> CanFrame {
        let mut data = [0; 8];
        data[2 * slot..2 * slot + 2].copy_from_slice(&raw.to_be_bytes());
        CanFrame::standard(id, data).unwrap()
    }

    fn feedback(esc: &mut Esc) -> CanFrame {
        esc.feedback(0.0, &Tampering::default()).unwrap()
    }

    #[test]
    fn every_id_listens_in_its_slot_and_answers_with_its_id() {
        let table = [
            (Model::M2006, 1, 0x200, 0, 0x201),
            (Model::M3508, 4, 0x200, 3, 0x204),
            (Model::M3508, 5, 0x1FF, 0, 0x205),
            (Model::M2006, 8, 0x1FF, 3, 0x208),
            (Model::Gm6020Voltage, 1, 0x1FF, 0, 0x205),
            (Model::Gm6020Voltage, 7, 0x2FF, 2, 0x20B),
            (Model::Gm6020Current, 4, 0x1FE, 3, 0x208),
            (Model::Gm6020Current, 5, 0x2FE, 0, 0x209),
        ];
        for (model, id, command_id, slot, feedback_id) in table {
            let mut esc = esc(model, id);
            for (other_id, other_slot) in [(command_id, (slot + 1) % 4), (command_id ^ 0x400, slot)]
            {
                esc.receive(&command(other_id, other_slot, 500), 0);
                assert_eq!(esc.command, 0, "{model:?} {id}");
            }
            esc.receive(&command(command_id, slot, -500), 0);
            assert_eq!(esc.command, -500, "{model:?} {id}");
            assert_eq!(feedback(&mut esc).header(), feedback_id);
        }
    }

    #[test]
    fn ids_that_no_switch_can_set_are_refused() {
        for (model, id) in [(Model::M3508, 0), (Model::M3508, 9), (Model::Gm6020Current, 8)] {
            assert!(Esc::new(MotorConfig::new(model, id), 1, 0, 0).is_none());
        }
    }

    #[test]
    fn commands_beyond_the_range_are_cut_and_short_or_remote_frames_ignored() {
        let mut esc = esc(Model::M2006, 1);
        esc.receive(&command(0x200, 0, i16::MIN), 0);
        assert_eq!(esc.command, -10_000);
        let id = command(0x200, 0, 0).id();
        esc.receive(&CanFrame::new(id, &[1, 2, 3, 4, 5, 6, 7]).unwrap(), 0);
        esc.receive(&CanFrame::new_remote(id, 8).unwrap(), 0);
        assert_eq!(esc.command, -10_000);
    }

    #[test]
    fn feedback_is_quantised_as_on_the_wire() {
        let mut esc = esc(Model::M3508, 1);
        assert_eq!(feedback(&mut esc).bytes(), &[0, 100, 0, 0, 0, 0, 25, 0]);
        esc.receive(&command(0x200, 0, 8192), 0); // 10 A
        for _ in 0..100_000 {
            esc.step_current(0, STEP);
        }
        assert_eq!(feedback(&mut esc).bytes()[4..6], 8192_i16.to_be_bytes());
        for _ in 0..10_000 {
            esc.step_current(0, STEP);
            esc.rotor.step_motion(0.0, STEP);
        }
        let bytes = *feedback(&mut esc).bytes();
        let speed = i16::from_be_bytes([bytes[2], bytes[3]]);
        assert!((9_250..9_262).contains(&speed), "{speed} rpm at the rotor, 482 * 19.2 = 9256");
        assert!(u16::from_be_bytes([bytes[0], bytes[1]]) < 8192);
    }

    #[test]
    fn scales_are_those_of_each_esc() {
        for (model, raw) in
            [(Model::M2006, 1000), (Model::M3508, 819), (Model::Gm6020Current, 5461)]
        {
            let mut esc = esc(model, 1);
            for _ in 0..1000 {
                esc.rotor.step_current(Drive::Amperes(-1.0), STEP);
            }
            let bytes = *feedback(&mut esc).bytes();
            assert_eq!(i16::from_be_bytes([bytes[4], bytes[5]]), -raw, "{model:?}");
        }
    }

    #[test]
    fn an_old_gm6020_has_more_counts_for_the_same_volts() {
        let config = MotorConfig::new(Model::Gm6020Voltage, 1);
        for (config, limit) in [(config, 25_000), (config.with_legacy_full_scale(), 30_000)] {
            let mut esc = Esc::new(config, 1, 0, 0).unwrap();
            esc.receive(&command(0x1FF, 0, i16::MAX), 0);
            assert_eq!(esc.command, limit);
            for _ in 0..20_000 {
                esc.step_current(0, STEP);
                esc.rotor.step_motion(0.0, STEP);
            }
            assert!((esc.rotor.rotor_rpm() - 320.0).abs() < 0.5);
        }
    }

    #[test]
    fn a_c610_has_no_temperature() {
        let mut esc = esc(Model::M2006, 1);
        esc.rotor.set_temperature(80.0);
        assert_eq!(feedback(&mut esc).bytes()[6], 0);
    }

    #[test]
    fn without_commands_the_last_command_holds_unless_configured_otherwise() {
        let timeout = Duration::from_millis(20);
        let config = MotorConfig::new(Model::M3508, 1);
        for (config, later) in [(config, 1000), (config.with_command_timeout(timeout), 0)] {
            let mut esc = Esc::new(config, 1, 0, 0).unwrap();
            esc.receive(&command(0x200, 0, 1000), 0);
            esc.step_current(20_000_000, STEP);
            assert_eq!(esc.command, 1000);
            esc.step_current(20_001_000, STEP);
            assert_eq!(esc.command, later);
        }
    }

    #[test]
    fn a_power_cycle_forgets_the_command_and_moves_the_phase() {
        let mut esc = esc(Model::M3508, 1);
        esc.receive(&command(0x200, 0, 1000), 0);
        let phase = esc.due().unwrap() % 1_000_000;
        esc.set_powered(Some(true), 0);
        assert_eq!(esc.due(), None);
        esc.receive(&command(0x200, 0, 1000), 0);
        esc.set_powered(None, 50_000_000);
        assert_eq!(esc.command, 0);
        assert_ne!(esc.due().unwrap() % 1_000_000, phase);
        assert_eq!(feedback(&mut esc).bytes()[..2], [0, 0]); // and it takes its angle as zero
    }

    #[test]
    fn the_free_running_clock_keeps_its_rate_under_any_jitter() {
        let config = MotorConfig::new(Model::M3508, 1).with_clock_ppm(40);
        let mut esc = Esc::new(config, 9, 3, 0).unwrap();
        let first = esc.due().unwrap();
        for _ in 0..10_000 {
            let _frame = feedback(&mut esc);
        }
        let elapsed = esc.due().unwrap() - first;
        assert!(elapsed.abs_diff(10_000 * 1_000_040) <= 10_000, "{elapsed}");
    }

    #[test]
    fn the_rate_is_as_set_and_never_silly() {
        for (micros, expected) in [(2_000, 2_000), (0, 100), (u64::MAX, 1_000_000)] {
            let config = MotorConfig::new(Model::M3508, 1).with_clock_ppm(0);
            let config = config.with_feedback_period(Duration::from_micros(micros));
            let mut esc = Esc::new(config, 1, 0, 0).unwrap();
            let first = esc.due().unwrap();
            for _ in 0..100 {
                let _frame = feedback(&mut esc);
            }
            let elapsed = esc.due().unwrap() - first;
            assert!(elapsed.abs_diff(100 * expected * 1_000) <= 10_000);
        }
    }

    #[test]
    fn rounding_is_to_the_nearest_and_saturates() {
        assert_eq!(
            [0.4, 0.5, -0.5, -1.4, 1e9, -1e9, f32::NAN].map(nearest_i16),
            [0, 1, -1, -1, 32767, -32768, 0]
        );
        assert_eq!([-5.0, 33.4, 999.0].map(nearest_u8), [0, 33, 255]);
    }

    #[test]
    fn the_numbers_are_those_of_the_reference_implementation() {
        // pcg32-demo of the author: seed 42, stream 54.
        let mut random = Random::new(42, 54);
        let drawn: std::vec::Vec<u32> = (0..6).map(|_| random.next_u32()).collect();
        assert_eq!(
            drawn,
            [0xA15C_02B7, 0x7B47_F409, 0xBA1D_3330, 0x83D2_F293, 0xBFA4_784B, 0xCBED_606E]
        );
    }

    #[test]
    fn chances_keep_their_probability_and_their_ends() {
        let mut random = Random::new(1, 2);
        let hits = (0..100_000).filter(|_| random.chance(0.25)).count();
        assert!(hits.abs_diff(25_000) < 500, "{hits}");
        assert!((0..1000).all(|_| random.chance(1.0) && !random.chance(0.0)));
        assert!(!random.chance(f32::NAN) && !random.chance(-1.0));
        assert!((0..1000).all(|_| random.below(7) < 7 && random.below(0) == 0));
    }
}
