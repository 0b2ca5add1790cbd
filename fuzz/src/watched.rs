//! The oracle of the fuzz targets: a bus whose every output is compared with what must hold.
//!
//! Each motor of the bus also runs alone, on a bus of its own that gets no frame but the motor's good ones, whose frames
//! are always taken and which compares every age in each update. What the whole bus sends must be, word for word, the newest of
//! what the motors alone would send. That is I3 (a slot of nobody is zero), I5 (refused input changes nothing), I7
//! (never an older command), I8 (one motor's trouble is no other's) and I10 (the same inputs, the same outputs) in one
//! comparison; states, conditions and edges are compared too. I2, I4, I6 and I9 are asserted from what is counted and
//! timed here. I1 is what the fuzzer itself looks for.
//!
//! Time is what the caller says, and need not be one. An update that lies not after the one before, or before the arming, gives
//! zeros in that cycle and until the motor is armed again; and the forward steps that a target drives for add up to its
//! deadline and one held step at most, whatever the clock shows. When an arming may be granted is reckoned here, too: the
//! gesture belongs to the whole bus, and a motor alone is armed with it.
//!
//! Feedback stamped in the future is the one thing that the whole bus may notice later than a motor alone: `Bus::ingest`
//! promises twice the time after which it is late. Until then, or until the time has caught up, either answer is right,
//! for that motor only; then both start anew from a motor that is attached again.
//!
//! Before the first update the frames are the clock of all: a motor alone misses what the others' tell. Who was lost by that
//! is asserted of the whole bus, and starts anew too. Stamps have 32 bits: a frame that comes with a time off by more than
//! half of that is held for what its stamp says.

use crate::alone::{
    Alone, COMMAND_US, LATE_US, PAUSE_US, as_stamped, is_old, lies_ahead, sorted, stamped_age,
    words,
};
use crate::gesture::Gesture;
use crate::motors::{COUNT, FACTS, INTEGRATOR, Motor, Target};
use drivetrain::dji::{Bus, Counters};
use drivetrain::frame::CanFrame;
use drivetrain::motor::{
    ArmError, CanDevice, Claim, Condition, Conditions, Devices, Ingest, Link, MotorName,
    TargetError, Timeouts, Visitor, WrongSetting,
};
use drivetrain::time::{Edge, TimeStep};
use drivetrain::time::{Instant, Tick};
use std::collections::VecDeque;

/// A bus of five motors under observation, a device like any other.
#[derive(Debug)]
pub struct Watched {
    bus: Bus,
    motors: [Option<Motor>; COUNT],
    alone: [Alone; COUNT],
    /// The time that new targets get.
    now: u64,
    updated: Option<u64>,
    /// The time of the last update; before the first one, that of the last good frame.
    clock: u64,
    /// No update may lie before it: the time of the last arming, until time is lost.
    armed_at: u64,
    gesture: Gesture,
    /// Motors that were relaxed since they were armed, and wait to be armed again.
    tripped: [bool; COUNT],
    held: u32,
    stopped: bool,
    /// Frames by what became of them.
    malformed: u32,
    unattached: u32,
    taken_out: u32,
    given_back: u32,
    wire: [Wire; COUNT],
    edges: VecDeque<Edge<Condition, MotorName>>,
    /// The times of the edges that wait need not be those of the motors alone: one left, and the room of its edges is
    /// not free yet; or there was no update that told the time.
    untimed: bool,
}

impl Watched {
    /// Motors that come back after so many good frames.
    pub fn new(good_frames: u8) -> Self {
        let timeouts = Timeouts::new().with_good_frames(good_frames);
        let mut bus = Bus::new().with_timeouts(timeouts);
        let motors = core::array::from_fn(|index| Motor::attach(&mut bus, index).ok());
        let all = motors.iter().all(Option::is_some);
        assert!(all, "the motors do not collide");
        Self {
            bus,
            motors,
            alone: core::array::from_fn(|index| Alone::new(index, timeouts)),
            now: 0,
            updated: None,
            clock: 0,
            armed_at: 0,
            gesture: Gesture::default(),
            tripped: [false; COUNT],
            held: 0,
            stopped: false,
            malformed: 0,
            unattached: 0,
            taken_out: 0,
            given_back: 0,
            wire: [Wire::Shows(0); COUNT],
            edges: VecDeque::new(),
            untimed: true,
        }
    }

