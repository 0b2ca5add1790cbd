//! Long runs: random frames and calls with the invariants of `docs/faults.md` asserted, and healthy motors that must not
//! raise an alarm.
//!
//! Ignored in the everyday run; `.ci/run` runs them whole, with the same seeds each time, so that a failure is of the change and not
//! of the day. Others are drawn by `DRIVETRAIN_SEED=7`.

#![cfg(test)]

use drivetrain::control::PidConfig;
use drivetrain::dji::{AnyHandle, Bus, Config, Gm6020Voltage, M2006, M3508};
use drivetrain::frame::CanFrame;
use drivetrain::motor::{
    ArmError, Condition, HealthConfig, Ingest, Link, Reaction, TargetError, Timeouts,
};
use drivetrain::time::TimeStep;
use drivetrain::time::{Duration, Instant, Tick};
use drivetrain::units::AngularVelocity;
use embedded_can::{ExtendedId, Frame, StandardId};
use std::thread;

/// Runs `work` on two threads, each with half of `count` and a seed of its own.
fn soak(what: &str, count: u64, work: impl Fn(u64, u64) -> Report + Sync) {
    let seed: u64 = std::env::var("DRIVETRAIN_SEED").map_or(1, |seed| seed.parse().unwrap());
    let seeds = [2 * seed, 2 * seed + 1];
    let start = std::time::Instant::now();
    let reports = thread::scope(|scope| {
        let threads = seeds.map(|seed| {
            let work = &work;
            scope.spawn(move || work(seed, count / 2))
        });
        threads.map(|thread| thread.join().unwrap())
    });
    let seconds = start.elapsed().as_secs_f64();
    println!("soak: {count} {what} in {seconds:.1} s, seeds {seeds:?}");
    reports.iter().for_each(|report| println!("  {report}"));
}

type Report = String;

/// splitmix64: short, and good enough to reach every case.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    fn below(&mut self, bound: u64) -> u64 {
        ((self.next() >> 32) * bound) >> 32
    }
}

/// A motor of the soak: feedback id, command id, slot and limit, from the manuals.
struct Motor {
    feedback: u16,
    command: u32,
    slot: usize,
    limit: i16,
    handle: AnyHandle,
    /// When its last good frame came, and its last accepted target.
    heard: Option<u64>,
    asked: Option<u64>,
    /// That target is a velocity.
    is_velocity: bool,
    /// No loop of it has run, and none took over from a raw command, since it was last at rest.
    is_empty: bool,
    /// It was at rest since the last update in which time passed.
    has_rested: bool,
    /// When it was armed last, as long as it is.
    armed: Option<u64>,
}

impl Motor {
    /// Relaxed, disarmed, stopped, lost, or without a target for too long.
    fn rest(&mut self) {
        self.lose_target();
        self.is_empty = true;
    }

    /// At rest, with its loops as they are.
    fn lose_target(&mut self) {
        self.asked = None;
        self.has_rested = true;
    }

    fn follow(&mut self, is_velocity: bool, now_us: u64) {
        // A target has the time of the update before it.
        self.asked = Some(now_us);
        self.is_velocity = is_velocity;
        // The loop that comes after a raw command goes on from there.
        self.is_empty &= is_velocity;
    }

    fn is_fresh(at: Option<u64>, now_us: u64, limit_us: u64) -> bool {
        at.is_some_and(|at| now_us - at <= limit_us)
    }
}

const LATE_US: u64 = 10_000;
const DEADLINE_US: u64 = 100_000;
/// In which nobody may ask for arming after a trip.
const PAUSE_US: u64 = 100_000;
/// A gap between two updates is no more of that pause.
const LONGEST_STEP_US: u64 = 20_000;
/// In which the output range of a motor opens, but for the integrator.
const OPENING_US: u64 = 200_000;
const SPEED: PidConfig = PidConfig::new(0.6, 6.0, 0.0);

/// Random feedback looks like faults, heat and two motors with one id: a motor that is to run has to be blind to them.
static BLIND: HealthConfig = HealthConfig::new()
    .with_reaction(Condition::Fault, Reaction::Ignore)
    .with_reaction(Condition::DuplicateId, Reaction::Ignore)
    .with_reaction(Condition::Runaway, Reaction::Ignore)
    .with_reaction(Condition::Warm, Reaction::Ignore)
    .with_reaction(Condition::Hot, Reaction::Ignore);

