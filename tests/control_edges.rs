//! What every type of `control` does at the edges of its inputs: one table of types, one test for each rule.

#![cfg(test)]
#![expect(clippy::float_cmp, reason = "exact results are the rule under test")]

use drivetrain::control::*;
use drivetrain::error::ConfigError;
use drivetrain::time::TimeStep;
use proptest::prelude::*;
use std::fmt::Debug;

const DT_S: f32 = 0.001;
const NO_TIME: [f32; 7] =
    [0.0, -0.0, -DT_S, f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MIN_POSITIVE / 4.0];
const NOT_FINITE: [f32; 3] = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY];
const HUGE: [f32; 8] = [f32::MAX, f32::MIN, 1.0, f32::MAX, 0.0, f32::MIN, 1e30, -1e30];

/// What a type does with a time step above its maximum.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Long {
    /// Integral and derivative stay: with the same inputs the output stays.
    Freezes,
    /// The same behind a filter or a differentiator, for which it counts as their maximum.
    FreezesBehindFilter,
    /// It counts as this many seconds.
    CountsAs(f32),
    /// It counts in full.
    InFull,
    /// It starts anew.
    StartsAnew,
    /// There is no time step.
    NoTime,
}

trait Subject: Debug {
    /// Steps with a setpoint, or an input, and one or two measurements; what a type has not is left out.
    fn step(&mut self, inputs: [f32; 3], dt_s: f32) -> f32;
    fn refused(&self) -> u16;
    /// How many of the inputs it takes.
    fn inputs(&self) -> usize;
}

macro_rules! subjects {
    ($($kind:ty, $inputs:literal, $it:ident, $values:pat, $dt_s:pat => $step:expr, $refused:expr;)*) => {
        $(impl Subject for $kind {
            fn step(&mut self, $values: [f32; 3], $dt_s: f32) -> f32 {
                let $it = self;
                $step
            }

            fn refused(&self) -> u16 {
                let $it = self;
                $refused
            }

            fn inputs(&self) -> usize {
                $inputs
            }
        })*
    };
}

/// A position loop over a speed loop, without filters.
#[derive(Debug, Clone, Copy)]
struct Cascade {
    position: Pid,
    speed: Pid,
}

impl Cascade {
    const fn new(position: PidConfig, speed: PidConfig) -> Result<Self, ConfigError> {
        match (Pid::new(position), Pid::new(speed)) {
            (Ok(position), Ok(speed)) => Ok(Self { position, speed }),
            (Err(error), _) | (_, Err(error)) => Err(error),
        }
    }

    fn step(&mut self, error: f32, velocity: f32, step: &TimeStep) -> f32 {
        let wanted = self.position.step_error(error, velocity, step);
        self.speed.step(wanted, velocity, step)
    }
}

/// A [`PositionActuator`] that is given errors.
#[derive(Debug)]
struct ByError(PositionActuator);

/// A [`Window`] that is asked for its mean.
#[derive(Debug)]
struct Mean(Window<5>);

/// A [`Window`] that is asked for its median.
#[derive(Debug)]
struct Median(Window<5>);

subjects! {
    Pid, 2, it, [a, b, _], dt_s => it.step(a, b, &TimeStep::of(dt_s)), it.rejected();
    Cascade, 2, it, [a, b, _], dt_s => it.step(a, b, &TimeStep::of(dt_s)), it.position.rejected().max(it.speed.rejected());
    SpeedActuator, 2, it, [a, b, _], dt_s => it.step(a, b, &TimeStep::of(dt_s)), it.rejected();
    PositionActuator, 3, it, [a, b, c], dt_s => it.step(a, b, c, &TimeStep::of(dt_s)), it.rejected();
    ByError, 2, it, [a, b, _], dt_s => it.0.step_error(a, b, &TimeStep::of(dt_s)), it.0.rejected();
    Differentiator, 1, it, [a, ..], dt_s => it.update(a, dt_s), it.rejected();
    Differentiator<true>, 1, it, [a, ..], dt_s => it.update(a, dt_s), it.rejected();
    LowPass, 1, it, [a, ..], dt_s => it.update(a, dt_s), it.rejected();
    SlewLimiter, 1, it, [a, ..], dt_s => it.update(a, dt_s), it.rejected();
    Biquad, 1, it, [a, ..], _ => it.update(a), it.rejected();
    Mean, 1, it, [a, ..], _ => it.0.push(a).mean(), it.0.rejected();
    Median, 1, it, [a, ..], _ => it.0.push(a).median(), it.0.rejected();
    RelayTuner, 2, it, [a, b, _], dt_s => it.update(a, b, dt_s), it.rejected();
    StepResponse, 1, it, [a, ..], dt_s => {
        it.record(a, dt_s);
        it.overshoot()
    }, it.rejected();
}

