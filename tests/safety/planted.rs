//! Devices with a defect: the reference finds what it is for.
//!
//! Defects of the crate were planted as well, one at a time, and are not kept. With 1000 clocks of 60 updates for each device, each was found
//! by the first device that has it, after so many updates of this device:
//!
//! | rule | defect | device | updates |
//! |---|---|---|---|
//! | edges | a condition that ends takes its unread beginning along (`Latch::set`) | guard | 60 |
//! | edges | edges are read in the order of the conditions (`Guard::next_edge`) | guard | 60 |
//! | edges | an edge found in a frame has the time of the update before (`dji::Motors::change`) | dji | 60 |
//! | edges | feedback ends *late* and leaves *offline* (`MotorGuard::hear`) | guard | 120 |
//! | edges | an edge that was read waits on (`Latch::take`) | guard | 60 |
//! | opening | a drive that is enabled again does not open anew (`Actuator::reopen`) | damiao, MIT | 2040 |
//! | opening | a millisecond of the opening has 1024 µs (`MotorGuard::share`) | guard | 120 |
//! | opening | a motor that resumes does not open anew (`MotorGuard::hear`) | dji that resumes | 30 060 |
//! | opening | the second arming does not open anew (`MotorGuard::open`) | guard | 840 |
//! | opening | after a pause the beginning may lie ahead (was in the crate) | guard without feedback | 3420 |
//! | opening | a driven drive has no output in one update of seven (in the subject `Damiao`) | damiao, MIT | 780 |
//! | opening | once driven and once at rest, a drive has no output again (in the subject `Damiao`) | damiao, MIT | all: never driven again |
//! | second master | the window has 1.05 s (`RIVAL_US`) | dji | 3300 |
//! | second master | its claim is named for ever (`Actuator::second_master`) | dji and own | 120 |
//! | second master | a command of other motors counts (`dji::watch::hear_command`) | dji | 120 |
//! | second master | a frame ahead of the update is one of long ago (was in the crate) | dji | 2940 |
//! | second master | it stays until a clock that was set back has caught up (was in the crate) | dji and own | 2100 |
//! | second master | a frame counts twice (`snake::Joints::ingest`) | snake | 120 |
//! | second master | it relaxes no motor that is configured so (`Watch::check`) | dji and own | 120 |

use super::*;
use drivetrain::motor::{Claim, Condition, Conditions, MotorName, TargetError};
use drivetrain::time::Edge;
use reference::Rules;

/// Defect of a wheel.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Defect {
    /// It goes on with its last target for ever.
    Immortal,
    /// Of two edges, it returns the second one first.
    Swaps,
    /// It loses every other edge.
    Loses,
    /// Its output opens from a tenth.
    Jumps,
    /// Its output stays at a tenth.
    Lame,
    /// It does not tell of a second master.
    Trusts,
    /// It still tells of a second master that is gone.
    Resents,
}

struct Planted {
    wheel: Wheel<false>,
    defect: Defect,
    target: f32,
    edge: Option<(usize, Edge<Condition, MotorName>)>,
    master: std::cell::Cell<Option<Claim>>,
}

impl Subject<1> for Planted {
    const RULES: [Rules; 1] = Wheel::<false>::RULES;

    fn hear(&mut self, now: Instant) {
        self.wheel.hear(now);
    }
    fn link(&self) -> [Link; 1] {
        self.wheel.link()
    }
    fn arm(&mut self, now: Instant) -> Result<(), Refusal> {
        self.wheel.arm(now)
    }
    fn is_armed(&self) -> [bool; 1] {
        self.wheel.is_armed()
    }
    fn set(&mut self, value: f32) -> [Result<(), TargetError>; 1] {
        let outcome = self.wheel.set(value);
        self.target = if outcome[0].is_ok() { value } else { 0.0 };
        outcome
    }
    fn relax(&mut self) -> [bool; 1] {
        self.target = 0.0;
        self.wheel.relax()
    }
    fn disarm(&mut self) {
        self.target = 0.0;
        self.wheel.disarm();
    }
    fn stop(&mut self) {
        self.target = 0.0;
        self.wheel.stop();
    }
    fn clear_stop(&mut self) {
        self.wheel.clear_stop();
    }
    fn outputs(&mut self, tick: Tick) -> [f64; 1] {
        if self.defect == Defect::Immortal && self.target != 0.0 {
            _ = self.wheel.set(self.target);
        }
        self.wheel.outputs(tick).map(|output| match self.defect {
            Defect::Jumps if output > 0.0 => output.max(0.1),
            Defect::Lame => output.min(0.1),
            _ => output,
        })
    }
    fn conditions(&self) -> [Conditions; 1] {
        self.wheel.conditions()
    }
    fn next_edge(&mut self) -> Option<(usize, Edge<Condition, MotorName>)> {
        let edge = self.wheel.next_edge();
        match self.defect {
            Defect::Loses => edge.and_then(|_| self.wheel.next_edge()),
            Defect::Swaps if self.edge.is_some() => self.edge.take(),
            Defect::Swaps => match self.wheel.next_edge() {
                Some(second) => {
                    self.edge = edge;
                    Some(second)
                }
                None => edge,
            },
            _ => edge,
        }
    }
    fn command(&self, motor: usize) -> Option<CanFrame> {
        self.wheel.command(motor)
    }
    fn ingest(&mut self, frame: &CanFrame, now: Instant) {
        self.wheel.ingest(frame, now);
    }
    fn second_master(&self) -> [Option<Claim>; 1] {
        let [named] = self.wheel.second_master();
        self.master.set(named.or(self.master.get()));
        match self.defect {
            Defect::Trusts => [None],
            Defect::Resents => [self.master.get()],
            _ => [named],
        }
    }
}

impl Planted {
    fn new(defect: Defect, setup: Setup) -> Self {
        let (edge, master) = (None, std::cell::Cell::new(None));
        Self { wheel: Wheel::new(setup), defect, target: 0.0, edge, master }
    }
}

fn try_out(defect: Defect) {
    run("planted", 1_000, |setup| Planted::new(defect, setup));
}

#[test]
#[should_panic(expected = "driven at")]
fn a_target_that_outlives_its_deadline_is_found() {
    let setup = Setup { opening: Duration::ZERO, on_rival: Reaction::Report };
    let mut trial = Trial::new(Planted::new(Defect::Immortal, setup), setup);
    trial.hear(1_000);
    trial.arm(1_000);
    trial.set(1.0);
    for ms in 1..=200 {
        trial.hear(1_000 * ms);
        trial.update(1_000 * ms, 0.001);
    }
}

#[test]
#[should_panic(expected = "not the oldest edge")]
fn edges_in_another_order_are_found() {
    try_out(Defect::Swaps);
}

#[test]
#[should_panic(expected = "edge")]
fn a_lost_edge_is_found() {
    try_out(Defect::Loses);
}

#[test]
#[should_panic(expected = "an output of")]
fn an_output_that_opens_too_early_is_found() {
    try_out(Defect::Jumps);
}

#[test]
#[should_panic(expected = "an output of")]
fn an_output_that_does_not_open_is_found() {
    try_out(Defect::Lame);
}

#[test]
#[should_panic(expected = "a second master at")]
fn a_second_master_without_a_name_is_found() {
    try_out(Defect::Trusts);
}

#[test]
#[should_panic(expected = "a second master at")]
fn a_second_master_that_is_gone_and_named_is_found() {
    try_out(Defect::Resents);
}