/// These run; the two others are what they look like, nearly always at fault.
const RUNNING: [usize; 3] = [0, 2, 4];

/// The motor whose loop does nothing but integrate: its first output after a rest is zero, or its integral outlived the rest.
const INTEGRATOR: usize = 2;

fn attach(bus: &mut Bus, index: usize) -> AnyHandle {
    let m3508 = |id| Config::<M3508>::new(id).speed_loop(SPEED);
    let voltage = PidConfig::new(1.0, 5.0, 0.0);
    let gm6020 = Config::<Gm6020Voltage>::new(5).speed_loop(voltage);
    match index {
        0 => bus.attach(m3508(1).with_health(&BLIND)).unwrap().into(),
        1 => bus.attach(m3508(2).reversed()).unwrap().into(),
        INTEGRATOR => {
            let integral = PidConfig::new(0.0, 50.0, 0.0);
            // Its range opens at once: a range that is still closed would hide an integral.
            let m2006 = Config::<M2006>::new(4).speed_loop(integral).with_opening(Duration::ZERO);
            bus.attach(m2006.with_health(&BLIND)).unwrap().into()
        }
        3 => bus.attach(Config::<M2006>::new(6)).unwrap().into(),
        _ => bus.attach(gm6020.with_health(&BLIND)).unwrap().into(),
    }
}

fn motors(bus: &mut Bus) -> Vec<Motor> {
    let of = |feedback, command, slot, limit, handle| Motor {
        feedback,
        command,
        slot,
        limit,
        handle,
        heard: None,
        asked: None,
        is_velocity: false,
        is_empty: true,
        has_rested: true,
        armed: None,
    };
    vec![
        of(0x201, 0x200, 0, 16_384, attach(bus, 0)),
        of(0x202, 0x200, 1, 16_384, attach(bus, 1)),
        of(0x204, 0x200, 3, 10_000, attach(bus, 2)),
        of(0x206, 0x1FF, 1, 10_000, attach(bus, 3)),
        of(0x209, 0x2FF, 0, 25_000, attach(bus, 4)),
    ]
}

/// One of the motors alone on a bus that gets no frame but its good ones, whose frames are always taken, and which
/// compares every age in each update: what it sends is what it has to send among others (I5, I7, I8, I10).
struct Alone {
    bus: Bus,
    handle: AnyHandle,
    index: usize,
    word: i16,
}

impl Alone {
    fn new(index: usize) -> Self {
        let mut bus = Bus::new();
        let handle = attach(&mut bus, index);
        Self { bus, handle, index, word: 0 }
    }

    fn update(&mut self, tick: Tick) {
        self.bus = core::mem::take(&mut self.bus).with_timeouts(Timeouts::new());
        self.bus.update(tick);
    }

    fn drain(&mut self, slot: usize) {
        while let Some(frame) = self.bus.next_frame() {
            self.word = word(&frame, slot);
        }
    }
}

fn word(frame: &CanFrame, slot: usize) -> i16 {
    i16::from_be_bytes([frame.bytes()[2 * slot], frame.bytes()[2 * slot + 1]])
}

/// What the test expects of the bus, counted by itself.
#[derive(Default)]
struct Books {
    offered: u64,
    taken: u64,
    unrelated: u64,
    bad_length: u32,
    bad_field: u32,
    unattached: u32,
    taken_out: u32,
    given_back: u32,
    nonzero: u64,
    compared: u64,
    from_rest: u64,
    armed: u64,
    armed_after_a_trip: u64,
    too_soon: u64,
    opening: u64,
}

struct Soak {
    bus: Bus,
    alone: Alone,
    motors: Vec<Motor>,
    books: Books,
    random: Random,
    now_us: u64,
    /// A motor was relaxed since the last arming, other than by `disarm`.
    tripped: bool,
    /// The updates since the last request to arm, or trip.
    quiet_us: u64,
    /// Of everything that was sent: I10.
    digest: u64,
}