const GAINS: PidConfig =
    PidConfig::new(2.0, 10.0, 0.01).with_output_limit(50.0).with_integral_limit(20.0);

const fn every_option() -> PidConfig {
    GAINS
        .with_output_range(-40.0, 50.0)
        .with_integral_separation(100.0)
        .with_variable_integral(20.0, 80.0)
        .with_dead_band(0.001)
        .with_feed_forward(0.5, 0.01)
        .with_slew_limit(4e5)
        .with_period(360.0)
        .with_derivative_filter(100.0)
        .with_back_calculation(0.05)
}

fn position(angle: PidConfig, speed: PidConfig) -> PositionActuator {
    let speed = SpeedActuator::new(speed).unwrap().with_output_filter(300.0).unwrap();
    let config = PositionActuator::new(angle, speed).unwrap().with_outer_divider(3).unwrap();
    config.with_angle_filter(200.0).unwrap()
}

fn bare(angle: PidConfig, speed: PidConfig) -> PositionActuator {
    PositionActuator::new(angle, SpeedActuator::new(speed).unwrap()).unwrap()
}

type Row = (Long, Box<dyn Subject>);

/// Every type with the loop gains given, twice where its options change what it does.
fn table(gains: PidConfig) -> Vec<Row> {
    let (kp, ki, kd) = gains.gains();
    let incremental = PidConfig::new(kp, ki, kd).with_output_limit(50.0).with_incremental_form();
    let tracking = incremental.with_tracking(80.0);
    let filtered = SpeedActuator::new(gains).unwrap().with_feedback_filter(100.0).unwrap();
    let options = every_option().with_gains(kp, ki, kd);
    use Long::{CountsAs, Freezes, FreezesBehindFilter, InFull, NoTime, StartsAnew};
    vec![
        (Freezes, Box::new(Pid::new(gains).unwrap())),
        (Freezes, Box::new(Pid::new(gains.with_derivative_on_error()).unwrap())),
        (Freezes, Box::new(Pid::new(options).unwrap())),
        (Freezes, Box::new(Pid::new(incremental).unwrap())),
        (CountsAs(0.01), Box::new(Differentiator::linear(100.0, 0.01).unwrap())),
        (CountsAs(0.01), Box::new(Differentiator::optimal(1e4, 0.0125, 0.01).unwrap())),
        (CountsAs(0.1), Box::new(SlewLimiter::new(30.0, 60.0).unwrap())),
        (Freezes, Box::new(Cascade::new(gains, gains).unwrap())),
        (Freezes, Box::new(SpeedActuator::new(gains).unwrap())),
        (Freezes, Box::new(bare(gains, gains))),
        (Freezes, Box::new(ByError(bare(gains, gains)))),
        (FreezesBehindFilter, Box::new(filtered)),
        (FreezesBehindFilter, Box::new(position(gains, gains))),
        (FreezesBehindFilter, Box::new(Pid::new(tracking).unwrap())),
        (InFull, Box::new(LowPass::new(10.0).unwrap())),
        (InFull, Box::new(StepResponse::new(0.0, 1.0, 100.0, 0.02).unwrap())),
        (StartsAnew, Box::new(RelayTuner::new(3.0, 0.01).unwrap())),
        (NoTime, Box::new(Biquad::low_pass(30.0, Biquad::BUTTERWORTH, 1000.0).unwrap())),
        (NoTime, Box::new(Biquad::notch(60.0, 2.0, 1000.0).unwrap())),
        (NoTime, Box::new(Mean(Window::new()))),
        (NoTime, Box::new(Median(Window::new()))),
    ]
}

/// Inputs that keep everything moving and nothing at a limit.
fn moving(sample: u8) -> [f32; 3] {
    let time = f32::from(sample);
    [1.0 + 0.5 * (0.7 * time).sin(), 0.02 * time, 0.3 * (0.4 * time).cos()]
}

/// Runs two of each type; `disturb` one of them before every sample, and it must leave no trace.
fn leaves_no_trace(gains: PidConfig, disturb: impl Fn(&mut dyn Subject, Long, [f32; 3]) -> u16) {
    for ((long, mut clean), (_, mut hit)) in table(gains).into_iter().zip(table(gains)) {
        let mut refused = 0;
        for sample in 0..20 {
            refused += disturb(&mut *hit, long, moving(sample));
            let expected = clean.step(moving(sample), DT_S);
            assert_eq!(hit.step(moving(sample), DT_S), expected, "{clean:?}");
        }
        assert_eq!(hit.refused(), refused, "{hit:?}");
        assert_eq!(clean.refused(), 0, "{clean:?}");
    }
}

