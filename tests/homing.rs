//! Homing against a stop on the simulated bus: both ways, from anywhere, with friction, and what goes wrong.

#![cfg(test)]

use drivetrain::control::PidConfig;
use drivetrain::dji::{Bus, Config, Handle, M2006};
use drivetrain::encoder::Position;
use drivetrain::motor::{Devices, HomingStep, Link, StopHoming};
use drivetrain::runner::{Nb, Runner};
use drivetrain::sim::{Fault, MotorConfig, MotorKey, Simulation};
use drivetrain::time::{Duration, Instant, Tick};
use drivetrain::units::{Angle, AngularVelocity, Current};

/// A per rad/s, A per rad: presses within a third of a second.
const SPEED: PidConfig = PidConfig::new(0.2, 3.0, 0.0);
/// The torque is bounded by this.
const LIMIT_A: f32 = 3.0;
const EFFORT_A: f32 = 2.5;

fn degrees(degrees: f32) -> Angle {
    Angle::from_degrees(degrees)
}

fn config(rpm: f32) -> StopHoming {
    let homing = StopHoming::new(AngularVelocity::from_rpm(rpm), EFFORT_A);
    homing.and_then(|homing| homing.with_travel(degrees(200.0))).unwrap()
}

fn shaft(bus: &Bus, motor: Handle<M2006>) -> Option<(Position, AngularVelocity, f32)> {
    let state = bus.state(motor).filter(|state| state.link == Link::Online)?;
    Some((state.position, state.velocity, state.current.as_amperes()))
}

#[derive(Debug)]
struct Outcome {
    result: HomingStep,
    took_ms: u64,
    /// What the library says, and how far the shaft really turned since the start.
    position: Position,
    turned: Angle,
    strongest_a: f32,
    relaxed: bool,
}

/// Homes a motor in a world, from rest; relaxed after a failure.
fn home(world: &Simulation, key: MotorKey, reversed: bool, mut homing: StopHoming) -> Outcome {
    let start = world.motor(key).unwrap().encoder_counts;
    let mut bus = Bus::new();
    let limit = Current::from_amperes(LIMIT_A);
    let arm = Config::<M2006>::new(1).speed_loop(SPEED).with_current_limit(limit);
    let arm = bus.attach(if reversed { arm.reversed() } else { arm }).unwrap();
    let mut runner = Runner::new(Nb(world.controller()), world.clock(), bus);
    let (mut result, mut strongest_a) = (None, 0.0_f32);
    while result.is_none() {
        world.advance(Duration::from_millis(1));
        runner.poll(16);
        let tick = runner.due().unwrap();
        if runner.device().state(arm).is_some_and(|state| state.link == Link::Online)
            && !runner.is_armed()
            && tick.now() < Instant::from_micros(100_000)
        {
            runner.arm(tick).unwrap();
        }
        let bus = runner.device_mut();
        if bus.is_armed() || tick.now() >= Instant::from_micros(100_000) {
            match homing.step(shaft(bus, arm), tick) {
                HomingStep::Drive(velocity) => bus.set_velocity(arm, velocity).unwrap(),
                HomingStep::SetPresentPosition(position) => {
                    bus.set_present_position(arm, position).unwrap();
                }
                last => result = Some(last),
            }
        }
        if result.is_some() {
            bus.relax(arm);
        }
        runner.tick(tick);
        strongest_a = strongest_a.max(world.motor(key).unwrap().current.as_amperes().abs());
    }
    let truth = world.motor(key).unwrap();
    let took_ms = world.now().as_micros() / 1_000;
    world.advance(Duration::from_millis(5));
    Outcome {
        result: result.unwrap(),
        took_ms,
        position: runner.device().state(arm).unwrap().position,
        turned: Angle::from_turns((truth.encoder_counts - start) as f32 / (8_192.0 * 36.0)),
        strongest_a,
        relaxed: world.motor(key).unwrap().command == 0,
    }
}

fn motor(lower: f32, upper: f32) -> MotorConfig {
    MotorConfig::m2006(1).with_stops(degrees(lower), degrees(upper))
}

#[test]
fn the_stop_is_found_from_both_sides_and_whichever_way_the_motor_is_mounted() {
    for (rpm, reversed, stop) in
        [(-30.0, false, -120.0), (30.0, false, 60.0), (-30.0, true, 60.0), (30.0, true, -120.0)]
    {
        let world = Simulation::new(3);
        let key = world.attach(motor(-120.0, 60.0)).unwrap();
        let stop_at = Position::new(2, degrees(40.0));
        let outcome = home(&world, key, reversed, config(rpm).with_stop_at(stop_at).unwrap());
        assert_eq!(outcome.result, HomingStep::Done, "{rpm} rpm: {outcome:?}");
        assert!((outcome.turned.as_degrees() - stop).abs() < 0.1, "{outcome:?}");
        assert!((outcome.position - stop_at).as_degrees().abs() < 0.1, "{outcome:?}");
        assert!(outcome.strongest_a < 1.01 * LIMIT_A && outcome.relaxed, "{outcome:?}");
    }
}

