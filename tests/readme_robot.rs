//! The robot of `docs/robot.md` on the simulator: what arms it, what disarms it, and what stops it.

#![cfg(test)]

use drivetrain::sim::{self, MotorConfig};
use drivetrain::time::{Duration, Instant};
use std::cell::RefCell;
use std::ops::Range;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};

include!("readme/robot.rs");

#[test]
fn the_program_of_this_test_is_that_of_the_page() {
    assert!(include_str!("../docs/robot.md").contains(include_str!("readme/robot.rs")));
}

const NEVER: u64 = u64::MAX;

/// Follows a plan of the times, in ms, in which the switch is on and the remote control is lost, and stops and clears at these.
struct Plan<'a> {
    world: &'a sim::Simulation,
    on: &'a [Range<u64>],
    lost: Range<u64>,
    stop: u64,
    clear: u64,
    refused: &'a RefCell<Vec<String>>,
}

impl Plan<'_> {
    fn ms(&self) -> u64 {
        self.world.now().as_micros() / 1_000
    }
}

impl Pilot for Plan<'_> {
    fn is_switch_on(&self) -> Option<bool> {
        let is_on = self.on.iter().any(|on| on.contains(&self.ms()));
        (!self.lost.contains(&self.ms())).then_some(is_on)
    }
    fn clears_stop(&mut self) -> bool {
        self.ms() == self.clear
    }
    fn twist(&self) -> Twist<World> {
        if self.ms() == self.stop {
            STOP.set();
        }
        let drives = self.on.iter().any(|on| (on.start + 5..on.end).contains(&self.ms()));
        if drives { Twist::new(0.5, 0.0, 0.0) } else { Twist::ZERO }
    }
    fn heading(&self) -> Heading {
        Heading::default()
    }
    fn offer(&mut self, _: &CanFrame) {}
    fn feed_watchdog(&mut self) {}
    fn report(&mut self, why: ArmError) {
        self.refused.borrow_mut().push(why.to_string());
    }
    fn note(&mut self, _: Edge<Condition, MotorName>) {}
}

/// Runs the robot, whose remote control is heard; returns the milliseconds in which a wheel was commanded, as spans, and the refusals.
fn run(on: &[Range<u64>], stop: u64, clear: u64, end: u64) -> (Vec<Range<u64>>, Vec<String>) {
    run_with(on, NEVER..NEVER, stop, clear, end)
}

fn run_with(
    on: &[Range<u64>],
    lost: Range<u64>,
    stop: u64,
    clear: u64,
    end: u64,
) -> (Vec<Range<u64>>, Vec<String>) {
    let world = sim::Simulation::new(1);
    let wheels = [1, 2, 3, 4].map(|id| world.attach(MotorConfig::m3508(id)).unwrap());
    world.attach(MotorConfig::gm6020_voltage(5)).unwrap();
    let refused = RefCell::new(Vec::new());
    let mut driven = Vec::<Range<u64>>::new();
    let clock = || {
        world.advance(Duration::from_micros(100));
        let now = world.now();
        let ms = now.as_micros() / 1_000;
        if wheels.iter().any(|key| world.motor(*key).unwrap().command != 0) {
            match driven.last_mut() {
                Some(last) if ms <= last.end + 5 => last.end = ms,
                _ => driven.push(ms..ms),
            }
        }
        if now >= Instant::from_micros(end * 1_000) {
            resume_unwind(Box::new("the end"));
        }
        now
    };
    let plan = Plan { world: &world, on, lost, stop, clear, refused: &refused };
    let outcome = catch_unwind(AssertUnwindSafe(|| robot(world.controller(), clock, plan)));
    assert_eq!(outcome.unwrap_err().downcast_ref(), Some(&"the end"));
    (driven, refused.into_inner())
}

fn are_near(driven: &[Range<u64>], expected: &[Range<u64>]) {
    let is_near = |(one, other): (&Range<u64>, &Range<u64>)| {
        (other.start..other.start + 10).contains(&one.start)
            && (other.end..other.end + 5).contains(&one.end)
    };
    let all = driven.len() == expected.len() && driven.iter().zip(expected).all(is_near);
    assert!(all, "{driven:?} for {expected:?}");
}

/// One test, as the emergency stop of the program is one.
#[test]
fn the_switch_arms_when_it_turns_and_never_by_being_on() {
    // Left on at power-on, or over the reset of a watchdog.
    let (driven, refused) = run(&[0..500, 500..600], NEVER, NEVER, 600);
    are_near(&driven, &[]);
    assert_eq!(refused, [""; 0]);
    // Turned off and on; each time that it is off, the robot rests.
    let (driven, _) = run(&[0..100, 200..400, 500..700], NEVER, NEVER, 800);
    are_near(&driven, &[200..400, 500..700]);
    // The remote control is lost: the robot brakes for a second. It is heard again with the switch on and the stick held.
    let (driven, _) =
        run_with(std::slice::from_ref(&(200..2_500)), 400..1_800, NEVER, NEVER, 2_600);
    are_near(&driven, std::slice::from_ref(&(200..1_400)));
    // An emergency stop, cleared while the switch is on.
    let (driven, refused) = run(&[100..600, 700..900, 1_000..1_200], 300, 800, 1_300);
    are_near(&driven, &[100..300, 1_000..1_200]);
    assert_eq!(refused, ["the emergency stop is set: call clear_emergency_stop"]);
}
