//! Joints between soft limits, with a drive of each family in each of its modes.

use crate::joint::stations;
use crate::station::Station;
use drivetrain::motor::{Condition, HealthConfig};
use drivetrain::units::Angle;

static NARROW: HealthConfig =
    HealthConfig::new().with_soft_limits(Angle::from_radians(-1.0), Angle::from_radians(1.0));
static WIDE: HealthConfig =
    HealthConfig::new().with_soft_limits(Angle::from_radians(-2.8), Angle::from_radians(2.8));

/// A joint at so many rad, armed.
fn at(
    make: fn() -> Station,
    limits: &'static HealthConfig,
    is_reversed: bool,
    angle: f32,
) -> Station {
    let mut station = make();
    if is_reversed {
        station.device.reverse();
    }
    station.device.set_health(limits);
    let mut station = station.settled();
    station.device.set_present_angle(angle).unwrap();
    station.steps(10, |_| {});
    station.device.arm(station.now()).unwrap();
    station
}

fn angle(station: &Station) -> f32 {
    station.device.angle_rad().unwrap()
}

/// Asks for a share of the target of the mode, and returns the least and the most angle of the joint.
fn drive(station: &mut Station, share: f32, ms: u32) -> (f32, f32) {
    let (mut least, mut most) = (f32::MAX, f32::MIN);
    station.steps(ms, |station| {
        station.device.set(share).unwrap();
        (least, most) = (least.min(angle(station)), most.max(angle(station)));
    });
    (least, most)
}

fn follows_torques(name: &str) -> bool {
    let modes = ["MIT", "operation", "current", "torque", "torque, 0.5", "torque, 0.6"];
    modes.iter().any(|mode| name.split_once(", ").is_some_and(|(_, name)| name == *mode))
}

#[test]
fn a_joint_stops_at_its_limits_and_leaves_them_again() {
    let mut modes = 0;
    for (name, make) in stations().filter(|(name, _)| !follows_torques(name)) {
        // A VESC lets go of the shaft below its least rpm, which here is more than the braking velocity.
        if name == "vesc, velocity" {
            continue;
        }
        // Loops of ours with an overshoot of their own.
        let over = if name == "vesc, current, angle" { 0.3 } else { 0.05 };
        for is_reversed in [false, true] {
            let mut station = at(make, &NARROW, is_reversed, 0.0);
            for outward in [1.0, -1.0, 1.0] {
                let (least, most) = drive(&mut station, outward, 3_000);
                let [end, furthest] = [angle(&station) * outward, most.max(-least)];
                assert!((0.85..1.05).contains(&end), "{name}, {is_reversed}: {end} rad");
                assert!(furthest < 1.0 + over, "{name}, {is_reversed}: {furthest} rad");
            }
        }
        modes += 1;
    }
    assert_eq!(modes, 24);
}

#[test]
fn a_target_beyond_a_limit_holds_a_joint_for_a_minute_against_a_load() {
    for (name, make) in stations().filter(|(name, _)| !follows_torques(name)) {
        if name == "vesc, velocity" {
            continue;
        }
        for (is_reversed, load_nm) in [(false, 0.1), (true, -0.1)] {
            let mut station = at(make, &NARROW, is_reversed, 0.0);
            drive(&mut station, 1.0, 3_000);
            station.drive.shaft_mut().set_load(load_nm);
            let (least, most) = drive(&mut station, 1.0, 60_000);
            assert!(least > 0.85 && most < 1.06, "{name}, {is_reversed}: {least} to {most} rad");
        }
    }
}

#[test]
fn a_torque_ends_before_a_limit_and_leads_back_from_beyond() {
    let mut modes = 0;
    for (name, make) in stations().filter(|(name, _)| follows_torques(name)) {
        // Of the tachometer of a VESC, in rad.
        let count = if name.starts_with("vesc") { 0.16 } else { 0.0 };
        for (is_reversed, sign) in [(false, 1.0), (true, -1.0)] {
            // Where the joint is, where it is after 0.24 s of the whole torque, and the largest torque then.
            for (here, from, to, most) in
                [(1.2, 1.18, 1.22, 0.003), (0.99, 0.985, 1.02, 0.1), (-1.2, -0.85, 0.4, 0.9)]
            {
                let mut station = at(make, &NARROW, is_reversed, here);
                drive(&mut station, 1.0, 240);
                let there = angle(&station);
                let case = format!("{name}, {is_reversed}: {here} to {there} rad");
                assert!((from..to + count).contains(&there), "{case}");
                assert!(station.drive.shaft().torque_nm() * sign < most, "{case}");
                let is_at_limit = station.device.conditions().contains(Condition::SoftLimit);
                assert_eq!(is_at_limit, there > 0.98, "{case}");
            }
            // Sped up by the whole torque, and braked by as much.
            let mut station = at(make, &NARROW, is_reversed, -0.5);
            let (_, furthest) = drive(&mut station, 1.0, 3_000);
            assert!((0.8..1.15 + count).contains(&furthest), "{name}, {is_reversed}: {furthest}");
        }
        modes += 1;
    }
    assert_eq!(modes, 8);
}

#[test]
fn a_joint_outside_of_its_limits_is_not_driven_further() {
    for (name, make) in stations() {
        for (is_reversed, side) in [(false, 1.0), (false, -1.0), (true, 1.0), (true, -1.0)] {
            let mut station = at(make, &NARROW, is_reversed, 1.4 * side);
            assert!(station.device.conditions().contains(Condition::SoftLimit), "{name}");
            let (least, most) = drive(&mut station, side, 300);
            let furthest = most.max(-least);
            assert!(furthest < 1.42, "{name}, {is_reversed}: {furthest} rad");
            drive(&mut station, -side, 1_500);
            assert!(angle(&station) * side < 1.0 || name == "vesc, velocity", "{name}");
        }
    }
}

#[test]
fn the_way_to_an_angle_leads_not_through_the_forbidden_part() {
    let mut modes = 0;
    let to_angles =
        stations().filter(|(name, _)| name.contains("angle") || name.contains("position"));
    for (name, make) in to_angles {
        for is_reversed in [false, true] {
            let mut station = at(make, &WIDE, is_reversed, 2.6);
            let start = station.drive.shaft().angle_rad();
            // To -2.6 rad, 1.08 rad away over half a turn.
            let (least, most) = drive(&mut station, -2.6 / 1.5, 4_000);
            let turned = station.drive.shaft().angle_rad() - start;
            let way = if is_reversed { 5.2 } else { -5.2 };
            assert!((turned - way).abs() < 0.3, "{name}, {is_reversed}: {turned} rad");
            let over = if name == "vesc, current, angle" { 0.6 } else { 0.05 };
            assert!(least > -2.8 - over && most < 2.8, "{name}: {least} to {most} rad");
        }
        modes += 1;
    }
    assert_eq!(modes, 14);
}
