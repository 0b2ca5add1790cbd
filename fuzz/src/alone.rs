//! One motor alone on a bus of its own: what the same motor has to do among others.

use crate::motors::{COUNT, FACTS, Motor, OPENING_US, Target};
use drivetrain::dji::Bus;
use drivetrain::motor::{CanDevice, Condition, Conditions, Link, MotorName, Timeouts};
use drivetrain::time::{Edge, Instant, Tick};

/// Feedback is late above this age, and targets are old above the other: the values of the documentation.
pub const LATE_US: u64 = 10_000;
pub const COMMAND_US: u64 = 100_000;

/// After so long without an update, everything that was heard is too old.
pub const PAUSE_US: u64 = 60_000_000;

/// A motor alone, and what is known of it.
pub struct Alone {
    pub bus: Bus,
    timeouts: Timeouts,
    pub motor: Option<Motor>,
    /// What it sent last.
    pub word: i16,
    pub heard: Option<u64>,
    /// When the target that counts was set, by the clock of the bus.
    pub commanded: Option<u64>,
    /// The sum of all forward steps of time since then, and from where the next one counts.
    driven_us: u64,
    counted: u64,
    /// Since when its output range opens.
    pub opened: Option<u64>,
    /// The last arming of which its bus knows, until time is lost.
    armed_at: u64,
    /// Time did not move on since it was armed.
    pub lost_time: bool,
    /// It was driven by a target since it was last at rest.
    pub moved: bool,
    /// The target that counts is a velocity, and the first one since the motor was at rest.
    pub first_velocity: bool,
    /// The target that counts is a place of the shaft.
    pub is_way: bool,
    /// It was at rest since the last update in which time passed.
    pub has_rested: bool,
    /// Since when its last frame lies so far ahead that it counts as late here, and the whole bus has not noticed.
    pub doubted: Option<u64>,
}

impl core::fmt::Debug for Alone {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let Self { word, heard, commanded, driven_us, opened, lost_time, .. } = self;
        let Self { moved, first_velocity, doubted, .. } = self;
        write!(
            f,
            "word {word}, heard {heard:?}, commanded {commanded:?}, driven {driven_us} us, "
        )?;
        write!(f, "opened {opened:?}, lost time {lost_time}, ")?;
        write!(f, "moved {moved}, first {first_velocity}, in doubt {doubted:?}")
    }
}

impl Alone {
    pub fn new(index: usize, timeouts: Timeouts) -> Self {
        let mut bus = Bus::new().with_timeouts(timeouts);
        let motor = Motor::attach(&mut bus, index).ok();
        Self {
            bus,
            timeouts,
            motor,
            word: 0,
            heard: None,
            commanded: None,
            driven_us: 0,
            counted: 0,
            opened: None,
            armed_at: 0,
            lost_time: false,
            moved: false,
            first_velocity: false,
            is_way: false,
            has_rested: true,
            doubted: None,
        }
    }

    /// At rest, with its loops as they are.
    pub fn lose_target(&mut self) {
        self.commanded = None;
        self.has_rested = true;
    }

    pub fn rest(&mut self) {
        self.lose_target();
        self.moved = false;
        self.first_velocity = false;
        self.is_way = false;
    }

    /// A target was taken at `now`.
    pub fn follow(&mut self, target: Target, now: u64) {
        let velocity = matches!(target, Target::Velocity(_));
        self.is_way = matches!(target, Target::Angle(_) | Target::Turns(..));
        // The loop that takes over from it goes on from its output.
        self.moved |= !velocity;
        self.first_velocity =
            velocity && !self.moved && (self.first_velocity || self.commanded.is_none());
        self.commanded = Some(now);
        (self.driven_us, self.counted) = (0, now);
    }

    /// Arms it where the whole bus was armed; `false` when a trip that left the whole bus with its motor is still known here.
    pub fn engage(&mut self, now: Instant) -> bool {
        let before = self.is_armed();
        let granted = self.bus.ask();
        let is_heard = self.bus.missing(now).next().is_none();
        self.bus.engage(now);
        if granted && is_heard && self.is_armed() {
            self.armed_at = self.armed_at.max(now.as_micros());
        }
        if !before && self.is_armed() {
            self.rest();
            (self.opened, self.lost_time) = (Some(now.as_micros()), false);
        }
        granted
    }

    /// Time did not move on: no age is known, and nothing is fresh.
    pub fn lose_time(&mut self) {
        self.rest();
        self.heard = None;
        self.lost_time = true;
    }

    /// I4: whatever the clock shows, a target drives for no longer than its deadline, and a step that is held.
    pub fn count_time(&mut self, now: u64, holds: bool) {
        let before = self.driven_us;
        self.driven_us += now.saturating_sub(self.counted);
        self.counted = now;
        let driven_us = if holds { before } else { self.driven_us };
        assert!(self.word == 0 || driven_us <= COMMAND_US, "I4: an old target at {now}: {self:?}");
    }

