//! The safety core against a plain reference: every device, under random clocks and a random application.
//!
//! The [reference] says after each step whether each motor is driven, armed and heard, what each call returns, and
//!
//! * which conditions hold, and which edges are unread, in order and with their times;
//! * the output: of a motor that is driven, the share that is open after arming bounds the commands that leave the device;
//! * whether a second master sends the commands of the motor, and which of them is named.
//!
//! The clocks wrap early, swing, jump and stand; the application sets, arms, stops and disarms at random, and may cease to at
//! any moment; feedback comes at the time of the update, a little ahead, many times at once or not at all; one in seven time
//! steps is not usable, and one in twenty is long; edges are read all or one, at once or late; frames of another controller come.

#![cfg(test)]

mod clock;
mod planted;
mod reference;
mod subjects;

use clock::{Clock, Random};
use drivetrain::frame::CanFrame;
use drivetrain::motor::{Condition, Link, OPENING, Reaction};
use drivetrain::time::{Duration, Instant, Tick};
use embedded_can::Frame;
use reference::{Opens, Reference, Refusal, Rivals, Setup};
use subjects::{Bare, Both, Damiao, Lk, Odrive, Rmd, RobStride, Snake, Subject, Vesc, Wheel};

#[expect(dead_code, reason = "the example's own main and simulation")]
#[path = "../../examples/custom_motor.rs"]
mod custom_motor;

const UPDATES: u64 = 60;
/// Feedback and arming may be this far ahead of the update, as from an interrupt.
const AHEAD_US: u64 = 3_000;

/// A device, and the reference of each of its motors.
struct Trial<S, const N: usize> {
    subject: S,
    motors: [Reference; N],
    seen: Seen,
}

/// What happened: a rule that nothing ever met was not tried.
#[derive(Debug, Default, Clone, Copy)]
struct Seen {
    driven: u64,
    repeated: u64,
    /// After a rest, without another arming.
    driven_again: u64,
    tripped: u64,
    armed_again: u64,
    offline: u64,
    recovered: u64,
    opening: u64,
    edges: u64,
    rivals: u64,
    /// A second master was gone again.
    alone: u64,
}

impl<S: Subject<N>, const N: usize> Trial<S, N> {
    fn new(subject: S, setup: Setup) -> Self {
        let motors = S::RULES.map(|rules| Reference::new(rules, setup));
        Self { subject, motors, seen: Seen::default() }
    }

    fn each(&mut self, act: impl FnMut(&mut Reference)) {
        self.motors.iter_mut().for_each(act);
    }

    fn hear(&mut self, now: u64) {
        self.subject.hear(Instant::from_micros(now));
        for (motor, link) in self.motors.iter_mut().zip(self.subject.link()) {
            let was_recovering = motor.link == Link::Recovering;
            motor.hear(now, link);
            self.seen.recovered += u64::from(was_recovering && motor.link == Link::Online);
        }
    }

    fn set(&mut self, value: f32) {
        let outcomes = self.subject.set(value);
        for (motor, outcome) in self.motors.iter_mut().zip(outcomes) {
            assert_eq!(outcome, motor.set(value), "a target: {motor:?}");
        }
    }

    fn arm(&mut self, now: u64) {
        let outcome = self.subject.arm(Instant::from_micros(now)).err();
        if outcome == Some(Refusal::Setting) {
            assert!(S::RULES.iter().any(|rules| rules.is_prepared));
            return self.each(Reference::ask);
        }
        if self.motors.iter().any(Reference::is_arming) {
            return assert_eq!(outcome, None, "it is arming");
        }
        self.each(Reference::ask);
        let refusals = self.motors.each_ref().map(|motor| motor.refusal(now));
        let first =
            [Refusal::Stopped, Refusal::Missing, Refusal::SecondMaster, Refusal::NotReleased]
                .into_iter()
                .find(|refusal| refusals.contains(&Some(*refusal)));
        assert_eq!(outcome, first, "armed at {now}: {:?}", self.motors);
        if first.is_none() {
            self.seen.armed_again += u64::from(self.motors.iter().any(Reference::is_tripped));
            self.each(|motor| motor.arm(now));
        }
    }

