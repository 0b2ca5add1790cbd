//! A chassis and a shooter, as a program calls them in each cycle.

use crate::meter::instructions;
use crate::report::row;
use crate::wiring::{Drive, START, Targets};
use core::hint::black_box;
use drivetrain::chassis::{
    Chassis, ChassisLimits, ChassisMode, Mecanum, MecanumWheels, ModeConfig, Modes, ModuleState,
    Omni, PowerModel, Swerve,
};
use drivetrain::control::PidConfig;
use drivetrain::dji::{Bus, Handle, M3508};
use drivetrain::encoder::Position;
use drivetrain::geometry::{Body, Gimbal, Twist, Vec2};
use drivetrain::shooter::{Shooter, ShooterFeedback, ShooterOrder, ShooterTargets};
use drivetrain::time::{Duration, Instant, Tick};
use drivetrain::units::{Angle, AngularVelocity};
use drivetrain::wire::referee::BarrelHeat;

const PERIOD: Duration = Duration::from_millis(1);

type Wheel = Handle<M3508>;
type Wheels = MecanumWheels<AngularVelocity>;
type Modules = [ModuleState; 4];
type Base = Chassis<Mecanum>;

#[unsafe(no_mangle)]
#[inline(never)]
fn robot_drive(
    base: &mut Base,
    bus: &mut Bus,
    wheels: &MecanumWheels<Wheel>,
    tick: Tick,
) -> Wheels {
    base.drive(bus, *wheels, tick)
}

#[unsafe(no_mangle)]
#[inline(never)]
fn robot_set_body(base: &mut Base, twist: &Twist<Body>) {
    base.set_body(*twist);
}

#[unsafe(no_mangle)]
#[inline(never)]
fn robot_omni_inverse(omni: &Omni<4>, twist: &Twist<Body>) -> [AngularVelocity; 4] {
    omni.inverse(*twist)
}

#[unsafe(no_mangle)]
#[inline(never)]
fn robot_omni_forward(omni: &Omni<4>, wheels: &[AngularVelocity; 4]) -> Twist<Body> {
    omni.forward(*wheels)
}

#[unsafe(no_mangle)]
#[inline(never)]
fn robot_swerve_inverse(swerve: &Swerve<4>, twist: &Twist<Body>) -> Modules {
    swerve.inverse(*twist)
}

#[unsafe(no_mangle)]
#[inline(never)]
fn robot_swerve_forward(swerve: &Swerve<4>, modules: &Modules) -> Twist<Body> {
    swerve.forward(*modules)
}

#[unsafe(no_mangle)]
#[inline(never)]
fn robot_steer(
    swerve: &Swerve<4>,
    memory: &mut [Option<(Angle, bool)>; 4],
    wanted: &Modules,
    angles: &[Option<Angle>; 4],
) -> Modules {
    swerve.steer(memory, *wanted, *angles)
}

#[unsafe(no_mangle)]
#[inline(never)]
fn robot_modes(modes: &mut Modes, twist: &Twist<Gimbal>, yaw: Angle) -> Option<Twist<Body>> {
    modes.update(*twist, Some(yaw), 0.001)
}

#[unsafe(no_mangle)]
#[inline(never)]
fn robot_cut(model: &PowerModel, loads: &[(f32, AngularVelocity); 4]) -> (f32, f32) {
    model.cut(*loads, 60.0)
}

#[unsafe(no_mangle)]
#[inline(never)]
fn robot_shooter(shooter: &mut Shooter, feedback: &ShooterFeedback, tick: Tick) -> ShooterTargets {
    shooter.update(ShooterOrder::Spin, feedback, tick)
}

/// A motion that is another one in each call.
fn motion<F>(call: u32) -> Twist<F> {
    let part = (call % 7) as f32 * 0.1;
    Twist::new(1.0 - part, 0.3 + part, 0.5 - part)
}

