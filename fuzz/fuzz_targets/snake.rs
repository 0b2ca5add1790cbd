//! Any frame, any time, any call: the joints keep their promises.
#![no_main]

use drivetrain::encoder::Position;
use drivetrain::frame::CanFrame;
use drivetrain::motor::{Devices, Ingest, Link};
use drivetrain::snake::{Command, Config, Joint, Joints, Register};
use drivetrain::time::{Instant, Tick};
use drivetrain::units::{Angle, AngularVelocity};
use drivetrain_fuzz::Gesture;
use embedded_can::{ExtendedId, Frame, StandardId};
use libfuzzer_sys::fuzz_target;
use std::hash::{DefaultHasher, Hash, Hasher};

/// The joints of the test.
const IDS: [u8; 3] = [1, 2, 12];

/// From the documentation: late after 40 ms, targets count for 100 ms, an answer is waited for for 2 ms, at most 255 rpm of 65536 pulses a turn.
const LATE_US: u64 = 40_000;
const COMMAND_US: u64 = 100_000;
const REPLY_US: u64 = 2_000;
const FASTEST: i32 = 255 * 65_536 / 60;

/// What has to be written before a joint is enabled.
const BEFORE_ENABLE: [Register; 6] = [
    Register::Mode,
    Register::Current,
    Register::Acceleration,
    Register::Deceleration,
    Register::Speed,
    Register::Position,
];

fuzz_target!(|data: &[u8]| {
    let mut all = Story::new();
    let digest = all.play(data, None);
    // I5 and I10: without the frames that were refused, and otherwise the same, the same is sent, bit for bit.
    assert_eq!(Story::new().play(data, Some(&all.refused)), digest, "a refused frame shows");
});

/// What is known of one joint apart from the crate.
#[derive(Debug, Default)]
struct Known {
    heard: Option<u64>,
    asked: Option<u64>,
    /// The sum of all forward steps since the target was set, and from where the next one counts.
    led_us: u64,
    counted: u64,
    /// The time that a new target gets: of the last good update, or of arming after it.
    stamp: u64,
    /// No update may lie before it.
    armed_at: u64,
    /// Time did not move on since it was armed.
    lost_time: bool,
    gesture: Gesture,
    /// Heard, and asked, since the last good update, which does not know of it yet.
    news: [bool; 2],
    /// The target and the speed that count, where they can be told exactly, and the current.
    target: Option<i32>,
    speed: Option<i32>,
    current: Option<i32>,
    /// The last position that it replied.
    raw: i32,
    written: Vec<Register>,
    /// What it was asked for and has not answered, when, and with which of all frames.
    due: Option<(Register, u64, u32)>,
    /// The same, where that frame came back, but may have been an older one that was given up.
    in_doubt: Option<(Register, u64)>,
    /// Questions that were given up and not answered since.
    given_up: Vec<Register>,
    /// Written to, and not disabled since.
    moves: bool,
    /// It was led and may be no longer: a disable comes first, whatever follows.
    stop_due: bool,
    /// That disable was given back, and waits for the next update.
    stop_returned: bool,
}

impl Known {
    /// What led it until now does so no longer.
    fn end(&mut self) {
        self.stop_due |= self.moves;
    }

    /// A target was taken.
    fn follow(&mut self, target: Option<i32>) {
        (self.asked, self.target) = (Some(self.stamp), target);
        (self.led_us, self.counted) = (0, self.stamp);
        self.news[1] = true;
    }

    /// An update lies at `now`. Whatever the clock shows, a target leads for no longer than its deadline.
    fn count_time(&mut self, now: u64) {
        self.led_us += now.saturating_sub(self.counted);
        self.counted = now;
    }

    /// Time did not move on: nothing is fresh, and nothing is asked for.
    fn lose_time(&mut self) {
        self.end();
        (self.heard, self.asked, self.news) = (None, None, [false; 2]);
        self.lost_time = true;
    }
}

