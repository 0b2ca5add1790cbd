//! Four steered modules drive a square while the body turns, then lock, on the simulator, through the public API.
//!
//! ```text
//! cargo run --release --example swerve [FILE.svg]
//! ```
//!
//! Eight motors do not fit on one bus at 1 kHz: eight feedback and two command frames take 111 to 135 % of it. Sorted by
//! kind, four on each of two buses need five frames a millisecond, 56 to 68 %; sorted by axle they would need six, because
//! each bus would carry the command frames of both kinds. `with_load_ceiling` refuses what does not fit.
//!
//! Prints how far the robot was off its plan, and fails when that is too much.

mod course;

use course::Sample;
use drivetrain::chassis::{Chassis, ChassisLimits, ModuleMotors, Swerve};
use drivetrain::control::PidConfig;
use drivetrain::dji::{Bus, Config, Gm6020Voltage, Handle, M3508};
use drivetrain::geometry::Vec2;
use drivetrain::math::wrap;
use drivetrain::motor::{AngleDrive, OneOf, VelocityDrive};
use drivetrain::runner::{Nb, Runner};
use drivetrain::sim::{ChassisConfig, Controller, Line, MotorConfig, Simulation, Wheel};
use drivetrain::time::{Duration, Tick};
use drivetrain::units::{Angle, AngularVelocity};
use std::error::Error;

const WHEEL_RADIUS_M: f32 = 0.06;
/// A module turns with its wheel, fork and drive motor.
const MODULE_INERTIA_KG_M2: f32 = 0.004;
/// A per rad/s and A per rad of the wheel: as `WheelTuning` reckons for 20 kg, at twice its bandwidth. The floor holds some 9 A on
/// each.
const DRIVE: PidConfig = PidConfig::new(2.4, 6.0, 0.0).with_output_limit(8.0);
/// rad/s per rad of the module, then V per rad/s and V per rad.
const ANGLE: PidConfig = PidConfig::new(50.0, 0.0, 0.0).with_output_limit(25.0);
const RATE: PidConfig = PidConfig::new(3.0, 30.0, 0.0);

/// Places of the modules, and angles of their encoders when they point forward.
const MODULES: [(Vec2, Angle); 4] = [
    (Vec2::new(0.2, 0.2), Angle::from_degrees(12.0)),
    (Vec2::new(0.2, -0.2), Angle::from_degrees(251.0)),
    (Vec2::new(-0.2, 0.2), Angle::from_degrees(98.0)),
    (Vec2::new(-0.2, -0.2), Angle::from_degrees(333.0)),
];

/// A motor on the first bus or on the second.
type Motor = OneOf<Handle<M3508>, Handle<Gm6020Voltage>>;
type Modules = [ModuleMotors<Motor>; 4];
type Robot<'w> = Runner<Nb<Controller<'w>>, &'w Simulation, Bus>;

fn main() -> Result<(), Box<dyn Error>> {
    let path = course::output::path("swerve");
    let world = Simulation::new(1);
    let samples = drive(&world)?;
    course::plot(&path, ["front left", "front right", "rear left", "rear right"], &samples)?;
    for (line, kind) in [(Line::Can1, "drive"), (Line::Can2, "steering")] {
        course::console::line(format_args!(
            "bus          {:.0} % load, {kind}",
            100.0 * world.traffic(line).load()
        ));
    }
    course::judge(&samples)
}

/// Rolling motors, steering motors, and the floor under them.
fn robot(world: &Simulation) -> Result<(Robot<'_>, Robot<'_>, Modules), Box<dyn Error>> {
    let (mut can1, mut can2) =
        (Bus::new().with_load_ceiling(0.9), Bus::new().with_load_ceiling(0.9));
    let (mut floor, mut motors) = (Vec::new(), Vec::new());
    for (id, (place, zero)) in (1..).zip(MODULES) {
        let drive = world.attach(MotorConfig::m3508(id))?;
        let steering = MotorConfig::gm6020_voltage(id)
            .with_line(Line::Can2)
            .with_load_inertia_kg_m2(MODULE_INERTIA_KG_M2);
        let steering = world.attach(steering)?;
        floor.push(Wheel::steered(drive, WHEEL_RADIUS_M, place, steering, zero));
        let drive = can1.attach(Config::<M3508>::new(id).speed_loop(DRIVE))?;
        let steering = can2.attach(Config::<Gm6020Voltage>::new(id).position_loop(ANGLE, RATE))?;
        motors.push(ModuleMotors::new(OneOf::First(drive), OneOf::Second(steering), zero));
    }
    world.attach_chassis(ChassisConfig::new(&floor))?;
    let motors = motors.try_into().map_err(|_| "there are four modules")?;
    let runner = |line, bus| Runner::new(Nb(world.controller_on(line)), world.clock(), bus);
    Ok((runner(Line::Can1, can1), runner(Line::Can2, can2), motors))
}

/// Arms by itself, which only a simulated robot may.
fn is_ready(robot: &mut Robot<'_>, tick: Tick) -> bool {
    robot.is_armed() || robot.arm(tick).is_ok()
}

/// From -180 to 180, and NaN for an angle that is not known.
fn degrees(angles: [Option<Angle>; 4]) -> [f32; 4] {
    angles.map(|angle| angle.map_or(f32::NAN, |angle| wrap(angle.as_degrees(), 360.0)))
}

fn drive(world: &Simulation) -> Result<Vec<Sample<4>>, Box<dyn Error>> {
    let (mut drives, mut steerings, modules) = robot(world)?;
    let mut chassis = Chassis::new(Swerve::new(WHEEL_RADIUS_M, MODULES.map(|(place, _)| place))?);
    let limits = ChassisLimits::new()
        .with_acceleration(4.0, 20.0)
        .with_wheel_speed(AngularVelocity::from_rpm(450.0));
    chassis.set_limits(limits)?;

    let mut samples = Vec::new();
    let mut started = None;
    for _ in 0..course::STEPS {
        world.advance(Duration::from_micros(100));
        drives.poll(16);
        steerings.poll(16);
        // Each runner has a grid of its own. The chassis is driven in the steps of the drive motors.
        if let Some(tick) = drives.due() {
            if is_ready(&mut steerings, tick) & is_ready(&mut drives, tick) {
                started = started.or(Some(tick.now()));
            }
            let time_s = tick.now().since(started.unwrap_or(tick.now())).as_secs_f32();
            let (driven_m, heading) = course::truth(world)?;
            course::command(&mut chassis, time_s, heading);
            let mut buses = (drives.device_mut(), steerings.device_mut());
            let targets = chassis.drive(&mut buses, modules, tick);
            let steered = modules.map(|ModuleMotors { steering, zero, .. }| {
                buses.angle(steering).map(|angle| angle - zero)
            });
            let measured = modules.map(|module| buses.velocity(module.drive));
            samples.push(Sample {
                time_s,
                planned_m: course::plan(time_s).0,
                driven_m,
                believed_m: course::place(chassis.pose()),
                target_rpm: targets.map(|module| module.velocity.as_rpm()),
                measured_rpm: measured.map(|wheel| wheel.map_or(0.0, AngularVelocity::as_rpm)),
                steering_deg: Some(
                    [targets.map(|module| Some(module.angle)), steered].map(degrees),
                ),
            });
            drives.tick(tick);
        }
        if let Some(tick) = steerings.due() {
            steerings.tick(tick);
        }
    }
    Ok(samples)
}
