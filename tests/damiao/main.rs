//! Motors of Damiao with a drive that is written from the manual: settings, arming, targets, limits, rest, and a drive that stops
//! by itself.

#![cfg(test)]

mod bench;
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::float_cmp,
    reason = "fields of a frame, drawn values, and the number of a mode"
)]
mod review;

use bench::{Bench, mit};
use drivetrain::control::PidConfig;
use drivetrain::damiao::{Mode, Model, Motor, Register};
use drivetrain::error::ConfigError;
use drivetrain::motor::{
    Actuator, AngleDrive, Devices, Impedance, ImpedanceControl, TargetError, VelocityDrive,
};
use drivetrain::runner::{Nb, Runner};
use drivetrain::sim::{DamiaoDrive, Drive, DriveShaft, Line, Simulation};
use drivetrain::time::{Duration, Instant, Tick};
use drivetrain::units::{Angle, AngularVelocity};

#[test]
fn a_motor_is_armed_when_its_settings_have_been_read() {
    let mut bench = Bench::new(mit(), 1.0);
    let refused = |bench: &mut Bench| bench.own.arm(bench.now()).unwrap_err().to_string();
    assert_eq!(refused(&mut bench), "no feedback from DM-J4310 #1");
    bench.steps(5, |_| {});
    assert!(refused(&mut bench).starts_with("DM-J4310 #1: its "));
    bench.steps(60, |_| {});
    assert_eq!(
        refused(&mut bench),
        "DM-J4310 #1: its number of drives is not known yet, ask again"
    );
    bench.steps(60, |_| {});
    assert_eq!(bench.own.arm(bench.now()), Ok(()));
}

/// As delivered, each drive has the id 1.
#[test]
fn two_drives_with_one_id_on_a_bus_are_not_armed() {
    let world = Simulation::new(1);
    let mut drives = [0.0, 1.5].map(|angle| {
        let mut shaft = DriveShaft::new(0.02, 0.05);
        shaft.set_angle(angle);
        DamiaoDrive::of(Model::J4310, 1).with_shaft(shaft)
    });
    let joint = Actuator::new(Motor::new(Model::J4310, 1, mit()).unwrap());
    let mut runner = Runner::new(Nb(world.controller()), world.clock(), joint);
    for (ms, is_alone) in (0..6_000).map(|ms| (ms, ms > 3_000)) {
        let [one, two] = &mut drives;
        let [one, two]: [&mut dyn Drive; 2] = [one, two];
        let mut pair = [(Line::Can1, one), (Line::Can1, two)];
        let shown = if is_alone { &mut pair[..1] } else { &mut pair[..] };
        world.advance_drives(Duration::from_millis(1), shown).unwrap();
        runner.poll(16);
        let Some(tick) = runner.due() else { continue };
        match ms {
            3_000 => {
                let refused = runner.arm(tick).unwrap_err().to_string();
                assert!(refused.contains("DM-J4310 #1"), "{refused}");
                let edge = runner.device_mut().next_edge().unwrap().to_string();
                assert!(edge.starts_with("DM-J4310 #1: duplicate id began"), "{edge}");
            }
            5_500 => runner.arm(tick).unwrap(),
            _ => {}
        }
        runner.tick(tick);
    }
    assert!(runner.is_armed());
}

#[test]
fn a_write_is_lost_with_the_supply_unless_it_was_stored_and_noticed_before_arming() {
    for stores in [false, true] {
        let mut bench = Bench::new(mit(), 2.0);
        bench.own.motor_mut().write(Register::ControlMode, 1.0).unwrap();
        bench.steps(100, |_| {});
        if stores {
            bench.own.motor_mut().store();
            bench.steps(50, |_| {});
        }
        bench.drive.lose_supply();
        bench.steps(150, |_| {});
        assert_eq!(bench.own.arm(bench.now()).is_ok(), stores);
    }
}