struct Story {
    joints: Joints,
    handles: Vec<Joint>,
    known: [Known; 3],
    now: u64,
    /// The time of the last good update.
    tick: u64,
    /// The greatest time of an update since the last good one.
    clock: u64,
    updated: Option<u64>,
    /// What was done was to disarm, which is no trip.
    disarms: bool,
    /// Of the time that goes on by itself.
    left_ms: u16,
    held: u32,
    /// Frames that wait in the driver, which may still give them back.
    kept: Vec<(CanFrame, u32)>,
    handed_out: u32,
    given_back: u32,
    /// Questions that were handed out and did not come back.
    asked: u32,
    taken: u32,
    malformed: u32,
    unrelated: u32,
    refused: Vec<bool>,
    sent: DefaultHasher,
}

impl Story {
    fn new() -> Self {
        let mut joints = Joints::new().with_frames_per_update(2, 3);
        let handles = IDS.map(|id| joints.attach(Config::new(id)).expect("a free id")).to_vec();
        Self {
            joints,
            handles,
            known: Default::default(),
            now: 0,
            tick: 0,
            clock: 0,
            updated: None,
            disarms: false,
            left_ms: 600,
            held: 0,
            kept: Vec::new(),
            handed_out: 0,
            given_back: 0,
            asked: 0,
            taken: 0,
            malformed: 0,
            unrelated: 0,
            refused: Vec::new(),
            sent: DefaultHasher::new(),
        }
    }

    fn play(&mut self, data: &[u8], without: Option<&[bool]>) -> u64 {
        let mut frames = 0;
        for step in data.as_chunks::<14>().0 {
            let [op, flags, register, length, id, time, payload @ ..] = *step;
            // Forward by up to 33 ms as a rule, and sometimes back.
            let shift = if flags & 16 == 0 { flags & 7 } else { flags & 31 };
            let jump = u64::from(time) << shift;
            self.now = if flags & 32 == 0 {
                self.now.wrapping_add(jump)
            } else {
                self.now.saturating_sub(jump)
            };
            let mut hear = |story: &mut Self, frame: &CanFrame| {
                if !without.is_some_and(|refused| refused[frames]) {
                    story.ingest(frame);
                }
                frames += 1;
            };
            if op >= 250 {
                let span_ms = u16::from(if register < 192 { register % 24 } else { register });
                let span_ms = span_ms.min(self.left_ms);
                self.left_ms -= span_ms;
                self.go_on(Going { op, id, how: time }, span_ms, &mut hear);
                continue;
            }
            let index = usize::from(id) % 3;
            self.watch(|story| match op % 12 {
                // Mostly replies, sometimes anything.
                0..=3 => {
                    if let Some(frame) = frame(op, flags, register, length, id, payload) {
                        hear(story, &frame);
                    }
                }
                9 | 10 => {
                    story.update(flags, payload);
                    story.send(flags);
                }
                // What was left over, whatever has come since the update.
                11 => {
                    if flags & 4 != 0 {
                        let kept = core::mem::take(&mut story.kept);
                        kept.iter().for_each(|(frame, number)| story.give_back(frame, *number));
                    }
                    story.send(flags);
                }
                op => story.call(op, flags, index, payload),
            });
        }
        self.sent.finish()
    }

    /// Some milliseconds as they should be: who was asked answers, but for one that may be silent. The clock is a good one as a
    /// rule.
    fn go_on(&mut self, going: Going, span_ms: u16, mut hear: impl FnMut(&mut Self, &CanFrame)) {
        let Going { op, id, how } = going;
        for ms in 0..span_ms {
            let next = self.now.wrapping_add(1_000);
            self.now = match op {
                // A timer of 8 to 23 bits that is passed on as it is; one that swings; one that stands.
                253 => next & ((1 << (8 + how % 16)) - 1),
                254 if ms % 2 == 0 => self.now.saturating_sub(1_000 * u64::from(how)),
                254 => self.now + 1_000 * u64::from(how) + 1_000,
                255 => self.now,
                _ => next,
            };
            if how & 1 != 0 && ms % 8 == 0 {
                self.watch(|story| story.call(5, 0, usize::from(how >> 4) % 3, [how; 8]));
            }
            if how & 2 != 0 && ms % 8 == 0 {
                self.watch(|story| story.call(6, 0, 0, [0; 8]));
            }
            for (index, raw_id) in IDS.into_iter().enumerate() {
                let known = &self.known[index];
                let Some((register, ..)) = known.due else { continue };
                if usize::from(id % 4) == index {
                    continue;
                }
                let value = match register {
                    Register::Enable => i32::from(known.written.contains(&register)),
                    _ => known.raw,
                };
                let id = StandardId::new(raw_id.into()).expect("an id");
                let reply = CanFrame::new(id, &register.reply(value));
                self.watch(|story| hear(story, &reply.expect("six bytes")));
            }
            self.watch(|story| {
                story.update(0, [0; 8]);
                story.send(0);
            });
        }
    }