    fn relax(&mut self) {
        let relaxed = self.subject.relax();
        for (motor, _) in self.motors.iter_mut().zip(relaxed).filter(|(_, relaxed)| *relaxed) {
            motor.relax();
        }
    }

    fn update(&mut self, now: u64, dt_s: f32) {
        let outputs = self.subject.outputs(Tick::new(Instant::from_micros(now), dt_s));
        let has_step = dt_s.is_finite() && dt_s > 0.0;
        let links = self.subject.link();
        let seen = outputs.into_iter().zip(links).zip(self.subject.conditions());
        for (motor, ((output, link), conditions)) in self.motors.iter_mut().zip(seen) {
            let (was_armed, link_before) = (motor.is_armed(), motor.link);
            let predicted = motor.update(now, has_step);
            motor.accept(link, conditions);
            let drives = output > 0.0;
            assert!(
                predicted.is_some() || !drives,
                "driven at {now} with {dt_s} s: {link_before:?} to {motor:?}"
            );
            self.seen.driven += u64::from(drives);
            self.seen.repeated += u64::from(drives && !has_step);
            self.seen.tripped += u64::from(was_armed && !motor.is_armed());
            self.seen.offline +=
                u64::from(link_before != Link::Offline && motor.link == Link::Offline);
            if !self.subject.has_commanded() {
                motor.miss(now);
                continue;
            }
            if let Some(bounds) = predicted {
                assert!(
                    motor.allows(output, bounds),
                    "an output of {output}, not {bounds:?}, at {now} with {dt_s} s: {motor:?}"
                );
                self.seen.opening += u64::from(drives && motor.is_opening());
            }
            self.seen.driven_again += u64::from(motor.note(now, output, predicted, has_step));
        }
    }

    /// A frame of another controller: a command of one of the motors, or of none.
    fn hear_another(&mut self, now: u64, random: &mut Random) {
        let motor = usize::try_from(random.below(N as u64 + 1)).unwrap();
        let command = self.subject.command(motor.min(N - 1)).filter(|_| motor < N);
        let stranger = CanFrame::standard(0x1FF, [1; 8]).unwrap();
        self.subject.ingest(&command.unwrap_or(stranger), Instant::from_micros(now));
        if command.is_some() {
            self.motors[motor].hear_rival(now);
            self.seen.rivals += 1;
        }
    }

    /// Reads edges, all or one.
    fn read(&mut self, all: bool) {
        while let Some((index, edge)) = self.subject.next_edge() {
            let is_first = |motor: &Reference| !motor.has_unread();
            assert!(self.motors[..index].iter().all(is_first), "not the first, {edge}");
            let motor = &mut self.motors[index];
            if motor.knows(edge.condition) {
                motor.read(&edge);
                self.seen.edges += 1;
                let is_over = edge.condition == Condition::SecondMaster && !edge.began;
                self.seen.alone += u64::from(is_over);
            } else {
                assert!(motor.is_news(&edge), "not known: {edge}");
            }
            if !all {
                return;
            }
        }
        for motor in &self.motors {
            assert!(!motor.has_unread(), "an edge is lost: {motor:?}");
        }
    }

    /// What can be asked at any time.
    fn check(&self, now: u64) {
        for (motor, is_armed) in self.motors.iter().zip(self.subject.is_armed()) {
            assert_eq!(is_armed, motor.is_armed(), "armed at {now}: {motor:?}");
        }
        for (motor, link) in self.motors.iter().zip(self.subject.link()) {
            assert_eq!(link, motor.link, "the link at {now}: {motor:?}");
        }
        for (motor, conditions) in self.motors.iter().zip(self.subject.conditions()) {
            assert!(motor.agrees_with(conditions), "{conditions} at {now}: {motor:?}");
        }
        let named = self.subject.second_master();
        for (index, (motor, named)) in self.motors.iter().zip(named).enumerate() {
            assert_eq!(named.is_some(), motor.has_rival(), "a second master at {now}: {motor:?}");
            if let Some(claim) = named {
                let command = self.subject.command(index).unwrap();
                assert!(!claim.is_feedback() && claim.covers(command.id()), "{claim}");
            }
        }
        let frames: u32 = self.motors.iter().map(Reference::rival_frames).sum();
        assert!(self.subject.counted().is_none_or(|counted| counted == frames), "{frames}");
    }
}