#[test]
fn each_mode_reaches_its_target_and_rests_after_a_disarm() {
    let wheel = AngularVelocity::from_rad_per_s(6.0);
    let mut velocity = Bench::armed(Mode::velocity(AngularVelocity::from_rad_per_s(20.0)), 3.0);
    velocity.steps(1_000, |bench| bench.own.set_velocity((), wheel).unwrap());
    assert!((velocity.drive.shaft().velocity_rad_per_s() - 6.0).abs() < 0.2);
    rests(velocity);

    let mut damped = Bench::armed(mit(), 1.0);
    damped.steps(1_000, |bench| bench.own.set_velocity((), wheel).unwrap());
    assert!((damped.drive.shaft().velocity_rad_per_s() - 6.0).abs() < 0.2);
    rests(damped);

    let loops = ImpedanceControl::new(3.0).unwrap().with_loops(
        PidConfig::new(10.0, 0.0, 0.0).with_output_limit(20.0),
        PidConfig::new(0.5, 2.0, 0.0),
    );
    let mut looped = Bench::armed(loops.unwrap(), 1.0);
    looped.steps(1_000, |bench| bench.own.set_velocity((), wheel).unwrap());
    assert!((looped.drive.shaft().velocity_rad_per_s() - 6.0).abs() < 0.1);
    looped.steps(1_500, |bench| bench.own.set_angle((), Angle::from_radians(1.0)).unwrap());
    assert!(
        (looped.drive.shaft().angle_rad() - 1.0).abs().rem_euclid(core::f32::consts::TAU) < 0.02
    );
    rests(looped);

    let quick = AngularVelocity::from_rad_per_s(10.0);
    let joint = Angle::from_radians(1.0);
    let mut position = Bench::armed(Mode::position_velocity(quick), 2.0);
    position.steps(2_000, |bench| bench.own.set_angle((), joint).unwrap());
    assert!((position.drive.shaft().angle_rad() - 1.0).abs() < 0.02);
    rests(position);

    let mut force = Bench::armed(Mode::force_position(quick, 2.0), 4.0);
    force.steps(2_000, |bench| {
        bench.own.set_angle((), joint).unwrap();
        assert!(bench.drive.shaft().torque_nm().abs() <= 2.001);
    });
    assert!((force.drive.shaft().angle_rad() - 1.0).abs() < 0.02);
    rests(force);
}

/// Disarmed, the drive gives no torque from the next frames on, and is disabled.
fn rests(mut bench: Bench) {
    bench.own.disarm();
    bench.step();
    bench.steps(50, |bench| {
        assert!(bench.drive.shaft().torque_nm().abs() < 0.003, "{:?}", bench.frames)
    });
    assert!(!bench.drive.is_enabled());
}

#[test]
fn an_impedance_holds_a_weight_at_its_angle_and_never_asks_for_more_than_the_limit() {
    let mut bench = Bench::armed(ImpedanceControl::new(3.0).unwrap(), 1.0);
    bench.drive = bench.drive.with_shaft(DriveShaft::new(0.05, 0.05));
    bench.drive.shaft_mut().set_load(-1.0);
    let far = Impedance {
        angle: Angle::from_radians(2.0),
        stiffness: 30.0,
        damping: 2.0,
        torque_nm: 1.0,
        ..Impedance::FREE
    };
    bench.steps(3_000, |bench| {
        bench.own.set_impedance(far).unwrap();
        assert!(
            bench.drive.shaft().torque_nm().abs() < 3.3,
            "a count of torque, and what one cycle changes"
        );
    });
    assert!(
        (bench.drive.shaft().angle_rad() - 2.0).abs() < 0.01,
        "{}",
        bench.drive.shaft().angle_rad()
    );
    for wrong in [
        Impedance { stiffness: -1.0, ..far },
        Impedance { damping: f32::NAN, ..far },
        Impedance { torque_nm: f32::INFINITY, ..far },
    ] {
        assert_eq!(bench.own.set_impedance(wrong), Err(TargetError::NotFinite));
    }
}

