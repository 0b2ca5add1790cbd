//! The rows of the controllers beside `Pid`, each through its checked `update`.

use crate::meter::{CALLS, instructions};
use crate::report::row;
use crate::rows::swinging;
use core::hint::black_box;
use drivetrain::chassis::Odometry;
use drivetrain::control::{
    Biquad, Differentiator, Identification, LoadObserver, LowPass, MotionLimits, Pid, PidConfig,
    Plant, PositionActuator, Profile, ProfileState, RelayTuner, SlewLimiter, SpeedActuator,
    StepResponse, Window,
};
use drivetrain::error::ConfigError;
use drivetrain::geometry::{Body, Twist};
use drivetrain::time::TimeStep;

const DT_S: f32 = 0.001;

/// Functions of one line, out of line. Not `row_`, whose code the row `text` sums.
macro_rules! functions {
    ($($name:ident($controller:ident: $kind:ty $(, $argument:ident)*) -> $result:ty = $body:expr;)*) => {
        $(
            #[unsafe(no_mangle)]
            #[inline(never)]
            fn $name($controller: $kind $(, $argument: f32)*) -> $result {
                $body
            }
        )*
    };
}

functions! {
    control_incremental(pid: &mut Pid, setpoint, measurement, dt_s) -> f32 = pid.step(setpoint, measurement, &TimeStep::of(dt_s));
    control_speed(actuator: &mut SpeedActuator, setpoint, speed, dt_s) -> f32 = actuator.step(setpoint, speed, &TimeStep::of(dt_s));
    control_position(actuator: &mut PositionActuator, setpoint, angle, speed, dt_s) -> f32 = actuator.step(setpoint, angle, speed, &TimeStep::of(dt_s));
    control_low_pass(filter: &mut LowPass, input, dt_s) -> f32 = filter.update(input, dt_s);
    control_biquad(filter: &mut Biquad, input) -> f32 = filter.update(input);
    control_moving_average(window: &mut Window<8>, sample) -> f32 = window.push(sample).mean();
    control_median(window: &mut Window<5>, sample) -> f32 = window.push(sample).median();
    control_linear(differentiator: &mut Differentiator, input, dt_s) -> f32 = differentiator.update(input, dt_s);
    control_optimal(differentiator: &mut Differentiator<true>, input, dt_s) -> f32 = differentiator.update(input, dt_s);
    control_slew(limiter: &mut SlewLimiter, target, dt_s) -> f32 = limiter.update(target, dt_s);
    control_profile(profile: &Profile, time_s) -> ProfileState = profile.at(time_s);
    control_plan(limits: &MotionLimits, start, end) -> Result<Profile, ConfigError> = Profile::plan(start, end, limits);
    control_feed_forward(gains: &Plant, velocity, acceleration) -> f32 = gains.effort(velocity, acceleration);
    control_relay(tuner: &mut RelayTuner, setpoint, measurement, dt_s) -> f32 = tuner.update(setpoint, measurement, dt_s);
    control_identification(identification: &mut Identification, effort, velocity, dt_s) -> () = identification.sample(effort, velocity, dt_s);
    control_load_observer(observer: &mut LoadObserver, velocity, torque, dt_s) -> () = observer.update(velocity, torque, dt_s);
    control_step_response(response: &mut StepResponse, value, dt_s) -> () = response.record(value, dt_s);
}

#[unsafe(no_mangle)]
#[inline(never)]
fn control_cascade(loops: &mut (Pid, Pid), error: f32, velocity: f32, step: &TimeStep) -> f32 {
    let (speed, position) = loops;
    let wanted = position.step_error(error, velocity, step);
    speed.step(wanted, velocity, step)
}

#[unsafe(no_mangle)]
#[inline(never)]
fn control_odometry(odometry: &mut Odometry, twist: &Twist<Body>, dt_s: f32) -> bool {
    odometry.advance(*twist, None, dt_s)
}

type Step<C> = fn(&mut C, f32, f32, f32) -> f32;
type Sampling<C> = fn(&mut C, f32, f32, f32);
type Filter<C> = fn(&mut C, f32, f32) -> f32;
type Sampler<C> = fn(&mut C, f32) -> f32;

/// Two controllers of one loop, the actuators, the filters, and the generators of targets.
pub fn rows() {
    loops();
    let mut filter = LowPass::new(black_box(30.0)).unwrap();
    timed("low_pass", control_low_pass, &mut filter);
    let mut filter = Biquad::low_pass(black_box(30.0), 0.7, 1_000.0).unwrap();
    sampled("biquad", control_biquad, &mut filter);
    sampled("moving_average_8", control_moving_average, &mut Window::new());
    sampled("median_5", control_median, &mut Window::new());
    let mut differentiator = Differentiator::linear(black_box(100.0), 0.005).unwrap();
    timed("differentiator_linear", control_linear, &mut differentiator);
    let mut differentiator = Differentiator::optimal(black_box(100.0), 0.006, 0.004).unwrap();
    timed("differentiator_optimal", control_optimal, &mut differentiator);
    let mut limiter = SlewLimiter::new(black_box(100.0), 50.0).unwrap();
    timed("slew_limiter", control_slew, &mut limiter);
    let limits = MotionLimits::new(2.0, 8.0);
    profile("profile_trapezoid", "profile_plan_trapezoid", limits);
    profile("profile_s_curve", "profile_plan_s_curve", limits.with_jerk(80.0));
    let effort = Plant::of_gains(black_box(0.3), 0.05, 0.01).unwrap();
    let each = |effort_of: fn(&Plant, f32, f32) -> f32, call| {
        _ = effort_of(&effort, swinging(call), swinging(call + 1));
    };
    row("feed_forward", &[instructions(control_feed_forward as _, each)]);
    let mut odometry = black_box(Odometry::default());
    let twist = black_box(Twist::<Body>::new(1.0, 0.5, 0.25));
    let each = |advance: fn(&mut Odometry, &Twist<Body>, f32) -> bool, _| {
        _ = advance(&mut odometry, &twist, DT_S);
    };
    row("odometry", &[instructions(control_odometry as _, each)]);
    tuning();
}