    /// I2: from arming on the output range opens in proportion to time, in steps of 1.024 ms.
    pub fn check_range(&self, index: usize, now: u64) {
        let (Some(opened), opening_us @ 1..) = (self.opened, OPENING_US[index]) else { return };
        let open_us = (now.saturating_sub(opened) + 2 * 1_024).min(opening_us);
        let range = u64::from(FACTS[index].limit) * open_us / opening_us + 1;
        let word = u64::from(self.word.unsigned_abs());
        assert!(word <= range, "I2: motor {index} beyond its opening at {now}: {self:?}");
    }

    /// Updates, and has the bus compare every age: setting the timeouts, to what they are, makes it look. The whole bus
    /// looks when it must, so that what it leaves out shows as a difference.
    pub fn update(&mut self, tick: Tick) {
        self.bus = core::mem::take(&mut self.bus).with_timeouts(self.timeouts);
        self.bus.update(tick);
    }

    /// Updates by a time that the whole bus refuses, as it does not lie after the last one, or lies before an arming. If this bus knows
    /// nothing of that arming, the update has no step: as in the whole bus, no motor has its turn to be checked.
    pub fn lose_update(&mut self, tick: Tick, is_after_the_last: bool) {
        let armed_at = core::mem::take(&mut self.armed_at);
        let knows = !is_after_the_last || tick.now().as_micros() < armed_at;
        self.update(if knows { tick } else { Tick::new(tick.now(), f32::NAN) });
    }

    pub fn drain(&mut self, index: usize) {
        let facts = &FACTS[index];
        let mut frames = 0;
        while let Some(frame) = self.bus.next_frame() {
            frames += 1;
            assert!(frames <= 1, "one motor, one frame");
            assert_eq!(frame.header(), u32::from(facts.command_id));
            let words = words(&frame);
            let others = words.iter().enumerate().filter(|(place, _)| *place != facts.place);
            assert!(others.into_iter().all(|(_, word)| *word == 0), "I3: {frame:?}");
            self.word = words[facts.place];
        }
        assert!(self.word.unsigned_abs() <= facts.limit, "I2: {} of {}", self.word, facts.limit);
    }

    pub fn link(&self) -> Option<Link> {
        self.bus.link(self.motor?.handle())
    }

    pub fn is_armed(&self) -> bool {
        self.motor.is_some_and(|motor| self.bus.is_motor_armed(motor.handle()))
    }

    pub fn has(&self, condition: Condition) -> bool {
        self.conditions().contains(condition)
    }

    pub fn conditions(&self) -> Conditions {
        self.motor.map_or(Conditions::NONE, |motor| self.bus.conditions(motor.handle()))
    }

    /// The edges that were not read yet, in an order that does not depend on how many there were.
    pub fn edges(&mut self) -> Vec<Edge<Condition, MotorName>> {
        sorted(core::iter::from_fn(|| self.bus.next_edge()).collect())
    }
}

/// Edges in the order of motors and conditions.
pub fn sorted(mut edges: Vec<Edge<Condition, MotorName>>) -> Vec<Edge<Condition, MotorName>> {
    assert!(edges.len() <= 2 * 15 * COUNT, "an edge is told again and again");
    edges.sort_by_key(|edge| (edge.source.to_string(), edge.condition, edge.began));
    edges
}

/// Tells whether a stamp is too old, or further ahead than a stamp of 32 bits may be.
pub fn is_old(now: u64, stamp: Option<u64>, limit: u64) -> bool {
    stamp.is_none_or(|stamp| match now.checked_sub(stamp) {
        Some(age) => age > limit,
        None => lies_ahead(now, Some(stamp), limit),
    })
}

/// Tells whether a stamp lies ahead by more than a limit, as far as stamps of 32 bits can tell.
pub fn lies_ahead(now: u64, stamp: Option<u64>, limit: u64) -> bool {
    stamp.and_then(|stamp| stamp.checked_sub(now)).is_some_and(|ahead| {
        let ahead = ahead & 0xFFFF_FFFF;
        ahead > limit && ahead < (1 << 32) - limit
    })
}

/// The time that a stamp of 32 bits stands for: the one nearest to the clock.
pub fn as_stamped(now: u64, clock: u64) -> u64 {
    let off = now.wrapping_sub(clock) as u32;
    clock.saturating_add_signed(off.cast_signed().into())
}

/// The age that stamps of 32 bits tell; none when it lies ahead.
pub fn stamped_age(now: u64, stamp: u64) -> u64 {
    let age = (now.wrapping_sub(stamp) as u32).cast_signed();
    age.try_into().unwrap_or_default()
}

pub fn words(frame: &drivetrain::frame::CanFrame) -> [i16; 4] {
    let [a, b, c, d, e, f, g, h] = *frame.bytes();
    [[a, b], [c, d], [e, f], [g, h]].map(i16::from_be_bytes)
}