    pub fn counters(&self) -> Counters {
        self.bus.counters()
    }

    /// How many frames were taken and not given back.
    pub fn left_for_good(&self) -> u32 {
        self.taken_out - self.given_back
    }

    pub fn set(&mut self, index: usize, target: Target) {
        let index = self.settled(index);
        let alone = &mut self.alone[index];
        let (Some(motor), Some(same)) = (self.motors[index], alone.motor) else { return };
        let outcome = motor.set(&mut self.bus, target);
        assert_eq!(outcome, same.set(&mut alone.bus, target), "I8");
        match outcome {
            Ok(()) => {
                assert!(self.bus.is_motor_armed(motor.handle()) && !self.stopped, "disarmed");
                assert!(!alone.lost_time, "a target without an arming: {alone:?}");
                alone.follow(target, self.now);
            }
            // A target that cannot be followed takes the one before away: no older one acts in its place.
            Err(TargetError::NotFinite | TargetError::NoFeedback) => alone.lose_target(),
            Err(_) => {}
        }
    }

    pub fn relax(&mut self, index: usize) {
        let index = self.settled(index);
        let alone = &mut self.alone[index];
        if let (Some(motor), Some(same)) = (self.motors[index], alone.motor) {
            self.bus.relax(motor.handle());
            alone.bus.relax(same.handle());
            alone.rest();
        }
    }

    pub fn zero(&mut self, index: usize) {
        let index = self.settled(index);
        let alone = &mut self.alone[index];
        if let (Some(motor), Some(same)) = (self.motors[index], alone.motor) {
            let outcome = self.bus.zero(motor.handle());
            assert_eq!(outcome, alone.bus.zero(same.handle()), "I8");
            if outcome.is_ok() && alone.is_way && alone.commanded.is_some() {
                alone.rest();
            }
        }
    }

    /// Detaches a motor, or attaches it again.
    pub fn plug(&mut self, index: usize) {
        let index = index % COUNT;
        self.wire[index] = Wire::Unknown;
        let alone = &mut self.alone[index];
        match (self.motors[index], alone.motor) {
            (Some(motor), Some(same)) => {
                self.bus.detach(motor.handle());
                self.tripped[index] = false;
                self.untimed = true;
                alone.bus.detach(same.handle());
                (self.motors[index], alone.motor) = (None, None);
                alone.drain(index);
                // Alone it leaves its frame for good, after zeros; beside others its word waits for the next update.
                alone.word = 0;
                alone.heard = None;
                alone.doubted = None;
                alone.rest();
            }
            _ => {
                self.motors[index] = Motor::attach(&mut self.bus, index).ok();
                alone.motor = Motor::attach(&mut alone.bus, index).ok();
                assert_eq!(self.motors[index].is_some(), alone.motor.is_some(), "I8");
            }
        }
    }

    /// Arms some motors, by the bits of their numbers, at the time of the last update.
    pub fn arm_only(&mut self, chosen: u8) {
        // A motor that is left out alone does not know of another time.
        if self.updated != Some(self.now) {
            return;
        }
        let chosen: Vec<usize> = (0..COUNT).filter(|index| chosen & 1 << index != 0).collect();
        chosen.iter().for_each(|index| _ = self.settled(*index));
        let handles = |index: &usize| self.motors[*index].map(Motor::handle);
        let handles: Vec<_> = chosen.iter().filter_map(handles).collect();
        let now = Instant::from_micros(self.clock);
        let granted = self.gesture.ask();
        let outcome = self.bus.arm_only(&handles, now);
        assert!(granted || outcome.is_err(), "armed without a new request");
        assert!(!granted || outcome != Err(ArmError::NotReleased), "a new request is refused");
        if outcome.is_ok() {
            self.engaged(now, &chosen);
        }
    }