impl Soak {
    fn new(seed: u64, chosen: usize) -> Self {
        let mut bus = Bus::new();
        let motors = motors(&mut bus);
        let (books, random) = (Books::default(), Random(seed));
        let alone = Alone::new(chosen);
        let (tripped, quiet_us) = (false, 0);
        Self { bus, alone, motors, books, random, now_us: 1, tripped, quiet_us, digest: 0 }
    }

    fn now(&self) -> Instant {
        Instant::from_micros(self.now_us)
    }

    /// Every other frame is good feedback of one of the motors; the others are anything.
    fn frame(&mut self) {
        let bits = self.random.next();
        let data = self.random.next().to_be_bytes();
        let (frame, mine) = if bits & 1 == 0 {
            let index = usize::try_from((bits >> 8) % 5).unwrap();
            let [high, rest @ ..] = data;
            let [b, c, d, e, f, g, h] = rest;
            let data = [high & 0x1F, b, c, d, e, f, g, h];
            (CanFrame::standard(self.motors[index].feedback, data), Some(index))
        } else {
            (self.any_frame(bits, &data), None)
        };
        let Some(frame) = frame else { return };
        let outcome = self.bus.ingest(&frame, self.now());
        self.books.offered += 1;
        self.check_outcome(&frame, mine, outcome);
    }

    fn any_frame(&self, bits: u64, data: &[u8; 8]) -> Option<CanFrame> {
        let mut near = u16::try_from(0x1F8 + (bits >> 8) % 24).ok()?;
        if (0x1FE..=0x200).contains(&near) && bits >> 40 & 0x1FFF != 0 {
            // A second master is heard now and then only: for a second, nobody is armed beside it.
            near = 0x1FD;
        }
        let length = usize::try_from((bits >> 16) % 9).ok()?;
        let standard = StandardId::new(near)?;
        match bits >> 1 & 7 {
            // Ids of the family and around it, often with 8 bytes.
            0..=2 => {
                CanFrame::new(standard, &data[..if bits & 0x1000_0000 == 0 { 8 } else { length }])
            }
            3 => CanFrame::new(
                StandardId::new(u16::try_from(bits >> 20 & 0x7FF).ok()?)?,
                &data[..length],
            ),
            4 => CanFrame::new_remote(standard, length),
            5 => CanFrame::new(ExtendedId::new(u32::from(near))?, data),
            6 => {
                CanFrame::new(ExtendedId::new(u32::try_from(bits >> 32 & 0x1FFF_FFFF).ok()?)?, data)
            }
            _ => CanFrame::new_remote(ExtendedId::new(u32::from(near))?, length),
        }
    }

    /// I5 and I6: the outcome is what the form of the frame says.
    fn check_outcome(&mut self, frame: &CanFrame, mine: Option<usize>, outcome: Ingest) {
        let id = match frame.id() {
            embedded_can::Id::Standard(id) if frame.is_data_frame() => id.as_raw(),
            _ => 0,
        };
        let owner = mine.or_else(|| self.motors.iter().position(|motor| motor.feedback == id));
        let family = (0x201..=0x20B).contains(&id);
        let books = &mut self.books;
        match (owner, frame.dlc(), frame.bytes()[0]) {
            (None, ..) => {
                assert_eq!(outcome, Ingest::Unrelated, "{frame:?}");
                books.unrelated += 1;
                books.unattached = books.unattached.saturating_add(u32::from(family));
            }
            (Some(_), 0..=7, _) => {
                assert_eq!(outcome, Ingest::WrongLength(frame.length()));
                books.bad_length = books.bad_length.saturating_add(1);
            }
            (Some(_), _, 0x20..) => {
                assert_eq!(outcome, Ingest::WrongField, "{frame:?}");
                books.bad_field = books.bad_field.saturating_add(1);
            }
            (Some(owner), ..) => {
                assert_eq!(outcome, Ingest::Taken, "{frame:?}");
                books.taken += 1;
                self.motors[owner].heard = Some(self.now_us);
                if owner == self.alone.index {
                    let same = self.alone.bus.ingest(frame, Instant::from_micros(self.now_us));
                    assert_eq!(same, Ingest::Taken);
                }
            }
        }
        let is_command = self.motors.iter().any(|motor| motor.command == u32::from(id));
        if is_command && frame.is_data_frame() {
            self.hear_rival(u32::from(id));
        }
    }