#[test]
fn a_time_step_that_is_no_time_holds_the_output_and_is_counted() {
    leaves_no_trace(GAINS, |subject, long, [a, b, c]| {
        if long == Long::NoTime {
            return 0;
        }
        let mut held = None;
        for dt_s in NO_TIME {
            let output = subject.step([a + 1.0, b + 1.0, c + 1.0], dt_s);
            assert_eq!(*held.get_or_insert(output), output, "{subject:?}");
        }
        7
    });
}

#[test]
fn an_input_that_is_not_finite_holds_the_output_and_is_counted() {
    // D rests in the step after it, and the filters of actuators start anew: tests of their own.
    leaves_no_trace(GAINS.with_gains(2.0, 10.0, 0.0), |subject, long, inputs| {
        let mut refused = 0;
        if long == Long::FreezesBehindFilter && !format!("{subject:?}").starts_with("Incr") {
            return 0;
        }
        for input in 0..subject.inputs() {
            for bad in NOT_FINITE {
                let mut inputs = inputs;
                inputs[input] = bad;
                // A cascade whose position loop holds runs its speed loop on: a law of its own, below.
                if input == 0 && format!("{subject:?}").starts_with("Cascade") {
                    continue;
                }
                assert!(subject.step(inputs, DT_S).is_finite(), "{subject:?}");
                refused += 1;
            }
        }
        refused
    });
}

#[test]
fn the_output_that_is_held_is_the_last_one() {
    for (long, mut subject) in table(GAINS) {
        let mut last = 0.0; // before the first good sample
        for sample in 0..10 {
            let mut bad = moving(sample);
            bad[subject.inputs() - 1] = f32::NAN;
            assert_eq!(subject.step(bad, DT_S), last, "{subject:?}");
            if long != Long::NoTime {
                assert_eq!(subject.step(moving(sample), 0.0), last, "{subject:?}");
            }
            last = subject.step(moving(sample), DT_S);
        }
    }
}

#[test]
fn a_cascade_with_a_bad_error_holds_the_speed_that_is_wanted() {
    let mut cascade = Cascade::new(GAINS, GAINS).unwrap();
    let step = TimeStep::of(DT_S);
    cascade.step(1.0, 0.0, &step);
    let (wanted, mut speed) = (cascade.position.output(), cascade.speed);
    for bad in NOT_FINITE {
        assert_eq!(cascade.step(bad, 0.5, &step), speed.step(wanted, 0.5, &step));
    }
    assert_eq!((cascade.position.rejected(), cascade.speed.rejected()), (3, 0));
}

#[test]
fn the_first_call_may_come_after_any_time() {
    for ((long, mut early), (_, mut late)) in table(GAINS).into_iter().zip(table(GAINS)) {
        let inputs = [3.0, 1.0, 0.0];
        let dt_s = if let Long::CountsAs(most) = long { most } else { DT_S };
        // By error, the rate of the first call is known: D rests in a long step, so let it be zero.
        let kind = format!("{early:?}");
        let is_by_error = ["Cascade", "ByError"].iter().any(|name| kind.starts_with(name));
        let inputs = if is_by_error { [3.0, 0.0, 0.0] } else { inputs };
        let expected = early.step(inputs, dt_s);
        assert_eq!(late.step(inputs, 1000.0), expected, "{early:?}");
    }
}

#[test]
fn a_time_step_above_the_maximum_does_what_the_documentation_says() {
    for ((long, mut subject), (_, mut steady)) in table(GAINS).into_iter().zip(table(GAINS)) {
        let inputs = [3.0, 1.0, 0.5];
        let (mut before, mut slow) = (0.0, 0.0);
        for _ in 0..5 {
            before = subject.step(inputs, DT_S);
            slow = steady.step(inputs, DT_S);
        }
        assert_eq!(before, slow, "{subject:?}");
        let after = subject.step(inputs, 1000.0);
        match long {
            Long::Freezes => assert_eq!(after, before, "{subject:?}"),
            // P follows what is in front, at most all of the error of 2; an integral of 1000 s would be at its limit of 20.
            Long::FreezesBehindFilter => assert!((after - before).abs() < 4.0, "{subject:?}"),
            Long::CountsAs(most) => assert_eq!(after, steady.step(inputs, most), "{subject:?}"),
            Long::InFull => assert!(after == before || (after - inputs[0]).abs() < 1e-3),
            Long::StartsAnew => assert_eq!(after, 3.0), // the setpoint is above
            Long::NoTime => {}
        }
        let is_counted = matches!(long, Long::Freezes | Long::FreezesBehindFilter);
        assert_eq!(subject.refused(), u16::from(is_counted), "{subject:?}");
    }
}

