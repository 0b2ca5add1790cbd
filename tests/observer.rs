//! The load observer on the simulator: a step of the load, the noise of the speed, and the lag of a filter of the same noise.

#![cfg(test)]

use drivetrain::control::{LoadObserver, LowPass, PidConfig};
use drivetrain::dji::{Bus, Config, M3508};
use drivetrain::runner::{Nb, Runner};
use drivetrain::sim::{MotorConfig, Simulation};
use drivetrain::time::Duration;
use drivetrain::units::AngularVelocity;

/// Of the simulated M3508 with its gearbox, kg m².
const INERTIA: f32 = 0.008;
/// Largest error of the rotor speed in the feedback, in rpm: 0.11 rad/s at the output shaft.
const NOISE_RPM: f32 = 20.0;

#[derive(Debug, Clone, Copy)]
struct Sample {
    ms: u32,
    truth: f32,
    measured: f32,
    observed: f32,
    filtered: f32,
    load_nm: f32,
}

/// Runs a motor under a speed loop; `plan` gives target in rad/s and load in Nm for each millisecond.
fn run(cutoff_hz: f32, millis: u32, plan: impl Fn(u32) -> (f32, f32)) -> Vec<Sample> {
    run_with(INERTIA, cutoff_hz, millis, plan)
}

/// As [`run`], with an observer of this inertia.
fn run_with(
    inertia: f32,
    cutoff_hz: f32,
    millis: u32,
    plan: impl Fn(u32) -> (f32, f32),
) -> Vec<Sample> {
    let world = Simulation::new(24);
    let key = world.attach(MotorConfig::m3508(1).with_speed_noise_rpm(NOISE_RPM)).unwrap();
    let mut bus = Bus::new();
    let speed = PidConfig::new(0.6, 6.0, 0.0);
    let motor = bus.attach(Config::<M3508>::new(1).speed_loop(speed)).unwrap();
    let mut runner = Runner::new(Nb(world.controller()), world.clock(), bus);
    let mut observer = LoadObserver::new(inertia, 200.0).unwrap();
    let mut filter = LowPass::new(cutoff_hz).unwrap();
    let (mut samples, mut was_armed, mut ms) = (Vec::new(), false, 0);
    while ms < millis {
        world.advance(Duration::from_micros(100));
        runner.poll(16);
        let Some(tick) = runner.due() else { continue };
        was_armed = was_armed || runner.arm(tick).is_ok();
        let (target, load_nm) = plan(ms);
        world.set_load_nm(key, load_nm);
        _ = runner.device_mut().set_velocity(motor, AngularVelocity::from_rad_per_s(target));
        if let Some(state) = runner.device().state(motor) {
            let measured = state.velocity.as_rad_per_s();
            observer.update(measured, state.torque_nm, tick.dt_s());
            filter.update(measured, tick.dt_s());
            samples.push(Sample {
                ms,
                truth: world.motor(key).unwrap().velocity.as_rad_per_s(),
                measured,
                observed: observer.velocity_rad_per_s(),
                filtered: filter.value(),
                load_nm: observer.load_nm(),
            });
        }
        runner.tick(tick);
        ms += 1;
    }
    samples
}

/// Root of the mean square of an error within some milliseconds.
fn error(samples: &[Sample], from: u32, until: u32, value: impl Fn(&Sample) -> f32) -> f32 {
    let within = samples.iter().filter(|sample| (from..until).contains(&sample.ms));
    let errors: Vec<f32> = within.map(|sample| (value(sample) - sample.truth).powi(2)).collect();
    assert!(errors.len() >= 100);
    (errors.iter().sum::<f32>() / errors.len() as f32).sqrt()
}

#[test]
fn a_load_step_of_1_nm_is_told_within_20_ms_and_the_noise_is_half() {
    for sign in [1.0, -1.0] {
        for load in [1.0, -1.0] {
            let at = |ms| (10.0 * sign, if ms < 1_500 { 0.0 } else { load });
            let samples = run(40.0, 2_000, at);
            let raw = error(&samples, 500, 1_500, |sample| sample.measured);
            let observed = error(&samples, 500, 1_500, |sample| sample.observed);
            assert!((0.05..0.08).contains(&raw), "{raw} rad/s");
            assert!(observed < 0.5 * raw, "{observed} of {raw} rad/s");

            // Friction is a load too: 0.12 Nm and 2.2 mNm s/rad.
            let friction = -sign * (0.12 + 10.0 * 2.2e-3);
            let before = samples.iter().filter(|sample| (1_000..1_500).contains(&sample.ms));
            let worst = before.map(|sample| (sample.load_nm - friction).abs()).fold(0.0, f32::max);
            assert!(worst < 0.1, "{worst} Nm off before the step");
            let after = samples.iter().filter(|sample| sample.ms >= 1_500);
            let told = after.clone().find(|sample| (sample.load_nm - friction) * load > 0.8);
            assert!(told.is_some_and(|sample| sample.ms < 1_520), "{told:?}");
            let settled = after.filter(|sample| sample.ms >= 1_900);
            for sample in settled {
                assert!((sample.load_nm - friction - load).abs() < 0.1, "{sample:?}");
            }
        }
    }
}

#[test]
fn a_filter_of_the_same_noise_lags_four_times_as_much() {
    // It accelerates from 0.3 s on, and is told of a new target before.
    let start = |ms| (if ms < 300 { 0.0 } else { 40.0 }, 0.0);
    let samples = run(43.0, 400, start);
    let rise = |value: fn(&Sample) -> f32| error(&samples, 300, 400, value);
    let (observed, filtered) = (rise(|sample| sample.observed), rise(|sample| sample.filtered));
    assert!(4.0 * observed < filtered, "{observed}, {filtered} rad/s");
    let steady = run(43.0, 1_500, |_| (10.0, 0.0));
    let noise = |value: fn(&Sample) -> f32| error(&steady, 500, 1_500, value);
    let (observed, filtered) = (noise(|sample| sample.observed), noise(|sample| sample.filtered));
    assert!((filtered / observed - 1.0).abs() < 0.25, "{observed}, {filtered} rad/s");
}

#[test]
fn twice_the_true_inertia_doubles_a_step_of_the_load_at_first_and_has_no_lasting_effect() {
    let step = |ms| (10.0, if ms < 1_500 { 0.0 } else { 1.0 });
    let [right, twice] =
        [INERTIA, 2.0 * INERTIA].map(|inertia| run_with(inertia, 40.0, 2_500, step));
    let load = |samples: &[Sample], from: u32, until: u32| {
        let within = samples.iter().filter(|sample| (from..until).contains(&sample.ms));
        let loads: Vec<f32> = within.map(|sample| sample.load_nm).collect();
        (loads.iter().sum::<f32>() / loads.len() as f32, loads.iter().copied().fold(0.0, f32::max))
    };
    let ((mean, _), (of_twice, _)) = (load(&right, 2_000, 2_500), load(&twice, 2_000, 2_500));
    assert!((mean - of_twice).abs() < 0.02 && mean > 0.8, "{mean} and {of_twice} Nm");
    let ((_, peak), (_, of_twice)) = (load(&right, 1_500, 1_550), load(&twice, 1_500, 1_550));
    assert!((1.3..2.2).contains(&(of_twice / peak)), "{peak} and {of_twice} Nm");
}
