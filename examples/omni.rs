//! Three omni wheels spin under a gimbal while the robot drives a square, from the public API to a plot.
//!
//! ```text
//! cargo run --release --example omni [FILE.svg]
//! ```
//!
//! The simulated motors are real ones on a real bus, but nothing simulates this robot's floor: the wheels turn freely, and
//! the path is what the odometry makes of them.

use drivetrain::chassis::{Chassis, ChassisLimits, OmniThree, OmniThreeWheels};
use drivetrain::control::PidConfig;
use drivetrain::dji::{Bus, Config, M3508};
use drivetrain::geometry::Twist;
use drivetrain::runner::{Nb, Runner};
use drivetrain::sim::{Model, MotorConfig, World};
use drivetrain::time::{Duration, Instant};
use drivetrain::units::AngularVelocity;
use plotters::prelude::*;
use std::error::Error;

const SPEED: PidConfig = PidConfig::new(0.5, 5.0, 0.0).with_output_limit(10.0);
const SIDE_S: f32 = 2.0;
const COLORS: [RGBColor; 3] = [RGBColor(200, 60, 40), RGBColor(30, 80, 180), RGBColor(40, 140, 60)];

struct Sample {
    time_s: f32,
    position_m: (f32, f32),
    rpm: [f32; 3],
}

fn main() -> Result<(), Box<dyn Error>> {
    let path = match std::env::args().nth(1) {
        Some(option) if option.starts_with('-') => {
            eprintln!("usage: omni [FILE.svg]");
            std::process::exit(2);
        }
        path => path.unwrap_or_else(|| "omni.svg".into()),
    };
    let samples = drive()?;
    plot(&path, &samples)?;
    let (x, y) = samples.last().ok_or("no samples")?.position_m;
    println!("the square of 1 m ends at ({x:.3}, {y:.3}) m; {path}");
    Ok(())
}

/// 0.5 m/s along the sides of a square fixed in the world, turning at 3 rad/s all the while.
fn command(time_s: f32) -> (f32, f32) {
    let leg = time_s / SIDE_S;
    match leg {
        leg if leg < 1.0 => (0.5, 0.0),
        leg if leg < 2.0 => (0.0, 0.5),
        leg if leg < 3.0 => (-0.5, 0.0),
        leg if leg < 4.0 => (0.0, -0.5),
        _ => (0.0, 0.0),
    }
}

fn drive() -> Result<Vec<Sample>, Box<dyn Error>> {
    let world = World::new(1);
    let mut bus = Bus::new();
    let wheels = OmniThreeWheels { front_left: 1, front_right: 2, rear: 3 }.try_map(
        |id| -> Result<_, Box<dyn Error>> {
            world.attach(MotorConfig::new(Model::M3508, id))?;
            Ok(bus.attach(Config::<M3508>::new(id).speed_loop(SPEED))?)
        },
    )?;
    let mut runner = Runner::new(Nb(world.controller()), world.clock(), bus);
    let mut chassis = Chassis::new(OmniThree::new(0.05, 0.2)?);
    let limits = ChassisLimits::new()
        .with_acceleration(2.0, 20.0)
        .with_wheel_speed(AngularVelocity::from_rpm(450.0));
    chassis.set_limits(limits)?;

    let mut samples = Vec::new();
    let mut started = None;
    while samples.len() < 9_000 {
        world.advance(Duration::from_micros(100));
        runner.poll(16);
        let Some(tick) = runner.due() else { continue };
        // This robot arms by itself, which only a simulated one may.
        if !runner.is_armed() && runner.arm(tick).is_ok() {
            started = Some(tick.now());
        }
        if let Some(start) = started {
            let (x, y) = command(tick.now().since(start).as_secs_f32());
            let heading = chassis.pose().heading(); // stands for the IMU
            chassis.set_body(Twist::new(x, y, 3.0).to_body(heading));
        }
        chassis.drive(runner.device_mut(), wheels, tick);
        let bus = runner.device();
        let rpm = |wheel| bus.state(wheel).map_or(0.0, |state| state.velocity.as_rpm());
        samples.push(Sample {
            time_s: tick.now().since(Instant::START).as_secs_f32(),
            position_m: (chassis.pose().x_m, chassis.pose().y_m),
            rpm: wheels.map(rpm).into_array(),
        });
        runner.tick(tick);
    }
    Ok(samples)
}

fn plot(path: &str, samples: &[Sample]) -> Result<(), Box<dyn Error>> {
    let root = SVGBackend::new(path, (1200, 520)).into_drawing_area();
    root.fill(&WHITE)?;
    let (speeds, map) = root.split_horizontally(700);
    let end = samples.last().map_or(1.0, |sample| sample.time_s);
    let mut chart = ChartBuilder::on(&speeds)
        .caption(
            "wheels, rpm (red: front left, blue: front right, green: rear)",
            ("sans-serif", 16),
        )
        .margin(8)
        .x_label_area_size(24)
        .y_label_area_size(46)
        .build_cartesian_2d(0.0..end, -260.0_f32..260.0)?;
    chart.configure_mesh().light_line_style(TRANSPARENT).draw()?;
    for (wheel, color) in COLORS.iter().enumerate() {
        let speed = |sample: &Sample| sample.rpm.get(wheel).copied().unwrap_or(0.0);
        let points = samples.iter().step_by(5).map(|sample| (sample.time_s, speed(sample)));
        chart.draw_series(LineSeries::new(points, color))?;
    }
    let mut chart = ChartBuilder::on(&map)
        .caption("path, m", ("sans-serif", 16))
        .margin(8)
        .x_label_area_size(24)
        .y_label_area_size(46)
        .build_cartesian_2d(-0.3_f32..1.3, -0.3_f32..1.3)?;
    chart.configure_mesh().light_line_style(TRANSPARENT).draw()?;
    let points = samples.iter().step_by(5).map(|sample| sample.position_m);
    chart.draw_series(LineSeries::new(points, &COLORS[1]))?;
    root.present()?;
    Ok(())
}
