//! Rules about the edges of the motors of a device, and about arming after a trip or during a fault.

use super::{Outcome, Rule, Run, Subject};
use crate::motor::{ArmError, Claim, Condition, Conditions, Devices, Ingest, MotorName};
use crate::time::{Duration, Edge, Instant};
use embedded_can::Frame;

/// Of so many motors the edges are told apart.
const MOST_MOTORS: usize = 64;

/// Edges are stamped in units of this.
const UNIT: Duration = Duration::from_micros(1_024);

/// The edges read: the conditions of each motor that began and ended.
struct Told([(Conditions, Conditions); MOST_MOTORS]);

impl Told {
    const NONE: Self = Self([(Conditions::NONE, Conditions::NONE); MOST_MOTORS]);

    /// Reads all pending edges. Each change comes once and names a motor; nothing is pending afterwards.
    fn read<S: Subject>(run: &mut Run<S>, rule: Rule) -> Result<Self, super::Violation> {
        let mut told = Self::NONE;
        while let Some(edge) = run.subject.device().next_edge() {
            let motor = index(run, edge.source);
            run.expect(motor.is_some(), rule)?;
            if let Some((began, ended)) = motor.and_then(|motor| told.0.get_mut(motor)) {
                let place = if edge.began { began } else { ended };
                let again = place.contains(edge.condition);
                *place = place.with(edge.condition);
                run.expect(!again && edge.at <= run.now(), rule)?;
            }
        }
        Ok(told)
    }

    /// Returns whether a change was among them.
    fn has(&self, motor: usize, condition: Condition, began: bool) -> bool {
        self.0.get(motor).is_some_and(|told| {
            let (begun, ended) = told;
            if began { begun.contains(condition) } else { ended.contains(condition) }
        })
    }
}

/// Returns the motor of the subject with this name.
fn index<S: Subject>(run: &mut Run<S>, name: MotorName) -> Option<usize> {
    (0..run.subject.motors()).find(|motor| called(run, *motor) == Some(name))
}

/// Returns the name of a motor of the subject. For motors with a shared id, the claims have the order of the motors.
fn called<S: Subject>(run: &mut Run<S>, motor: usize) -> Option<MotorName> {
    let id = run.subject.feedback(motor)?.id();
    let shares = |other: &usize| run.subject.feedback(*other).is_some_and(|frame| frame.id() == id);
    let before = (0..motor).filter(shares).count();
    let feedback = |claim: &Claim| claim.is_feedback() && claim.covers(id);
    let mut last = None;
    let claims = run.subject.device().claims().filter(feedback).map(|claim| claim.motor());
    // A motor may claim the id more than once.
    claims.filter(|name| last.replace(*name) != Some(*name)).nth(before)
}

/// Motors fall silent one after the other, and each edge is read in the millisecond of its change.
pub(super) fn per_change<S: Subject>(make: &impl Fn() -> S) -> Outcome {
    let rule = Rule::ChangeIsAnEdge;
    for silent in 0..make().motors() {
        let mut run = Run::driving(make())?;
        for _ in 0..50 {
            _ = run.subject.drive(1.0);
            run.step()?;
            let edge = run.subject.device().next_edge();
            run.expect(edge.is_none(), rule)?;
        }
        let name = called(&mut run, silent);
        let late = |edge: &Edge<Condition, MotorName>, began| {
            edge.condition == Condition::Late && edge.began == began
        };
        for (began, ms) in [(true, run.subject.late_ms() + 2), (false, 20)] {
            let mut changes = 0;
            for _ in 0..ms {
                _ = run.subject.drive(1.0);
                run.step_without(if began { silent } else { usize::MAX })?;
                while let Some(edge) = run.subject.device().next_edge() {
                    let timely = edge.at + UNIT > run.now() && edge.at <= run.now();
                    let named = Some(edge.source) == name || edge.condition != Condition::Late;
                    changes += u32::from(late(&edge, began));
                    run.expect(timely && named && changes <= 1, rule)?;
                }
            }
            run.expect(changes == 1, rule)?;
        }
    }
    Ok(())
}