#[test]
fn huge_gains_and_huge_inputs_end_at_a_limit_and_never_in_nan() {
    let huge = PidConfig::new(1e30, 1e30, 1e30).with_output_limit(50.0);
    for dt_s in [1e-6, DT_S, 0.1, 1e3] {
        for (_, mut subject) in table(huge) {
            for round in 0..24 {
                let at = |shift: usize| HUGE[(round * (shift + 1) + shift) % HUGE.len()];
                let output = subject.step([at(0), at(1), at(2)], dt_s);
                assert!(output.is_finite(), "{subject:?}");
            }
            for _ in 0..2_000 {
                subject.step([0.0; 3], DT_S);
            }
            assert!(subject.step([0.0; 3], DT_S).is_finite(), "{subject:?}");
        }
    }
}

fn is_controller(subject: &dyn Subject) -> bool {
    let kind = format!("{subject:?}");
    ["Pid", "Cascade", "SpeedA", "PositionA", "ByError"].iter().any(|name| kind.starts_with(name))
}

#[test]
fn controllers_stay_within_their_output_limit_with_huge_gains() {
    let huge = PidConfig::new(1e30, 1e30, 1e30).with_output_limit(50.0);
    for (_, mut subject) in table(huge) {
        for sample in 0..40 {
            let output = subject.step(moving(sample), DT_S);
            let within = (-50.0..=50.0).contains(&output) || !is_controller(&*subject);
            assert!(within, "{subject:?}: {output}");
        }
    }
}

proptest! {
    #[test]
    fn every_controller_stays_within_its_output_limit_for_any_finite_input(
        gains in (0.0_f32..1e6, 0.0_f32..1e6, 0.0_f32..1e6),
        samples in prop::collection::vec((-f32::MAX..f32::MAX, -1e3_f32..1e3, -1e3_f32..1e3, 0.0_f32..0.2), 1..30),
    ) {
        let gains = PidConfig::new(gains.0, gains.1, gains.2).with_output_limit(50.0);
        for (_, mut subject) in table(gains) {
            for (order, &(a, b, c, dt_s)) in samples.iter().enumerate() {
                let inputs = [[a, b, c], [b, a, c], [c, b, a]][order % 3];
                let output = subject.step(inputs, dt_s);
                let within = (-50.0..=50.0).contains(&output) || !is_controller(&*subject);
                prop_assert!(output.is_finite() && within, "{:?}: {}", subject, output);
            }
        }
    }
}

#[test]
fn the_count_of_refused_steps_stays_at_its_end() {
    for (_, mut subject) in table(GAINS) {
        for _ in 0..70_000 {
            subject.step([f32::NAN; 3], DT_S);
        }
        assert_eq!(subject.refused(), u16::MAX, "{subject:?}");
        assert!(subject.step(moving(1), DT_S).is_finite(), "{subject:?}");
    }
}

#[test]
fn after_a_bad_input_the_filters_of_an_actuator_start_anew_and_smooth_again() {
    let proportional = PidConfig::new(2.0, 0.0, 0.0);
    let smooth = SpeedActuator::new(proportional).unwrap().with_feedback_filter(1.0).unwrap();
    let mut speed = smooth;
    let position = PositionActuator::new(PidConfig::new(3.0, 0.0, 0.0), smooth).unwrap();
    let mut position = position.with_angle_filter(1.0).unwrap();
    for bad in NOT_FINITE {
        for _ in 0..5 {
            speed.step(0.0, 1.0, &TimeStep::of(DT_S));
            position.step(0.0, 1.0, 1.0, &TimeStep::of(DT_S));
        }
        let held = (speed.output(), position.output());
        assert_eq!(
            (
                speed.step(0.0, bad, &TimeStep::of(DT_S)),
                position.step(0.0, 1.0, bad, &TimeStep::of(DT_S))
            ),
            held
        );
        assert_eq!(
            (
                speed.step(bad, 1.0, &TimeStep::of(DT_S)),
                position.step(0.0, bad, 1.0, &TimeStep::of(DT_S))
            ),
            held
        );
        // As the first ones they count in full, and not a 160th part as those that follow.
        let first = (
            speed.step(0.0, 5.0, &TimeStep::of(DT_S)),
            position.step(0.0, 5.0, 4.0, &TimeStep::of(DT_S)),
        );
        assert_eq!(first, (-10.0, -38.0));
        let next = (
            speed.step(0.0, 9.0, &TimeStep::of(DT_S)),
            position.step(0.0, 9.0, 8.0, &TimeStep::of(DT_S)),
        );
        assert!((next.0 + 10.05).abs() < 0.01 && (next.1 + 38.2).abs() < 0.01, "{next:?}");
    }
    assert_eq!((speed.rejected(), position.rejected()), (6, 6));
}

