//! Joints between soft limits, with a drive of each family in each of its modes.

use crate::drives::Damiao;
use crate::joint::stations;
use crate::station::Station;
use drivetrain::damiao::{Model, Motor};
use drivetrain::motor::{Capability, Condition, HealthConfig, ImpedanceControl};
use drivetrain::sim::{DamiaoDrive, DriveShaft};
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

/// A joint under a velocity, in a mode that follows angles too. All values are in the direction of the upper limit, 1 rad.
struct Pushed {
    name: String,
    station: Station,
    sign: f32,
}

impl Pushed {
    /// Each mode with velocities and angles once, and each mounting, with a joint at so many rad.
    fn each(angle: f32) -> Vec<Self> {
        let mut joints = Vec::new();
        // The other targets of a mode are left out.
        for (name, make) in stations().filter(|(name, _)| !follows_torques(name)) {
            let is_twice = ["MIT, velocity", "MIT, damper"].iter().any(|mode| name.ends_with(mode));
            let capabilities = make().device.capabilities();
            let has_both = [Capability::Velocity, Capability::Angle].map(|it| capabilities.has(it));
            if has_both == [true; 2] && !is_twice {
                joints.extend([false, true].map(|is_reversed| Self {
                    name: format!("{name}, {is_reversed}"),
                    station: at(make, &NARROW, is_reversed, angle),
                    sign: if is_reversed { -1.0 } else { 1.0 },
                }));
            }
        }
        assert_eq!(joints.len(), 14);
        joints
    }

    /// As [`each`](Self::each), without loops that a block winds up, by counts of 0.16 rad.
    fn fine(angle: f32) -> Vec<Self> {
        let joints: Vec<_> = Self::each(angle).into_iter().filter(|it| !it.is_coarse()).collect();
        assert_eq!(joints.len(), 12);
        joints
    }

    /// Whether loops of ours with an integral, by a tachometer with a count of 0.16 rad, drive the joint.
    fn is_coarse(&self) -> bool {
        self.name.starts_with("vesc")
    }

    fn angle(&self) -> f32 {
        angle(&self.station)
    }

    fn turn(&self) -> f32 {
        self.station.drive.shaft().angle_rad() * self.sign
    }

    fn velocity(&self) -> f32 {
        self.station.drive.shaft().velocity_rad_per_s() * self.sign
    }

    fn torque(&self) -> f32 {
        self.station.drive.shaft().torque_nm() * self.sign
    }

    fn load(&mut self, load_nm: f32) {
        self.station.drive.shaft_mut().set_load(load_nm * self.sign);
    }

    /// Asks for a velocity, and returns the least and the most of a quantity.
    fn run(&mut self, rad_per_s: f32, ms: u32, quantity: fn(&Self) -> f32) -> (f32, f32) {
        let (mut least, mut most) = (f32::MAX, f32::MIN);
        for _ in 0..ms {
            self.station.device.set_velocity(rad_per_s).unwrap();
            self.station.step();
            let now = quantity(self);
            (least, most) = (least.min(now), most.max(now));
        }
        (least, most)
    }
}

/// The damper of these modes holds 0.3 Nm at 0.5 rad/s, the spring sags by 0.05 rad.
#[test]
fn a_velocity_holds_a_joint_at_its_limit_for_a_minute_against_a_load_that_only_a_spring_holds() {
    for mut joint in Pushed::each(0.5) {
        joint.run(2.0, 100, Pushed::angle);
        // Of the whole torque of the VESC, half.
        joint.load(if joint.is_coarse() { 0.5 } else { 1.0 });
        let (_, furthest) = joint.run(2.0, 60_000, Pushed::angle);
        let (least, most) = joint.run(2.0, 1_000, Pushed::angle);
        let over = if joint.is_coarse() { 0.35 } else { 0.15 };
        assert!(furthest < 1.0 + over, "{}: {furthest} rad", joint.name);
        let end = if joint.is_coarse() { 0.7..1.3 } else { 0.98..1.07 };
        assert!(end.contains(&least) && end.contains(&most), "{}: {least}, {most}", joint.name);
        assert!(joint.station.device.is_armed(), "{}", joint.name);
    }
}