/// An edge unread for long stays pending, with the time of its detection.
pub(super) fn wait<S: Subject>(mut run: Run<S>) -> Outcome {
    let rule = Rule::EdgesWait;
    let motors = run.subject.motors();
    if motors == 0 {
        return Ok(());
    }
    let begun = run.now();
    let limit = begun + Duration::from_millis(run.subject.late_ms() + 1);
    for _ in 0..200 {
        run.step_silent()?;
    }
    // Until each of them counts as heard again.
    for _ in 0..500 {
        run.step()?;
    }
    let first = run.subject.device().next_edge();
    let in_time = |at: Instant| at + UNIT > begun && at <= limit;
    let is_first = first.is_some_and(|edge| edge.began && in_time(edge.at));
    run.expect(is_first, rule)?;
    let told = Told::read(&mut run, rule)?;
    for motor in 0..motors.min(MOST_MOTORS) {
        let name = called(&mut run, motor);
        let begins = Some((name, Condition::Late, true));
        let read_first =
            first.map(|edge| (Some(edge.source), edge.condition, edge.began)) == begins;
        let has = |condition, began| told.has(motor, condition, began);
        let both = (has(Condition::Late, true) || read_first) && has(Condition::Late, false);
        run.expect(both, rule)?;
    }
    let rest = run.subject.device().next_edge();
    run.expect(rest.is_none(), rule)
}

/// A condition that begins and ends again and again before the reading is one edge each way.
pub(super) fn flood<S: Subject>(mut run: Run<S>) -> Outcome {
    let rule = Rule::EdgesDoNotFlood;
    for _ in 0..20 {
        for _ in 0..run.subject.late_ms() + 2 {
            _ = run.subject.drive(1.0);
            run.step_silent()?;
        }
        for _ in 0..15 {
            _ = run.subject.drive(1.0);
            run.step()?;
        }
    }
    let told = Told::read(&mut run, rule)?;
    for motor in 0..run.subject.motors().min(MOST_MOTORS) {
        let both = [true, false].map(|began| told.has(motor, Condition::Late, began));
        run.expect(both == [true; 2], rule)?;
    }
    Ok(())
}

/// An expired target is an edge, and a new target too.
pub(super) fn lost_command<S: Subject>(mut run: Run<S>) -> Outcome {
    let rule = Rule::ChangeIsAnEdge;
    let lost = |edge: &Edge<Condition, MotorName>, began| {
        edge.condition == Condition::CommandLost && edge.began == began
    };
    let (mut begun, mut ended) = (0, 0);
    for _ in 0..run.subject.command_ms() + 50 {
        run.step()?;
        while let Some(edge) = run.subject.device().next_edge() {
            let timely = edge.at + UNIT > run.now() && edge.at <= run.now();
            run.expect(timely, rule)?;
            begun += u32::from(lost(&edge, true));
        }
    }
    for _ in 0..50 {
        _ = run.subject.drive(1.0);
        run.step()?;
        while let Some(edge) = run.subject.device().next_edge() {
            ended += u32::from(lost(&edge, false));
        }
    }
    // Of one motor at least: the others may have kept theirs.
    run.expect(begun > 0 && ended == begun, rule)
}