/// How the application and the motors behave under one clock.
struct Manner {
    /// From this update on the application sets no target and does not ask.
    ends: u64,
    /// One in so many updates asks to be armed.
    asks: u64,
    /// The updates without feedback.
    silence: std::ops::Range<u64>,
    /// Many frames come at once after the silence.
    bursts: bool,
    /// Its target.
    value: f32,
    /// One in so many updates hears another controller.
    rivals: u64,
    /// One in so many updates reads edges.
    reads: u64,
}

impl Manner {
    fn draw(random: &mut Random) -> Self {
        let from = if random.one_in(2) { random.below(UPDATES) } else { UPDATES };
        Self {
            ends: UPDATES / 4 + random.below(2 * UPDATES),
            asks: random.pick([1, 2, 8, 12, 20]),
            silence: from..from + random.below(30),
            bursts: random.one_in(2),
            value: 0.5 + 0.01 * random.below(50) as f32,
            rivals: random.pick([4, 40, u64::MAX, u64::MAX, u64::MAX, u64::MAX]),
            reads: random.pick([1, 3, 40]),
        }
    }
}

impl<S: Subject<N>, const N: usize> Trial<S, N> {
    fn run(&mut self, random: &mut Random) {
        let (mut clock, manner) = (Clock::draw(random), Manner::draw(random));
        for update in 0..UPDATES {
            let now = clock.next(random);
            if !manner.silence.contains(&update) && !random.one_in(16) {
                let frames = if manner.bursts && random.one_in(4) { random.below(14) } else { 1 };
                (0..frames).for_each(|_| self.hear(ahead(now, 8, random)));
            }
            if random.one_in(manner.rivals) {
                self.hear_another(ahead(now, 4, random), random);
            }
            if update < manner.ends {
                (0..3).for_each(|_| self.act(&manner, now, random));
            }
            self.check(now);
            let dt_s = random.pick([0.0, f32::NAN, -0.001, f32::INFINITY]);
            let usable_s = if random.one_in(20) { 0.03 } else { 0.001 };
            self.update(now, if random.one_in(7) { dt_s } else { usable_s });
            self.check(now);
            if random.one_in(manner.reads) {
                self.read(random.one_in(2));
            }
        }
        self.read(true);
    }

    fn act(&mut self, manner: &Manner, now: u64, random: &mut Random) {
        match random.below(128) {
            0..64 => self.set(manner.value),
            64 => self.set(random.pick([f32::NAN, f32::INFINITY, f32::NEG_INFINITY])),
            65 => self.relax(),
            66 if random.one_in(2) => {
                self.subject.disarm();
                self.each(Reference::disarm);
            }
            67 if random.one_in(2) => {
                self.subject.stop();
                self.each(Reference::stop);
            }
            68..72 => {
                self.subject.clear_stop();
                self.each(Reference::clear_stop);
            }
            72..104 if random.one_in(manner.asks) => self.arm(ahead(now, 64, random)),
            _ => {}
        }
    }
}

/// One in `count` times a little later than `now`.
fn ahead(now: u64, count: u64, random: &mut Random) -> u64 {
    now.saturating_add(if random.one_in(count) { random.below(AHEAD_US) } else { 0 })
}

/// Says where a trial failed.
struct Place<'a>(&'a str, u64);

impl Drop for Place<'_> {
    fn drop(&mut self) {
        if std::thread::panicking() {
            println!("{}, clock {}", self.0, self.1);
        }
    }
}