#[test]
fn a_velocity_leads_a_joint_far_outside_back_without_a_throw() {
    for mut joint in Pushed::fine(2.2) {
        let (mut furthest, mut fastest, mut jump) = (0.0_f32, 0.0_f32, 0.0_f32);
        for ms in 0_u16..5_000 {
            // Comes in half a second, when the output is open.
            joint.load((f32::from(ms) / 500.0 - 0.5).clamp(0.0, 1.0));
            let before = joint.torque();
            let (_, here) = joint.run(6.0, 1, Pushed::angle);
            furthest = furthest.max(here);
            fastest = fastest.max(joint.velocity().abs());
            jump = jump.max((joint.torque() - before).abs());
            let slowest = 2.2 + 0.06 - 0.5 * (f32::from(ms) / 1_000.0 - 0.4);
            assert!(here < slowest.max(1.07), "{}, {ms} ms: {here} rad", joint.name);
        }
        let case = format!("{}: {furthest} rad, {fastest} rad/s, {jump} Nm", joint.name);
        assert!(furthest < 2.25 && fastest < 0.8 && jump < 0.3, "{case}");
    }
}

/// The arm of `docs/gains.md`, whose weight stretches its soft spring by 0.22 rad.
#[test]
fn a_velocity_leads_an_arm_back_whose_weight_stretches_its_spring_far() {
    let arm = || {
        let gains = ImpedanceControl::new(9.0).unwrap().with_gains(6.75, 0.9).unwrap();
        let drive = DamiaoDrive::of(Model::J4340, 1).with_shaft(DriveShaft::new(0.03, 0.01));
        let motor = Motor::new(Model::J4340, 1, gains).unwrap();
        Station::new(motor, |own, share| own.set_torque(share), Damiao(drive, true))
    };
    for (is_reversed, sign) in [(false, 1.0), (true, -1.0)] {
        let station = at(arm, &NARROW, is_reversed, 2.2);
        let mut joint = Pushed { name: String::new(), station, sign };
        joint.run(0.0, 300, Pushed::angle);
        joint.load(1.47);
        let (_, furthest) = joint.run(0.0, 1_000, Pushed::angle);
        assert!((joint.angle() - 2.42).abs() < 0.01 && furthest < 2.5, "{furthest} rad");
        let (fastest, _) = joint.run(2.0, 7_000, Pushed::velocity);
        assert!((joint.angle() - 1.22).abs() < 0.01, "{} rad", joint.angle());
        assert!(fastest > -0.6, "{fastest} rad/s");
    }
}

#[test]
fn a_joint_blocked_beyond_its_limit_turns_a_quarter_of_a_radian_when_it_is_freed() {
    for mut joint in Pushed::fine(2.2) {
        let block = joint.turn();
        for ms in 0_u16..10_000 {
            // It trembles at 2 Hz.
            let tremble = if ms % 500 < 250 { 0.03 } else { 0.0 };
            joint.station.drive.shaft_mut().set_angle((block + tremble) * joint.sign);
            joint.station.drive.shaft_mut().set_velocity(0.0);
            joint.run(6.0, 1, Pushed::angle);
        }
        let (least, _) = joint.run(6.0, 200, Pushed::angle);
        // With the way at 0.5 rad/s.
        assert!(least > 2.2 - 0.36, "{}: {least} rad", joint.name);
        joint.run(6.0, 4_000, Pushed::angle);
        assert!((joint.angle() - 1.0).abs() < 0.02, "{}: {} rad", joint.name, joint.angle());
    }
}