/// An error that comes and goes at up to 1 kHz is one edge; a permanent error refuses arming.
pub(super) fn fault<S: Subject>(make: &impl Fn() -> S) -> Outcome {
    for motor in 0..make().motors() {
        let mut run = Run::driving(make())?;
        let Some(fault) = run.subject.fault(motor) else { continue };
        let hear = |run: &mut Run<S>, holds: bool| {
            run.step_without(motor)?;
            let now = run.now();
            let taken = if holds {
                run.subject.device().ingest(&fault, now) == Ingest::Taken
            } else {
                run.hear(motor)
            };
            run.expect(taken, Rule::ClaimsFeedback)
        };
        for ms in 0..1_000 {
            // Not in step with a device that checks one motor after the other.
            hear(&mut run, ms % 5 < 2)?;
        }
        // For some devices the condition lasts as long as the flicker.
        for _ in 0..50 {
            hear(&mut run, false)?;
        }
        let told = Told::read(&mut run, Rule::EdgesDoNotFlood)?;
        let both = [true, false].map(|began| told.has(motor, Condition::Fault, began));
        run.expect(both == [true; 2], Rule::ChangeIsAnEdge)?;
        for _ in 0..100 {
            hear(&mut run, true)?;
        }
        let now = run.now();
        let refused = matches!(run.subject.device().arm(now), Err(ArmError::Faulty(_)));
        let zero = run.step_without(motor)?.driving == 0;
        let alone = run.subject.motors() == 1;
        run.expect(refused && (zero || !alone), Rule::FaultIsNotArmed)?;
        for _ in 0..100 {
            hear(&mut run, false)?;
        }
        let now = run.now();
        let armed = run.subject.device().arm(now).is_ok();
        run.expect(armed, Rule::FaultIsNotArmed)?;
    }
    Ok(())
}

/// Another node sends the commands of the device: one after the other.
pub(super) fn second_master<S: Subject>(make: &impl Fn() -> S) -> Outcome {
    let rule = Rule::SecondMasterIsNotArmed;
    let commands = |run: &mut Run<S>, nth| {
        let command = |claim: &Claim| !claim.is_feedback();
        run.subject.device().claims().filter(command).nth(nth)
    };
    for nth in 0.. {
        let mut run = Run::new(make());
        run.step()?;
        let Some(claim) = commands(&mut run, nth) else { break };
        let Some(frame) = run.subject.rival(&claim) else { continue };
        let now = run.now();
        let taken = run.subject.device().ingest(&frame, now) == Ingest::Taken;
        run.expect(!taken, rule)?;
        let outcome = run.subject.device().arm(now);
        let refused = matches!(outcome, Err(ArmError::SecondMaster(found)) if found == claim);
        let armed = run.subject.device().is_armed();
        run.expect(refused && !armed, rule)?;
    }
    Ok(())
}

/// Updates that do not lie after the one before: zero in that cycle, and until the device is armed by a new request.
pub(super) fn lost_time<S: Subject>(make: &impl Fn() -> S) -> Outcome {
    for back_ms in [0, 1, 5, 100, 350] {
        let mut run = Run::driving(make())?;
        run.step()?;
        run.ms = run.ms.saturating_sub(back_ms).max(1);
        for round in 0..50 {
            _ = run.subject.drive(1.0);
            let output = if round == 0 { run.update(0.001)? } else { run.step()? };
            let armed = run.subject.device().is_armed();
            run.expect(output.driving == 0 && !armed, Rule::LostTimeTrips)?;
        }
        gesture(run)?;
    }
    Ok(())
}

/// After a trip: a repeated request is never granted, and a request after a pause is.
pub(super) fn gesture<S: Subject>(mut run: Run<S>) -> Outcome {
    let rule = Rule::ArmingIsAGesture;
    for round in 0..150 {
        // A program that stalls did not release its switch.
        let stalls = round % 50 == 25;
        if stalls {
            run.ms += 200;
            for motor in 0..run.subject.motors() {
                run.hear(motor);
            }
        }
        let now = run.now();
        let outcome = run.subject.device().arm(now);
        let is_early = matches!(outcome, Err(ArmError::NotReleased | ArmError::Setting(_)));
        let refused = is_early || (stalls && outcome.is_err());
        _ = run.subject.drive(1.0);
        let output = run.step()?;
        run.expect(refused && output.driving == 0, rule)?;
    }
    for _ in 0..100 {
        run.step()?;
    }
    run.arm_and_open(rule)?;
    let driven = run.step()?.driving > 0;
    run.expect(driven, rule)
}
