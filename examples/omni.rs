//! Three omni wheels turn under a gimbal while the robot drives a square, on the simulator, through the public API.
//!
//! ```text
//! cargo run --release --example omni [FILE.svg]
//! ```
//!
//! Prints how far the robot was off its plan, and fails when that is too much.

mod course;

use course::Sample;
use drivetrain::chassis::{Chassis, ChassisLimits, Omni};
use drivetrain::control::PidConfig;
use drivetrain::dji::{Bus, Config, Handle, M3508};
use drivetrain::geometry::Vec2;
use drivetrain::runner::{Nb, Runner};
use drivetrain::sim::{ChassisConfig, Line, MotorConfig, Simulation, Wheel};
use drivetrain::time::Duration;
use drivetrain::units::{Angle, AngularVelocity};
use std::error::Error;

const WHEEL_RADIUS_M: f32 = 0.076;
const DISTANCE_M: f32 = 0.22;
/// A per rad/s and A per rad of the output shaft: gains of `WheelTuning` for 15 kg, with twice its `ki`, since the robot follows a plan. The floor holds some 9 A on each of three wheels.
const SPEED: PidConfig = PidConfig::new(4.0, 10.0, 0.0).with_output_limit(8.0);

fn main() -> Result<(), Box<dyn Error>> {
    let path = course::output::path("omni");
    let world = Simulation::new(1);
    let samples = drive(&world)?;
    course::plot(&path, ["front left", "front right", "rear"], &samples)?;
    course::console::line(format_args!(
        "bus          {:.0} % load",
        100.0 * world.traffic(Line::Can1).load()
    ));
    course::judge(&samples)
}

/// Front left, front right, rear.
type Wheels = [Handle<M3508>; 3];

/// The robot, and the floor under it: each wheel rolls counter-clockwise round the centre.
fn robot(world: &Simulation) -> Result<(Bus, Wheels), Box<dyn Error>> {
    let mut bus = Bus::new().with_load_ceiling(0.9);
    let mut floor = Vec::new();
    let mut wheel = |id, degrees: f32| -> Result<_, Box<dyn Error>> {
        let motor = world.attach(MotorConfig::m3508(id))?;
        let (sine, cosine) = degrees.to_radians().sin_cos();
        let place = Vec2::new(cosine, sine) * DISTANCE_M;
        floor.push(Wheel::omni(motor, WHEEL_RADIUS_M, place, Angle::from_degrees(degrees + 90.0)));
        Ok(bus.attach(Config::<M3508>::new(id).speed_loop(SPEED))?)
    };
    let wheels = [wheel(1, 60.0)?, wheel(2, -60.0)?, wheel(3, 180.0)?];
    world.attach_chassis(ChassisConfig::new(&floor).with_mass_kg(15.0))?;
    Ok((bus, wheels))
}

fn drive(world: &Simulation) -> Result<Vec<Sample<3>>, Box<dyn Error>> {
    let (bus, wheels) = robot(world)?;
    let mut runner = Runner::new(Nb(world.controller()), world.clock(), bus);
    let mut chassis = Chassis::new(Omni::three(WHEEL_RADIUS_M, DISTANCE_M)?);
    let limits = ChassisLimits::new()
        .with_acceleration(4.0, 20.0)
        .with_wheel_speed(AngularVelocity::from_rpm(450.0));
    chassis.set_limits(limits)?;

    let mut samples = Vec::new();
    let mut started = None;
    for _ in 0..course::STEPS {
        world.advance(Duration::from_micros(100));
        runner.poll(16);
        let Some(tick) = runner.due() else { continue };
        // This robot arms by itself, which only a simulated one may.
        if !runner.is_armed() && runner.arm(tick).is_ok() {
            started = started.or(Some(tick.now()));
        }
        let time_s = tick.now().since(started.unwrap_or(tick.now())).as_secs_f32();
        let (driven_m, heading) = course::truth(world)?;
        course::command(&mut chassis, time_s, heading);
        let targets = chassis.drive(runner.device_mut(), wheels, tick);
        let bus = runner.device();
        let rpm = |wheel| bus.state(wheel).map_or(0.0, |state| state.velocity.as_rpm());
        samples.push(Sample {
            time_s,
            planned_m: course::plan(time_s).0,
            driven_m,
            believed_m: course::place(chassis.pose()),
            target_rpm: targets.map(AngularVelocity::as_rpm),
            measured_rpm: wheels.map(rpm),
            steering_deg: None,
        });
        runner.tick(tick);
    }
    Ok(samples)
}
