//! One joint: from replies to the next frame; its handle and its zero.

pub(super) mod health;

use super::config::{Settings, Stall};
use super::model::{FASTEST, PULSES_PER_TURN, name};
use super::{AttachError, Command, Config, Register};
use crate::encoder::Homing;
use crate::motor::{Condition, DeviceGuard, Guarded, MotorGuard, MotorName, TargetError, Traffic};
use crate::time::{Duration, Instant};
use core::f32::consts::TAU;

/// A relaxed joint is disabled again after this time, a driven joint told its target: the drive may have missed the frame.
const REMIND: Duration = Duration::from_millis(100);
/// Tolerance between two positions in rad: a sixteenth of a turn.
const JUMP: f32 = TAU / 16.0;
/// One of so many speed requests is replaced by a check that the drive is still enabled.
const CHECKS: u8 = 8;
/// Two positions and one other register, until all others had their turn.
const TURNS: u8 = 3 * CHECKS;

/// All registers of [`Register::SEQUENCE`], and its last register: the enable.
const ALL: u8 = 0x7F;
const LAST: u8 = 0x40;

/// Names a joint of a bus: one byte, `Copy`.
///
/// A handle of a detached joint finds nothing, even after another joint took its place.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Joint(u8);

impl Joint {
    /// Number of joints that can follow each other in one place.
    pub(super) const GENERATIONS: u8 = 16;

    /// Index in the low half, generation in the high half.
    pub(super) const fn new(index: u8, generation: u8) -> Self {
        Self(generation << 4 | (index & 15))
    }

    pub(super) const fn index(self) -> usize {
        (self.0 & 15) as usize
    }

    pub(super) const fn generation(self) -> u8 {
        self.0 >> 4
    }
}

#[derive(Debug, Clone, Copy)]
pub(super) struct Slot {
    pub(super) id: Option<u8>,
    generation: u8,
    reversed: bool,
    settings: Settings,
    pub(super) guard: MotorGuard,
    pub(super) offset: Offset,
    homing: Homing,
    pub(super) raw: Option<i32>,
    raw_speed: i32,
    /// In rad/s, up to the marked position and its time.
    rate: f32,
    marked: (i32, Instant),
    heard: Instant,
    /// Target and speed, as on the wire.
    target: i32,
    speed: i32,
    /// Registers of [`Register::SEQUENCE`] that wait for a write; and registers with precedence, all of them before the first write.
    pending: u8,
    ahead: u8,
    pub(super) driven: bool,
    /// The drive was enabled at the last position, or since.
    was_led: bool,
    /// Time of the last disable or write of the target.
    told_at: Instant,
    turn: u8,
    pub(super) question: Option<Register>,
    pub(super) answer: Option<(Register, i32)>,
    pub(super) unanswered: u32,
    pub(super) bad_replies: u32,
    position_jumps: u16,
    resets: u16,
    traffic: Traffic,
    window_from: Instant,
    pub(super) stall: Stall,
    stands: Standing,
}

/// Position of a standing joint, and the time from which the joint must move.
#[derive(Debug, Clone, Copy)]
struct Standing {
    at: i32,
    since: Instant,
}

/// The common rules of the joints. So many unread edges have an order and a time of their own.
pub(super) type Rules = DeviceGuard<48>;

impl Guarded for Slot {
    fn guard(&mut self) -> &mut MotorGuard {
        &mut self.guard
    }
}

impl Slot {
    pub(super) const FREE: Self = Self {
        id: None,
        generation: 0,
        reversed: false,
        settings: Settings::USUAL,
        guard: MotorGuard::FREE,
        offset: Offset(0),
        homing: Homing::Relative,
        raw: None,
        raw_speed: 0,
        rate: 0.0,
        marked: (0, Instant::START),
        heard: Instant::START,
        target: 0,
        speed: 0,
        pending: 0,
        ahead: 0,
        driven: false,
        was_led: false,
        told_at: Instant::START,
        turn: 0,
        question: None,
        answer: None,
        unanswered: 0,
        bad_replies: 0,
        position_jumps: 0,
        resets: 0,
        traffic: Traffic::NONE,
        window_from: Instant::START,
        stall: Stall::USUAL,
        stands: Standing { at: 0, since: Instant::START },
    };