    /// A second master is remembered for the whole bus: a motor that has one is told again.
    fn hear_rival(&mut self, command: u32) {
        let now = self.now();
        let alone = &mut self.alone;
        let own = self.motors[alone.index].command;
        if own == command || alone.bus.conditions(alone.handle).contains(Condition::SecondMaster) {
            let id = u16::try_from(own).unwrap();
            _ = alone.bus.ingest(&CanFrame::standard(id, [0; 8]).unwrap(), now);
        }
    }

    fn call(&mut self) {
        let bits = self.random.next();
        let index = usize::try_from(bits % 5).unwrap();
        let value = f32::from_bits(u32::try_from(bits >> 32).unwrap());
        let now = self.now();
        let motor = &mut self.motors[index];
        let alone = (index == self.alone.index).then_some((&mut self.alone.bus, self.alone.handle));
        let each = [Some((&mut self.bus, motor.handle)), alone];
        let mut done = Vec::new();
        for (bus, handle) in each.into_iter().flatten() {
            match bits >> 8 & 31 {
                0..=7 => {
                    #[expect(clippy::cast_possible_truncation, reason = "any word")]
                    done.push(bus.set_raw(handle, (bits >> 40) as i16));
                }
                8..=15 => {
                    let velocity = if bits & 0x10_0000 == 0 { value } else { 20.0 };
                    let velocity = AngularVelocity::from_rad_per_s(velocity);
                    done.push(bus.set_velocity(handle, velocity));
                }
                16 => bus.relax(handle),
                21 => _ = bus.zero(handle),
                _ => {}
            }
        }
        assert!(done.iter().all(|one| *one == done[0]), "I8: {done:?}");
        match done.first() {
            Some(Ok(())) => motor.follow(bits >> 8 & 31 > 7, self.now_us),
            Some(Err(TargetError::NotFinite | TargetError::NoFeedback)) => motor.lose_target(),
            None if bits >> 8 & 31 == 16 => motor.rest(),
            _ => {}
        }
        // Their masks leave the bits 8 to 12 out, which are the number of the call: 16 and above all have the bit 12.
        match bits >> 8 & 31 {
            17 if bits & 0xF_E000 == 0 => {
                self.look_who_rests();
                // Not a trip.
                self.motors.iter_mut().for_each(|motor| motor.armed = None);
                self.both(Bus::disarm);
            }
            18 if bits & 0xF_E000 == 0 && !self.bus.is_stopped() => {
                self.both(Bus::emergency_stop);
                self.trip();
            }
            19..=20 if self.bus.is_stopped() => {
                self.both(Bus::clear_emergency_stop);
                self.trip();
            }
            22..=26 => self.arm(now, &RUNNING),
            27.. => self.arm(now, &[0, 1, 2, 3, 4]),
            _ => {}
        }
    }

    fn both(&mut self, work: impl Fn(&mut Bus)) {
        work(&mut self.bus);
        work(&mut self.alone.bus);
        self.look_who_rests();
        self.alone.drain(self.motors[self.alone.index].slot);
    }

    fn trip(&mut self) {
        (self.tripped, self.quiet_us) = (true, 0);
    }

    /// Arming is a gesture: after a trip the application mostly waits until it may ask again.
    fn arm(&mut self, now: Instant, which: &[usize]) {
        let handles: Vec<AnyHandle> =
            which.iter().map(|index| self.motors[*index].handle).collect();
        self.look_who_rests();
        let has_waited = self.quiet_us >= PAUSE_US;
        if self.tripped && !has_waited && self.random.below(500) > 0 {
            return;
        }
        let armed = self.bus.arm_only(&handles, now);
        self.quiet_us = 0;
        self.books.too_soon += u64::from(armed == Err(ArmError::NotReleased));
        if armed.is_err() {
            assert!(armed != Err(ArmError::NotReleased) || (self.tripped && !has_waited));
            return;
        }
        assert!(!self.tripped || has_waited, "armed too soon after a trip");
        self.books.armed_after_a_trip += u64::from(self.tripped);
        self.tripped = false;
        for index in which {
            let motor = &mut self.motors[*index];
            self.books.armed += u64::from(motor.armed.is_none());
            motor.armed = motor.armed.or(Some(self.now_us));
        }
        if which.contains(&self.alone.index) {
            assert_eq!(self.alone.bus.arm(now), Ok(()), "I8: armed among others only");
        }
    }