    /// Does something, and sees who is no longer armed after that.
    fn watch(&mut self, act: impl FnOnce(&mut Self)) {
        let armed = self.are_armed();
        act(self);
        let disarms = core::mem::take(&mut self.disarms);
        for (index, (before, after)) in armed.into_iter().zip(self.are_armed()).enumerate() {
            if before && !after {
                self.known[index].end();
                if !disarms {
                    self.known[index].gesture.trip();
                }
            }
        }
    }

    fn are_armed(&self) -> [bool; 3] {
        [0, 1, 2].map(|index| self.joints.is_joint_armed(self.handles[index]))
    }

    fn ingest(&mut self, frame: &CanFrame) {
        let rivals = self.joints.counters().foreign_commands;
        let outcome = self.joints.ingest(frame, Instant::from_micros(self.now));
        // Another controller's command is no reply, but noticed: it relaxes its joint.
        let rival = self.joints.counters().foreign_commands != rivals;
        // Nor is the answer of a joint that went refused: nothing is sent to it before.
        let answers = self.answers(frame);
        self.refused.push(outcome != Ingest::Taken && !rival && !answers);
        assert_eq!(outcome == Ingest::Taken, self.is_reply(frame), "{frame:?}: {outcome:?}");
        match outcome {
            Ingest::Taken => {
                self.taken += 1;
                let (register, value) = Register::from_reply(frame.data()).expect("a reply");
                let known = &mut self.known[index_of(frame).expect("of an attached joint")];
                if register == Register::ActualPosition {
                    known.heard = Some(self.now);
                    known.news[0] = true;
                    known.raw = value;
                }
            }
            Ingest::WrongLength(_) | Ingest::WrongField => self.malformed += 1,
            Ingest::Unrelated => self.unrelated += 1,
        }
    }

    /// From a joint that is attached.
    fn is_reply(&self, frame: &CanFrame) -> bool {
        let attached = self.joints.joints().any(|(_, name)| u32::from(name.id()) == frame.header());
        attached && is_reply(frame)
    }

    /// Waits no longer for what a reply answers; `false` when it is none.
    fn answers(&mut self, frame: &CanFrame) -> bool {
        let Some(index) = index_of(frame).filter(|_| is_reply(frame)) else { return false };
        let known = &mut self.known[index];
        let is_this = |register: Register| frame.data().get(1) == Some(&register.as_raw());
        // A question that is answered was sent: the driver has it no longer.
        self.kept.retain(|(kept, _)| match Command::decode(kept.data()) {
            Some(Command::Read(register)) => kept.header() != frame.header() || !is_this(register),
            _ => true,
        });
        known.given_up.retain(|register| !is_this(*register));
        known.in_doubt.take_if(|(register, _)| is_this(*register));
        known.due.take_if(|(register, ..)| is_this(*register));
        true
    }