#[test]
fn a_positive_kd_damps_in_every_controller_by_every_way_in() {
    type Way = Box<dyn FnMut(f32, f32) -> f32>;
    let damper = PidConfig::new(0.0, 0.0, 0.5);
    let (follower, idle) = (PidConfig::new(1.0, 0.0, 0.0), PidConfig::new(0.0, 0.0, 0.0));
    let step = TimeStep::of(DT_S);
    let pid = |config| Pid::new(config).unwrap();
    let (mut one, mut two, mut three) = (pid(damper), pid(damper), pid(damper));
    let mut on_error = pid(damper.with_derivative_on_error());
    let mut options = pid(every_option().with_gains(0.0, 0.0, 0.5).with_feed_forward(0.0, 0.0));
    let incremental = PidConfig::new(0.0, 0.0, 0.5).with_incremental_form();
    let mut four = Pid::new(incremental).unwrap();
    let mut five = four;
    let mut tracking = Pid::new(incremental.with_tracking(80.0)).unwrap();
    let mut six = SpeedActuator::new(damper).unwrap();
    let mut seven = six;
    let (mut eight, mut inner) = (bare(damper, follower), bare(idle, damper));
    let (mut nine, mut ten, mut eleven) = (eight, eight, eight);
    let mut cascade = Cascade::new(damper, follower).unwrap();
    let (mut outer, mut speed) = (cascade, Cascade::new(idle, damper).unwrap());
    let ways: [(&str, Way); 18] = [
        ("update", Box::new(move |at, _| one.step(0.0, at, &TimeStep::of(DT_S)))),
        ("step", Box::new(move |at, _| two.step(0.0, at, &step))),
        ("step_error", Box::new(move |_, rate| three.step_error(0.0, rate, &step))),
        ("on error", Box::new(move |at, _| on_error.step(0.0, at, &TimeStep::of(DT_S)))),
        ("every option", Box::new(move |at, _| options.step(0.0, at, &TimeStep::of(DT_S)))),
        ("incremental update", Box::new(move |at, _| four.step(0.0, at, &TimeStep::of(DT_S)))),
        ("incremental step", Box::new(move |at, _| five.step(0.0, at, &step))),
        ("tracking", Box::new(move |at, _| tracking.step(0.0, at, &TimeStep::of(DT_S)))),
        ("speed update", Box::new(move |at, _| six.step(0.0, at, &TimeStep::of(DT_S)))),
        ("speed step", Box::new(move |at, _| seven.step(0.0, at, &step))),
        ("angle update", Box::new(move |at, _| eight.step(0.0, at, 0.0, &TimeStep::of(DT_S)))),
        ("angle step", Box::new(move |at, _| nine.step(0.0, at, 0.0, &step))),
        ("angle error", Box::new(move |_, rate| ten.step_error(0.0, rate, &TimeStep::of(DT_S)))),
        ("angle error step", Box::new(move |_, rate| eleven.step_error(0.0, rate, &step))),
        ("inner loop", Box::new(move |at, _| inner.step(0.0, 0.0, at, &TimeStep::of(DT_S)))),
        ("cascade", Box::new(move |_, rate| cascade.step(0.0, rate, &step))),
        ("cascade, position", Box::new(move |_, rate| outer.position.step_error(0.0, rate, &step))),
        ("cascade, speed", Box::new(move |at, _| speed.speed.step(0.0, at, &step))),
    ];
    for (name, mut way) in ways {
        for rate in [10.0, -10.0] {
            way(0.0, rate);
            let output = way(rate * DT_S, rate);
            assert!(output * rate < 0.0, "{name}: {output} at {rate}/s");
        }
    }
}

/// A bad constant of these does not compile.
#[test]
fn what_needs_arithmetic_and_comparison_only_is_made_in_a_constant() {
    const SPEED: Option<SpeedActuator> = match SpeedActuator::new(GAINS) {
        Ok(speed) => match speed.with_feedback_filter(100.0) {
            Ok(speed) => Some(speed),
            Err(_) => None,
        },
        Err(_) => None,
    };
    const MADE: [bool; 15] = [
        Pid::new(every_option()).is_ok(),
        Pid::new(GAINS.with_incremental_form().with_tracking(5.0)).is_ok(),
        Cascade::new(GAINS, GAINS).is_ok(),
        SPEED.is_some(),
        matches!(SPEED, Some(speed) if PositionActuator::new(GAINS, speed).is_ok()),
        Differentiator::linear(100.0, DT_S).is_ok(),
        Differentiator::optimal(1e4, 0.002, DT_S).is_ok(),
        LowPass::new(10.0).is_ok(),
        Biquad::low_pass(30.0, Biquad::BUTTERWORTH, 1000.0).is_ok(),
        Biquad::notch(60.0, 2.0, 1000.0).is_ok(),
        Window::<5>::new().rejected() == 0,
        SlewLimiter::new(1.0, 2.0).is_ok() && MotionLimits::new(1.0, 1.0).validate().is_ok(),
        Plant::of_gains(0.3, 0.05, 0.01).is_ok(),
        RelayTuner::new(3.0, 0.01).is_ok(),
        StepResponse::new(0.0, 1.0, 1.0, 0.02).is_ok(),
    ];
    assert_eq!(MADE, [true; 15]);
}

