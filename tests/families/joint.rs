//! A joint that turns the other way than its drive, and counts from another zero.

use crate::motors::{FAMILIES, VESC};
use crate::station::Station;
use drivetrain::control::PidConfig;
use drivetrain::error::ConfigError;
use drivetrain::math::wrap_pi;
use drivetrain::motor::{
    Actuator, AngleDrive, Condition, Conditions, Devices, DriveProtocol, Impedance,
    ImpedanceControl, Ingest, Link, TargetError,
};
use drivetrain::runner::{Nb, Runner};
use drivetrain::sim::{DamiaoDrive, Drive, DriveShaft, Line, RobStrideDrive, Simulation};
use drivetrain::time::{Duration, Instant, Tick};
use drivetrain::units::{Angle, AngularVelocity};
use drivetrain::{damiao, lk, odrive, rmd, robstride, vesc};
use std::f32::consts::TAU;

/// Each family and mode, and a motor in it.
pub(crate) fn stations() -> impl Iterator<Item = (String, fn() -> Station)> {
    FAMILIES.iter().flat_map(|family| {
        family.modes.iter().map(|(mode, make)| (format!("{}, {mode}", family.name), *make))
    })
}

#[test]
fn a_reversed_motor_with_the_opposite_target_sends_the_same_frames() {
    for (name, make) in stations() {
        let (mut direct, mut reversed) = (make(), make());
        reversed.device.reverse();
        let mut was_driven = false;
        for ms in 0..650 {
            if ms == 150 {
                direct.device.arm(direct.now()).unwrap();
                reversed.device.arm(reversed.now()).unwrap();
            }
            if ms >= 150 {
                direct.device.set(1.0).unwrap();
                reversed.device.set(-1.0).unwrap();
            }
            direct.step();
            reversed.step();
            assert_eq!(direct.frames, reversed.frames, "{name}, {ms} ms");
            was_driven |= !direct.rests();
            let velocity = reversed.device.velocity_rad_per_s().map(|velocity| -velocity);
            assert_eq!(direct.device.velocity_rad_per_s(), velocity, "{name}, {ms} ms");
            let angle = reversed.device.angle_rad().map(|angle| -angle);
            assert_eq!(direct.device.angle_rad(), angle, "{name}, {ms} ms");
        }
        assert!(was_driven, "{name}");
    }
}

#[test]
fn a_joint_goes_to_angles_from_its_own_zero() {
    let to_angles =
        stations().filter(|(name, _)| name.contains("angle") || name.contains("position"));
    let mut names = Vec::new();
    for (name, make) in to_angles {
        // A count of the tachometer is 0.15 rad.
        let near_rad = if name == "vesc, current, angle" { 0.3 } else { 0.03 };
        for is_reversed in [false, true] {
            let mut station = make().settled();
            if is_reversed {
                station.device.reverse();
            }
            station.device.set_present_angle(0.75).unwrap();
            assert!((station.device.angle_rad().unwrap() - 0.75).abs() < 1e-3, "{name}");
            station.device.arm(station.now()).unwrap();
            station.steps(3_000, |station| station.device.set(1.0).unwrap()); // to 1.5 rad
            let way = if is_reversed { -0.75 } else { 0.75 };
            let turned = station.drive.shaft().angle_rad();
            assert!((turned - way).abs() < near_rad, "{name}: {turned} rad");
            let off = wrap_pi(station.device.angle_rad().unwrap() - 1.5);
            assert!(off.abs() < near_rad, "{name}: {off} rad");
            // A new zero moves nothing by itself.
            station.device.set_present_angle(-2.0).unwrap();
            station.steps(50, |_| {});
            assert!((station.drive.shaft().angle_rad() - turned).abs() < near_rad, "{name}");
            assert_eq!(station.device.set_present_angle(f32::NAN), Err(TargetError::NotFinite));
        }
        names.push(name);
    }
    assert!(names.len() > 12, "{names:?}");
}