    /// Makes the slot of a joint, validating its configuration.
    pub(super) fn new(config: &Config, generation: u8) -> Result<Self, AttachError> {
        let joint = name(config.id());
        let speed = config.speed.as_rad_per_s();
        let refused = if !(speed.is_finite() && speed >= 0.0 && to_pulses(speed) <= FASTEST) {
            Some("speed")
        } else if config.stall.window == Duration::ZERO {
            Some("stall window")
        } else {
            config.settings.refused()
        };
        if let Some(parameter) = refused {
            return Err(AttachError::Parameter { joint, parameter });
        }
        Ok(Self {
            id: Some(config.id()),
            generation,
            reversed: config.reversed,
            settings: config.settings,
            guard: MotorGuard::NEW,
            stall: config.stall,
            speed: to_pulses(speed),
            ..Self::FREE
        })
    }

    /// Frees the slot; handles of the joint find nothing from now on.
    pub(super) const fn free(&mut self) {
        *self = Self { generation: self.generation + 1, ..Self::FREE };
    }

    pub(super) const fn was_ever_attached(&self) -> bool {
        self.id.is_some() || self.generation > 0
    }

    pub(super) const fn next_generation(&self) -> Option<u8> {
        if self.generation < Joint::GENERATIONS { Some(self.generation) } else { None }
    }

    pub(super) const fn matches(&self, joint: Joint) -> bool {
        self.id.is_some() && self.generation == joint.generation()
    }

    /// Returns the index of the slot.
    pub(super) fn place(&self) -> u8 {
        self.id.unwrap_or(1) - 1
    }

    pub(super) fn name(&self) -> Option<MotorName> {
        self.id.map(name)
    }

    /// Tells whether a driven joint has a value to write, beside periodic refreshes.
    pub(super) const fn has_news(&self) -> bool {
        self.driven && self.pending != 0
    }

    /// Tells whether a relaxed joint must be disabled again.
    pub(super) fn wants_reminder(&self, now: Instant) -> bool {
        !self.driven && self.is_forgotten(now)
    }

    fn is_forgotten(&self, now: Instant) -> bool {
        // After a set-back of the clock, the time of the last write lies ahead.
        now.since(self.told_at) >= REMIND || now < self.told_at
    }

    /// Relaxes a driven joint that may no longer be driven. Returns whether the joint must be disabled: not if there was no write since the
    /// last disable.
    pub(super) fn let_go(&mut self) -> bool {
        let stops = self.driven && !self.guard.drives();
        self.driven = self.driven && !stops;
        stops && !self.is_told()
    }

    /// Tells whether the joint was disabled, without a write since.
    pub(super) const fn is_told(&self) -> bool {
        self.ahead == ALL
    }

    /// Returns the next register to request.
    pub(super) fn next_read(&mut self) -> Register {
        let register = match (self.turn % 3, self.question) {
            (2, Some(question)) => question,
            (2, None) if self.turn / 3 == CHECKS - 1 => Register::Enable,
            (2, None) => Register::ActualSpeed,
            _ => Register::ActualPosition,
        };
        self.turn = (self.turn + 1) % TURNS;
        register
    }

    /// Takes back a request that was not sent: its turn comes again.
    pub(super) const fn take_back_question(&mut self) {
        self.turn = (self.turn + TURNS - 1) % TURNS;
    }

    /// Tells whether a new target may be taken. A drive whose zero was lost may count from another angle, whole turns away.
    #[inline]
    pub(super) fn admit(&mut self, is_finite: bool) -> Result<(), TargetError> {
        self.guard.admit(is_finite)?;
        self.guard.require_zero((self.homing != Homing::Uncertain).then_some(()))
    }

    /// Sets a target in pulses from the joint's zero.
    pub(super) fn set_target(&mut self, pulses: i32) {
        let target = self.offset.target(self.directed(pulses));
        if target != self.target {
            self.target = target;
            self.renew(Register::Position);
        }
    }

    /// Sets the speed of moves to the target; saturates.
    pub(super) fn set_speed(&mut self, rad_per_s: f32) {
        let speed = to_pulses(rad_per_s.abs()).min(FASTEST);
        if speed != self.speed {
            self.speed = speed;
            self.renew(Register::Speed);
        }
    }

    pub(super) fn set_settings(&mut self, settings: Settings) {
        self.settings = settings;
        for register in
            [Register::Mode, Register::Current, Register::Acceleration, Register::Deceleration]
        {
            self.renew(register);
        }
    }

    pub(super) const fn set_offset(&mut self, offset: Offset) {
        self.guard.latch.set(Condition::PositionUncertain, false);
        self.offset = offset;
        self.homing = Homing::Homed;
    }