#[test]
fn the_table_of_the_module_says_when_to_use_each_type() {
    let source = include_str!("../src/control/mod.rs");
    let rows: String = source.lines().filter(|line| line.starts_with("//! |")).collect();
    let public = source.split("pub use ").skip(1).filter_map(|rest| rest.split(';').next());
    let names = public.flat_map(|uses| uses.split(|letter: char| !letter.is_alphanumeric()));
    let parts = ["TimeStep", "MotionLimits", "ProfileState"];
    let mut seen = 0;
    for name in names.filter(|name| name.starts_with(char::is_uppercase)) {
        let is_part = ["Config", "Error", "Fault", "Failure"].iter().any(|end| name.ends_with(end));
        if !is_part && !parts.contains(&name) {
            assert!(rows.contains(&format!("[`{name}")), "{name} is not in the table");
            seen += 1;
        }
    }
    assert_eq!(seen, 20);
}

#[test]
fn without_ki_nothing_is_wound_up() {
    let proportional = PidConfig::new(2.0, 0.0, 0.0).with_output_limit(50.0);
    let actuator = SpeedActuator::new(proportional).unwrap();
    let loops: [Box<dyn Subject>; 6] = [
        Box::new(Pid::new(proportional).unwrap()),
        Box::new(Pid::new(every_option().with_gains(2.0, 0.0, 0.0)).unwrap()),
        Box::new(Cascade::new(proportional, proportional).unwrap()),
        Box::new(actuator),
        Box::new(bare(proportional, proportional)),
        Box::new(ByError(bare(proportional, proportional))),
    ];
    for mut subject in loops {
        for _ in 0..1000 {
            subject.step([100.0, 0.0, 0.0], DT_S);
        }
        subject.step([0.0; 3], DT_S);
        assert_eq!(subject.step([0.0; 3], DT_S), 0.0, "{subject:?}");
    }
    // The incremental form: P of 200 and 180 is cut to 50, and no more than that is gone.
    let config = PidConfig::new(2.0, 0.0, 0.0).with_output_limit(50.0).with_incremental_form();
    let mut incremental = Pid::new(config).unwrap();
    assert_eq!(incremental.step(100.0, 0.0, &TimeStep::of(DT_S)), 50.0);
    assert_eq!(incremental.step(90.0, 0.0, &TimeStep::of(DT_S)), 50.0);
    assert_eq!(incremental.step(0.0, 0.0, &TimeStep::of(DT_S)), 0.0);
}

#[test]
fn the_angle_loop_rests_when_one_of_its_steps_was_too_long() {
    let integral = PidConfig::new(0.0, 1.0, 0.0);
    let speed = SpeedActuator::new(PidConfig::new(1.0, 0.0, 0.0)).unwrap();
    let mut actuator =
        PositionActuator::new(integral, speed).unwrap().with_outer_divider(4).unwrap();
    for step in 0..=8 {
        let dt_s = if step == 6 { 10.0 } else { 0.1 };
        actuator.step(1.0, 0.0, 0.0, &TimeStep::of(dt_s));
    }
    // Four steps of 0.1 s on the first turn; none on the second, though three of its four were good.
    assert!((actuator.speed_setpoint() - 0.4).abs() < 1e-6, "{}", actuator.speed_setpoint());
}

#[test]
fn the_integral_of_the_angle_loop_works_at_every_divider() {
    for divider in [1, 5, 120, 255] {
        let integral = PidConfig::new(0.0, 1.0, 0.0);
        let speed = SpeedActuator::new(PidConfig::new(1.0, 0.0, 0.0)).unwrap();
        let config =
            PositionActuator::new(integral, speed).unwrap().with_outer_divider(divider).unwrap();
        let mut actuator = config;
        for _ in 0..=10 * u32::from(divider) {
            actuator.step(1.0, 0.0, 0.0, &TimeStep::of(DT_S));
        }
        let expected = 10.0 * f32::from(divider) * DT_S;
        assert!((actuator.speed_setpoint() - expected).abs() < 1e-4, "{divider}");
    }
}