    fn call(&mut self, op: u8, flags: u8, index: usize, payload: [u8; 8]) {
        let bits = u32::from_le_bytes([payload[0], payload[1], payload[2], payload[3]]);
        let value = f32::from_bits(bits);
        let (joints, joint) = (&mut self.joints, self.handles[index]);
        let known = &mut self.known[index];
        match op {
            4 => {
                let position = Position::from_angle(Angle::from_turns(value));
                if joints.set_position(joint, position).is_ok() {
                    known.follow(None);
                } else {
                    known.end();
                }
            }
            5 => {
                let pulses = bits.cast_signed();
                let offset = joints.offset(joint);
                if joints.set_pulses(joint, pulses).is_ok() {
                    known.follow(offset.map(|offset| pulses.wrapping_add(offset)));
                }
                match joints.set_speed(joint, AngularVelocity::from_rad_per_s(value)) {
                    // Nearly: the last bit is the crate's own affair.
                    Ok(()) => {
                        let pulses = value.abs() * (65_536.0 / core::f32::consts::TAU);
                        known.speed = Some(pulses.round().min(FASTEST as f32) as i32);
                    }
                    Err(_) => known.end(),
                }
            }
            6 => {
                let before = self.are_armed();
                let asked = self.known.iter_mut().zip(&self.handles);
                let granted = asked
                    .filter(|(_, handle)| self.joints.link(**handle).is_some())
                    .fold(true, |granted, (known, _)| known.gesture.ask() && granted);
                if self.joints.arm(Instant::from_micros(self.now)).is_ok() {
                    assert!(!self.joints.is_stopped() && self.joints.is_armed());
                    assert!(granted, "armed without a new request");
                    self.engaged(before);
                }
            }
            7 => match flags & 3 {
                0 => joints.emergency_stop(),
                1 => joints.clear_emergency_stop(),
                2 => {
                    joints.disarm();
                    self.disarms = true;
                }
                _ => {
                    joints.relax(joint);
                    known.end();
                }
            },
            _ => match flags & 3 {
                0 => {
                    if joints.zero(joint).is_ok() {
                        known.end();
                    }
                }
                1 => {
                    let settings = Config::new(1).with_current(bits.cast_signed());
                    if joints.set_settings(joint, &settings).is_ok() {
                        known.current = Some(bits.cast_signed());
                    }
                }
                2 => _ = joints.answer(joint),
                _ => joints.detach(self.handles[2]),
            },
        }
    }

    /// The joints were armed: those that were not before begin.
    fn engaged(&mut self, before: [bool; 3]) {
        for (index, known) in self.known.iter_mut().enumerate() {
            known.stamp = known.stamp.max(self.now);
            known.armed_at = known.armed_at.max(self.now);
            if !before[index] && self.joints.is_joint_armed(self.handles[index]) {
                known.gesture.grant(false);
                known.lost_time = false;
            }
        }
    }

    /// I4: where time did not move on, nothing moves, no joint is armed, and no feedback is fresh.
    fn lose_time(&mut self) {
        for (known, handle) in self.known.iter_mut().zip(&self.handles) {
            (known.stamp, known.armed_at) = (self.now, 0);
            if self.joints.link(*handle).is_none() {
                continue;
            }
            known.lose_time();
            assert!(!self.joints.is_joint_armed(*handle), "I4: armed without time: {known:?}");
            let is_fresh = self.joints.link(*handle) == Some(Link::Online);
            assert!(!is_fresh, "I4: fresh without time: {known:?}");
            let is_driven = self.joints.state(*handle).is_some_and(|state| state.is_driven);
            assert!(!is_driven, "I4: driven without time: {known:?}");
        }
    }