#[test]
fn a_zero_found_by_the_program_ends_with_a_silence_of_100_ms_unless_the_drive_knows_its_angle() {
    for family in FAMILIES.iter().filter(|family| !["damiao", "robstride"].contains(&family.name)) {
        // In its position mode a VESC has an encoder.
        let counts = family.modes.iter().find(|(mode, _)| *mode == "current, angle");
        let make = || counts.map_or_else(|| family.at_position(), |(_, make)| make());
        let mut station = make().settled();
        station.device.set_present_angle(1.0).unwrap();
        station.is_deaf = true;
        station.steps(80, |_| {});
        assert_eq!(station.device.link(), Link::Late, "{}", family.name);
        station.is_deaf = false;
        station.steps(150, |_| {});
        assert!(station.device.angle_rad().is_some(), "{}: a short silence", family.name);
        station.is_deaf = true;
        station.steps(900, |_| {});
        assert_eq!(station.device.set_present_angle(1.0), Err(TargetError::NoFeedback));
        station.is_deaf = false;
        lacks_its_zero(station, family.name);
        // The program itself stands still, and takes what the drive has sent before its next update.
        let mut station = make().settled();
        station.device.set_present_angle(1.0).unwrap();
        let last = station.heard.last().copied();
        station.now_us += 300_000;
        if let Some(frame) = last {
            station.deliver(&frame);
        }
        lacks_its_zero(station, family.name);
    }
}

#[test]
fn a_zero_of_a_vesc_with_an_encoder_outlives_a_silence() {
    let family = FAMILIES.iter().find(|family| family.name == "vesc").unwrap();
    let mut station = family.at_position().settled();
    station.device.set_present_angle(1.0).unwrap();
    station.steps(50, |_| {});
    station.is_deaf = true;
    station.steps(300, |_| {});
    station.is_deaf = false;
    station.steps(150, |_| {});
    assert!((station.device.angle_rad().unwrap() - 1.0).abs() < 1e-3);
}

fn lacks_its_zero(mut station: Station, family: &str) {
    station.steps(150, |_| {});
    assert_eq!(station.device.link(), Link::Online, "{family}");
    assert_eq!(station.device.angle_rad(), None, "{family}");
    station.device.arm(station.now()).unwrap();
    assert_eq!(station.device.set(f32::NAN), Err(TargetError::NotFinite), "{family}");
    assert_eq!(station.device.set(1.0), Err(TargetError::NotHomed), "{family}");
    station.device.set_present_angle(1.0).unwrap();
    assert_eq!(station.device.set_present_angle(2e4), Err(TargetError::NotFinite));
    assert_eq!(station.device.set(1.0), Ok(()), "{family}");
}

/// Tries to change the loops of a motor, with good and with bad gains.
fn change(motor: Result<impl DriveProtocol, ConfigError>) -> [Result<(), ConfigError>; 2] {
    let mut own = Actuator::new(motor.unwrap());
    let position = PidConfig::new(8.0, 0.0, 0.0).with_output_limit(10.0);
    [0.4, -0.4].map(|kp| own.set_loops(position, PidConfig::new(kp, 2.0, 0.0)))
}

#[test]
fn each_family_changes_the_loops_that_run_here_and_refuses_others() {
    let position = PidConfig::new(10.0, 0.0, 0.0).with_output_limit(20.0);
    let speed = PidConfig::new(0.2, 1.0, 0.0);
    let loops = || ImpedanceControl::new(2.0).unwrap().with_loops(position, speed).unwrap();
    let quick = AngularVelocity::from_rad_per_s(20.0);
    let axis =
        |mode| odrive::Motor::new(odrive::Model::D6374, odrive::Firmware::V0_6, 3, quick, mode);
    let wheel = |mode| vesc::Motor::new(VESC, 23, mode);
    for changed in [
        change(damiao::Motor::new(damiao::Model::J4310, 1, loops())),
        change(lk::Motor::new(lk::Model::MF9025_16T, 1, loops())),
        change(rmd::Motor::new(rmd::Model::X8_120, 1, loops())),
        change(robstride::Motor::new(robstride::Model::RS02, 1, loops())),
        change(axis(loops())),
        change(wheel(vesc::Mode::current_with_loops(position, speed).unwrap())),
        change(wheel(vesc::Mode::duty(0.4, speed).unwrap())),
    ] {
        assert_eq!(changed, [Ok(()), Err(ConfigError::Negative("kp"))]);
    }
    for refused in [
        change(damiao::Motor::new(damiao::Model::J4310, 1, gains())),
        change(lk::Motor::new(lk::Model::MF9025_16T, 1, lk::Mode::velocity(quick))),
        change(rmd::Motor::new(rmd::Model::X8_120, 1, gains())),
        change(robstride::Motor::new(robstride::Model::RS02, 1, gains())),
        change(axis(gains())),
        change(wheel(vesc::Mode::current())),
    ] {
        assert_eq!(refused, [Err(ConfigError::Unsupported("loops")); 2]);
    }
}