#[test]
fn what_has_no_state_answers_bad_arguments_with_rest() {
    let effort = Plant::of_gains(0.3, 0.05, 0.01).unwrap();
    let profile = Profile::plan(1.0, 2.0, &MotionLimits::new(1.0, 1.0)).unwrap();
    for bad in NOT_FINITE {
        assert_eq!((effort.effort(bad, 1.0), effort.effort(1.0, bad)), (0.0, 0.0));
        assert_eq!(profile.at(bad).velocity, 0.0);
        assert!(fhan(bad, 1.0, 2.0, 0.01).abs() <= 2.0 && fhan(1.0, bad, 2.0, 0.01).abs() <= 2.0);
    }
    assert_eq!((profile.at(f32::NAN).position, profile.at(f32::INFINITY).position), (1.0, 2.0));
    assert_eq!((fhan(f32::NAN, 0.0, 2.0, 0.01), fhan(1.0, 0.0, 2.0, f32::NAN)), (0.0, 0.0));
}

type Make = fn(f32) -> Option<ConfigError>;
type Parameters = &'static [(&'static str, Make)];

/// Every parameter of every constructor; what is made of a bad value must be an error of this name.
const MORE_THAN_ZERO: Parameters = &[
    ("output_limit", |x| Pid::new(GAINS.with_output_limit(x)).err()),
    ("integral_limit", |x| Pid::new(GAINS.with_integral_limit(x)).err()),
    ("integral_separation", |x| Pid::new(GAINS.with_integral_separation(x)).err()),
    ("back_calculation", |x| Pid::new(GAINS.with_back_calculation(x)).err()),
    ("slew_limit", |x| Pid::new(GAINS.with_slew_limit(x)).err()),
    ("period", |x| Pid::new(GAINS.with_period(x)).err()),
    ("derivative_filter", |x| Pid::new(GAINS.with_derivative_filter(x)).err()),
    ("output_limit", |x| incremental(|config| config.with_output_limit(x))),
    ("r", |x| incremental(|config| config.with_tracking(x))),
    ("r", |x| Differentiator::linear(x, DT_S).err()),
    ("max_step", |x| Differentiator::linear(1.0, x).err()),
    ("r", |x| Differentiator::optimal(x, 0.002, DT_S).err()),
    ("h0", |x| Differentiator::optimal(1.0, x, DT_S).err()),
    ("max_step", |x| Differentiator::optimal(1.0, 0.002, x).err()),
    ("cutoff", |x| LowPass::new(x).err()),
    ("cutoff", |x| Biquad::low_pass(x, 1.0, 1000.0).err()),
    ("q", |x| Biquad::low_pass(10.0, x, 1000.0).err()),
    ("sample_hz", |x| Biquad::low_pass(10.0, 1.0, x).err()),
    ("center", |x| Biquad::notch(x, 1.0, 1000.0).err()),
    ("q", |x| Biquad::notch(10.0, x, 1000.0).err()),
    ("sample_hz", |x| Biquad::notch(10.0, 1.0, x).err()),
    ("up", |x| SlewLimiter::new(x, 1.0).err()),
    ("down", |x| SlewLimiter::new(1.0, x).err()),
    ("max_step", |x| SlewLimiter::new(1.0, 1.0).ok()?.with_max_step(x).err()),
    ("velocity", |x| Profile::plan(0.0, 1.0, &MotionLimits::new(x, 1.0)).err()),
    ("acceleration", |x| Profile::plan(0.0, 1.0, &MotionLimits::new(1.0, x)).err()),
    ("jerk", |x| Profile::plan(0.0, 1.0, &MotionLimits::new(1.0, 1.0).with_jerk(x)).err()),
    ("feedback_filter", |x| speed(|config| config.with_feedback_filter(x))),
    ("output_filter", |x| speed(|config| config.with_output_filter(x))),
    ("angle_filter", |x| angle(|config| config.with_angle_filter(x))),
    ("amplitude", |x| RelayTuner::new(x, 0.1).err()),
    ("time_limit", |x| RelayTuner::new(1.0, 0.1).and_then(|tuner| tuner.with_time_limit(x)).err()),
    ("duration", |x| StepResponse::new(0.0, 1.0, x, 0.02).err()),
    ("tolerance", |x| StepResponse::new(0.0, 1.0, 1.0, x).err()),
];