/// Runs clocks of 60 updates each, every one on a device of its own.
fn run<S: Subject<N>, const N: usize>(name: &str, clocks: u64, make: impl Fn(Setup) -> S) {
    let mut seen = Seen::default();
    for seed in 1..=clocks {
        let mut random = Random(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1);
        let setup = Setup {
            opening: random.pick([Duration::ZERO, OPENING, Duration::from_micros(37_900)]),
            on_rival: random.pick([Reaction::Report, Reaction::Relax, Reaction::Ignore]),
        };
        let mut trial = Trial { seen, ..Trial::new(make(setup), setup) };
        let _place = Place(name, seed);
        trial.run(&mut random);
        seen = trial.seen;
    }
    println!("{name}: {} updates, {seen:?}", clocks * UPDATES);
    let Seen { driven, driven_again, repeated, tripped, armed_again, offline, recovered, .. } =
        seen;
    // A drive that is asked and enabled first takes most of a clock for that.
    let is_prepared = S::RULES.iter().any(|rules| rules.is_prepared);
    let often = if is_prepared { clocks / 2 } else { clocks };
    let trips = if is_prepared { clocks / 20 } else { clocks / 10 };
    assert!(driven > often && driven_again > clocks / 50 && tripped > trips, "{name}");
    assert!(repeated > clocks / 20 && armed_again > clocks / 100, "{name}");
    let listens = S::RULES.iter().any(|rules| rules.late_us.is_some());
    assert!(!listens || offline > clocks / 20 && recovered > clocks / 100, "{name}");
    assert!(seen.edges > clocks, "{name}");
    let opens = S::RULES.iter().any(|rules| rules.opens != Opens::Never);
    assert!(!opens || seen.opening > clocks / 5, "{name}");
    let has_rivals = S::RULES.iter().any(|rules| rules.rivals != Rivals::Never);
    assert!(!has_rivals || seen.rivals > clocks / 2 && seen.alone > clocks / 40, "{name}");
}

/// A million updates of each device; another number of clocks by the environment.
fn clocks() -> u64 {
    let chosen = std::env::var("DRIVETRAIN_CLOCKS").ok();
    chosen.map_or(1_000_000_u64.div_ceil(UPDATES), |clocks| clocks.parse().unwrap())
}

/// A test of each device, so that the cores share them.
macro_rules! devices {
    ($($(#[$hal:meta])? $test:ident: $name:literal, $make:expr;)*) => {
        mod every_device_keeps_to_the_reference {
            use super::*;

            $(
                $(#[$hal])?
                #[test]
                fn $test() {
                    run($name, clocks(), $make);
                }
            )*
        }
    };
}

devices! {
    guard: "guard", Bare::<true>::new;
    guard_without_feedback: "guard without feedback", Bare::<false>::new;
    dji: "dji", Wheel::<false>::new;
    dji_that_resumes: "dji that resumes", Wheel::<true>::new;
    dji_and_own: "dji and own", Both::new;
    snake: "snake", Snake::new;
    damiao_mit: "damiao, MIT", Damiao::mit;
    damiao_position: "damiao, position", Damiao::position;
    lk_torque: "lk, torque", Lk::torque;
    lk_velocity: "lk, velocity", Lk::velocity;
    lk_position: "lk, position", Lk::position;
    rmd_torque: "rmd, torque", Rmd::torque;
    rmd_velocity: "rmd, velocity", Rmd::velocity;
    rmd_position: "rmd, position", Rmd::position;
    vesc: "vesc", Vesc::new;
    odrive_torque: "odrive, torque", Odrive::torque;
    odrive_position: "odrive, position", Odrive::position;
    robstride_operation: "robstride, operation", RobStride::operation;
    robstride_current: "robstride, current", RobStride::current;
    #[cfg(feature = "hal")]
    rc_esc: "RC ESC", subjects::pins::esc;
    #[cfg(feature = "hal")]
    brushed: "brushed", subjects::pins::brushed;
}
