//! The outcome of each run, as the rows of `docs/faults.md` demand it of this robot.

use super::robot::{Event, HOST_DEADLINE};
use super::simulation::{AGAIN_S, FAULT_S, HIT, Run, Sample, Trouble};
use drivetrain::encoder::Homing;

/// The largest RMS error of a joint in full swing, in degrees.
pub(crate) const RMS_LIMIT_DEG: f32 = 1.0;
/// A joint without enable stands after this time: 75 degrees a second against its friction, with a margin.
const STANDS_S: f32 = 0.1;
/// A lost joint relaxes all after 100 ms without a position, seen within a tick; it may have sent its last before the fault.
const OFFLINE_S: f32 = 0.102;

/// One sentence that has to be true.
pub(crate) struct Check {
    pub(crate) holds: bool,
    pub(crate) what: String,
}

pub(crate) fn checks(run: &Run) -> Vec<Check> {
    let mut list = Vec::new();
    let mut check = |holds: bool, what: String| list.push(Check { holds, what });
    healthy(run, &mut check);
    let Some(trouble) = run.setup.trouble else { return list };
    match trouble {
        Trouble::HostLineCut | Trouble::CorruptStream => host_is_lost(run, &mut check),
        Trouble::SilentJoint | Trouble::JointPowerLoss => joint_is_lost(run, &mut check),
        Trouble::ResetInMotion => zeroed_in_motion(run, &mut check),
        Trouble::ControllerReset => controller_starts(run, &mut check),
    }
    let after = run.worst_rms_deg(true);
    let armed = run.swinging(true).all(|sample| sample.armed);
    check(
        armed && after <= RMS_LIMIT_DEG,
        format!("recovers: within {after:.2} degrees RMS after it was told to go on"),
    );
    list
}

fn healthy(run: &Run, check: &mut impl FnMut(bool, String)) {
    let rms = run.worst_rms_deg(false);
    let armed = run.swinging(false).all(|sample| sample.armed);
    check(
        armed && rms <= RMS_LIMIT_DEG,
        format!("tracks within {rms:.2} degrees RMS, worst joint, in full swing"),
    );
    let load = run.traffic.load();
    let (nominal, worst) = (run.budget.nominal(), run.budget.worst_case());
    check(
        (nominal..=worst).contains(&load),
        format!(
            "the bus carries {:.1} %, between {:.1} and {:.1} %",
            load * 100.0,
            nominal * 100.0,
            worst * 100.0
        ),
    );
    check(run.collisions == 0, format!("{} frames met a reply of the same id", run.collisions));
    check(run.overruns == (0, 0), format!("no overrun: {:?}", run.overruns));
    let mut sent = run.sent.iter();
    let genuine = run.accepted.iter().all(|command| sent.any(|other| other == command));
    check(
        genuine && !run.accepted.is_empty(),
        format!("{} commands were taken, each as it was sent, in order", run.accepted.len()),
    );
    let restarted = run.setup.trouble == Some(Trouble::ControllerReset);
    let imus = run.imus.iter().all(|(sent, counts)| {
        let all = counts.frames + 1 >= *sent || restarted;
        all && counts.checksum_errors == 0 && counts.frames > 100
    });
    check(imus, "every frame of the four IMUs was read".to_owned());
    let speaks = run.servo.frames > 100 && run.servo.checksum_errors == 0;
    check(speaks, format!("the servo answered {} times", run.servo.frames));
    let swung = run.swinging(false).flat_map(|sample| sample.gripper_deg);
    let off = swung.fold(0.0_f32, |most, (wanted, is)| most.max((wanted - is).abs()));
    check(off < 10.0, format!("gripper and servo follow, {off:.1} degrees off at most"));
}

/// F58, F59, F61: relaxed after the deadline with an edge, nothing wild taken, heard again, not armed by itself.
fn host_is_lost(run: &Run, check: &mut impl FnMut(bool, String)) {
    let lost = at_event(run, FAULT_S, |event| *event == Event::HostLost);
    // The last command may have come before; in a storm one in a thousand passes.
    let latest_s = FAULT_S + HOST_DEADLINE.as_secs_f32() + 0.15;
    let in_time = lost.is_some_and(|s| s <= latest_s);
    check(in_time, format!("the silent host was noticed, with an edge at {}", shown(lost)));
    let lost = lost.unwrap_or(FAULT_S);
    relaxed(run, lost + 0.015, AGAIN_S, check);
    let heard = at_event(run, lost, |event| *event == Event::HostHeard);
    check(heard.is_some_and(|s| s < AGAIN_S), format!("it was heard again at {}", shown(heard)));
    stays_relaxed_until_told(run, check);
}