/// The same for those that may be zero.
const ZERO_OR_MORE: Parameters = &[
    ("kp", |x| Pid::new(PidConfig::new(x, 0.0, 0.0)).err()),
    ("ki", |x| Pid::new(PidConfig::new(0.0, x, 0.0)).err()),
    ("kd", |x| Pid::new(PidConfig::new(0.0, 0.0, x)).err()),
    ("kp", |x| Pid::new(GAINS).ok()?.set_gains(x, 0.0, 0.0).err()),
    ("ki", |x| Pid::new(PidConfig::new(0.0, x, 0.0).with_incremental_form()).err()),
    ("kd", |x| Cascade::new(GAINS.with_gains(0.0, 0.0, x), GAINS).err()),
    ("kd", |x| Cascade::new(GAINS, GAINS.with_gains(0.0, 0.0, x)).err()),
    ("variable_integral", |x| Pid::new(GAINS.with_variable_integral(x, 10.0)).err()),
    ("dead_band", |x| Pid::new(GAINS.with_dead_band(x)).err()),
    ("static_gain", |x| Pid::new(GAINS.with_feed_forward(x, 0.0)).err()),
    ("velocity_gain", |x| Pid::new(GAINS.with_feed_forward(0.0, x)).err()),
    ("ks", |x| Plant::of_gains(x, 0.0, 0.0).err()),
    ("kv", |x| Plant::of_gains(0.0, x, 0.0).err()),
    ("ka", |x| Plant::of_gains(0.0, 0.0, x).err()),
    ("hysteresis", |x| RelayTuner::new(1.0, x).err()),
];

/// What no pair of values, or no value of its kind, can mean.
const CONTRADICTIONS: Parameters = &[
    ("output_range", |_| Pid::new(GAINS.with_output_range(5.0, 4.0)).err()),
    ("output_range", |_| Pid::new(GAINS.with_output_range(5.0, 5.0)).err()),
    ("output_range", |_| incremental(|config| config.with_output_range(1.0, -2.0))),
    ("variable_integral", |_| Pid::new(GAINS.with_variable_integral(3.0, 2.0)).err()),
    ("r", |_| Pid::new(GAINS.with_period(360.0).with_tracking(80.0)).err()),
    ("r", |_| Differentiator::linear(1001.0, DT_S).err()),
    ("h0", |_| Differentiator::optimal(1.0, 1.2 * DT_S, DT_S).err()),
    ("cutoff", |_| Biquad::low_pass(500.0, 1.0, 1000.0).err()),
    ("center", |_| Biquad::notch(500.0, 1.0, 1000.0).err()),
    ("cutoff", |_| Biquad::low_pass(0.9, 1.0, 1000.0).err()),
    ("q", |_| Biquad::notch(60.0, 1e3, 1000.0).err()),
    ("q", |_| Biquad::low_pass(60.0, 1e-3, 1000.0).err()),
    ("outer_divider", |_| angle(|config| config.with_outer_divider(0))),
    ("angle_filter", |_| {
        let circle =
            PositionActuator::new(GAINS.with_period(360.0), SpeedActuator::new(GAINS).unwrap())
                .unwrap();
        circle.with_angle_filter(10.0).err()
    }),
    ("cycles", |_| RelayTuner::new(1.0, 0.1).and_then(|tuner| tuner.with_cycles(0)).err()),
    ("bias", |_| RelayTuner::new(f32::MAX, 0.1).and_then(|tuner| tuner.with_bias(f32::MAX)).err()),
    ("target", |_| StepResponse::new(1.0, 1.0, 1.0, 0.02).err()),
    ("start", |_| Profile::plan(f32::NAN, 1.0, &MotionLimits::new(1.0, 1.0)).err()),
    ("distance", |_| Profile::plan(f32::MIN, f32::MAX, &MotionLimits::new(1.0, 1.0)).err()),
];

fn incremental(with: impl Fn(PidConfig) -> PidConfig) -> Option<ConfigError> {
    Pid::new(with(PidConfig::new(1.0, 1.0, 1.0).with_incremental_form())).err()
}

fn speed(
    with: impl Fn(SpeedActuator) -> Result<SpeedActuator, ConfigError>,
) -> Option<ConfigError> {
    SpeedActuator::new(GAINS).and_then(with).err()
}

fn angle(
    with: impl Fn(PositionActuator) -> Result<PositionActuator, ConfigError>,
) -> Option<ConfigError> {
    let speed = SpeedActuator::new(GAINS).unwrap();
    PositionActuator::new(GAINS, speed).and_then(with).err()
}

#[test]
fn a_parameter_that_cannot_work_is_named() {
    let bad = [-1.0, f32::NAN, f32::INFINITY, f32::NEG_INFINITY];
    let tables: [(Parameters, &[f32]); 4] = [
        (MORE_THAN_ZERO, &bad),
        (MORE_THAN_ZERO, &[0.0, -0.0]),
        (ZERO_OR_MORE, &bad),
        (CONTRADICTIONS, &[0.0]),
    ];
    for (table, values) in tables {
        for (index, (name, make)) in table.iter().enumerate() {
            for &value in values {
                let error =
                    make(value).unwrap_or_else(|| panic!("{index}: {name} {value} is taken"));
                assert_eq!(error.parameter(), *name, "{index}: {value}");
            }
        }
    }
    for (index, (name, make)) in ZERO_OR_MORE.iter().enumerate() {
        assert_eq!(make(0.0), None, "{index}: {name}");
    }
}