    fn update(&mut self, flags: u8, payload: [u8; 8]) {
        let dt_s = if flags & 1 == 0 {
            0.001
        } else {
            f32::from_le_bytes([payload[0], payload[1], payload[2], payload[3]])
        };
        let bad_steps = self.joints.counters().bad_steps;
        self.joints.update(Tick::new(Instant::from_micros(self.now), dt_s));
        let holds = self.joints.counters().bad_steps != bad_steps;
        let is_armed_later = self.known.iter().any(|known| self.now < known.armed_at);
        let is_lost = is_armed_later || self.updated.is_some_and(|updated| self.now <= updated);
        let step = self.updated.map_or(0, |updated| self.now.saturating_sub(updated));
        self.updated = Some(self.now);
        for known in &mut self.known {
            known.gesture.update((!is_lost).then_some(step));
        }
        assert!(holds || !is_lost, "time does not move on at {}", self.now);
        if is_lost {
            self.lose_time();
        }
        let stands = self.now <= self.clock;
        let is_late = self.now.saturating_sub(self.clock) > LATE_US;
        assert!(holds || dt_s > 0.0 && dt_s.is_finite(), "no time: {dt_s}");
        self.held = if holds { self.held + 1 } else { 0 };
        if self.held >= 2 || holds && is_late {
            self.known.iter_mut().for_each(Known::end);
        }
        self.clock = if holds { self.clock.max(self.now) } else { self.now };
        for known in &mut self.known {
            known.stop_returned = false;
            let waits = |at: u64| {
                self.clock.abs_diff(at) <= REPLY_US
                    && !(holds && stands && u64::from(self.held) * 1_000 > REPLY_US)
            };
            if let Some((register, ..)) = known.due.take_if(|(_, at, _)| !waits(*at)) {
                known.given_up.push(register);
            }
            if let Some((register, _)) = known.in_doubt.take_if(|(_, at)| !waits(*at)) {
                known.given_up.push(register);
            }
        }
        if !holds {
            self.tick = self.now;
            let now = self.now;
            for (known, handle) in self.known.iter_mut().zip(&self.handles) {
                // Its feedback or its target is too old, say.
                if !self.joints.state(*handle).is_some_and(|state| state.is_driven) {
                    known.end();
                }
                known.news = [false; 2];
                (known.stamp, known.armed_at) = (now, 0);
                known.count_time(now);
            }
        }
    }

    fn send(&mut self, flags: u8) {
        for sent in 0.. {
            let Some(frame) = self.joints.next_frame() else { break };
            assert!(sent < 12 + 2 + 3, "I1: bounded");
            (frame.header(), frame.data()).hash(&mut self.sent);
            self.handed_out += 1;
            self.check(&frame);
            let is_read = matches!(Command::decode(frame.data()), Some(Command::Read(_)));
            let keeps = if is_read { 64 } else { 8 };
            if flags & 2 != 0 {
                self.give_back(&frame, self.handed_out);
            } else if flags & keeps != 0 && self.kept.len() < 8 {
                self.kept.push((frame, self.handed_out));
            }
        }
        for known in &self.known {
            let waits = known.due.is_some() || known.in_doubt.is_some() || known.stop_returned;
            assert!(!known.stop_due || waits, "I9: not disabled at once: {known:?}");
        }
        self.add_up();
    }

    fn check(&mut self, frame: &CanFrame) {
        assert!(frame.is_data_frame(), "I3: {frame:?}");
        let index = index_of(frame).unwrap_or_else(|| panic!("I3: nobody's id: {frame:?}"));
        let command = Command::decode(frame.data()).expect("I3: a command");
        let known = &mut self.known[index];
        assert!(known.due.is_none(), "sent while an answer is due: {known:?}");
        if let Command::Read(register) = command {
            assert!(known.in_doubt.is_none(), "asked while an answer may be due: {known:?}");
            known.due = Some((register, self.clock, self.handed_out));
            self.asked += 1;
        }
        if let Command::Write(register, value) = command {
            match register {
                Register::Speed => {
                    assert!((0..=FASTEST).contains(&value), "I2: {frame:?}");
                    let off = known.speed.map_or(0, |speed| speed.abs_diff(value));
                    assert!(off <= 1, "I7: {frame:?}: {known:?}");
                }
                Register::Current => {
                    assert!(value > 0, "I2: {frame:?}");
                    assert!(known.current.is_none_or(|current| current == value), "I7: {frame:?}");
                }
                Register::Position => {
                    assert!(known.target.is_none_or(|target| target == value), "I7: {frame:?}");
                }
                Register::Enable if value != 0 => {
                    let ready = BEFORE_ENABLE.iter().all(|other| known.written.contains(other));
                    assert!(ready, "I9: enabled after {:?} only", known.written);
                }
                _ => {}
            }
            if command == Command::DISABLE {
                known.written.clear();
                (known.moves, known.stop_due) = (false, false);
            } else {
                known.written.push(register);
                known.moves = true;
                assert!(!known.stop_due, "I9: led again before it was disabled: {frame:?}");
            }
        }
        if command.is_safe() {
            return;
        }
        assert!(self.joints.is_joint_armed(self.handles[index]), "moves while disarmed: {frame:?}");
        assert!(!self.joints.is_stopped() && self.held < 2, "moves while stopped: {frame:?}");
        assert!(!known.lost_time, "moves after time was lost: {frame:?}: {known:?}");
        let [heard, asked] = known.news;
        // A reply may be stamped a little ahead of the update.
        let heard = heard || known.heard.is_some_and(|at| self.tick.abs_diff(at) <= LATE_US);
        let in_time = |at: u64| self.tick.checked_sub(at).is_some_and(|age| age <= COMMAND_US);
        let asked = asked || known.asked.is_some_and(in_time) && known.led_us <= COMMAND_US;
        assert!(heard && asked, "I4: {frame:?} at {}: {known:?}", self.tick);
    }