/// While they work: neither is done within the calls of a row.
fn tuning() {
    let tuner = RelayTuner::new(black_box(3.0), 0.1).and_then(|tuner| tuner.with_cycles(255));
    let mut tuner = tuner.unwrap();
    row(
        "relay_tuner",
        &[instructions(control_relay as Step<_>, |update, call| {
            update(&mut tuner, 1.0, swinging(call), DT_S);
        })],
    );
    assert!(!tuner.is_complete());
    let mut identification = Identification::new(black_box(10.0), 0.0).unwrap();
    // Not blind any more: the first of all, and the time after the jump from zero.
    for _ in 0..50 {
        identification.sample(3.0, 1.0, DT_S);
    }
    let before = identification.samples();
    row(
        "identification",
        &[instructions(control_identification as Sampling<_>, |sample, call| {
            sample(&mut identification, 3.0, 1.5 + 0.1 * swinging(call), DT_S);
        })],
    );
    assert!(identification.samples() >= before + CALLS);
    let mut observer = LoadObserver::new(black_box(0.05), 200.0).unwrap();
    row(
        "load_observer",
        &[instructions(control_load_observer as Sampling<_>, |update, call| {
            update(&mut observer, 3.0, 1.5 + 0.1 * swinging(call), DT_S);
        })],
    );
    assert!(observer.rejected() == 0);
    let mut response = StepResponse::new(0.0, black_box(1.0), 1.5, 0.02).unwrap();
    let each = |record: fn(&mut StepResponse, f32, f32), call| {
        record(&mut response, swinging(call), DT_S);
    };
    row("step_response", &[instructions(control_step_response as _, each)]);
    assert!(!response.is_complete());
}

fn loops() {
    let incremental =
        PidConfig::new(0.8, 4.0, 0.001).with_output_limit(20.0).with_incremental_form();
    let led = incremental.with_tracking(100.0);
    for (name, config) in [("incremental_update", incremental), ("tracking_update", led)] {
        let mut pid = Pid::new(black_box(config)).unwrap();
        row(
            name,
            &[instructions(control_incremental as Step<_>, |update, call| {
                update(&mut pid, 1.0, swinging(call), DT_S);
            })],
        );
    }
    let pid = PidConfig::new(0.8, 4.0, 0.001).with_output_limit(20.0).with_integral_limit(10.0);
    let bare = SpeedActuator::new(pid).unwrap();
    let filtered = bare.with_feedback_filter(100.0).unwrap().with_output_filter(200.0).unwrap();
    for (name, config) in [("speed_actuator", bare), ("speed_actuator_filters", filtered)] {
        let mut actuator = black_box(config);
        row(
            name,
            &[instructions(control_speed as Step<_>, |update, call| {
                update(&mut actuator, 1.0, swinging(call), DT_S);
            })],
        );
    }
    let position = Pid::new(black_box(pid)).unwrap();
    let mut cascade = (Pid::new(pid).unwrap(), position);
    let step = TimeStep::of(DT_S);
    row(
        "cascade",
        &[instructions(
            control_cascade as fn(&mut (Pid, Pid), f32, f32, &TimeStep) -> f32,
            |update, call| {
                update(&mut cascade, 0.5 - swinging(call), swinging(call + 1), &step);
            },
        )],
    );
    let mut actuator = black_box(PositionActuator::new(pid, bare).unwrap());
    row(
        "position_actuator",
        &[instructions(
            control_position as fn(&mut PositionActuator, f32, f32, f32, f32) -> f32,
            |update, call| {
                update(&mut actuator, 1.0, swinging(call), swinging(call + 1), DT_S);
            },
        )],
    );
}

fn timed<C>(name: &str, update: Filter<C>, controller: &mut C) {
    let each = |update: Filter<C>, call| _ = update(controller, swinging(call), DT_S);
    row(name, &[instructions(update, each)]);
}

fn sampled<C>(name: &str, update: Sampler<C>, controller: &mut C) {
    let each = |update: Sampler<C>, call| _ = update(controller, swinging(call));
    row(name, &[instructions(update, each)]);
}

/// Planning a move that takes about a second, and asking for a moment: over all of its parts.
fn profile(name: &str, plan: &str, limits: MotionLimits) {
    let profile = Profile::plan(0.0, black_box(1.5), &limits).unwrap();
    let call_s = profile.duration_s() / CALLS as f32;
    let each = |at: fn(&Profile, f32) -> ProfileState, call: u32| {
        _ = at(&profile, call as f32 * call_s);
    };
    row(name, &[instructions(control_profile as fn(&Profile, f32) -> ProfileState, each)]);
    // Moves that reach full speed, and shorter ones that do not.
    let each = |plan: fn(&MotionLimits, f32, f32) -> Result<Profile, ConfigError>, call| {
        _ = plan(&limits, 0.0, swinging(call) - 0.5);
    };
    row(plan, &[instructions(control_plan as _, each)]);
}
