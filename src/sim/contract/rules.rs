use super::{Outcome, Output, Rule, Run, Subject, Violation, edges};
use crate::frame::CanFrame;
use crate::motor::{ArmError, Claim, Devices, Ingest, TargetError};
use crate::time::Tick;
use embedded_can::{ExtendedId, Frame, Id, StandardId};

/// Checks a device against the promises of [`Devices`]: makes fresh devices, plays their motors, and checks their
/// frames.
///
/// # Examples
/// ```
/// use drivetrain::dji::{Bus, Config, Handle, M3508};
/// use drivetrain::frame::CanFrame;
/// use drivetrain::motor::TargetError;
/// use drivetrain::sim::contract::{Subject, check_contract};
/// use drivetrain::units::Current;
///
/// struct OneWheel(Bus, Handle<M3508>);
///
/// impl Subject for OneWheel {
///     type Device = Bus;
///     fn device(&mut self) -> &mut Bus { &mut self.0 }
///     fn motors(&self) -> usize { 1 }
///     fn feedback(&self, _motor: usize) -> Option<CanFrame> { CanFrame::standard(0x201, [0; 8]) }
///     fn drive(&mut self, share: f32) -> Result<(), TargetError> {
///         self.0.set_current(self.1, Current::from_amperes(5.0 * share))
///     }
/// }
///
/// let make = || {
///     let mut bus = Bus::new();
///     let wheel = bus.attach(Config::new(1)).expect("a free id");
///     OneWheel(bus, wheel)
/// };
/// assert_eq!(check_contract(make), Ok(29)); // rules
/// ```
///
/// # Errors
/// The first rule that the device breaks.
pub fn check_contract<S: Subject>(make: impl Fn() -> S) -> Result<usize, Violation> {
    claims(Run::new(make()))?;
    disarmed(Run::new(make()))?;
    missing(Run::new(make()))?;
    armed(Run::driving(make())?)?;
    opening(Run::new(make()))?;
    rejected(Run::driving(make())?, Run::driving(make())?)?;
    not_fresh(Run::driving(make())?)?;
    late(Run::driving(make())?)?;
    others(&make)?;
    old_target(Run::driving(make())?)?;
    for share in [0.0, f32::NAN] {
        refused(Run::driving(make())?, share)?;
    }
    nan(Run::driving(make())?)?;
    unsupported(Run::driving(make())?, Run::driving(make())?)?;
    bad_steps(&make)?;
    edges::lost_time(&make)?;
    requeue(Run::driving(make())?)?;
    emergency_stop(Run::driving(make())?)?;
    from_zero(Run::driving(make())?)?;
    edges::fault(&make)?;
    edges::second_master(&make)?;
    edges::per_change(&make)?;
    edges::lost_command(Run::driving(make())?)?;
    edges::wait(Run::driving(make())?)?;
    edges::flood(Run::driving(make())?)?;
    deterministic(Run::driving(make())?, Run::driving(make())?)?;
    Ok(Rule::IsDeterministic as usize + 1)
}

fn claims<S: Subject>(mut run: Run<S>) -> Outcome {
    let clash = run.subject.device().clash();
    run.expect(clash.is_none(), Rule::ClaimsFeedback)?;
    for motor in 0..run.subject.motors() {
        let Some(frame) = run.subject.feedback(motor) else {
            return run.expect(false, Rule::ClaimsFeedback);
        };
        let feedback = |claim: &Claim| claim.is_feedback() && claim.covers(frame.id());
        let claimed = run.subject.device().claims().any(|claim| feedback(&claim));
        run.expect(claimed, Rule::ClaimsFeedback)?;
    }
    Ok(())
}

fn disarmed<S: Subject>(mut run: Run<S>) -> Outcome {
    for _ in 0..50 {
        let output = run.step()?;
        let refused = run.subject.drive(1.0) == Err(TargetError::Disarmed);
        let armed = run.subject.device().is_armed();
        run.expect(output.driving == 0 && refused && !armed, Rule::DisarmedIsZero)?;
    }
    Ok(())
}