    fn give_back(&mut self, frame: &CanFrame, number: u32) {
        assert!(self.joints.requeue(frame), "{frame:?}");
        self.given_back += 1;
        let known = &mut self.known[index_of(frame).expect("checked before")];
        match Command::decode(frame.data()) {
            Some(Command::DISABLE) => {
                known.written.clear();
                (known.moves, known.stop_due, known.stop_returned) = (true, true, true);
            }
            Some(Command::Write(register, _)) => known.written.retain(|other| *other != register),
            Some(Command::Read(register)) => {
                let back = known.due.take_if(|(_, _, due)| *due == number);
                let in_doubt = back.filter(|_| known.given_up.contains(&register));
                known.in_doubt =
                    in_doubt.map(|(register, at, _)| (register, at)).or(known.in_doubt);
                self.asked -= 1;
            }
            None => {}
        }
    }

    /// I6: every frame that came is somewhere.
    fn add_up(&self) {
        let counters = self.joints.counters();
        assert_eq!((counters.replies, counters.requests), (self.taken, self.asked), "I6");
        let malformed = counters.bad_length + counters.bad_field + counters.foreign_commands;
        assert_eq!(malformed, self.malformed, "I6");
        assert!(counters.unattached <= self.unrelated, "I6");
        let sent = self.handed_out - self.given_back;
        let waiting = counters.packed.checked_sub(counters.superseded + sent);
        assert!(waiting.is_some_and(|waiting| waiting <= 9), "I6: {counters:?}, {sent} sent");
    }
}

/// How time goes on by itself.
#[derive(Debug, Clone, Copy)]
struct Going {
    op: u8,
    id: u8,
    how: u8,
}

/// Whose frame it is, by its id.
fn index_of(frame: &CanFrame) -> Option<usize> {
    IDS.iter().position(|id| u32::from(*id) == frame.header())
}

/// By the protocol: `04`, a register of the table, and its value.
fn is_reply(frame: &CanFrame) -> bool {
    const REGISTERS: [u8; 9] = [6, 7, 8, 9, 10, 11, 12, 15, 16];
    let [kind, register, ..] = *frame.data() else { return false };
    frame.is_data_frame()
        && frame.is_standard()
        && (frame.data().len(), kind) == (6, 4)
        && REGISTERS.contains(&register)
}

fn frame(
    op: u8,
    flags: u8,
    register: u8,
    length: u8,
    id: u8,
    payload: [u8; 8],
) -> Option<CanFrame> {
    let mut bytes = payload;
    if flags & 64 == 0 {
        let position = Register::ActualPosition.as_raw();
        (bytes[0], bytes[1]) = (4, if register < 128 { position } else { register % 0x12 });
    }
    let length = if flags & 128 == 0 { 6 } else { usize::from(length % 9) };
    let id = u16::from(if id < 192 { IDS[usize::from(id) % 3] } else { id % 16 });
    match (op, StandardId::new(id)?, ExtendedId::new(u32::from(id))?) {
        (0..=100, id, _) => CanFrame::new(id, &bytes[..length]),
        (101..=150, id, _) => CanFrame::new_remote(id, length),
        (_, _, id) => CanFrame::new(id, &bytes[..length]),
    }
}