    /// Has the bus do something, and notes whether it relaxed a motor until it is armed.
    fn noting_trips<T>(&mut self, act: impl FnOnce(&mut Bus) -> T) -> T {
        let armed = |bus: &Bus, motors: &[Option<Motor>; COUNT]| {
            motors.map(|motor| motor.is_some_and(|motor| bus.is_motor_armed(motor.handle())))
        };
        let before = armed(&self.bus, &self.motors);
        let outcome = act(&mut self.bus);
        let after = armed(&self.bus, &self.motors);
        for (tripped, (before, after)) in self.tripped.iter_mut().zip(before.into_iter().zip(after))
        {
            if before && !after {
                *tripped = true;
                self.gesture.trip();
            }
        }
        outcome
    }

    /// A motor that may be called and compared: one in doubt starts anew before.
    fn settled(&mut self, index: usize) -> usize {
        let index = index % COUNT;
        if self.alone[index].doubted.is_some() {
            self.plug(index);
            self.plug(index);
        }
        index
    }

    /// I6: every frame is somewhere. Returns how many wait.
    pub fn add_up(&self) -> u32 {
        let counters = self.bus.counters();
        assert_eq!(counters.bad_length + counters.bad_field, self.malformed, "I6");
        assert_eq!(counters.unattached, self.unattached, "I6");
        let came = counters.packed + self.given_back;
        let gone = self.taken_out + counters.superseded;
        let waiting = came.checked_sub(gone);
        let Some(waiting) = waiting.filter(|waiting| *waiting <= 3) else {
            panic!("I6: {came} came, {gone} gone, of three frames");
        };
        waiting
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
            let doubted = owner.is_some_and(|owner| self.alone[owner].doubted.is_some());
            let newest = owner.map_or(0, |owner| self.alone[owner].word);
            assert!(
                word == newest || doubted,
                "I3, I5, I7, I8 or I10: place {place} of {frame:?}, not {newest}: {:?}",
                self.alone
            );
            let Some(owner) = owner.filter(|_| word != 0) else { continue };
            assert!(word.unsigned_abs() <= FACTS[owner].limit, "I2: {frame:?}");
            assert!(!self.stopped, "moves after an emergency stop: {frame:?}");
            let armed = |motor: Motor| self.bus.is_motor_armed(motor.handle());
            assert!(self.motors[owner].is_some_and(armed), "moves while disarmed: {frame:?}");
        }
    }

    /// I4: where time did not move on, everything is zero in that cycle, no motor is armed, and no feedback is fresh.
    fn check_lost_time(&mut self) {
        for (index, alone) in self.alone.iter_mut().enumerate() {
            alone.lose_time();
            assert!(alone.word == 0 && !alone.is_armed(), "I4: {index} without time: {alone:?}");
            let Some(motor) = self.motors[index] else { continue };
            let link = self.bus.link(motor.handle());
            assert!(link != Some(Link::Online), "I4: {index} is fresh without time: {alone:?}");
            assert!(!self.bus.is_motor_armed(motor.handle()), "armed without time: {alone:?}");
        }
    }

    /// I4 and I9, after an update whose time moved on.
    fn check_motors(&mut self, now: u64) {
        for (index, alone) in self.alone.iter_mut().enumerate() {
            alone.check_range(index, now);
            let Some(motor) = alone.motor else { continue };
            let old = is_old(now, alone.heard, LATE_US) || is_old(now, alone.commanded, COMMAND_US);
            assert!(!old || alone.word == 0, "I4: motor {index} at {now}: {alone:?}");
            let kept = index == INTEGRATOR && alone.first_velocity && alone.word != 0;
            assert!(!kept, "I9: an integral outlived its rest: {alone:?}");
            // A loop that has run since it was at rest may integrate from now on.
            alone.moved |= alone.commanded.is_some() && !old;
            alone.first_velocity &= old;
            if is_old(now, alone.commanded, COMMAND_US) {
                alone.commanded = None;
            }
            if !alone.is_armed() || alone.bus.link(motor.handle()) == Some(Link::Offline) {
                alone.rest();
            }
        }
    }

    /// Feedback from the future: the whole bus may notice it later than the motor alone, but not after twice the limit.
    fn look_at_what_lies_ahead(&mut self, now: u64) {
        for index in 0..COUNT {
            let alone = &mut self.alone[index];
            let Some(motor) = self.motors[index] else { continue };
            let noticed = self.bus.link(motor.handle()) != Some(Link::Online);
            let ahead = lies_ahead(now, alone.heard, LATE_US);
            if alone.doubted.is_none() {
                if noticed || !ahead || alone.link() == Some(Link::Online) {
                    continue;
                }
                alone.doubted = Some(now);
            }
            let since = alone.doubted.map_or(0, |since| now.saturating_sub(since));
            // Where the time has caught up, it need not be noticed any more.
            if noticed || !ahead {
                self.settled(index);
            } else {
                assert!(since < 2 * LATE_US, "I4: {index} lies ahead for {since} us: {alone:?}");
            }
        }
    }

    /// Before the first update, time passes for all with each good frame: whoever it makes known to be lost, and is not lost
    /// alone, starts anew. So do the others when it sets the clock back: alone they would not arm then.
    fn pass(&mut self, now: u64, owner: Option<usize>) {
        let before = core::mem::replace(&mut self.clock, now);
        let (is_pause, is_reset) = (now > before + PAUSE_US, before > now + PAUSE_US);
        for index in 0..COUNT {
            let Some(motor) = self.motors[index] else { continue };
            let (motor, alone) = (motor.handle(), &self.alone[index]);
            let (link, conditions) = (self.bus.link(motor), self.bus.conditions(motor));
            let is_own = owner == Some(index);
            if link != alone.link() || conditions != alone.conditions() {
                let is_bygone = |at: u64| is_pause || stamped_age(now, at) > PAUSE_US;
                // Its own frame may be enough to bring it back.
                let gone =
                    if is_own { link != Some(Link::Late) } else { link == Some(Link::Offline) };
                let lost = alone.heard.is_some_and(is_bygone) && gone;
                let forgotten = alone.commanded.is_some_and(is_bygone)
                    && conditions.contains(Condition::CommandLost);
                assert!(lost || forgotten, "I8: {index} is {link:?} at {now}: {alone:?}");
            } else if !is_reset || is_own {
                continue;
            }
            self.plug(index);
            self.plug(index);
        }
    }

    /// A motor that was refused alone knows nothing of the time at which the bus was armed: it starts anew where an update lies
    /// before that.
    fn forget_the_unknowing(&mut self) {
        for index in 0..COUNT {
            let knows = self.alone[index].has(Condition::ClockFault);
            if self.motors[index].is_some() && !knows {
                self.plug(index);
                self.plug(index);
            }
        }
    }

    /// What is known of each motor does not depend on the others.
    fn compare(&self) {
        for (motor, alone) in self.motors.iter().zip(&self.alone) {
            let (Some(motor), Some(same)) = (motor, alone.motor) else { continue };
            if alone.doubted.is_none() {
                let (one, other) = (motor.handle(), same.handle());
                assert_eq!(self.bus.state(one), alone.bus.state(other), "I8: depends on others");
                assert_eq!(self.bus.conditions(one), alone.bus.conditions(other), "I8");
                assert_eq!(self.bus.is_motor_armed(one), alone.is_armed(), "I8");
            }
        }
    }

    /// Reads every edge that waits: each motor's are those of the motor alone, none lost and none told twice. With more
    /// than the journal holds, their times are not.
    fn read_edges(&mut self) {
        let edges: Vec<Edge<Condition, MotorName>> =
            core::iter::from_fn(|| self.bus.next_edge()).collect();
        let untimed = core::mem::replace(&mut self.untimed, self.updated.is_none());
        let timed = edges.len() <= 12 && !untimed;
        let known = |edge: &Edge<Condition, MotorName>| {
            (edge.condition, edge.began, timed.then_some(edge.at))
        };
        for alone in &mut self.alone {
            let same = alone.edges();
            let Some(name) = alone
                .motor
                .and_then(|motor| alone.bus.motors().find(|(handle, _)| *handle == motor.handle()))
            else {
                continue;
            };
            if alone.doubted.is_some() {
                continue;
            }
            let mine = sorted(edges.iter().filter(|edge| edge.source == name.1).copied().collect());
            assert!(mine.iter().map(known).eq(same.iter().map(known)), "I8: {mine:?} and {same:?}");
        }
        self.edges.extend(edges);
    }

    /// A command frame of another node: a second master of the motors in it. It is remembered for the whole bus, so that
    /// a motor with an older one is told of it again.
    fn hear_rival(&mut self, frame: &CanFrame, now: Instant) {
        let header = frame.header();
        let in_use = |(facts, motor): (&crate::motors::Facts, &Option<Motor>)| {
            motor.is_some() && u32::from(facts.command_id) == header
        };
        if !FACTS.iter().zip(&self.motors).any(in_use) {
            return;
        }
        for (alone, facts) in self.alone.iter_mut().zip(&FACTS) {
            let own = CanFrame::standard(facts.command_id, [0; 8]);
            if u32::from(facts.command_id) == header || alone.has(Condition::SecondMaster) {
                let outcome = own.map(|own| alone.bus.ingest(&own, now));
                assert_eq!(outcome, Some(Ingest::Unrelated));
            }
        }
    }
}