#[test]
fn nothing_jumps_when_a_motor_far_from_its_target_is_armed() {
    let quick = AngularVelocity::from_rad_per_s(10.0);
    let there = Angle::from_radians(-1.5);
    let mut position = Bench::new(Mode::position_velocity(quick), 2.0);
    position.drive.shaft_mut().set_angle(1.5);
    position.steps(100, |_| {});
    position.own.arm(position.now()).unwrap();
    position.steps(60, |bench| bench.own.set_angle((), there).unwrap());
    let near = position.drive.shaft().angle_rad();
    assert!((near - 1.5).abs() < 0.05, "60 ms after arming at {near}");
    let mut spring = Bench::new(mit(), 1.0);
    spring.drive.shaft_mut().set_angle(1.5);
    spring.steps(100, |_| {});
    spring.own.arm(spring.now()).unwrap();
    spring.steps(30, |bench| {
        bench.own.set_angle((), there).unwrap();
        assert!(bench.drive.shaft().torque_nm().abs() < 0.3, "{}", bench.drive.shaft().torque_nm());
    });
}

#[test]
fn two_motors_with_one_master_id_are_told_apart() {
    let mode = mit();
    let motor = |id| {
        Actuator::new(Motor::new(Model::J4310, id, mode).unwrap().with_master_id(0x10).unwrap())
    };
    let mut robot = [motor(1), motor(2)];
    let drive = |id| DamiaoDrive::of(Model::J4310, id).with_register(7, 16.0);
    let mut drives = [drive(1), drive(2)];
    let mut now = Instant::from_micros(0);
    for ms in 0..1_200_u64 {
        now = Instant::from_micros(1_000 * (ms + 1));
        robot.update(Tick::new(now, 0.001));
        while let Some(frame) = robot.next_frame(0) {
            for drive in &mut drives {
                if let Some(answer) = drive.hear(&frame) {
                    assert_eq!(robot.ingest(&answer, now), drivetrain::motor::Ingest::Taken);
                }
            }
        }
        drives.iter_mut().for_each(|drive| drive.step(0.001));
        if ms == 100 {
            robot.arm(now).unwrap();
        }
        if ms > 100 {
            robot[0].set_velocity((), AngularVelocity::from_rad_per_s(3.0)).unwrap();
            robot[1].set_velocity((), AngularVelocity::from_rad_per_s(-5.0)).unwrap();
        }
    }
    assert!(robot.is_armed() && now > Instant::START + Duration::from_millis(1_000));
    let speeds = drives.map(|drive| drive.shaft().velocity_rad_per_s());
    assert!((speeds[0] - 3.0).abs() < 0.2 && (speeds[1] + 5.0).abs() < 0.2, "{speeds:?}");
}

#[test]
fn bad_configurations_are_refused_with_the_limit() {
    let text = |outcome: Result<Motor, ConfigError>| outcome.unwrap_err().to_string();
    assert_eq!(
        text(Motor::new(Model::J4310, 0, ImpedanceControl::new(1.0).unwrap())),
        "id 0: 1 to 15 are allowed"
    );
    assert_eq!(
        text(Motor::new(Model::J4310, 16, ImpedanceControl::new(1.0).unwrap())),
        "id 16: 1 to 15 are allowed"
    );
    let motor = |limit| {
        let mode = ImpedanceControl::new(limit)?;
        Motor::new(Model::J4310, 1, mode)
    };
    assert!(
        text(motor(10.001))
            .ends_with("torque limit in Nm 10.001: above 0 and at most 10 is allowed")
    );
    for limit in [0.0, -1.0, f32::INFINITY, f32::NAN] {
        assert!(ImpedanceControl::new(limit).is_err(), "{limit}");
    }
    assert!(motor(1.0).unwrap().with_master_id(1).is_err());
    assert!(motor(1.0).unwrap().with_timeout(Duration::ZERO).is_err());
    assert!(
        ImpedanceControl::new(1.0).unwrap().with_gains(-1.0, 0.0).is_err()
            && ImpedanceControl::new(1.0).unwrap().with_gains(0.0, f32::NAN).is_err()
    );
    let mut motor = motor(1.0).unwrap();
    let refused = motor.write(Register::GearRatio, 10.0).unwrap_err();
    assert_eq!(refused.to_string(), "register 20 (GearRatio) is read only");
}