#[test]
fn a_velocity_of_zero_and_a_slow_one_beyond_a_limit_hold_a_load_and_an_inward_one_leaves() {
    for mut joint in Pushed::fine(1.5) {
        joint.run(0.0, 300, Pushed::angle);
        joint.load(1.0);
        for held in [0.0, 0.001, -0.001, 0.0] {
            let (least, most) = joint.run(held, 3_000, Pushed::angle);
            assert!(least > 1.48 && most < 1.61, "{}, {held}: {least}, {most}", joint.name);
        }
        // Turned round and round, by a spring that moves on.
        for outward in [2.0, -0.2, 0.1, -0.4] {
            let before = joint.torque();
            joint.run(outward, 1, Pushed::angle);
            let change = (joint.torque() - before).abs();
            assert!(change < 0.1, "{}, {outward}: {change} Nm", joint.name);
            let from = joint.angle();
            joint.run(outward, 200, Pushed::angle);
            let way = from - joint.angle();
            let most = outward.abs().min(0.5) * 0.2;
            assert!((most - 0.03..most + 0.03).contains(&way), "{}: {way} rad", joint.name);
        }
        // The joint does not leave by a damper that is too weak, and is not pulled on either.
        let (_, most) = joint.run(-0.3, 10_000, Pushed::angle);
        assert!(most < 1.5, "{}: {most} rad", joint.name);
        let (_, most) = joint.run(-0.3, 10_000, Pushed::angle);
        assert!(most < 1.15, "{}: {most} rad", joint.name);
        // A velocity that changes between slow and fast neither.
        for fast in 0_u8..100 {
            let inward = if fast % 2 == 0 { -0.49 } else { -0.51 };
            let (_, most) = joint.run(inward, 100, Pushed::angle);
            assert!(most < 1.15, "{}: {most} rad", joint.name);
        }
        // The torque of a faster inward velocity is as large as anywhere.
        let (_, most) = joint.run(-6.0, 1_000, Pushed::angle);
        assert!(most < 1.15 && joint.angle() < 0.0, "{}: {most} rad", joint.name);
    }
}

/// A motor whose feedback is late rests meanwhile, and so does one whose program stands still: the joint is where it is.
#[test]
fn a_joint_that_was_moved_while_its_motor_rested_is_not_thrown_back() {
    for mut joint in Pushed::fine(1.2) {
        joint.run(2.0, 300, Pushed::angle);
        for step in [0.0, 0.001] {
            let is_hold = step == 0.0;
            (joint.station.dt_s, joint.station.is_deaf) = (step, !is_hold);
            for ms in 0_u8..60 {
                let moved = joint.turn() + if ms > 20 { 0.02 } else { 0.0 };
                joint.station.drive.shaft_mut().set_angle(moved * joint.sign);
                joint.station.drive.shaft_mut().set_velocity(0.0);
                _ = joint.station.device.set_velocity(2.0);
                joint.station.step();
            }
            (joint.station.dt_s, joint.station.is_deaf) = (0.001, false);
            joint.station.steps(3, |_| {});
            let from = joint.angle();
            let (least, most) = joint.run(2.0, 100, Pushed::angle);
            assert!(
                least > from - 0.06 && most < from + 0.04,
                "{}: {from}, {least}, {most}",
                joint.name
            );
        }
    }
}

#[test]
fn silences_let_a_loaded_joint_beyond_its_limit_no_further_out() {
    for mut joint in Pushed::fine(1.2) {
        joint.run(0.0, 300, Pushed::angle);
        joint.load(1.0);
        for silence in 0_u8..20 {
            joint.station.is_deaf = true;
            joint.station.steps(20, |_| {});
            joint.station.is_deaf = false;
            joint.station.steps(3, |_| {});
            let (_, most) = joint.run(0.0, 480, Pushed::angle);
            assert!(most < 1.5, "{}, {silence}: {most} rad", joint.name);
        }
        assert!(joint.angle() < 1.3, "{}: {} rad", joint.name, joint.angle());
    }
}
