//! The oracle of the fuzz targets: a bus whose every output is compared with what must hold.
//!
//! Each motor of the bus also runs alone, on a bus of its own that gets no frame but the motor's good ones and whose
//! frames are always taken. What the whole bus sends must be, word for word, the newest of what the motors alone would
//! send. That is I3 (a slot of nobody is zero), I5 (refused input changes nothing), I7 (never an older command), I8
//! (one motor's trouble is no other's) and I10 (the same inputs, the same outputs) in one comparison. I2, I4, I6 and
//! I9 are asserted from what is counted and timed here. I1 is what the fuzzer itself looks for.

use crate::motors::{COUNT, FACTS, INTEGRATOR, Motor, Target};
use drivetrain::control::TimeStep;
use drivetrain::dji::{Bus, Counters};
use drivetrain::frame::CanFrame;
use drivetrain::motor::{ArmError, CanDevice, Claim, Ingest, Link, MotorName, TargetError};
use drivetrain::time::{Instant, Tick};

const LATE_US: u64 = 10_000;
const COMMAND_US: u64 = 100_000;

/// A motor alone, and what is known of it.
struct Alone {
    bus: Bus,
    motor: Option<Motor>,
    /// What it sent last.
    word: i16,
    heard: Option<u64>,
    /// When the target that counts was set, by the clock of the bus.
    commanded: Option<u64>,
    /// It was driven by a target since it was last at rest.
    moved: bool,
    /// The target that counts is a velocity, and the first one since the motor was at rest.
    first_velocity: bool,
}

impl core::fmt::Debug for Alone {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let Self { word, heard, commanded, moved, first_velocity, .. } = self;
        write!(
            f,
            "word {word}, heard {heard:?}, commanded {commanded:?}, moved {moved}, first {first_velocity}"
        )
    }
}

impl Alone {
    fn new(index: usize) -> Self {
        let mut bus = Bus::new();
        let motor = Motor::attach(&mut bus, index).ok();
        Self {
            bus,
            motor,
            word: 0,
            heard: None,
            commanded: None,
            moved: false,
            first_velocity: false,
        }
    }

    fn rest(&mut self) {
        self.commanded = None;
        self.moved = false;
        self.first_velocity = false;
    }

    fn drain(&mut self, index: usize) {
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
}

/// A bus of five motors under observation, a device like any other.
#[derive(Debug)]
pub struct Watched {
    bus: Bus,
    motors: [Option<Motor>; COUNT],
    alone: [Alone; COUNT],
    /// The time that new targets get.
    now: u64,
    updated: Option<u64>,
    held: u32,
    stopped: bool,
    /// Frames by what became of them.
    malformed: u32,
    unattached: u32,
    taken_out: u32,
    given_back: u32,
}

impl Default for Watched {
    fn default() -> Self {
        Self::new()
    }
}

impl Watched {
    pub fn new() -> Self {
        let mut bus = Bus::new();
        let motors = core::array::from_fn(|index| Motor::attach(&mut bus, index).ok());
        let all = motors.iter().all(Option::is_some);
        assert!(all, "the motors do not collide");
        Self {
            bus,
            motors,
            alone: core::array::from_fn(Alone::new),
            now: 0,
            updated: None,
            held: 0,
            stopped: false,
            malformed: 0,
            unattached: 0,
            taken_out: 0,
            given_back: 0,
        }
    }

    pub fn counters(&self) -> Counters {
        self.bus.counters()
    }

    pub fn set(&mut self, index: usize, target: Target) {
        let index = index % COUNT;
        let alone = &mut self.alone[index];
        let (Some(motor), Some(same)) = (self.motors[index], alone.motor) else { return };
        let outcome = motor.set(&mut self.bus, target);
        assert_eq!(outcome, same.set(&mut alone.bus, target), "I8");
        match outcome {
            Ok(()) => {
                assert!(self.bus.is_motor_armed(motor.handle()) && !self.stopped, "disarmed");
                let velocity = matches!(target, Target::Velocity(_));
                alone.first_velocity =
                    velocity && !alone.moved && (alone.first_velocity || alone.commanded.is_none());
                alone.commanded = Some(self.now);
            }
            // A target that cannot be followed takes the one before away: no older one acts in its place.
            Err(TargetError::NotFinite | TargetError::NoFeedback) => alone.commanded = None,
            Err(_) => {}
        }
    }