/// The loss of the supply, and what is none.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Event {
    NoSupply,
    /// The program stands still, and takes a frame before its next update.
    Stall,
    Error,
}

/// A joint at 0.5 rad, whose zero is at 3 rad of the drive, so that the drive passes half a turn.
#[test]
fn the_turns_of_a_joint_with_a_zero_stay_whatever_happens_to_its_drive() {
    for (turn, event, found) in [
        (-1.0, Event::NoSupply, false),
        (0.0, Event::NoSupply, false),
        (1.0, Event::NoSupply, false),
        (0.0, Event::NoSupply, true),
        (1.0, Event::NoSupply, true),
        (1.0, Event::Stall, true),
        (1.0, Event::Error, true),
        (0.0, Event::Stall, false),
        (0.0, Event::Error, false),
    ] {
        let motor = damiao::Motor::new(damiao::Model::J4310, 1, gains()).unwrap();
        let mut joint = Actuator::new(motor);
        if !found {
            joint = joint.with_zero(Angle::from_radians(3.0)).unwrap();
        }
        let (mut paused_us, mut last) = (0, None);
        let mut drive = DamiaoDrive::of(damiao::Model::J4310, 1);
        drive.shaft_mut().set_angle(3.5 + turn * TAU);
        for ms in 1..2_500_u64 {
            let now = Instant::from_micros(ms * 1_000 + paused_us);
            if ms == 200 || ms == 1_900 {
                joint.arm(now).unwrap();
            }
            if found && ms == 100 {
                // More than half a turn from its zero.
                joint.set_present_angle(Angle::from_radians(4.0)).unwrap();
            }
            let at = if found { 4.0 } else { 0.5 };
            let hold = Impedance {
                angle: Angle::from_radians(at),
                stiffness: 20.0,
                damping: 0.6,
                ..Impedance::FREE
            };
            _ = joint.set_impedance(hold);
            if ms == 700 && event == Event::Stall {
                paused_us = 120_000;
                let late = Instant::from_micros(ms * 1_000 + paused_us);
                assert_eq!(Devices::ingest(&mut joint, &last.unwrap(), late), Ingest::Taken);
                continue;
            }
            Devices::update(&mut joint, Tick::new(now, 0.001));
            // Without supply for a second, after which the drive is within half a turn.
            let is_dark = event == Event::NoSupply && (700..1_700).contains(&ms);
            match event {
                Event::NoSupply if ms == 700 => drive.lose_supply(),
                Event::Error if ms == 700 => drive.fail(10),
                _ => {}
            }
            while let Some(frame) = Devices::next_frame(&mut joint, 0) {
                if let Some(answer) = drive.hear(&frame).filter(|_| !is_dark) {
                    assert_eq!(Devices::ingest(&mut joint, &answer, now), Ingest::Taken);
                    last = Some(answer);
                    let off = joint.angle(()).map_or(0.0, |angle| angle.as_radians() - at);
                    let is_set = !found || ms > 100;
                    assert!(!is_set || off.abs() < 0.01, "{turn}, {event:?}, {ms} ms: {off}");
                }
            }
            drive.step(0.001);
        }
        assert!(Devices::is_armed(&mut joint) && joint.angle(()).is_some(), "{turn}, {event:?}");
    }
}

#[test]
fn a_zero_is_given_to_drives_alone_that_know_their_angle() {
    let zero = Angle::from_radians(0.3);
    let of = |motor: Result<robstride::Motor, ConfigError>| {
        Actuator::new(motor.unwrap()).with_zero(zero)
    };
    assert!(of(robstride::Motor::new(robstride::Model::RS02, 1, gains())).is_ok());
    let counting = of(robstride::Motor::new(robstride::Model::CYBERGEAR, 1, gains())).err();
    assert_eq!(counting, Some(ConfigError::Unsupported("zero")));
    let wheel = vesc::Motor::new(VESC, 23, vesc::Mode::current()).unwrap();
    assert!(Actuator::new(wheel).with_zero(zero).is_err());
    assert!(Actuator::new(wheel.with_encoder()).with_zero(zero).is_ok());
    let joint = lk::Motor::new(lk::Model::MF9025_16T, 1, gains()).unwrap();
    assert!(Actuator::new(joint).with_zero(zero).is_err());
    let known = damiao::Motor::new(damiao::Model::J4310, 1, gains()).unwrap();
    let refused = Actuator::new(known).with_zero(Angle::from_radians(f32::NAN)).err();
    assert_eq!(refused, Some(ConfigError::NotFinite("zero")));
}