fn chassis() {
    let mut drive = Drive::new(Targets::Speed, 0, START);
    let [front_left, front_right, rear_left, rear_right, ..] = drive.motors();
    let wheels = MecanumWheels { front_left, front_right, rear_left, rear_right };
    let mut base = Chassis::new(Mecanum::new(0.076, Vec2::new(0.2, 0.18)).unwrap());
    let limits = ChassisLimits::new().with_acceleration(3.0, 10.0);
    base.set_limits(limits.with_wheel_speed(AngularVelocity::from_rad_per_s(40.0))).unwrap();
    let mut now = drive.now;
    let function = robot_drive as fn(&mut Base, &mut Bus, &MecanumWheels<Wheel>, Tick) -> Wheels;
    let driven = instructions(function, |drive_all, call| {
        now = now + PERIOD;
        base.set_body(motion(call));
        _ = drive_all(&mut base, &mut drive.bus, &wheels, Tick::new(now, 0.001));
    });
    assert_eq!(base.status().refused, 0);
    row("chassis_drive", &[driven]);
    let function = robot_set_body as fn(&mut Base, &Twist<Body>);
    row("chassis_set_body", &[instructions(function, |f, call| f(&mut base, &motion(call)))]);
    let mut modes = Modes::new(ModeConfig::new(PidConfig::new(5.0, 0.0, 0.1))).unwrap();
    modes.set_mode(ChassisMode::FollowGimbal);
    let function = robot_modes as fn(&mut Modes, &Twist<Gimbal>, Angle) -> Option<Twist<Body>>;
    let mode = instructions(function, |update, call| {
        _ = update(&mut modes, &motion(call), Angle::from_radians(0.2));
    });
    row("chassis_modes", &[mode]);
}

fn kinematics() {
    let omni = Omni::four(0.076, 0.25).unwrap();
    let function = robot_omni_inverse as fn(&Omni<4>, &Twist<Body>) -> [AngularVelocity; 4];
    let inverse = instructions(function, |f, call| {
        _ = black_box(f(&omni, &motion(call)));
    });
    row("omni_inverse", &[inverse]);
    let wheels = omni.inverse(motion(3));
    let function = robot_omni_forward as fn(&Omni<4>, &[AngularVelocity; 4]) -> Twist<Body>;
    let forward = instructions(function, |f, _| {
        _ = black_box(f(&omni, &wheels));
    });
    row("omni_forward", &[forward]);

    let places = [(0.2, 0.2), (0.2, -0.2), (-0.2, 0.2), (-0.2, -0.2)];
    let swerve = Swerve::new(0.05, places.map(|(x, y)| Vec2::new(x, y))).unwrap();
    let function = robot_swerve_inverse as fn(&Swerve<4>, &Twist<Body>) -> Modules;
    let inverse = instructions(function, |f, call| {
        _ = black_box(f(&swerve, &motion(call)));
    });
    row("swerve_inverse", &[inverse]);
    let modules = swerve.inverse(motion(3));
    let function = robot_swerve_forward as fn(&Swerve<4>, &Modules) -> Twist<Body>;
    let forward = instructions(function, |f, _| {
        _ = black_box(f(&swerve, &modules));
    });
    row("swerve_forward", &[forward]);
    let mut memory = [None; 4];
    let angles = modules.map(|module| Some(module.angle));
    let function =
        robot_steer as fn(&_, &mut [Option<(Angle, bool)>; 4], &Modules, &[_; 4]) -> Modules;
    let steer = instructions(function, |f, call| {
        let wanted = swerve.inverse(motion(call));
        _ = black_box(f(&swerve, &mut memory, &wanted, &angles));
    });
    row("swerve_steer", &[steer]);
}

fn power() {
    let model = PowerModel::new(1.0, 1.0, 2.0, 0.001).unwrap();
    let loads = [1.0, 2.0, 3.0, -1.0].map(|torque| (torque, AngularVelocity::from_rad_per_s(10.0)));
    let function = robot_cut as fn(&PowerModel, &[(f32, AngularVelocity); 4]) -> (f32, f32);
    let cut = instructions(function, |f, _| {
        _ = black_box(f(&model, &loads));
    });
    row("power_cut", &[cut]);
}

fn shooter() {
    let wheels = AngularVelocity::from_rpm(6_000.0);
    let mut shooter = Shooter::new(wheels, 8, 10.0).unwrap();
    let feedback = ShooterFeedback {
        is_armed: true,
        wheels: [Some(wheels); 2],
        loader: Some((Position::from_turns(0), AngularVelocity::ZERO)),
        heat: Some(BarrelHeat { heat: 0, limit: 200, cooling_per_s: 10 }),
    };
    let mut now: Instant = START;
    let function = robot_shooter as fn(&mut Shooter, &ShooterFeedback, Tick) -> ShooterTargets;
    let update = instructions(function, |f, _| {
        now = now + PERIOD;
        _ = black_box(f(&mut shooter, &feedback, Tick::new(now, 0.001)));
    });
    row("shooter", &[update]);
}

pub fn rows() {
    chassis();
    kinematics();
    power();
    shooter();
}
