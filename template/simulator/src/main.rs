//! The robot on simulated motors and a floor: `cargo run --release -p simulator`.

use drivetrain::dji::Bus;
use drivetrain::geometry::Vec2;
use drivetrain::runner::{Nb, Runner};
use drivetrain::sim::{ChassisConfig, MotorConfig, Simulation, Wheel};
use drivetrain::time::{Duration, Instant};
use drivetrain::wire::dbus::{Remote, Switch};
use {{crate_name}}::{Arming, HALF_TRACK_M, MASS_KG, Robot, WHEEL_RADIUS_M};
use std::error::Error;

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

/// Drives for 3 s. Returns the largest speed and the way, in m/s and m.
fn drive() -> Result<(f32, f32), Box<dyn Error>> {
    let world = Simulation::new(1);
    let wheel = |id, y| -> Result<Wheel, Box<dyn Error>> {
        let wheel =
            Wheel::plain(world.attach(MotorConfig::m3508(id))?, WHEEL_RADIUS_M, Vec2::new(0.0, y));
        Ok(if y < 0.0 { wheel.reversed() } else { wheel })
    };
    let floor = [wheel(1, HALF_TRACK_M)?, wheel(2, -HALF_TRACK_M)?];
    world.attach_chassis(ChassisConfig::new(&floor).with_mass_kg(MASS_KG))?;

    let mut bus = Bus::new();
    let mut robot = Robot::new(&mut bus)?;
    let mut runner = Runner::new(Nb(world.controller()), world.clock(), bus);
    let mut fastest = 0.0_f32;
    while world.now() < Instant::START + Duration::from_secs(3) {
        world.advance(Duration::from_micros(100));
        runner.poll(16);
        let Some(tick) = runner.due() else { continue };
        let remote = pilot(tick.now().as_micros() / 1_000);
        match robot.hear(&remote) {
            Arming::Arm => runner.arm(tick)?,
            Arming::Keep => {}
            Arming::Disarm => runner.device_mut().disarm(),
        }
        robot.drive(runner.device_mut(), &remote, tick);
        runner.tick(tick);
        while let Some(edge) = runner.device_mut().next_edge() {
            println!("{edge}");
        }
        fastest = fastest.max(world.chassis().ok_or("no chassis")?.1.vx_m_s);
    }
    Ok((fastest, world.chassis().ok_or("no chassis")?.0.x_m))
}

fn main() -> Result<(), Box<dyn Error>> {
    let (fastest, way) = drive()?;
    println!("{fastest:.2} m/s at most, {way:.2} m");
    Ok(())
}

#[test]
fn a_stick_that_is_pushed_for_two_seconds_drives_three_metres() {
    let (fastest, way) = drive().unwrap();
    assert!((1.3..1.7).contains(&fastest), "{fastest} m/s");
    assert!((2.0..3.5).contains(&way), "{way} m");
}
