//! The robot on simulated motors and a floor: `cargo run --release -p simulator`.

use drivetrain::dji::Bus;
use drivetrain::geometry::{Body, Pose2, Twist, Vec2, World};
use drivetrain::motor::SwitchOrder;
use drivetrain::runner::{Nb, Runner};
use drivetrain::sim::{ChassisConfig, Fault, MotorConfig, Simulation, Wheel};
use drivetrain::time::{Duration, Instant};
use drivetrain::wire::dbus::{Remote, Switch};
use {{crate_name}}::{HALF_TRACK_M, MASS_KG, Robot, WHEEL_RADIUS_M};
use std::error::Error;

type Outcome<T> = Result<T, Box<dyn Error>>;

/// What the pilot does: the switch, and the right stick ahead.
fn pilot(ms: u64) -> Remote {
    let (right_switch, right_y) = match ms {
        0..200 => (Switch::Down, 0.0),
        200..500 => (Switch::Up, 0.0),
        500..2_500 => (Switch::Up, 1.0),
        _ => (Switch::Down, 0.0),
    };
    Remote { right_switch, right_y, ..Remote::default() }
}

/// Drives for so many milliseconds; from `silent_from_ms` on, the left motor is not heard. Returns the largest speed ahead in m/s, and
/// the pose and the motion at the end.
fn drive(
    pilot: impl Fn(u64) -> Remote,
    end_ms: u64,
    silent_from_ms: Option<u64>,
) -> Outcome<(f32, Pose2<World>, Twist<Body>)> {
    let at = |ms| Instant::START + Duration::from_millis(ms);
    let world = Simulation::new(1);
    let (left, right) =
        (world.attach(MotorConfig::m3508(1))?, world.attach(MotorConfig::m3508(2))?);
    let wheel = |motor, y| Wheel::plain(motor, WHEEL_RADIUS_M, Vec2::new(0.0, y));
    let floor = [wheel(left, HALF_TRACK_M), wheel(right, -HALF_TRACK_M).reversed()];
    world.attach_chassis(ChassisConfig::new(&floor).with_mass_kg(MASS_KG))?;
    if let Some(from_ms) = silent_from_ms {
        world.fault(Fault::Silent(left), at(from_ms)..at(end_ms))?;
    }

    let mut bus = Bus::new();
    let mut robot = Robot::new(&mut bus)?;
    let mut runner = Runner::new(Nb(world.controller()), world.clock(), bus);
    let mut fastest = 0.0_f32;
    while world.now() < at(end_ms) {
        world.advance(Duration::from_micros(100));
        runner.poll(16);
        let Some(tick) = runner.due() else { continue };
        let remote = pilot(tick.now().as_micros() / 1_000);
        match robot.hear(&remote, tick) {
            SwitchOrder::Arm => runner.arm(tick)?,
            SwitchOrder::Keep | SwitchOrder::Brake => {}
            SwitchOrder::Disarm => runner.device_mut().disarm(),
        }
        robot.drive(runner.device_mut(), &remote, tick);
        runner.tick(tick);
        while let Some(edge) = runner.device_mut().next_edge() {
            println!("{edge}");
        }
        fastest = fastest.max(world.chassis().ok_or("no chassis")?.1.vx_m_s);
    }
    let (pose, motion) = world.chassis().ok_or("no chassis")?;
    Ok((fastest, pose, motion))
}

fn main() -> Outcome<()> {
    let (fastest, pose, _) = drive(pilot, 3_000, None)?;
    println!("{fastest:.2} m/s at most, {:.2} m", pose.x_m);
    Ok(())
}

#[test]
fn a_stick_that_is_pushed_for_two_seconds_drives_three_metres() {
    let (fastest, pose, _) = drive(pilot, 3_000, None).unwrap();
    assert!((1.3..1.7).contains(&fastest), "{fastest} m/s");
    assert!((2.0..3.5).contains(&pose.x_m), "{} m", pose.x_m);
}

#[test]
fn a_robot_whose_remote_control_is_lost_at_full_speed_stands_within_a_metre() {
    let lost = |ms| if ms < 2_000 { pilot(ms) } else { Remote::default() };
    let (_, from, before) = drive(lost, 2_000, None).unwrap();
    let (_, to, after) = drive(lost, 3_000, None).unwrap();
    assert!(before.vx_m_s > 1.3, "{before:?}");
    assert!((0.3..1.0).contains(&(to.x_m - from.x_m)), "{} m", to.x_m - from.x_m);
    assert!(after.linear().norm() < 0.05, "{after:?}");
}

/// A braked wheel alone leaves a turn about itself free, which friction ends.
#[test]
fn a_robot_that_loses_a_wheel_while_a_stick_is_held_stops_within_half_a_metre() {
    let held = |ms: u64| {
        let right_y = if ms < 500 { 0.0 } else { 0.5 };
        Remote { right_y, ..pilot(ms.min(500)) }
    };
    let (_, from, before) = drive(held, 2_000, None).unwrap();
    let (_, to, after) = drive(held, 6_000, Some(2_000)).unwrap();
    assert!((before.vx_m_s - 0.75).abs() < 0.05, "{before:?}");
    let way_m = Vec2::new(to.x_m - from.x_m, to.y_m - from.y_m).norm();
    assert!(way_m < 0.5, "{way_m} m");
    assert!(after.linear().norm() < 0.02 && after.wz_rad_s.abs() < 0.05, "{after:?}");
}