fn gains() -> ImpedanceControl {
    ImpedanceControl::new(2.0).unwrap().with_gains(20.0, 0.6).unwrap()
}

/// Runs a joint at its zero whose drive loses its supply after a second and is dark for so long. Returns the angle of the joint before
/// and after, how far the shaft turned, and whether there was the edge of a fault.
fn brown_out(
    model: robstride::Model,
    start: f32,
    (dark_ms, is_on): (u64, bool),
) -> (Option<Angle>, Option<Angle>, f32, Conditions) {
    let world = Simulation::new(1);
    let mut drive = RobStrideDrive::of(model, 1).with_shaft(DriveShaft::new(0.05, 0.5));
    drive.shaft_mut().set_angle(start);
    let mode = ImpedanceControl::new(5.0).unwrap();
    let joint = Actuator::new(robstride::Motor::new(model, 1, mode).unwrap());
    let mut runner = Runner::new(Nb(world.controller()), world.clock(), joint);
    let (mut before, mut turned, mut edges) = (None, 0.0_f32, Conditions::NONE);
    for ms in 0..3_000_u64 {
        if ms == 1_000 {
            before = runner.device().angle(());
            drive.lose_supply();
        }
        let from = drive.shaft().angle_rad();
        let is_dark = (1_000..1_000 + dark_ms).contains(&ms);
        let mut on: [(Line, &mut dyn Drive); 1] = [(Line::Can1, &mut drive)];
        let on = if is_dark { &mut [][..] } else { &mut on[..] };
        world.advance_drives(Duration::from_millis(1), on).unwrap();
        turned += (drive.shaft().angle_rad() - from).abs();
        runner.poll(16);
        let Some(tick) = runner.due() else { continue };
        match ms {
            300 => runner.device_mut().set_present_angle(Angle::ZERO).unwrap(),
            400 | 2_000 => runner.arm(tick).unwrap(),
            900 if !is_on => runner.device_mut().disarm(),
            // The switch turns off, whatever happened.
            1_900 => runner.device_mut().disarm(),
            _ => {}
        }
        let spring = Impedance { stiffness: 10.0, damping: 1.0, ..Impedance::FREE };
        _ = runner.device_mut().set_impedance(spring);
        runner.tick(tick);
        while let Some(edge) = runner.device_mut().next_edge() {
            edges = if edge.began { edges.with(edge.condition) } else { edges };
        }
    }
    (before, runner.device().angle(()), turned, edges)
}

#[test]
fn a_drive_that_starts_again_at_once_keeps_the_joint_where_it_is_or_loses_its_zero() {
    for dark_ms in [0, 5, 20, 60, 99, 150, 500] {
        for is_on in [true, false] {
            let case = format!("dark for {dark_ms} ms, armed: {is_on}");
            // Beyond half a turn of the drive, which is lost.
            let (before, after, turned, _) =
                brown_out(robstride::Model::RS03, 3.6, (dark_ms, is_on));
            let off = |angle: Option<Angle>| angle.unwrap().as_radians().abs();
            assert!(off(before) < 0.01 && off(after) < 0.01, "{case}: {after:?}");
            assert!(turned < 0.05, "{case}: the shaft turned by {turned} rad");
            // The CyberGear counts from where it is switched on.
            let (before, after, turned, edges) =
                brown_out(robstride::Model::CYBERGEAR, 1.5, (dark_ms, is_on));
            assert!(off(before) < 0.01 && after.is_none(), "{case}: {after:?}");
            assert!(edges.contains(Condition::PositionUncertain), "{case}: {edges}");
            let lost = if dark_ms > 100 { Condition::Offline } else { Condition::Fault };
            assert!(edges.contains(lost), "{case}: {edges}");
            assert!(turned < 0.05, "{case}: the shaft turned by {turned} rad");
        }
    }
}