    /// Who is not armed, or lost, rests. Who was armed and was not disarmed has tripped.
    fn look_who_rests(&mut self) {
        let mut trips = false;
        for motor in &mut self.motors {
            let is_lost = self.bus.link(motor.handle) == Some(Link::Offline);
            let is_armed = self.bus.is_motor_armed(motor.handle);
            if is_lost || !is_armed {
                motor.rest();
            }
            trips |= motor.armed.is_some() && !is_armed;
            motor.armed = motor.armed.filter(|_| is_armed);
        }
        if trips {
            self.trip();
        }
    }

    /// What an update in which time passed did to the motors.
    fn look_who_ran(&mut self) {
        for motor in &mut self.motors {
            motor.has_rested = false;
            if !Motor::is_fresh(motor.heard, self.now_us, LATE_US) || motor.asked.is_none() {
                continue;
            }
            if Motor::is_fresh(motor.asked, self.now_us, DEADLINE_US) {
                motor.is_empty = false;
            } else {
                motor.rest();
            }
        }
    }

    /// Time goes on, mostly by a millisecond, sometimes by much more.
    fn update(&mut self) {
        // What frames and calls tripped has the time of now.
        self.look_who_rests();
        let bits = self.random.next();
        let before_us = self.now_us;
        self.now_us += match bits & 0xFF {
            0 => bits >> 8 & 0x3_FFFF,
            1 if bits & 0xFF00 == 0 => bits >> 20 & 0xFFFF_FFFF,
            2..=20 => bits >> 8 & 0x3FF,
            _ => 1_000,
        };
        let dt_s = if bits >> 56 == 0 {
            f32::from_bits(u32::try_from(bits & 0xFFFF_FFFF).unwrap())
        } else {
            0.001
        };
        let step_us = self.now_us - before_us;
        self.quiet_us = if step_us > 0 { self.quiet_us + step_us.min(LONGEST_STEP_US) } else { 0 };
        let tick = Tick::new(self.now(), dt_s);
        self.bus.update(tick);
        self.alone.update(tick);
        self.alone.drain(self.motors[self.alone.index].slot);
        let (one, other) = (self.motors[self.alone.index].handle, self.alone.handle);
        assert_eq!(self.bus.state(one), self.alone.bus.state(other), "I8");
        // The last words stay for one update whose step is unusable, and none where time stands.
        let moved_on = self.now_us > before_us;
        let has_time = !TimeStep::new(dt_s, 0.02).is_hold() && moved_on;
        let is_armed = |motor: &Motor| self.bus.is_motor_armed(motor.handle);
        assert!(moved_on || !self.motors.iter().any(is_armed), "armed where time stands");
        self.look_who_rests();
        // Each bit is a frame that the driver gives back; or it is full, and the others wait.
        let refuses = if bits >> 48 & 7 == 0 { bits >> 52 } else { 0 };
        let mut drained = false;
        for sent in 0.. {
            let Some(frame) = self.bus.next_frame() else {
                drained = true;
                break;
            };
            assert!(sent < 3, "more frames than there are");
            self.books.taken_out = self.books.taken_out.wrapping_add(1);
            self.check_frame(&frame, has_time);
            if refuses >> sent & 1 == 1 {
                assert!(self.bus.requeue(&frame));
                self.books.given_back = self.books.given_back.wrapping_add(1);
            }
            if refuses & 8 != 0 {
                break;
            }
        }
        if has_time {
            self.look_who_ran();
        }
        self.check_books(drained);
    }