/// F15, F24: the joint is offline, so all relax; it waits for the operator; its zero is in doubt, for its drive may have lost its supply.
fn joint_is_lost(run: &Run, check: &mut impl FnMut(bool, String)) {
    let relaxed_at = at_event(run, FAULT_S, |event| *event == Event::Relaxed("a motor is lost"));
    let in_time = relaxed_at.is_some_and(|s| s <= FAULT_S + OFFLINE_S);
    check(in_time, format!("the lost joint relaxed the robot at {}", shown(relaxed_at)));
    let hit = |sample: &Sample| sample.enabled.get(HIT).copied().unwrap_or(true);
    let off = run.samples.iter().find(|sample| sample.time_s > FAULT_S && !hit(sample));
    let off = off.map(|sample| sample.time_s);
    check(
        off.is_some_and(|s| s <= FAULT_S + 0.045),
        format!("the joint itself was disabled at {}", shown(off)),
    );
    relaxed(run, relaxed_at.unwrap_or(FAULT_S) + 0.005, AGAIN_S, check);
    stays_relaxed_until_told(run, check);
    let unanswered = run.joints.get(HIT).and_then(|joint| joint.map(|joint| joint.unanswered));
    check(
        unanswered.is_some_and(|count| count > 10),
        format!("{} requests to it were not answered", unanswered.unwrap_or(0)),
    );
    let homed = run.joints.iter().flatten().all(|joint| joint.homing == Homing::Homed);
    check(homed, "its zero, in doubt since, was set again by the operator".to_owned());
}

/// The present position becomes the new zero: the angle that is shown jumps, and the joint does not.
fn zeroed_in_motion(run: &Run, check: &mut impl FnMut(bool, String)) {
    let zeroed = at_event(run, FAULT_S, |event| *event == Event::Zeroed);
    check(
        zeroed.is_some_and(|s| s < FAULT_S + 0.2),
        format!("the joints were zeroed at {}", shown(zeroed)),
    );
    let zeroed = zeroed.unwrap_or(FAULT_S);
    let window = |sample: &&Sample| (zeroed..AGAIN_S).contains(&sample.time_s);
    let mut moving = run.samples.iter().filter(window);
    let Some(first) = moving.next() else {
        return check(false, "there is nothing after it".to_owned());
    };
    let fastest = largest(first.rate_deg_s);
    check(fastest > 30.0, format!("the fastest joint moved at {fastest:.0} degrees a second"));
    let way = |sample: &Sample| {
        let both = sample.absolute_deg.iter().zip(first.absolute_deg);
        both.map(|(is, was)| (is - was).abs()).fold(0.0_f32, f32::max)
    };
    let furthest = moving.clone().map(way).fold(0.0_f32, f32::max);
    check(furthest < 4.0, format!("no joint went further than {furthest:.1} degrees from there"));
    let last = moving.next_back().map_or(f32::NAN, |sample| largest(sample.true_deg));
    check(last < 0.1, format!("it rests {last:.2} degrees from the new zero"));
}

/// A controller that starts disables what its predecessor left running.
fn controller_starts(run: &Run, check: &mut impl FnMut(bool, String)) {
    relaxed(run, FAULT_S + 0.005, AGAIN_S, check);
    stays_relaxed_until_told(run, check);
}

/// No joint is enabled, and soon none moves.
fn relaxed(run: &Run, from_s: f32, until_s: f32, check: &mut impl FnMut(bool, String)) {
    let window = |s: &&Sample| (from_s..until_s).contains(&s.time_s);
    let off = run.samples.iter().filter(window).all(|s| !s.enabled.contains(&true) && !s.armed);
    check(off, format!("no joint is enabled from {from_s:.3} s on"));
    let after = run.samples.iter().filter(window).filter(|s| s.time_s >= from_s + STANDS_S);
    let fastest = after.clone().map(|s| largest(s.rate_deg_s)).fold(0.0_f32, f32::max);
    let any = after.count() > 0;
    check(
        any && fastest < 0.5,
        format!("they stand {STANDS_S} s later ({fastest:.2} degrees a second)"),
    );
}

fn stays_relaxed_until_told(run: &Run, check: &mut impl FnMut(bool, String)) {
    let armed = at_event(run, FAULT_S, |event| *event == Event::Armed);
    check(
        armed.is_some_and(|s| s >= AGAIN_S),
        format!("it was armed again by the operator only, at {}", shown(armed)),
    );
}

fn at_event(run: &Run, from_s: f32, wanted: impl Fn(&Event) -> bool) -> Option<f32> {
    let mut events = run.events.iter();
    events.find(|(time_s, event)| *time_s >= from_s && wanted(event)).map(|(time_s, _)| *time_s)
}

fn largest(values: [f32; super::JOINTS]) -> f32 {
    values.iter().fold(0.0_f32, |most, value| most.max(value.abs()))
}

fn shown(time_s: Option<f32>) -> String {
    time_s.map_or_else(|| "no time".to_owned(), |time_s| format!("{time_s:.3} s"))
}