/// What is known of a motor's word on the wire.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Wire {
    /// It was sent last.
    Shows(i16),
    /// Its frame was given back, and waits for the next update.
    Waits,
    /// Its frame has to be offered.
    Due,
    /// The motor came or left.
    Unknown,
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
        if let (Verdict::Taken, Some(owner)) = (expected, owner) {
            self.settled(owner);
        }
        let outcome = self.noting_trips(|bus| bus.ingest(frame, now));
        let verdict = match outcome {
            Ingest::Taken => Verdict::Taken,
            Ingest::WrongLength(_) | Ingest::WrongField => Verdict::Malformed,
            Ingest::Unrelated if expected == Verdict::Unattached => Verdict::Unattached,
            Ingest::Unrelated => Verdict::Unrelated,
        };
        assert_eq!(verdict, expected, "{frame:?}");
        match (expected, owner) {
            (Verdict::Taken, Some(owner)) => {
                let alone = &mut self.alone[owner];
                let was_armed = alone.is_armed();
                assert_eq!(alone.bus.ingest(frame, now), Ingest::Taken, "I8");
                if !was_armed && alone.is_armed() {
                    assert!(!alone.lost_time, "resumes after time was lost: {alone:?}");
                    alone.opened = Some(now.as_micros());
                }
                if self.updated.is_none() {
                    self.pass(now.as_micros(), Some(owner));
                }
                self.alone[owner].heard = Some(as_stamped(now.as_micros(), self.clock));
            }
            (Verdict::Malformed, _) => self.malformed += 1,
            (Verdict::Unattached, _) => self.unattached += 1,
            _ => self.hear_rival(frame, now),
        }
        outcome
    }

    fn update(&mut self, tick: Tick) {
        let now = tick.now().as_micros();
        let lost = self.updated.is_some_and(|updated| now <= updated) || now < self.armed_at;
        let holds = !lost && TimeStep::new(tick.dt_s(), 0.02).is_hold();
        let is_long = self.updated.is_some_and(|updated| now > updated + LATE_US);
        let step = (!lost).then(|| self.updated.map_or(0, |updated| now - updated));
        self.gesture.update(step);
        self.noting_trips(|bus| bus.update(tick));
        let is_after_the_last = self.updated.is_none_or(|updated| updated < now);
        self.each_alone(|alone| {
            if lost {
                alone.lose_update(tick, is_after_the_last);
            } else {
                alone.update(tick);
            }
        });
        if lost {
            self.forget_the_unknowing();
        }
        if self.updated.is_none() {
            self.pass(now, None);
        }
        (self.updated, self.clock) = (Some(now), now);
        self.now = now;
        if lost {
            self.armed_at = 0;
            self.check_lost_time();
        } else if holds {
            self.held += 1;
            let zero = self.held < 2 && !is_long || self.alone.iter().all(|alone| alone.word == 0);
            assert!(zero, "driven without time: {:?}", self.alone);
            let is_new = |alone: &&Alone| alone.has_rested || alone.first_velocity;
            let kept = self.alone.iter().filter(is_new).find(|alone| alone.word != 0);
            assert!(kept.is_none(), "I9: a command outlived its rest: {kept:?}");
        } else {
            self.held = 0;
            self.check_motors(now);
            self.alone.iter_mut().for_each(|alone| alone.has_rested = false);
            self.look_at_what_lies_ahead(now);
        }
        for alone in &mut self.alone {
            alone.count_time(now, holds);
            assert!(alone.word == 0 || !alone.lost_time, "driven after time was lost: {alone:?}");
        }
        for wire in self.wire.iter_mut().filter(|wire| **wire == Wire::Waits) {
            *wire = Wire::Due;
        }
        self.compare();
        self.add_up();
    }

    fn next_frame(&mut self) -> Option<CanFrame> {
        let Some(frame) = self.bus.next_frame() else {
            assert_eq!(self.add_up(), 0, "I6: nothing waits, and something is missing");
            for (wire, alone) in self.wire.iter().zip(&self.alone) {
                let same = match *wire {
                    Wire::Shows(word) => word == alone.word || alone.doubted.is_some(),
                    Wire::Due => false,
                    Wire::Waits | Wire::Unknown => true,
                };
                assert!(same, "I7: {wire:?} is what is left on the wire: {alone:?}");
            }
            return None;
        };
        self.taken_out += 1;
        self.check_frame(&frame);
        let words = words(&frame);
        self.note_wire(&frame, |place| Wire::Shows(words[place]));
        Some(frame)
    }

    fn requeue(&mut self, frame: &CanFrame) -> bool {
        let own = self.bus.requeue(frame);
        let known = FACTS.iter().any(|facts| u32::from(facts.command_id) == frame.header());
        assert_eq!(own, known, "{frame:?}");
        self.given_back += u32::from(own);
        self.note_wire(frame, |_| Wire::Waits);
        own
    }

    fn put_back(&mut self, frame: &CanFrame) -> bool {
        let own = CanDevice::put_back(&mut self.bus, frame);
        self.given_back += u32::from(own);
        self.note_wire(frame, |_| Wire::Waits);
        own
    }

    fn superseded(&self) -> u32 {
        CanDevice::superseded(&self.bus)
    }

    fn claims(&self) -> impl Iterator<Item = Claim> {
        self.bus.claims()
    }

    fn missing(&self, now: Instant) -> impl Iterator<Item = MotorName> {
        self.bus.missing(now)
    }

    fn faulty(&self) -> impl Iterator<Item = (MotorName, Conditions)> {
        self.bus.faulty()
    }

    fn wrong_setting(&self) -> Option<WrongSetting> {
        self.bus.wrong_setting()
    }
    fn second_master(&self) -> Option<Claim> {
        self.bus.second_master()
    }

    fn next_edge(&mut self) -> Option<Edge<Condition, MotorName>> {
        if self.edges.is_empty() {
            self.read_edges();
        }
        self.edges.pop_front()
    }

    fn ask(&mut self) -> bool {
        let granted = self.gesture.ask();
        assert_eq!(self.bus.ask(), granted, "a request counts: {:?}", self.gesture);
        granted
    }

    /// All conditions hold, says [`Devices::arm`].
    fn engage(&mut self, now: Instant) {
        assert!(!self.stopped, "armed while stopped");
        // Of one in doubt the bus may not know yet that it is late.
        let missing =
            |alone: &&Alone| alone.doubted.is_none() && alone.bus.missing(now).next().is_some();
        let missing = self.alone.iter().find(missing);
        assert!(missing.is_none(), "armed without all motors: {missing:?}");
        let unfit = self
            .alone
            .iter()
            .any(|alone| alone.has(Condition::SecondMaster) || alone.bus.faulty().next().is_some());
        assert!(!unfit, "armed beside a second master, or with a fault: {:?}", self.alone);
        CanDevice::engage(&mut self.bus, now);
        assert!(self.bus.is_armed(), "granted, and not armed");
        self.engaged(now, &[0, 1, 2, 3, 4]);
    }

    fn disarm(&mut self) {
        self.bus.disarm();
        self.tripped = [false; COUNT];
        self.each_alone(|alone| {
            alone.bus.disarm();
            alone.rest();
        });
        assert!(self.alone.iter().all(|alone| alone.word == 0), "disarmed is zero at once");
        assert!(!self.bus.is_armed());
    }

    fn trip(&mut self) {
        CanDevice::trip(&mut self.bus);
        self.gesture.trip();
        self.tripped = [false; COUNT];
        self.each_alone(|alone| {
            CanDevice::trip(&mut alone.bus);
            alone.rest();
        });
        assert!(self.alone.iter().all(|alone| alone.word == 0), "tripped is zero at once");
        assert!(!self.bus.is_armed());
    }

    fn is_armed(&self) -> bool {
        self.bus.is_armed()
    }

    fn emergency_stop(&mut self) {
        if !self.stopped {
            self.gesture.trip();
            self.tripped = [false; COUNT];
        }
        self.bus.emergency_stop();
        self.each_alone(|alone| {
            alone.bus.emergency_stop();
            alone.rest();
        });
        self.stopped = true;
        assert!(self.alone.iter().all(|alone| alone.word == 0), "stopped is zero at once");
    }

    fn clear_emergency_stop(&mut self) {
        if self.stopped {
            self.gesture.trip();
        }
        self.bus.clear_emergency_stop();
        self.alone.iter_mut().for_each(|alone| alone.bus.clear_emergency_stop());
        self.stopped = false;
    }

    fn is_stopped(&self) -> bool {
        assert_eq!(self.bus.is_stopped(), self.stopped);
        self.stopped
    }
}

impl Devices for Watched {
    fn visit(&mut self, visitor: &mut impl Visitor) {
        visitor.visit(self);
    }

    // No two of the five do, and to look at every pair of ids would take most of the time of the fuzzer.
    fn clash(&mut self) -> Option<(Claim, Claim)> {
        None
    }
}

impl Watched {
    fn engaged(&mut self, now: Instant, chosen: &[usize]) {
        chosen.iter().for_each(|index| self.tripped[*index] = false);
        self.gesture.grant(self.tripped.contains(&true));
        self.now = now.as_micros();
        self.armed_at = self.armed_at.max(self.now);
        for index in chosen {
            if !self.alone[*index].engage(now) {
                self.plug(*index);
                self.plug(*index);
            }
        }
    }

    fn note_wire(&mut self, frame: &CanFrame, shows: impl Fn(usize) -> Wire) {
        for (wire, facts) in self.wire.iter_mut().zip(&FACTS) {
            if u32::from(facts.command_id) == frame.header() {
                *wire = shows(facts.place);
            }
        }
    }
}