    /// I2 to I4 and I7 to I9 on a frame.
    fn check_frame(&mut self, frame: &CanFrame, has_time: bool) {
        assert!(frame.is_data_frame() && frame.dlc() == 8);
        assert!([0x200, 0x1FF, 0x2FF].contains(&frame.header()), "{frame:?}");
        let bytes = u64::from_be_bytes(*frame.bytes());
        self.digest = (self.digest ^ bytes ^ u64::from(frame.header()))
            .rotate_left(7)
            .wrapping_mul(0x100_0000_01B3);
        for slot in 0..4 {
            let word = word(frame, slot);
            let owner = self
                .motors
                .iter()
                .position(|motor| motor.command == frame.header() && motor.slot == slot);
            if owner == Some(self.alone.index) {
                assert_eq!(word, self.alone.word, "I7 or I8: not what it sends alone: {frame:?}");
                self.books.compared += u64::from(word != 0);
            }
            if owner == Some(INTEGRATOR) {
                let motor = &self.motors[INTEGRATOR];
                let is_first = motor.is_empty && motor.is_velocity && motor.asked.is_some();
                assert!(!is_first || word == 0, "I9: something outlived the rest: {frame:?}");
                let is_heard = Motor::is_fresh(motor.heard, self.now_us, LATE_US);
                self.books.from_rest += u64::from(is_first && is_heard && has_time);
            }
            if word == 0 {
                continue;
            }
            let owner = owner.unwrap_or_else(|| panic!("a slot of nobody: {frame:?}"));
            let motor = &self.motors[owner];
            let since_us = motor.armed.map_or(0, |armed| self.now_us - armed);
            if owner != INTEGRATOR && since_us < OPENING_US {
                // In units of 1.024 ms.
                let share = (since_us + 2 * 1_024) as f64 / OPENING_US as f64;
                let open = share.min(1.0) * f64::from(motor.limit);
                assert!(f64::from(word).abs() <= open + 1.0, "{since_us} us: {frame:?}");
                self.books.opening += 1;
            }
            assert!((-motor.limit..=motor.limit).contains(&word), "{frame:?}");
            assert!(
                !self.bus.is_stopped() && self.bus.is_motor_armed(motor.handle),
                "driven unarmed: {frame:?}"
            );
            self.books.nonzero += 1;
            assert!(has_time || !motor.has_rested, "I9: held from before a rest: {frame:?}");
            if has_time {
                let fresh = |at, limit_us| Motor::is_fresh(at, self.now_us, limit_us);
                assert!(fresh(motor.heard, LATE_US), "driven without feedback: {frame:?}");
                assert!(fresh(motor.asked, DEADLINE_US), "driven without a target: {frame:?}");
            }
        }
    }

    /// I6, on both sides.
    fn check_books(&self, drained: bool) {
        let (books, counters) = (&self.books, self.bus.counters());
        let refused = u64::from(books.bad_length) + u64::from(books.bad_field);
        assert_eq!(books.offered, books.taken + books.unrelated + refused);
        assert_eq!(
            (counters.bad_length, counters.bad_field, counters.unattached),
            (books.bad_length, books.bad_field, books.unattached)
        );
        let came = counters.packed.wrapping_add(books.given_back);
        let waiting = came.wrapping_sub(books.taken_out.wrapping_add(counters.superseded));
        assert!(waiting <= if drained { 0 } else { 3 }, "{waiting} frames are nowhere");
    }

    fn run(&mut self, frames_and_calls: u64) {
        for _ in 0..frames_and_calls / 32 {
            for _ in 0..26 {
                self.frame();
            }
            for _ in 0..5 {
                self.call();
            }
            self.update();
        }
    }
}

