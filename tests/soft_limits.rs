//! A `dji` motor between its soft limits, under a load, for each kind of target with a loop: held at the limit, and not beyond.

#![cfg(test)]

use drivetrain::control::PidConfig;
use drivetrain::dji::{AnyHandle, Bus, Config, M2006};
use drivetrain::encoder::Position;
use drivetrain::motor::{Condition, HealthConfig, TargetError};
use drivetrain::runner::{Nb, Runner};
use drivetrain::sim::{MotorConfig, Simulation};
use drivetrain::time::Duration;
use drivetrain::units::{Angle, AngularVelocity};
use std::ops::RangeInclusive;

static LIMITS: HealthConfig =
    HealthConfig::new().with_soft_limits(Angle::from_degrees(-60.0), Angle::from_degrees(90.0));

type Target = fn(&mut Bus, AnyHandle) -> Result<(), TargetError>;

/// The angles in degrees of the last eight of ten seconds and of all, and the beginnings of a soft limit. The gains are those of
/// `docs/gains.md`, for 0.004 kg m².
fn run(
    load_nm: f32,
    is_reversed: bool,
    target: Target,
) -> (RangeInclusive<f32>, RangeInclusive<f32>, usize) {
    let world = Simulation::new(1);
    let key = world.attach(MotorConfig::m2006(3).with_load_inertia_kg_m2(0.004)).unwrap();
    let (angle, speed) =
        (PidConfig::new(10.0, 0.0, 0.0).with_output_limit(6.0), PidConfig::new(1.0, 10.0, 0.0));
    let config = Config::<M2006>::new(3).position_loop(angle, speed).with_health(&LIMITS);
    let mut bus = Bus::new();
    let motor = bus.attach(if is_reversed { config.reversed() } else { config }).unwrap();
    let mut runner = Runner::new(Nb(world.controller()), world.clock(), bus);
    let sign = if is_reversed { -1.0 } else { 1.0 };
    let (mut zero, mut begins) = (0.0, 0);
    let (mut late, mut all) = ((f32::MAX, f32::MIN), (f32::MAX, f32::MIN));
    for ms in 0..10_000 {
        world.advance(Duration::from_millis(1));
        runner.poll(16);
        let Some(tick) = runner.due() else { continue };
        let here = world.motor(key).unwrap().position.as_angle().as_degrees();
        match ms {
            50 => {
                runner.device_mut().zero(motor).unwrap();
                zero = here;
            }
            100 => runner.arm(tick).unwrap(),
            150 => world.set_load_nm(key, sign * load_nm),
            _ => {}
        }
        if ms > 100 {
            target(runner.device_mut(), motor.erase()).unwrap();
            let degrees = sign * (here - zero);
            let grow = |(least, most): (f32, f32)| (least.min(degrees), most.max(degrees));
            all = grow(all);
            late = if ms > 2_000 { grow(late) } else { late };
        }
        runner.tick(tick);
        while let Some(edge) = runner.device_mut().next_edge() {
            begins += usize::from(edge.condition == Condition::SoftLimit && edge.began);
        }
    }
    (late.0..=late.1, all.0..=all.1, begins)
}

const TARGETS: [(&str, Target, f32); 6] = [
    ("position 90", |bus, motor| bus.set_position(motor, position(90.0)), 90.0),
    ("position 200", |bus, motor| bus.set_position(motor, position(200.0)), 90.0),
    ("position -90", |bus, motor| bus.set_position(motor, position(-90.0)), -60.0),
    ("100 rpm", |bus, motor| bus.set_velocity(motor, AngularVelocity::from_rpm(100.0)), 90.0),
    ("-20 rpm", |bus, motor| bus.set_velocity(motor, AngularVelocity::from_rpm(-20.0)), -60.0),
    ("angle 120", |bus, motor| bus.set_angle(motor, Angle::from_degrees(120.0)), 90.0),
];

const fn position(degrees: f32) -> Position {
    Position::from_angle(Angle::from_degrees(degrees))
}

#[test]
fn a_motor_is_held_at_its_limit_with_any_load() {
    for (what, target, limit) in TARGETS {
        for load_nm in [0.0, 0.3, -0.3, 0.5, -0.5] {
            for is_reversed in [false, true] {
                let (late, all, begins) = run(load_nm, is_reversed, target);
                println!("{what:12} {load_nm:4} {is_reversed:5} {late:.2?} {all:.2?} {begins}");
                let is_near = |angle: f32| (angle - limit).abs() < 3.0;
                assert!(is_near(*late.start()) && is_near(*late.end()), "{what}, {load_nm} Nm");
                assert!(*all.start() > -63.0 && *all.end() < 93.0, "{what}, {load_nm} Nm");
                assert!(begins <= 2, "{what}, {load_nm} Nm: {begins} beginnings");
            }
        }
    }
}
