//! Both forms of the PID on a simulated M3508, with a step that takes the output to its limit.

#![cfg(test)]
#![cfg(feature = "sim")]

use drivetrain::control::{Pid, PidConfig, StepResponse};
use drivetrain::dji::{Bus, Config, M3508};
use drivetrain::runner::{Nb, Runner};
use drivetrain::sim::{MotorConfig, Simulation};
use drivetrain::time::Duration;
use drivetrain::time::TimeStep;
use drivetrain::units::{AngularVelocity, Current};

const TARGET: f32 = 30.0; // rad/s
const LIMIT: f32 = 6.0; // A

/// Steps the speed of a motor from rest; `control` gets setpoint, speed and time step, and gives amperes.
fn step_response(mut control: impl FnMut(f32, f32, f32) -> f32) -> StepResponse {
    let world = Simulation::new(1);
    world.attach(MotorConfig::m3508(1)).unwrap();
    let mut bus = Bus::new();
    let motor = bus.attach(Config::<M3508>::new(1)).unwrap();
    let mut runner = Runner::new(Nb(world.controller()), world.clock(), bus);
    let mut response = StepResponse::new(0.0, TARGET, 3.0, 0.05).unwrap();
    let mut armed = false;
    while !response.is_complete() {
        world.advance(Duration::from_micros(100));
        runner.poll(8);
        let Some(tick) = runner.due() else { continue };
        armed = armed || runner.arm(tick).is_ok();
        let speed = runner.device().state(motor).map(|state| state.velocity.as_rad_per_s());
        if let (true, Some(speed)) = (armed, speed) {
            let amperes = control(TARGET, speed, tick.dt_s());
            runner.device_mut().set_current(motor, Current::from_amperes(amperes)).unwrap();
            response.record(speed, tick.dt_s());
        }
        runner.tick(tick);
    }
    response
}

#[test]
fn after_a_step_that_saturates_the_incremental_form_settles_as_fast_as_the_positional_one() {
    for (kp, ki) in [(0.6, 0.3), (0.6, 1.5), (0.6, 6.0), (2.0, 10.0), (4.0, 4.0)] {
        let config = PidConfig::new(kp, ki, 0.0).with_output_limit(LIMIT);
        let mut positional = Pid::new(config).unwrap();
        let config = config.with_incremental_form();
        let mut incremental = Pid::new(config).unwrap();
        let mut most = 0.0_f32;
        let expected = step_response(|setpoint, speed, dt_s| {
            let amperes = positional.step(setpoint, speed, &TimeStep::of(dt_s));
            most = most.max(amperes);
            amperes
        });
        let measured = step_response(|setpoint, speed, dt_s| {
            incremental.step(setpoint, speed, &TimeStep::of(dt_s))
        });
        assert!((most - LIMIT).abs() < 1e-6, "{most}"); // the step does saturate
        let settled = |measures: &StepResponse| measures.settling_time_s().unwrap_or(f32::INFINITY);
        assert!(settled(&expected) < 3.0, "kp {kp}, ki {ki}: {expected:?}");
        assert!(
            settled(&measured) <= 1.2 * settled(&expected),
            "kp {kp}, ki {ki}: {measured:?}, positional {expected:?}"
        );
    }
}

/// The loop of a motor, as the bus runs it: speed and amperes of each tick after a step of the target.
fn driven(speed_loop: PidConfig) -> Vec<(f32, f32)> {
    let world = Simulation::new(1);
    world.attach(MotorConfig::m3508(1)).unwrap();
    let mut bus = Bus::new();
    let config = Config::<M3508>::new(1).with_opening(Duration::ZERO).speed_loop(speed_loop);
    let motor = bus.attach(config).unwrap();
    let mut runner = Runner::new(Nb(world.controller()), world.clock(), bus);
    let (mut armed, mut ticks) = (false, Vec::new());
    while ticks.len() < 1_000 {
        world.advance(Duration::from_micros(100));
        runner.poll(8);
        let Some(tick) = runner.due() else { continue };
        armed = armed || runner.arm(tick).is_ok();
        if armed {
            let target = AngularVelocity::from_rad_per_s(TARGET);
            runner.device_mut().set_velocity(motor, target).unwrap();
        }
        runner.tick(tick);
        let Some(state) = runner.device().state(motor) else { continue };
        let amperes = runner.device().commanded_current(motor).unwrap().as_amperes();
        ticks.push((state.velocity.as_rad_per_s(), amperes));
    }
    ticks
}

#[test]
fn an_incremental_speed_loop_with_a_tracking_differentiator_drives_a_motor() {
    let plain = PidConfig::new(0.6, 6.0, 0.0).with_output_limit(LIMIT);
    let fastest = |ticks: &[(f32, f32)]| ticks.iter().fold(0.0_f32, |most, tick| most.max(tick.0));
    let most = |ticks: &[(f32, f32)]| ticks.iter().fold(0.0_f32, |most, tick| most.max(tick.1));
    let positional = driven(plain);
    // Step by step the same loop, so the same words.
    assert_eq!(driven(plain.with_incremental_form()), positional);
    assert!((most(&positional) - LIMIT).abs() < 1e-2); // a step of 30 rad/s asks for 18 A
    let led = driven(plain.with_incremental_form().with_tracking(8.0));
    assert!(most(&led) < 0.8 * LIMIT, "{}", most(&led));
    assert!(fastest(&led) < fastest(&positional), "{}", fastest(&led));
    assert!(led.last().is_some_and(|&(speed, _)| (speed - TARGET).abs() < 0.5), "{:?}", led.last());
}