#[test]
#[ignore = "10^9 frames and calls: by .ci/run"]
fn random_frames_and_calls_keep_the_invariants() {
    soak("frames and calls", 1_000_000_000, |seed, count| {
        // I10: the same again gives the same, bit for bit.
        let again = [0, 1].map(|_| {
            let mut soak = Soak::new(seed, 0);
            soak.run(100_000);
            soak.digest
        });
        assert_eq!(again[0], again[1]);
        // Each of the motors is compared with itself alone, in a part of the run.
        let parts: Vec<String> = (0..5)
            .map(|chosen| {
                let mut soak = Soak::new(5 * seed + chosen as u64, chosen);
                soak.run(count / 5);
                let books = &soak.books;
                let least = if RUNNING.contains(&chosen) { count / 20_000 } else { 0 };
                assert!(books.nonzero > count / 2_000, "{}: hardly ever ran", books.nonzero);
                assert!(books.compared >= least, "{}: {chosen} hardly ever ran", books.compared);
                assert!(books.from_rest > count / 150_000, "{}: hardly ever from rest", books.from_rest);
                assert!(books.taken * 2 > books.offered, "half of the frames are good");
                assert!(books.armed_after_a_trip > count / 500_000, "{}: hardly ever armed after a trip", books.armed_after_a_trip);
                assert!(books.too_soon > count / 2_500_000, "{}: hardly ever asked too soon", books.too_soon);
                assert!(books.opening > count / 20_000, "{}: hardly ever opening", books.opening);
                format!(
                    "{} frames: {} taken, {} of others, {} of a wrong length, {} with a bad field; {} sent, {} given back, {} words not zero, {} of them compared, {} first ones after a rest, {} while the range opened; {} times armed, {} after a trip, {} times too soon",
                    books.offered,
                    books.taken,
                    books.unrelated,
                    books.bad_length,
                    books.bad_field,
                    books.taken_out,
                    books.given_back,
                    books.nonzero,
                    books.compared,
                    books.from_rest,
                    books.opening,
                    books.armed,
                    books.armed_after_a_trip,
                    books.too_soon
                )
            })
            .collect();
        parts.join("\n  ")
    });
}

/// A motor that does what it is told: first order, in rotor counts.
struct Healthy {
    feedback: u16,
    command: u32,
    slot: usize,
    handle: AnyHandle,
    /// Rotor rpm of full command without load.
    fastest_rpm: f64,
    limit: f64,
    wanted_rpm: f64,
    gear: f64,
    rpm: f64,
    counts: f64,
    word: i16,
    /// Rotor counts at the first frame.
    first: Option<i64>,
}

impl Healthy {
    /// One millisecond.
    fn turn(&mut self) {
        let drive = f64::from(self.word) / self.limit * self.fastest_rpm;
        // 50 ms to no-load speed, as `resolve_gap` takes it.
        self.rpm += (drive - self.rpm) * (1.0 / 50.0);
        self.counts += self.rpm * (8192.0 / 60_000.0);
    }

    fn whole_counts(&self) -> i64 {
        #[expect(clippy::cast_possible_truncation, reason = "far below 2^53")]
        let counts = self.counts.floor() as i64;
        counts
    }

    fn frame(&self) -> CanFrame {
        let angle = u16::try_from(self.whole_counts().rem_euclid(8192)).unwrap();
        #[expect(clippy::cast_possible_truncation, reason = "below no-load speed")]
        let rpm = self.rpm.round() as i16;
        let ([a, b], [c, d], [e, f]) =
            (angle.to_be_bytes(), rpm.to_be_bytes(), self.word.to_be_bytes());
        CanFrame::standard(self.feedback, [a, b, c, d, e, f, 40, 0]).unwrap()
    }
}

/// What no healthy motor may show.
fn alarm(bus: &Bus, motor: &Healthy) -> Option<String> {
    let state = bus.state(motor.handle)?;
    let quiet = state.link == Link::Online
        && state.ambiguous_gaps == 0
        && state.refused_targets == 0
        && state.forgotten_targets == 0
        && state.error.is_none()
        && bus.conditions(motor.handle).is_empty()
        && bus.is_motor_armed(motor.handle);
    (!quiet).then(|| format!("{:?} of {state:?}", bus.conditions(motor.handle)))
}

fn healthy_motors(bus: &mut Bus) -> Vec<Healthy> {
    let mut motors = Vec::new();
    let of = |feedback, command, slot, handle, fastest_rpm, limit, gear| Healthy {
        feedback,
        command,
        slot,
        handle,
        fastest_rpm,
        limit,
        wanted_rpm: 0.0,
        gear,
        rpm: 0.0,
        counts: f64::from(feedback) * 700.0 % 8192.0,
        word: 0,
        first: None,
    };
    let amperes = PidConfig::new(0.2, 2.0, 0.0);
    for id in 1..=4_u8 {
        let (slot, feedback) = (usize::from(id - 1), 0x200 + u16::from(id));
        let m3508 = bus.attach(Config::<M3508>::new(id).speed_loop(amperes)).unwrap();
        motors.push(of(feedback, 0x200, slot, m3508.into(), 9256.0, 16_384.0, 3591.0 / 187.0));
        let m2006 = bus.attach(Config::<M2006>::new(id + 4).speed_loop(amperes)).unwrap();
        motors.push(of(feedback + 4, 0x1FF, slot, m2006.into(), 18_000.0, 10_000.0, 36.0));
    }
    for id in 5..=7_u8 {
        let volts = PidConfig::new(0.2, 2.0, 0.0);
        let gm6020 = bus.attach(Config::<Gm6020Voltage>::new(id).speed_loop(volts)).unwrap();
        let feedback = 0x204 + u16::from(id);
        motors.push(of(feedback, 0x2FF, usize::from(id - 5), gm6020.into(), 320.0, 25_000.0, 1.0));
    }
    motors
}