#[test]
fn a_stop_that_is_touched_already_is_home() {
    for (rpm, lower, upper) in [(-30.0, 0.0, 90.0), (30.0, -90.0, 0.0)] {
        let world = Simulation::new(4);
        let key = world.attach(motor(lower, upper)).unwrap();
        let outcome = home(&world, key, false, config(rpm));
        assert_eq!(outcome.result, HomingStep::Done);
        assert!(outcome.turned.as_degrees().abs() < 0.1 && outcome.took_ms < 1_500, "{outcome:?}");
        assert!((outcome.position - Position::ZERO).as_degrees().abs() < 0.1, "{outcome:?}");
    }
}

#[test]
fn it_backs_off_by_as_much_as_is_asked_for_and_keeps_the_stop_where_it_is() {
    for (rpm, rest) in [(-30.0, 12.0), (30.0, -12.0)] {
        let world = Simulation::new(5);
        let key = world.attach(motor(-70.0, 70.0)).unwrap();
        let outcome = home(&world, key, false, config(rpm).with_back_off(degrees(12.0)).unwrap());
        assert_eq!(outcome.result, HomingStep::Done);
        let found = (outcome.position - Position::ZERO).as_degrees();
        assert!((found - rest).abs() < 2.0, "{found} of {rest}");
        // Zero is at the stop, wherever the shaft is now.
        let stop = 70.0_f32.copysign(rpm);
        assert!((outcome.turned.as_degrees() - stop - found).abs() < 0.5, "{outcome:?}");
    }
}

#[test]
fn friction_is_not_taken_for_the_stop() {
    // It needs 2 A to move, and at the start the loop winds up until it does.
    for friction_nm in [0.1, 0.2, 0.3] {
        let world = Simulation::new(6);
        let key = world.attach(motor(-100.0, 100.0).with_load_friction_nm(friction_nm)).unwrap();
        let outcome = home(&world, key, false, config(-30.0));
        assert_eq!(outcome.result, HomingStep::Done, "{outcome:?}");
        assert!((outcome.turned.as_degrees() + 100.0).abs() < 0.1, "{friction_nm} Nm: {outcome:?}");
    }
    // To break loose takes 2.7 A, more than at the stop; but not for the whole window.
    for (window_ms, turned) in [(100, -100.0), (10, 0.0)] {
        let world = Simulation::new(6);
        let key = world.attach(motor(-100.0, 100.0).with_load_friction_nm(0.44)).unwrap();
        let window = Duration::from_millis(window_ms);
        let outcome = home(&world, key, false, config(-30.0).with_window(window).unwrap());
        let wrong = (outcome.turned.as_degrees() - turned).abs();
        assert!(outcome.result == HomingStep::Done && wrong < 0.2, "{window_ms} ms: {outcome:?}");
    }
}

#[test]
fn each_failure_is_told_and_the_motor_relaxed() {
    let free = MotorConfig::m2006(1);
    let stuck = free.with_load_friction_nm(0.6); // 3.6 A: more than it may
    let weak = StopHoming::new(AngularVelocity::from_rpm(-30.0), 3.5).unwrap();
    let weak = weak.with_timeout(Duration::from_secs(2)).unwrap();
    for (motor, config, error, turned) in [
        (free, config(-30.0), HomingStep::NoStop, -200.0),
        (free, config(30.0), HomingStep::NoStop, 200.0),
        (stuck, weak, HomingStep::TimedOut, 0.0),
    ] {
        let world = Simulation::new(7);
        let key = world.attach(motor).unwrap();
        let outcome = home(&world, key, false, config);
        assert_eq!(outcome.result, error);
        assert!((outcome.turned.as_degrees() - turned).abs() < 2.0, "{outcome:?}");
        assert!(outcome.strongest_a < 1.01 * LIMIT_A && outcome.relaxed, "{outcome:?}");
    }
    let world = Simulation::new(7);
    let key = world.attach(free).unwrap();
    world.fault(Fault::Silent(key), Instant::from_micros(500_000)..).unwrap();
    let outcome = home(&world, key, false, config(-30.0));
    assert_eq!(outcome.result, HomingStep::LostFeedback);
    assert!((510..=512).contains(&outcome.took_ms) && outcome.relaxed, "{outcome:?}");
}

/// The shaft breaks loose from friction, turns by half a radian while the loop stands, and presses again: nobody saw it stand.
#[test]
fn a_pause_of_the_loop_is_no_standstill() {
    for (pause_ms, longer_ms) in [(20, 0), (21, 100), (100, 100)] {
        let mut homing = StopHoming::new(AngularVelocity::from_rad_per_s(-2.0), 3.0).unwrap();
        let mut finds = |radians: f32, effort: f32, ms: u64| {
            let position = Position::from_angle(Angle::from_radians(radians));
            let tick = Tick::new(Instant::from_micros(1_000 * ms), 0.001);
            let step = homing.step(Some((position, AngularVelocity::ZERO, effort)), tick);
            matches!(step, HomingStep::SetPresentPosition(_))
        };
        assert!(!finds(0.0, 0.0, 1) && !(2..=90).any(|ms| finds(0.0, -3.1, ms)));
        let found = (90 + pause_ms..).find(|ms| finds(-0.5, -3.1, *ms));
        assert_eq!(found, Some(90 + pause_ms + longer_ms), "after a pause of {pause_ms} ms");
    }
}