fn missing<S: Subject>(mut run: Run<S>) -> Outcome {
    for heard in 0..run.subject.motors() {
        let now = run.now();
        let total = run.subject.motors() - heard;
        let outcome = run.subject.device().arm(now);
        let named = match outcome {
            Err(ArmError::Missing(missing)) => usize::from(missing.total()) == total,
            _ => false,
        };
        let armed = run.subject.device().is_armed();
        run.expect(named && !armed, Rule::MissingAreNamed)?;
        run.hear(heard);
    }
    run.prepare()?;
    run.arm(Rule::ArmedDrives)
}

fn armed<S: Subject>(mut run: Run<S>) -> Outcome {
    let output = run.step()?;
    let armed = run.subject.device().is_armed();
    run.expect(armed && output.driving > 0, Rule::ArmedDrives)
}

fn opening<S: Subject>(mut run: Run<S>) -> Outcome {
    run.step().and_then(|_| run.prepare())?;
    run.arm(Rule::ArmedDrives)?;
    let (mut first, opening_ms) = (None, run.subject.opening_ms());
    for ms in 0..opening_ms {
        _ = run.subject.drive(1.0);
        let Output { effort, last, driving, .. } = run.step()?;
        first = first.or(last.filter(|_| driving > 0));
        let most = (0.02 + 1.25 * ms as f32 / opening_ms as f32).min(1.001);
        run.expect(effort <= most, Rule::OpensFromZero)?;
    }
    _ = run.subject.drive(1.0);
    let opened = run.step()?.last;
    run.expect(opening_ms == 0 || first.is_none() || first != opened, Rule::OpensFromZero)
}

/// Frames of others, or only similar to a motor's: on one device of two, without any difference.
fn rejected<S: Subject>(mut run: Run<S>, mut other: Run<S>) -> Outcome {
    let count = run.subject.motors();
    for round in 0..40 {
        let now = run.now();
        for frame in (0..count).filter_map(|motor| other.subject.feedback(motor)) {
            for foreign in twins(&frame) {
                let outcome = run.subject.device().ingest(&foreign, now);
                run.expect(outcome == Ingest::Unrelated, Rule::ForeignIsUnrelated)?;
            }
            for short in shorter(&frame) {
                let outcome = run.subject.device().ingest(&short, now);
                run.expect(outcome != Ingest::Taken, Rule::ShortIsNotTaken)?;
            }
        }
        if let Some(foreign) = unclaimed(run.subject.device()) {
            let outcome = run.subject.device().ingest(&foreign, now);
            run.expect(outcome == Ingest::Unrelated, Rule::ForeignIsUnrelated)?;
        }
        // With feedback and without: a late motor must stay late.
        let (one, two) = if round < 20 {
            (run.step()?, other.step()?)
        } else {
            (run.step_silent()?, other.step_silent()?)
        };
        run.expect(one == two, Rule::ShortIsNotTaken)?;
    }
    Ok(())
}

fn not_fresh<S: Subject>(mut run: Run<S>) -> Outcome {
    if run.subject.motors() == 0 {
        return Ok(());
    }
    for _ in 0..run.subject.late_ms() {
        let now = run.now();
        for motor in 0..run.subject.motors() {
            let Some(frame) = run.subject.feedback(motor) else { continue };
            for wrong in twins(&frame).chain(shorter(&frame)) {
                _ = run.subject.device().ingest(&wrong, now);
            }
        }
        _ = run.subject.drive(1.0);
        run.step_silent()?;
    }
    let output = run.step_silent()?;
    run.expect(output.driving == 0, Rule::RejectedIsNotFresh)
}

fn late<S: Subject>(mut run: Run<S>) -> Outcome {
    if run.subject.motors() == 0 {
        return Ok(());
    }
    run.step()?;
    for ms in 0..200 {
        _ = run.subject.drive(1.0);
        let output = run.step_silent()?;
        let limit = run.subject.late_ms();
        run.expect(output.driving == 0 || ms + 1 < limit, Rule::LateIsZero)?;
    }
    Ok(())
}