#[test]
#[ignore = "10^8 ticks of 11 motors: by .ci/run"]
fn healthy_motors_that_lose_one_frame_in_twenty_raise_no_alarm() {
    soak("ticks of 11 healthy motors at 5 % loss", 100_000_000, |seed, count| {
        let mut bus = Bus::new();
        let mut motors = healthy_motors(&mut bus);
        let mut random = Random(seed);
        let (mut lost, mut longest, mut fastest) = (0_u64, 0, 0.0_f64);
        let (mut commands, mut lost_commands) = (0_u64, 0_u64);
        let mut silent = [0; 11];
        for ms in 1..=count {
            let now = Instant::from_micros(ms * 1_000);
            for (motor, silent) in motors.iter_mut().zip(&mut silent) {
                motor.turn();
                if random.below(20) == 0 && ms > 1 {
                    lost += 1;
                    *silent += 1;
                    longest = longest.max(*silent);
                    continue;
                }
                *silent = 0;
                assert_eq!(bus.ingest(&motor.frame(), now), Ingest::Taken);
                // Exact to the count, whatever was lost.
                if ms % 64 == 0 || motor.first.is_none() {
                    let counts = bus.state(motor.handle).unwrap().rotor_counts;
                    let offset = motor.whole_counts() - counts;
                    assert_eq!(
                        *motor.first.get_or_insert(offset),
                        offset,
                        "{ms} ms: a turn too many or too few"
                    );
                }
            }
            if ms == 1 {
                bus.arm(now).unwrap();
                while bus.next_edge().is_some() {}
            }
            for motor in &mut motors {
                // Half of no-load speed at most: there, 9 lost frames in a row leave no doubt about the turns.
                if random.below(2_000) == 0 {
                    let share = random.below(2_001) as f64 / 1_000.0 - 1.0;
                    motor.wanted_rpm = share * motor.fastest_rpm.min(10_000.0) * 0.5;
                }
                #[expect(clippy::cast_possible_truncation, reason = "a speed")]
                let rpm = (motor.wanted_rpm / motor.gear) as f32;
                bus.set_velocity(motor.handle, AngularVelocity::from_rpm(rpm)).unwrap();
                fastest = fastest.max(motor.rpm.abs());
            }
            bus.update(Tick::new(now, 0.001));
            while let Some(frame) = bus.next_frame() {
                commands += 1;
                if random.below(20) == 0 {
                    lost_commands += 1;
                    continue;
                }
                for motor in motors.iter_mut().filter(|motor| motor.command == frame.header()) {
                    let [high, low] = [0, 1].map(|byte| frame.bytes()[2 * motor.slot + byte]);
                    motor.word = i16::from_be_bytes([high, low]);
                }
            }
            assert_eq!(bus.next_edge(), None, "{ms} ms");
            if ms % 8 == 0 {
                let alarm = motors.iter().find_map(|motor| alarm(&bus, motor));
                assert_eq!(alarm, None, "{ms} ms");
            }
        }
        assert!(fastest > 4_000.0, "{fastest} rpm: they hardly moved");
        let share = lost as f64 * 100.0 / (11 * count) as f64;
        let share_of_commands = lost_commands as f64 * 100.0 / commands as f64;
        for share in [share, share_of_commands] {
            assert!((4.5..5.5).contains(&share), "{share} % lost");
        }
        format!(
            "{lost} frames lost ({share:.2} %), at most {longest} in a row, and {lost_commands} of {commands} commands; up to {fastest:.0} rpm; no alarm"
        )
    });
}
