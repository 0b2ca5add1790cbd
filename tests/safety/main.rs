//! The safety core against a plain reference: every device, under random clocks and a random application.
//!
//! The [reference] says after each step whether each motor is driven, armed and heard, and what each call returns. The
//! clocks wrap early, swing, jump and stand; the application sets, arms, stops and disarms at random, and may cease to at
//! any moment; feedback comes at the time of the update, a little ahead, many times at once or not at all; one in ten time
//! steps is not usable.

#![cfg(test)]

mod clock;
mod odrive;
mod reference;
mod subjects;

use clock::{Clock, Random};
use drivetrain::motor::{ArmError, Link, TargetError};
use drivetrain::time::{Instant, Tick};
use reference::{Reference, Refusal, Rules};
use subjects::{Both, Damiao, Lk, Rmd, RobStride, Snake, Subject, Vesc, Wheel};

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
    tripped: u64,
    armed_again: u64,
    offline: u64,
    recovered: u64,
}

impl<S: Subject<N>, const N: usize> Trial<S, N> {
    fn new(subject: S) -> Self {
        Self { subject, motors: S::RULES.map(Reference::new), seen: Seen::default() }
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
            assert_eq!(outcome, motor.set(value.is_finite()), "a target: {motor:?}");
        }
    }

    fn arm(&mut self, now: u64) {
        let outcome = self.subject.arm(Instant::from_micros(now));
        let outcome = match outcome {
            Ok(()) => None,
            Err(ArmError::Stopped) => Some(Refusal::Stopped),
            Err(ArmError::Missing(_)) => Some(Refusal::Missing),
            Err(ArmError::NotReleased) => Some(Refusal::NotReleased),
            Err(ArmError::Setting(_)) => {
                assert!(S::RULES.iter().any(|rules| rules.is_prepared));
                return self.each(Reference::ask);
            }
            Err(error) => panic!("refused: {error}"),
        };
        if self.motors.iter().any(Reference::is_arming) {
            return assert_eq!(outcome, None, "it is arming");
        }
        self.each(Reference::ask);
        let refusals = self.motors.map(|motor| motor.refusal(now));
        let first = [Refusal::Stopped, Refusal::Missing, Refusal::NotReleased]
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
        let driven = self.subject.drives(Tick::new(Instant::from_micros(now), dt_s));
        let has_step = dt_s.is_finite() && dt_s > 0.0;
        let links = self.subject.link();
        for ((motor, drives), link) in self.motors.iter_mut().zip(driven).zip(links) {
            let before = *motor;
            let may_drive = motor.update(now, has_step);
            motor.accept(link);
            assert!(may_drive || !drives, "driven at {now} with {dt_s} s: {before:?} to {motor:?}");
            assert!(
                drives || !may_drive || S::RULES.iter().any(|rules| rules.is_prepared),
                "at rest at {now} with {dt_s} s: {before:?} to {motor:?}"
            );
            self.seen.driven += u64::from(drives);
            self.seen.repeated += u64::from(drives && !has_step);
            self.seen.tripped += u64::from(before.is_armed() && !motor.is_armed());
            self.seen.offline +=
                u64::from(before.link != Link::Offline && motor.link == Link::Offline);
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
}

impl Manner {
    fn draw(random: &mut Random) -> Self {
        let from = if random.one_in(2) { random.below(UPDATES) } else { UPDATES };
        Self {
            ends: UPDATES / 4 + random.below(2 * UPDATES),
            asks: random.pick([1, 2, 8, 12, 20]),
            silence: from..from + random.below(30),
            bursts: random.one_in(2),
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
            if update < manner.ends {
                (0..3).for_each(|_| self.act(&manner, now, random));
            }
            self.check(now);
            let dt_s = random.pick([0.0, f32::NAN, -0.001, f32::INFINITY]);
            self.update(now, if random.one_in(10) { dt_s } else { 0.001 });
            self.check(now);
        }
    }

    fn act(&mut self, manner: &Manner, now: u64, random: &mut Random) {
        match random.below(128) {
            0..64 => self.set(0.5 + 0.01 * random.below(50) as f32),
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
            72..104 if random.one_in(manner.asks) => self.arm(ahead(now, 16, random)),
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
fn run<S: Subject<N>, const N: usize>(name: &str, clocks: u64, make: impl Fn() -> S) {
    let mut seen = Seen::default();
    for seed in 1..=clocks {
        let mut random = Random(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1);
        let mut trial = Trial { seen, ..Trial::new(make()) };
        let _place = Place(name, seed);
        trial.run(&mut random);
        seen = trial.seen;
    }
    println!("{name}: {} updates, {seen:?}", clocks * UPDATES);
    let Seen { driven, repeated, tripped, armed_again, offline, recovered } = seen;
    // A drive that is asked and enabled first takes most of a clock for that.
    let is_prepared = S::RULES.iter().any(|rules| rules.is_prepared);
    let often = if is_prepared { clocks / 50 } else { clocks };
    assert!(driven > often && tripped > clocks / 10, "{name}");
    let again = if is_prepared { 0 } else { clocks / 100 };
    assert!((is_prepared || repeated > clocks / 20) && armed_again >= again, "{name}");
    let listens = S::RULES.iter().any(|rules| rules.late_us.is_some());
    assert!(!listens || offline > clocks / 20 && recovered > clocks / 100, "{name}");
}

fn every_device(clocks: u64) {
    run("dji", clocks, Wheel::<false>::new);
    run("dji that resumes", clocks, Wheel::<true>::new);
    run("dji and own", clocks, Both::new);
    run("snake", clocks, Snake::new);
    run("damiao, MIT", clocks, Damiao::mit);
    run("damiao, position", clocks, Damiao::position);
    run("lk, torque", clocks, Lk::torque);
    run("lk, velocity", clocks, Lk::velocity);
    run("lk, position", clocks, Lk::position);
    run("rmd, torque", clocks, Rmd::torque);
    run("rmd, velocity", clocks, Rmd::velocity);
    run("rmd, position", clocks, Rmd::position);
    run("vesc", clocks, Vesc::new);
    run("odrive, torque", clocks, odrive::Odrive::torque);
    run("odrive, position", clocks, odrive::Odrive::position);
    run("robstride, operation", clocks, RobStride::operation);
    run("robstride, current", clocks, RobStride::current);
    #[cfg(feature = "hal")]
    {
        run("RC ESC", clocks, subjects::pins::esc);
        run("brushed", clocks, subjects::pins::brushed);
    }
}

#[test]
fn every_device_keeps_to_the_reference() {
    every_device(1_000);
}

#[test]
#[ignore = "10^6 clocks: by .ci/run"]
fn every_device_keeps_to_the_reference_under_a_million_clocks() {
    every_device(170_000);
}

/// The reference finds what it is for: a device that goes on with its last target for ever.
#[test]
#[should_panic(expected = "driven at")]
fn a_target_that_outlives_its_deadline_is_found() {
    struct Immortal(Wheel<false>, f32);
    impl Subject<1> for Immortal {
        const RULES: [Rules; 1] = Wheel::<false>::RULES;

        fn hear(&mut self, now: Instant) {
            self.0.hear(now);
        }
        fn link(&self) -> [Link; 1] {
            self.0.link()
        }
        fn arm(&mut self, now: Instant) -> Result<(), ArmError> {
            self.0.arm(now)
        }
        fn is_armed(&self) -> [bool; 1] {
            self.0.is_armed()
        }
        fn set(&mut self, value: f32) -> [Result<(), TargetError>; 1] {
            let outcome = self.0.set(value);
            self.1 = if outcome[0].is_ok() { value } else { 0.0 };
            outcome
        }
        fn relax(&mut self) -> [bool; 1] {
            self.1 = 0.0;
            self.0.relax()
        }
        fn disarm(&mut self) {
            self.1 = 0.0;
            self.0.disarm();
        }
        fn stop(&mut self) {
            self.1 = 0.0;
            self.0.stop();
        }
        fn clear_stop(&mut self) {
            self.0.clear_stop();
        }
        fn drives(&mut self, tick: Tick) -> [bool; 1] {
            if self.1 != 0.0 {
                _ = self.0.set(self.1);
            }
            self.0.drives(tick)
        }
    }
    let mut trial = Trial::new(Immortal(Wheel::new(), 0.0));
    trial.hear(1_000);
    trial.arm(1_000);
    trial.set(1.0);
    for ms in 1..=200 {
        trial.hear(1_000 * ms);
        trial.update(1_000 * ms, 0.001);
    }
}