/// One motor after the other falls silent; frames that wait for a silent motor do not stop the others.
fn others<S: Subject>(make: &impl Fn() -> S) -> Outcome {
    let motors = make().motors();
    if motors < 2 {
        return Ok(());
    }
    for silent in 0..motors {
        let mut run = Run::driving(make())?;
        for _ in 0..200 {
            _ = run.subject.drive(1.0);
            let output = run.step_without(silent)?;
            run.expect(output.driving > 0, Rule::OthersGoOn)?;
        }
    }
    Ok(())
}

fn old_target<S: Subject>(mut run: Run<S>) -> Outcome {
    for ms in 0..run.subject.command_ms() + 50 {
        let output = run.step()?;
        run.expect(output.driving == 0 || ms < run.subject.command_ms(), Rule::OldTargetsAreZero)?;
    }
    run.drive_again(Rule::OldTargetsAreZero)
}

/// A stop that comes while the feedback is late.
fn refused<S: Subject>(mut run: Run<S>, share: f32) -> Outcome {
    if run.subject.motors() == 0 {
        return Ok(());
    }
    let driven = run.subject.drive(1.0).is_ok() && run.step()?.driving > 0;
    run.expect(driven, Rule::ArmedDrives)?;
    for _ in 0..=run.subject.late_ms() {
        run.step_silent()?;
    }
    let is_refused = run.subject.drive(share).is_err();
    run.expect(is_refused, Rule::RefusedTargetsAreZero)?;
    for _ in 0..20 {
        let output = run.step()?;
        run.expect(output.driving == 0, Rule::RefusedTargetsAreZero)?;
    }
    Ok(())
}

fn nan<S: Subject>(mut run: Run<S>) -> Outcome {
    for share in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        run.drive_again(Rule::ArmedDrives)?;
        let refused = run.subject.drive(share) == Err(TargetError::NotFinite);
        let output = run.step()?;
        run.expect(refused && output.driving == 0, Rule::NanIsZero)?;
    }
    Ok(())
}

/// On one device of two: without any difference to the other.
fn unsupported<S: Subject>(mut run: Run<S>, mut other: Run<S>) -> Outcome {
    for _ in 0..20 {
        let outcome = run.subject.drive_unsupported();
        let refused = matches!(outcome, Err(TargetError::Unsupported | TargetError::NoLoop));
        let same = run.step()? == other.step()?;
        run.expect(refused && same, Rule::UnsupportedIsAnError)?;
    }
    Ok(())
}

fn bad_steps<S: Subject>(make: &impl Fn() -> S) -> Outcome {
    for dt_s in [0.0, -0.001, f32::NAN, f32::INFINITY] {
        let mut run = Run::driving(make())?;
        run.step()?;
        run.step_for(dt_s)?;
        let output = run.step_for(dt_s)?;
        run.expect(output.driving == 0, Rule::BadStepsAreZero)?;
        run.drive_again(Rule::ArmedDrives)?;
    }
    Ok(())
}

fn requeue<S: Subject>(mut run: Run<S>) -> Outcome {
    let Output { last: Some(frame), .. } = run.step()? else {
        return run.expect(false, Rule::ArmedDrives);
    };
    // Without a place in the controller, the frame comes again in this update.
    let waits = run.subject.device().put_back(&frame);
    let again = run.drain()?;
    let expected = if waits { (1, Some(frame)) } else { (0, None) };
    run.expect((again.frames, again.last) == expected, Rule::RequeuedComesAgain)?;
    let taken = run.subject.device().requeue(&frame);
    let waiting = run.drain()?.frames;
    run.expect(taken && waiting == 0, Rule::RequeuedComesAgain)?;
    // The newest value is to relax: the old value must not come back.
    run.subject.device().put_back(&frame);
    run.subject.device().disarm();
    run.subject.device().put_back(&frame);
    let output = run.drain()?;
    run.expect(output.driving == 0, Rule::RequeuedComesAgain)?;
    run.subject.device().requeue(&frame);
    let output = run.step()?;
    run.expect(output.frames > 0 && output.driving == 0, Rule::RequeuedComesAgain)?;
    for foreign in unclaimed(run.subject.device()).into_iter().chain(twins(&frame)) {
        let taken = run.subject.device().put_back(&foreign);
        let taken = taken || run.subject.device().requeue(&foreign);
        run.expect(!taken, Rule::ForeignIsNotRequeued)?;
    }
    Ok(())
}

