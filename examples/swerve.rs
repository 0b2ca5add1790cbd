//! Four steered modules drive a square while the body turns, on the simulator, through the public API.
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
use drivetrain::chassis::{
    Chassis, ChassisLimits, ModuleState, SteeringConfig, Swerve, SwerveSteering,
};
use drivetrain::control::PidConfig;
use drivetrain::dji::{self, Bus, Config, Gm6020Voltage, Handle, M3508};
use drivetrain::geometry::Vec2;
use drivetrain::motor::VelocityDrive;
use drivetrain::runner::{Nb, Runner};
use drivetrain::sim::{
    ChassisConfig, Controller, Line, Model, MotorConfig, SimClock, Wheel, World,
};
use drivetrain::time::{Duration, Tick};
use drivetrain::units::{Angle, AngularVelocity};
use std::error::Error;

const WHEEL_RADIUS_M: f32 = 0.06;
/// A module turns with its wheel, fork and drive motor.
const MODULE_INERTIA_KG_M2: f32 = 0.004;
/// A per rad/s and A per rad of the wheel. The floor holds some 9 A on each.
const DRIVE: PidConfig = PidConfig::new(3.0, 20.0, 0.0).with_output_limit(8.0);
/// rad/s per rad of the module, then V per rad/s and V per rad.
const ANGLE: PidConfig = PidConfig::new(50.0, 0.0, 0.0).with_output_limit(25.0);
const RATE: PidConfig = PidConfig::new(3.0, 30.0, 0.0);

/// Where the modules stand, and what their encoders show when they point forward.
const MODULES: [(Vec2, Angle); 4] = [
    (Vec2::new(0.2, 0.2), Angle::from_degrees(12.0)),
    (Vec2::new(0.2, -0.2), Angle::from_degrees(251.0)),
    (Vec2::new(-0.2, 0.2), Angle::from_degrees(98.0)),
    (Vec2::new(-0.2, -0.2), Angle::from_degrees(333.0)),
];

/// All motors of one kind, on a bus of their own.
struct Row<'w, M: dji::Model> {
    runner: Runner<Nb<Controller<'w>>, SimClock<'w>, Bus>,
    motors: [Handle<M>; 4],
}

impl<M: dji::Model> Row<'_, M> {
    /// Arms by itself, which only a simulated robot may.
    fn is_ready(&mut self, tick: Tick) -> bool {
        self.runner.is_armed() || self.runner.arm(tick).is_ok()
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let path = course::output("swerve")?;
    let world = World::new(1);
    let samples = drive(&world)?;
    course::plot(&path, ["front left", "front right", "rear left", "rear right"], &samples)?;
    for (line, kind) in [(Line::Can1, "drive"), (Line::Can2, "steering")] {
        println!("bus          {:.0} % load, {kind}", 100.0 * world.traffic(line).load());
    }
    course::judge(&samples)
}

/// The robot, and the floor under it.
fn robot(world: &World) -> Result<(Row<'_, M3508>, Row<'_, Gm6020Voltage>), Box<dyn Error>> {
    let mut floor = Vec::new();
    for (id, (place, zero)) in (1..).zip(MODULES) {
        let drive = world.attach(MotorConfig::new(Model::M3508, id))?;
        let steering = MotorConfig::new(Model::Gm6020Voltage, id)
            .with_line(Line::Can2)
            .with_load_inertia_kg_m2(MODULE_INERTIA_KG_M2);
        let steering = world.attach(steering)?;
        floor.push(Wheel::steered(drive, WHEEL_RADIUS_M, place, steering, zero));
    }
    world.attach_chassis(ChassisConfig::new(&floor))?;
    let (mut can1, mut can2) =
        (Bus::new().with_load_ceiling(0.9), Bus::new().with_load_ceiling(0.9));
    let drive = |id| Config::<M3508>::new(id).speed_loop(DRIVE);
    let steering = |id| Config::<Gm6020Voltage>::new(id).position_loop(ANGLE, RATE);
    let drives = can1.attach_all([1, 2, 3, 4].map(drive))?;
    let steerings = can2.attach_all([1, 2, 3, 4].map(steering))?;
    let runner = |line, bus| Runner::new(Nb(world.controller_on(line)), world.clock(), bus);
    Ok((
        Row { runner: runner(Line::Can1, can1), motors: drives },
        Row { runner: runner(Line::Can2, can2), motors: steerings },
    ))
}

fn drive(world: &World) -> Result<Vec<Sample<4>>, Box<dyn Error>> {
    let (mut drives, mut steerings) = robot(world)?;
    let swerve = Swerve::new(WHEEL_RADIUS_M, MODULES.map(|(place, _)| place))?;
    let mut chassis = Chassis::new(swerve);
    let limits = ChassisLimits::new()
        .with_acceleration(4.0, 20.0)
        .with_wheel_speed(AngularVelocity::from_rpm(450.0));
    chassis.set_limits(limits)?;
    let mut modules = SwerveSteering::<4>::new(SteeringConfig::new());

    let mut samples = Vec::new();
    let mut started = None;
    for _ in 0..course::STEPS {
        world.advance(Duration::from_micros(100));
        drives.runner.poll(16);
        steerings.runner.poll(16);
        let (Some(tick), Some(steering_tick)) = (drives.runner.due(), steerings.runner.due())
        else {
            continue;
        };
        // Both, or neither: modules that do not steer must not drive.
        let ready = steerings.is_ready(steering_tick) & drives.is_ready(tick);
        if ready {
            started = started.or(Some(tick.now()));
        }
        let time_s = tick.now().since(started.unwrap_or(tick.now())).as_secs_f32();
        let (driven_m, heading) = course::truth(world)?;
        chassis.set_world(course::command(time_s, chassis.pose()), heading);

        let (angles, measured) = measured(&drives, &steerings);
        let targets = modules.steer(chassis.update(measured, tick), angles);
        for ((drive, steering), (target, (_, zero))) in
            drives.motors.into_iter().zip(steerings.motors).zip(targets.into_iter().zip(MODULES))
        {
            let speed = if ready { target.velocity } else { AngularVelocity::ZERO };
            // What a motor refuses shows in `ready` one tick later.
            _ = drives.runner.device_mut().set_velocity(drive, speed);
            _ = steerings.runner.device_mut().set_angle(steering, target.angle + zero);
        }
        samples.push(Sample {
            time_s,
            planned_m: course::plan(time_s).0,
            driven_m,
            believed_m: course::place(chassis.pose()),
            target_rpm: targets.map(|module| module.velocity.as_rpm()),
            measured_rpm: measured.map(|module| module.map_or(0.0, |m| m.velocity.as_rpm())),
        });
        drives.runner.tick(tick);
        steerings.runner.tick(steering_tick);
    }
    Ok(samples)
}

type Measured = ([Option<Angle>; 4], [Option<ModuleState>; 4]);

/// What each module does, as far as its motors are heard.
fn measured(drives: &Row<'_, M3508>, steerings: &Row<'_, Gm6020Voltage>) -> Measured {
    let (drive, steering) = (drives.runner.device(), steerings.runner.device());
    let mut zeros = MODULES.into_iter();
    let angles = steerings.motors.map(|motor| {
        let (_, zero) = zeros.next()?;
        let state = steering.state(motor).filter(|_| steering.velocity(motor).is_some())?;
        Some(state.position.angle() - zero)
    });
    let mut known = angles.into_iter();
    let states = drives.motors.map(|motor| {
        let angle = known.next().flatten()?;
        Some(ModuleState::new(drive.velocity(motor)?, angle))
    });
    (angles, states)
}