    pub fn relax(&mut self, index: usize) {
        let index = index % COUNT;
        let alone = &mut self.alone[index];
        if let (Some(motor), Some(same)) = (self.motors[index], alone.motor) {
            self.bus.relax(motor.handle());
            alone.bus.relax(same.handle());
            alone.rest();
        }
    }

    pub fn zero(&mut self, index: usize) {
        let index = index % COUNT;
        let alone = &mut self.alone[index];
        if let (Some(motor), Some(same)) = (self.motors[index], alone.motor) {
            let outcome = self.bus.zero(motor.handle());
            assert_eq!(outcome, alone.bus.zero(same.handle()), "I8");
        }
    }

    /// Detaches a motor, or attaches it again.
    pub fn plug(&mut self, index: usize) {
        let index = index % COUNT;
        let alone = &mut self.alone[index];
        match (self.motors[index], alone.motor) {
            (Some(motor), Some(same)) => {
                self.bus.detach(motor.handle());
                alone.bus.detach(same.handle());
                (self.motors[index], alone.motor) = (None, None);
                alone.drain(index);
                // Alone it leaves its frame for good, after zeros; beside others its word waits for the next update.
                alone.word = 0;
                alone.heard = None;
                alone.rest();
            }
            _ => {
                self.motors[index] = Motor::attach(&mut self.bus, index).ok();
                alone.motor = Motor::attach(&mut alone.bus, index).ok();
                assert_eq!(self.motors[index].is_some(), alone.motor.is_some(), "I8");
            }
        }
    }

    /// I6: every frame is somewhere.
    pub fn add_up(&self) {
        let counters = self.bus.counters();
        assert_eq!(counters.bad_length + counters.bad_field, self.malformed, "I6");
        assert_eq!(counters.unattached, self.unattached, "I6");
        let came = counters.packed + self.given_back;
        let gone = self.taken_out + counters.superseded;
        let waiting = came.checked_sub(gone);
        // Open: a frame that is given back while a newer one waits is not counted as superseded. Then at most 5 wait.
        let most = 5 + self.given_back;
        assert!(waiting.is_some_and(|waiting| waiting <= most), "I6: {came} came, {gone} gone");
    }

    fn each_alone(&mut self, mut work: impl FnMut(&mut Alone)) {
        for (index, alone) in self.alone.iter_mut().enumerate() {
            work(alone);
            alone.drain(index);
        }
    }

    /// What a frame has to be taken for, from the tables of the protocol alone.
    fn expected(&self, frame: &CanFrame) -> (Option<usize>, Verdict) {
        let Ok(id) = u16::try_from(frame.header()) else { return (None, Verdict::Unrelated) };
        let owner = FACTS.iter().position(|facts| facts.feedback_id == id);
        let attached = owner.filter(|index| self.motors[*index].is_some());
        let [high, low, ..] = *frame.bytes();
        let verdict = match attached {
            None if (0x201..=0x20B).contains(&id) => Verdict::Unattached,
            None => Verdict::Unrelated,
            Some(_) if frame.length() == 8 && u16::from_be_bytes([high, low]) < 8192 => {
                Verdict::Taken
            }
            Some(_) => Verdict::Malformed,
        };
        (attached, verdict)
    }