    const fn directed(&self, pulses: i32) -> i32 {
        if self.reversed { pulses.wrapping_neg() } else { pulses }
    }
}

impl Slot {
    /// Notes a disable at `now`. With a new target, the joint is then brought up from the beginning.
    pub(super) const fn told_to_relax(&mut self, now: Instant) {
        self.told_at = now;
        (self.pending, self.ahead) = (ALL, ALL);
    }

    /// Returns the next frame to write.
    pub(super) fn next_write(&mut self, now: Instant) -> Command {
        if !self.driven {
            self.told_at = now;
            return Command::DISABLE;
        }
        // In turns, so that no register waits for endless changes of another.
        let first = self.pending & self.ahead;
        let waiting = if first == 0 { self.pending } else { first };
        let bit = waiting & waiting.wrapping_neg();
        self.pending &= !bit;
        self.ahead = bit.wrapping_neg() << 1;
        let register = Register::SEQUENCE.get(bit.trailing_zeros() as usize);
        let register = *register.unwrap_or(&Register::Position);
        if register == Register::Position {
            self.told_at = now;
        }
        self.was_led |= bit == LAST;
        Command::Write(register, self.value(register))
    }

    const fn value(&self, register: Register) -> i32 {
        match register {
            Register::Mode => self.settings.mode,
            Register::Current => self.settings.current,
            Register::Acceleration => self.settings.acceleration,
            Register::Deceleration => self.settings.deceleration,
            Register::Speed => self.speed,
            Register::Enable => 1,
            Register::Position | Register::ActualPosition | Register::ActualSpeed => self.target,
        }
    }

    /// Takes back a write that was not sent: its turn comes again, and then the turns of the registers behind it. Registers before it in
    /// the sequence keep their places.
    pub(super) fn take_back(&mut self, register: Register) {
        self.ahead |= self.renew(register).wrapping_neg();
    }

    /// Marks a register for a write; returns its bit.
    fn renew(&mut self, register: Register) -> u8 {
        let place = Register::SEQUENCE.iter().position(|other| *other == register);
        let bit = place.map_or(0, |place| 1 << place);
        self.pending |= bit;
        // An enable that comes back was not sent.
        self.was_led &= bit != LAST;
        bit
    }
}

/// Position of a joint's zero in the counts of its motor.
///
/// ```text
/// position shown = raw - offset        target sent = wanted + offset
/// ```
/// [`Reset::Rezero`](crate::wire::host_link::Reset::Rezero) makes the present position zero. The robot's document states `offset = shown +
/// offset`, with a doubt. `shown + offset` is the raw position, so the raw position is the new offset. All arithmetic wraps as the motor's
/// own 32-bit counter does.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
pub(super) struct Offset(pub(super) i32);

impl Offset {
    /// Returns the position from the zero, in pulses.
    pub(super) const fn shown(self, raw_pulses: i32) -> i32 {
        raw_pulses.wrapping_sub(self.0)
    }

    /// Returns the raw target for a wanted position from the zero, in pulses.
    pub(super) const fn target(self, wanted_pulses: i32) -> i32 {
        wanted_pulses.wrapping_add(self.0)
    }
}

/// Rounds rad or rad/s to pulses; saturates, NaN gives 0.
#[expect(clippy::cast_possible_truncation, reason = "saturates")]
pub(super) fn to_pulses(radians: f32) -> i32 {
    let pulses = radians * (PULSES_PER_TURN as f32 / TAU);
    (pulses + 0.5_f32.copysign(pulses)) as i32
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_zero_is_shown_as_zero_and_moves_the_targets() {
        let offset = Offset(70_000);
        assert_eq!((offset.shown(70_000), offset.target(-1_000)), (0, 69_000));
        assert_eq!(Offset(69_000).shown(70_000), 1_000);
    }

    proptest! {
        #[test]
        fn the_documents_sum_is_the_raw_position(first: i32, raw: i32) {
            let sum = Offset(first).shown(raw).wrapping_add(first);
            let offset = Offset(raw);
            prop_assert_eq!(offset, Offset(sum));
            prop_assert_eq!(offset.shown(raw), 0);
        }

        #[test]
        fn a_target_that_is_reached_is_shown_as_wanted(zero: i32, wanted: i32) {
            let offset = Offset(zero);
            prop_assert_eq!(offset.shown(offset.target(wanted)), wanted);
        }
    }
}