fn emergency_stop<S: Subject>(mut run: Run<S>) -> Outcome {
    let rule = Rule::EmergencyStopStays;
    let tick = Tick::new(run.now(), 0.001);
    run.subject.device().update(tick);
    // In the middle of a cycle: pending frames must be zero already.
    run.subject.device().emergency_stop();
    let output = run.drain()?;
    let mut frames = output.frames;
    run.expect(output.driving == 0, rule)?;
    for ms in 0..20 {
        let now = run.now();
        let refused = run.subject.device().arm(now) == Err(ArmError::Stopped);
        let no_target = run.subject.drive(1.0) == Err(TargetError::Disarmed);
        let output = run.step()?;
        if ms < run.subject.stop_ms() {
            frames += output.frames;
        }
        let stopped = run.subject.device().is_stopped();
        run.expect(refused && no_target && output.driving == 0 && stopped, rule)?;
    }
    run.expect(frames > 0, rule)?;
    run.subject.device().clear_emergency_stop();
    let zero = run.step()?.driving == 0;
    let disarmed = !run.subject.device().is_armed();
    run.expect(zero && disarmed, rule)?;
    edges::gesture(run)
}

fn from_zero<S: Subject>(mut run: Run<S>) -> Outcome {
    run.step()?;
    run.subject.device().disarm();
    let mut driving = run.drain()?.driving;
    for _ in 0..=run.subject.preparation_ms() {
        driving += run.step()?.driving;
    }
    run.arm(Rule::StartsFromZero)?;
    for _ in 0..20 {
        driving += run.step()?.driving;
    }
    run.expect(driving == 0, Rule::StartsFromZero)
}

fn deterministic<S: Subject>(mut one: Run<S>, mut other: Run<S>) -> Outcome {
    for ms in 0..100_u8 {
        let share = f32::from(ms) / 100.0;
        let targets = one.subject.drive(share) == other.subject.drive(share);
        let (output, same) = (one.step()?, other.step()?);
        one.expect(targets && output == same, Rule::IsDeterministic)?;
    }
    Ok(())
}

/// The remote and the extended frame of the same number.
fn twins(frame: &CanFrame) -> impl Iterator<Item = CanFrame> {
    let (remote, other) = match frame.id() {
        Id::Standard(id) => (
            CanFrame::new_remote(id, frame.dlc()),
            ExtendedId::new(id.as_raw().into()).and_then(|id| CanFrame::new(id, frame.data())),
        ),
        Id::Extended(id) => {
            let short = u16::try_from(id.as_raw()).ok().and_then(StandardId::new);
            (
                CanFrame::new_remote(id, frame.dlc()),
                short.and_then(|id| CanFrame::new(id, frame.data())),
            )
        }
    };
    [remote, other].into_iter().flatten()
}

/// The same frame with fewer bytes.
fn shorter(frame: &CanFrame) -> impl Iterator<Item = CanFrame> + '_ {
    (0..frame.data().len())
        .filter_map(|length| CanFrame::new(frame.id(), frame.data().get(..length)?))
}

/// A frame with an id of no motor.
fn unclaimed(device: &mut impl Devices) -> Option<CanFrame> {
    let mut free = |id: &StandardId| {
        let probe = Claim::feedback(*id, crate::motor::MotorName::new("foreign", 0));
        !device.claims().any(|claim| claim.clashes_with(&probe))
    };
    let id = (1..0x7FF).filter_map(StandardId::new).find(|id| free(id))?;
    CanFrame::new(id, &[0xFF; 8])
}