    fn check_frame(&self, frame: &CanFrame) {
        use embedded_can::Frame;
        assert!(frame.is_data_frame() && frame.length() == 8, "I3: {frame:?}");
        let header = frame.header();
        assert!(FACTS.iter().any(|facts| u32::from(facts.command_id) == header), "I3: {frame:?}");
        for (place, word) in words(frame).into_iter().enumerate() {
            let owner = FACTS
                .iter()
                .position(|facts| u32::from(facts.command_id) == header && facts.place == place);
            let newest = owner.map_or(0, |owner| self.alone[owner].word);
            assert_eq!(word, newest, "I3, I5, I7, I8 or I10: place {place} of {frame:?}");
            let Some(owner) = owner.filter(|_| word != 0) else { continue };
            assert!(word.unsigned_abs() <= FACTS[owner].limit, "I2: {frame:?}");
            assert!(!self.stopped, "moves after an emergency stop: {frame:?}");
            let armed = |motor: Motor| self.bus.is_motor_armed(motor.handle());
            assert!(self.motors[owner].is_some_and(armed), "moves while disarmed: {frame:?}");
        }
    }

    /// I4 and I9, after an update whose time moved on.
    fn check_motors(&mut self, now: u64) {
        for (index, alone) in self.alone.iter_mut().enumerate() {
            let Some(motor) = alone.motor else { continue };
            let old = is_old(now, alone.heard, LATE_US) || is_old(now, alone.commanded, COMMAND_US);
            assert!(!old || alone.word == 0, "I4: motor {index} at {now}: {alone:?}");
            let kept = index == INTEGRATOR && alone.first_velocity && alone.word != 0;
            assert!(!kept, "I9: an integral outlived its rest: {alone:?}");
            // A loop that has run since it was at rest may integrate from now on.
            alone.moved |= alone.commanded.is_some() && !old;
            alone.first_velocity &= old;
            // While the feedback is late nobody looks at the target: where time goes back, it may be young again.
            if is_old(now, alone.commanded, COMMAND_US) && !is_old(now, alone.heard, LATE_US) {
                alone.commanded = None;
            }
            if alone.bus.link(motor.handle()) == Some(Link::Offline) {
                alone.rest();
            }
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Verdict {
    Taken,
    Malformed,
    Unattached,
    Unrelated,
}

impl CanDevice for Watched {
    fn ingest(&mut self, frame: &CanFrame, now: Instant) -> Ingest {
        let (owner, expected) = self.expected(frame);
        let outcome = self.bus.ingest(frame, now);
        let verdict = match outcome {
            Ingest::Taken => Verdict::Taken,
            Ingest::Malformed(_) => Verdict::Malformed,
            Ingest::Unrelated if expected == Verdict::Unattached => Verdict::Unattached,
            Ingest::Unrelated => Verdict::Unrelated,
        };
        assert_eq!(verdict, expected, "{frame:?}");
        match (expected, owner) {
            (Verdict::Taken, Some(owner)) => {
                let alone = &mut self.alone[owner];
                assert_eq!(alone.bus.ingest(frame, now), Ingest::Taken, "I8");
                alone.heard = Some(now.as_micros());
            }
            (Verdict::Malformed, _) => self.malformed += 1,
            (Verdict::Unattached, _) => self.unattached += 1,
            _ => {}
        }
        outcome
    }

    fn update(&mut self, tick: Tick) {
        let now = tick.now().as_micros();
        let stands = self.updated.is_some_and(|updated| now <= updated);
        let holds = stands || TimeStep::new(tick.dt_s(), 0.02).is_hold();
        self.bus.update(tick);
        self.each_alone(|alone| alone.bus.update(tick));
        let pause = self.updated.replace(now).map(|updated| now.saturating_sub(updated));
        self.now = now;
        self.held = if holds { self.held + 1 } else { 0 };
        if holds {
            let zero = self.held < 2 || self.alone.iter().all(|alone| alone.word == 0);
            assert!(zero, "driven without time: {:?}", self.alone);
        } else if pause.is_some() || now < 1 << 31 {
            self.check_motors(now);
        }
        // Open: an update that ends a pause of more than 60 s takes every motor for lost, because stamps of 32 bits do not
        // tell; but not when it is the first one, nor when its time step is unusable. After a pause of 71 minutes
        // and 35 seconds, to 10 ms, what was heard before it then counts as fresh.
        if pause.map_or(now > 1 << 31, |pause| holds && pause > 60_000_000) {
            self.disarm();
        }
        for (motor, alone) in self.motors.iter().zip(&self.alone) {
            if let (Some(motor), Some(same)) = (motor, alone.motor) {
                let same = alone.bus.state(same.handle());
                assert_eq!(self.bus.state(motor.handle()), same, "I8: depends on others");
            }
        }
        self.add_up();
    }

    fn next_frame(&mut self, _turn: u32) -> Option<CanFrame> {
        let frame = self.bus.next_frame()?;
        self.taken_out += 1;
        self.check_frame(&frame);
        Some(frame)
    }

    fn requeue(&mut self, frame: &CanFrame) -> bool {
        let own = self.bus.requeue(frame);
        let known = FACTS.iter().any(|facts| u32::from(facts.command_id) == frame.header());
        assert_eq!(own, known, "{frame:?}");
        self.given_back += u32::from(own);
        own
    }

    fn superseded(&self) -> u32 {
        self.bus.superseded()
    }

    fn claims(&self) -> impl Iterator<Item = Claim> {
        self.bus.claims()
    }

    fn missing(&self, now: Instant) -> impl Iterator<Item = MotorName> {
        self.bus.missing(now)
    }

    fn arm(&mut self, now: Instant) -> Result<(), ArmError> {
        let outcome = self.bus.arm(now);
        if outcome.is_ok() {
            assert!(!self.stopped, "armed while stopped");
            let missing = self.alone.iter().map(|alone| alone.bus.missing(now).count());
            assert_eq!(missing.sum::<usize>(), 0, "armed without all motors");
            self.engaged(now);
        }
        outcome
    }

    fn engage(&mut self, now: Instant) {
        self.bus.engage(now);
        self.engaged(now);
    }

    fn disarm(&mut self) {
        self.bus.disarm();
        self.each_alone(|alone| {
            alone.bus.disarm();
            alone.rest();
        });
        assert!(self.alone.iter().all(|alone| alone.word == 0), "disarmed is zero at once");
        assert!(!self.bus.is_armed());
    }

    fn is_armed(&self) -> bool {
        self.bus.is_armed()
    }

    fn emergency_stop(&mut self) {
        self.bus.emergency_stop();
        self.each_alone(|alone| {
            alone.bus.emergency_stop();
            alone.rest();
        });
        self.stopped = true;
        assert!(self.alone.iter().all(|alone| alone.word == 0), "stopped is zero at once");
    }

    fn clear_emergency_stop(&mut self) {
        self.bus.clear_emergency_stop();
        self.alone.iter_mut().for_each(|alone| alone.bus.clear_emergency_stop());
        self.stopped = false;
    }

    fn is_stopped(&self) -> bool {
        assert_eq!(self.bus.is_stopped(), self.stopped);
        self.stopped
    }
}

impl Watched {
    fn engaged(&mut self, now: Instant) {
        if self.stopped {
            return;
        }
        self.now = now.as_micros();
        for alone in &mut self.alone {
            let armed = |alone: &Alone| {
                alone.motor.is_some_and(|motor| alone.bus.is_motor_armed(motor.handle()))
            };
            let before = armed(alone);
            alone.bus.engage(now);
            if !before && armed(alone) {
                alone.rest();
            }
        }
    }
}

/// Tells whether a stamp is too old, or further ahead than a stamp of 32 bits may be.
fn is_old(now: u64, stamp: Option<u64>, limit: u64) -> bool {
    stamp.is_none_or(|stamp| match now.checked_sub(stamp) {
        Some(age) => age > limit,
        None => {
            let ahead = (stamp - now) & 0xFFFF_FFFF;
            ahead > limit && ahead < (1 << 32) - limit
        }
    })
}

pub fn words(frame: &CanFrame) -> [i16; 4] {
    let [a, b, c, d, e, f, g, h] = *frame.bytes();
    [[a, b], [c, d], [e, f], [g, h]].map(i16::from_be_bytes)
}
