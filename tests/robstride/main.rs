//! Motors of RobStride with a drive that is written from the manual: settings, arming, targets, limits, rest, and a drive that stops
//! by itself.

#![cfg(test)]

mod bench;
mod frames;
mod golden;
mod rest;

use bench::{Bench, operation};
use drivetrain::control::PidConfig;
use drivetrain::error::ConfigError;
use drivetrain::frame::CanFrame;
use drivetrain::motor::{
    Actuator, AngleDrive, ArmError, Condition, Devices, Impedance, ImpedanceControl, MotorName,
    TargetError, VelocityDrive,
};
use drivetrain::robstride::{Mode, Model, Motor, Register, Status};
use drivetrain::sim::{Drive, DriveShaft, RobStrideDrive};
use drivetrain::time::{Duration, Edge, Instant, Tick};
use drivetrain::units::{Angle, AngularVelocity};

/// The type of a frame.
fn kind(frame: &CanFrame) -> u32 {
    frame.header() >> 24 & 0x1F
}

/// The index of a parameter in a frame.
fn index(frame: &CanFrame) -> u16 {
    u16::from_le_bytes([frame.bytes()[0], frame.bytes()[1]])
}

fn extended(raw: u32, data: [u8; 8]) -> CanFrame {
    CanFrame::of(embedded_can::ExtendedId::new(raw).unwrap(), data)
}

fn status(bench: &Bench) -> Status {
    bench.own.motor().feedback().unwrap().status
}

fn rad_per_s(value: f32) -> AngularVelocity {
    AngularVelocity::from_rad_per_s(value)
}

#[test]
fn a_motor_is_armed_when_its_settings_have_been_read() {
    let mut bench = Bench::new(operation());
    let refused = |bench: &mut Bench| bench.own.arm(bench.now()).unwrap_err().to_string();
    assert_eq!(refused(&mut bench), "no feedback from RS02 #1");
    bench.steps(5, |_| {});
    assert!(refused(&mut bench).starts_with("RS02 #1: its "));
    bench.steps(100, |_| {});
    assert_eq!(bench.own.arm(bench.now()), Ok(()));
}

#[test]
fn each_mode_reaches_its_target_and_rests_after_a_disarm() {
    let wheel = rad_per_s(6.0);
    let mut velocity = Bench::armed(Mode::velocity(rad_per_s(20.0), 10.0));
    velocity.steps(1_000, |bench| bench.own.set_velocity((), wheel).unwrap());
    assert!((velocity.drive.shaft().velocity_rad_per_s() - 6.0).abs() < 0.2);
    rests(velocity);

    let mut damped = Bench::armed(operation());
    damped.steps(1_000, |bench| bench.own.set_velocity((), wheel).unwrap());
    assert!((damped.drive.shaft().velocity_rad_per_s() - 6.0).abs() < 0.2);
    rests(damped);

    let loops = ImpedanceControl::new(3.0).unwrap().with_loops(
        PidConfig::new(10.0, 0.0, 0.0).with_output_limit(20.0),
        PidConfig::new(0.5, 2.0, 0.0),
    );
    let mut looped = Bench::armed(loops.unwrap());
    // Less than a lap of the feedback, which ends at 4π.
    looped.steps(1_000, |bench| bench.own.set_velocity((), wheel).unwrap());
    assert!((looped.drive.shaft().velocity_rad_per_s() - 6.0).abs() < 0.1);
    looped.steps(1_500, |bench| bench.own.set_angle((), Angle::from_radians(1.0)).unwrap());
    let turns = (looped.drive.shaft().angle_rad() - 1.0) / core::f32::consts::TAU;
    assert!((turns - turns.round()).abs() < 0.01, "{turns}");
    rests(looped);

    for model in [Model::RS02, Model::CYBERGEAR] {
        let joint = Angle::from_radians(1.0);
        let mut position = Bench::of(model, Mode::position(rad_per_s(10.0), 8.0));
        position.steps(150, |_| {});
        position.own.arm(position.now()).unwrap();
        position.steps(2_000, |bench| {
            bench.own.set_angle((), joint).unwrap();
            assert!(bench.drive.shaft().torque_nm().abs() <= 8.001);
        });
        assert!((position.drive.shaft().angle_rad() - 1.0).abs() < 0.02);
        rests(position);
    }

    let mut current = Bench::armed(Mode::current(4.0, 1.0));
    current.drive = current.drive.with_shaft(DriveShaft::new(0.05, 1.0));
    current.steps(1_000, |bench| bench.own.set_torque(2.0).unwrap());
    assert!((current.drive.shaft().torque_nm() - 2.0).abs() < 0.01);
    current.steps(300, |bench| bench.own.set_torque(100.0).unwrap());
    assert!((current.drive.shaft().torque_nm() - 4.0).abs() < 0.01, "4 A of 1 Nm each");
    rests(current);
}

/// Disarmed, the drive gives no torque from the next frames on, and is disabled.
fn rests(mut bench: Bench) {
    bench.own.disarm();
    bench.step();
    bench.steps(50, |bench| {
        assert!(bench.drive.shaft().torque_nm().abs() < 0.001, "{:?}", bench.frames);
    });
    assert!(!bench.drive.is_enabled() && status(&bench) == Status::Reset);
}

#[test]
fn the_run_mode_is_read_and_set_before_a_motor_is_armed() {
    let mut bench = Bench::new(Mode::velocity(rad_per_s(20.0), 10.0));
    bench.drive = bench.drive.with_parameter(0x7005, 3.0);
    bench.steps(150, |_| {});
    assert_eq!(bench.drive.parameter(0x7005), Some(2.0));
    assert_eq!(bench.own.arm(bench.now()), Ok(()));
}

/// A firmware that does not know the mode keeps its own.
#[test]
fn a_drive_that_does_not_take_the_run_mode_is_not_armed_and_the_parameter_is_named() {
    let mut bench = Bench::new(Mode::position(rad_per_s(10.0), 8.0));
    bench.drive = RobStrideDrive::of(Model::CYBERGEAR, 1);
    bench.steps(400, |bench| assert!(!bench.drive.is_enabled()));
    let refused = bench.own.arm(bench.now()).unwrap_err();
    assert!(matches!(refused, ArmError::Setting(_)));
    assert!(refused.to_string().contains("run_mode 0, the program needs 5"), "{refused}");
}

#[test]
fn a_drive_whose_supply_fails_while_it_is_driven_trips_and_is_not_enabled_again_by_itself() {
    let mut bench = Bench::armed(Mode::velocity(rad_per_s(20.0), 10.0));
    let drive = |bench: &mut Bench| _ = bench.own.set_velocity((), rad_per_s(6.0));
    bench.steps(500, drive);
    assert!(bench.drive.is_enabled());
    bench.drive.lose_supply();
    bench.steps(500, |bench| {
        drive(bench);
        assert!(!bench.drive.is_enabled());
    });
    assert!(!Devices::is_armed(&mut bench.own));
    bench.steps(150, |_| {});
    assert_eq!(bench.own.arm(bench.now()), Ok(()));
    bench.steps(500, drive);
    assert!(bench.drive.is_enabled() && bench.drive.parameter(0x7028) == Some(2_000.0));
}

#[test]
fn lost_feedback_disables_the_drive_and_it_does_not_go_on_by_itself() {
    let mut bench = Bench::armed(operation());
    let drive = |bench: &mut Bench| _ = bench.own.set_velocity((), rad_per_s(6.0));
    bench.steps(500, drive);
    bench.is_deaf = true;
    let mut ms = 0;
    bench.steps(400, |bench| {
        drive(bench);
        ms += 1;
        assert!(ms < 15 || bench.drive.shaft().torque_nm().abs() < 0.001, "{ms} ms");
    });
    assert!(!bench.drive.is_enabled());
    bench.is_deaf = false;
    bench.steps(500, |bench| assert!(bench.drive.shaft().torque_nm().abs() < 0.001));
}

#[test]
fn nothing_jumps_when_a_motor_far_from_its_target_is_armed() {
    let there = Angle::from_radians(-1.5);
    let mut position = Bench::new(Mode::position(rad_per_s(10.0), 8.0));
    position.drive.shaft_mut().set_angle(1.5);
    position.steps(150, |_| {});
    position.own.arm(position.now()).unwrap();
    let mut enabled = 0;
    position.steps(200, |bench| {
        bench.own.set_angle((), there).unwrap();
        enabled += u32::from(bench.drive.is_enabled());
        let near = bench.drive.shaft().angle_rad();
        assert!(enabled > 40 || (near - 1.5).abs() < 0.05, "{enabled} ms after enabling at {near}");
    });
    assert!(enabled > 40, "{enabled}");

    let mut spring = Bench::new(operation());
    spring.drive.shaft_mut().set_angle(1.5);
    spring.steps(150, |_| {});
    spring.own.arm(spring.now()).unwrap();
    let mut enabled = 0;
    spring.steps(150, |bench| {
        bench.own.set_angle((), there).unwrap();
        enabled += u32::from(bench.drive.is_enabled());
        assert!(enabled > 15 || bench.drive.shaft().torque_nm().abs() < 0.3);
    });
    assert!(enabled > 15, "{enabled}");
}

/// In the position mode a drive goes on to the target that it has: zero, after power-on.
#[test]
fn a_drive_that_is_enabled_has_no_current_and_its_target_where_the_shaft_is() {
    let mut bench = Bench::new(Mode::position(rad_per_s(10.0), 8.0));
    bench.drive.shaft_mut().set_angle(3.0);
    bench.steps(150, |_| {});
    bench.own.arm(bench.now()).unwrap();
    let mut seen = false;
    bench.steps(300, |bench| {
        let _ = bench.own.set_angle((), Angle::from_radians(3.0));
        if bench.frames.iter().any(|frame| kind(frame) == 3) && !seen {
            seen = true;
            assert_eq!(bench.drive.parameter(0x7018), Some(0.0), "limit_cur");
            assert_eq!(bench.drive.parameter(0x7017), Some(10.0), "limit_spd");
            assert!((bench.drive.parameter(0x7016).unwrap() - 3.0).abs() < 0.001, "loc_ref");
        }
        assert!((bench.drive.shaft().angle_rad() - 3.0).abs() < 0.01);
    });
    assert!(seen);
}

#[test]
fn the_drive_itself_gets_the_torque_limit_of_the_operation_mode() {
    let mut bench = Bench::armed(operation());
    bench.steps(300, |bench| bench.own.set_torque(1.0).unwrap());
    assert!(bench.drive.is_enabled());
    assert_eq!(bench.drive.parameter(0x700B), Some(3.0));
}

/// An old firmware says that it cannot read canTimeout.
#[test]
fn a_robstride_without_a_time_out_is_not_armed() {
    let mut bench = Bench::new(operation());
    bench.drive = RobStrideDrive::of(Model::CYBERGEAR, 1);
    bench.steps(400, |_| {});
    let refused = bench.own.arm(bench.now()).unwrap_err().to_string();
    assert!(
        refused.contains("does not report its canTimeout, the program needs 2000"),
        "{refused}"
    );
}

#[test]
fn a_cybergear_is_armed_and_driven_without_a_time_out() {
    let mut bench = Bench::of(Model::CYBERGEAR, operation());
    bench.steps(150, |_| {});
    bench.own.arm(bench.now()).unwrap();
    bench.steps(500, |bench| {
        bench.own.set_velocity((), rad_per_s(6.0)).unwrap();
        assert!(bench.frames.iter().all(|frame| kind(frame) < 17 || index(frame) != 0x7028));
    });
    assert!((bench.drive.shaft().velocity_rad_per_s() - 6.0).abs() < 0.3);
}

/// RobStride's feedback starts again at the other end of its range, while the drive's own loop may not.
#[test]
fn a_shaft_beyond_the_range_of_the_feedback_has_no_angle_and_no_spring_pulls_it() {
    let mut bench = Bench::armed(operation());
    bench.drive.shaft_mut().set_angle(12.0);
    bench.steps(20, |_| {});
    let turns: fn(&mut Bench) = |bench| {
        let target = Impedance {
            angle: Angle::from_radians(12.0),
            stiffness: 20.0,
            damping: 0.2,
            ..Impedance::FREE
        };
        _ = bench.own.set_impedance(target);
    };
    bench.steps(300, turns);
    assert!(bench.drive.is_enabled());
    bench.drive.shaft_mut().set_angle(13.0);
    // What was sent before the drive reported that.
    bench.step();
    bench.steps(100, |bench| {
        turns(bench);
        assert_eq!(bench.own.angle(()), None);
        assert!(bench.drive.shaft().torque_nm().abs() < 0.001, "{:?}", bench.frames);
        bench.drive.shaft_mut().set_angle(13.0);
        bench.drive.shaft_mut().set_velocity(0.0);
    });
    bench.drive.shaft_mut().set_angle(12.0);
    bench.steps(5, |_| {});
    assert!((bench.own.angle(()).unwrap().as_radians() - 12.0).abs() < 0.1, "back again");
}

#[test]
fn a_position_motor_beyond_the_range_of_the_feedback_is_not_armed() {
    let mut bench = Bench::new(Mode::position(rad_per_s(10.0), 8.0));
    bench.drive.shaft_mut().set_angle(-30.0);
    bench.steps(200, |_| {});
    let refused = bench.own.arm(bench.now()).unwrap_err().to_string();
    assert!(refused.contains("has mechPos -30, the program needs 12.566"), "{refused}");
    let mut free = Bench::new(operation());
    free.drive.shaft_mut().set_angle(-30.0);
    free.steps(200, |_| {});
    assert_eq!(free.own.angle(()), None);
    assert_eq!(free.own.arm(free.now()), Ok(()), "a torque needs no angle");
}

#[test]
fn a_fault_trips_and_is_an_edge_with_its_code_and_is_cleared() {
    for (faults, code, is_reported) in [
        (1 << 2, 16, false),
        (1 << 4, 17, false),
        (1, 18, false),
        (1 << 14, 20, false),
        (1 << 7, 21, false),
        (1 << 3, 35, true),
    ] {
        let mut bench = Bench::armed(operation());
        let drive = |bench: &mut Bench| _ = bench.own.set_velocity((), rad_per_s(6.0));
        bench.steps(300, drive);
        while bench.own.next_edge().is_some() {}
        bench.drive.fail(faults);
        if is_reported {
            let report = bench.drive.report();
            let now = bench.now();
            _ = Devices::ingest(&mut bench.own, &report, now);
            assert_eq!(bench.own.motor().reported_faults(), faults);
        }
        bench.steps(2, drive);
        let edges: Vec<Edge<Condition, MotorName>> =
            std::iter::from_fn(|| bench.own.next_edge()).collect();
        assert!(!edges.is_empty());
        assert_eq!(bench.own.health().error_code, code, "{edges:?}");
        bench.steps(300, drive);
        assert!(bench.drive.faults() == 0 && !bench.drive.is_enabled(), "cleared, and disabled");
        assert!(!Devices::is_armed(&mut bench.own));
        assert_eq!(bench.own.motor().reported_faults(), 0);
        bench.steps(150, |_| {});
        assert_eq!(bench.own.arm(bench.now()), Ok(()));
    }
}

#[test]
fn a_drive_that_calibrates_itself_is_not_armed() {
    let mut bench = Bench::new(operation());
    // It does not hear what would end that.
    bench.passes = |frame| kind(frame) != 4;
    bench.drive.calibrate(true);
    bench.steps(150, |_| {});
    assert_eq!(status(&bench), Status::Calibration);
    assert!(matches!(bench.own.arm(bench.now()), Err(ArmError::Faulty(_))));
}

#[test]
fn parameters_are_read_written_and_stored_while_the_motor_is_disarmed() {
    for stores in [false, true] {
        let mut bench = Bench::new(operation());
        bench.own.motor_mut().write(Register::VelocityLimit, 5.0).unwrap();
        bench.steps(150, |_| {});
        assert_eq!(bench.own.motor().register(), Some((Register::VelocityLimit, 5.0)));
        if stores {
            bench.own.motor_mut().store().unwrap();
            bench.steps(60, |_| {});
        }
        bench.drive.lose_supply();
        bench.own.motor_mut().read(Register::VelocityLimit);
        bench.steps(150, |_| {});
        let expected = if stores { 5.0 } else { 44.0 };
        assert_eq!(bench.own.motor().register(), Some((Register::VelocityLimit, expected)));
    }
}

#[test]
fn a_parameter_that_the_drive_does_not_have_reads_as_no_number() {
    let mut bench = Bench::new(operation());
    bench.own.motor_mut().read(Register::Damper);
    bench.steps(150, |_| {});
    let (register, value) = bench.own.motor().register().unwrap();
    assert!(register == Register::Damper && value.is_nan());
}

/// The frame that stores the parameters of a RobStride sets the bit rate of a CyberGear.
#[test]
fn a_cybergear_is_never_told_to_store() {
    let mut bench = Bench::of(Model::CYBERGEAR, operation());
    let refused = bench.own.motor_mut().store().unwrap_err();
    assert_eq!(
        refused.to_string(),
        "frame to store parameters: not available for this model, its mode or its firmware"
    );
    bench.steps(200, |bench| assert!(bench.frames.iter().all(|frame| kind(frame) != 22)));
    bench.own.arm(bench.now()).unwrap();
    bench.steps(300, |bench| {
        _ = bench.own.set_torque(1.0);
        assert!(bench.frames.iter().all(|frame| kind(frame) != 22));
    });
    assert_eq!(bench.drive.bit_rate(), 1);
}

/// The joint may be driven elsewhere before the motor is disarmed: the zero would be there.
#[test]
fn a_running_drive_refuses_a_zero_and_an_id_and_a_disarmed_one_takes_them() {
    let mut bench = Bench::armed(operation());
    bench.drive.shaft_mut().set_angle(2.0);
    bench.steps(300, |bench| _ = bench.own.set_torque(0.0));
    let here = bench.drive.shaft().angle_rad();
    let driven = |bench: &mut Bench| {
        _ = bench.own.set_torque(0.0);
        assert!(bench.frames.iter().all(|frame| ![6, 7].contains(&kind(frame))));
    };
    let disarmed = |bench: &mut Bench| {
        assert!(bench.frames.iter().all(|frame| ![6, 7].contains(&kind(frame))));
    };
    let refused = bench.own.motor_mut().set_zero().unwrap_err().to_string();
    assert!(refused.starts_with("zero or id of a running drive"), "{refused}");
    bench.steps(100, driven);
    assert!(bench.own.motor_mut().set_id(0x55).is_err());
    bench.steps(100, driven);
    bench.own.disarm();
    bench.steps(100, disarmed);
    assert!((bench.drive.shaft().angle_rad() - here).abs() < 0.5);
    bench.own.motor_mut().set_zero().unwrap();
    bench.steps(100, |_| {});
    assert!(bench.drive.shaft().angle_rad().abs() < 0.5, "{}", bench.drive.shaft().angle_rad());
    assert!(bench.own.motor_mut().set_id(0).is_err() && bench.own.motor_mut().set_id(128).is_err());
    bench.own.motor_mut().set_id(0x55).unwrap();
    bench.steps(30, |_| {});
    assert!(bench.drive.hear(&extended(0x0300_FD55, [0; 8])).is_some(), "it has the id 0x55");
}

#[test]
fn two_motors_on_one_bus_are_told_apart() {
    let motor = |id| Actuator::new(Motor::new(Model::RS02, id, operation()).unwrap());
    let mut robot = [motor(1), motor(2)];
    let mut drives = [1, 2].map(|id| RobStrideDrive::of(Model::RS02, id));
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
        if ms == 150 {
            robot.arm(now).unwrap();
        }
        if ms > 150 {
            robot[0].set_velocity((), rad_per_s(3.0)).unwrap();
            robot[1].set_velocity((), rad_per_s(-5.0)).unwrap();
        }
    }
    assert!(robot.is_armed() && now > Instant::START + Duration::from_millis(1_000));
    let speeds = drives.map(|drive| drive.shaft().velocity_rad_per_s());
    assert!((speeds[0] - 3.0).abs() < 0.2 && (speeds[1] + 5.0).abs() < 0.2, "{speeds:?}");
}

#[test]
fn a_host_id_that_is_a_motor_on_the_bus_clashes() {
    let motor = |id| Motor::new(Model::RS02, id, operation()).unwrap();
    assert!(motor(1).with_host_id(1).is_err());
    let first = Actuator::new(motor(1).with_host_id(2).unwrap());
    let clashes = |first: &Actuator<_>, second: &Actuator<_>| {
        use drivetrain::motor::CanDevice;
        CanDevice::claims(first).any(|claim| {
            CanDevice::claims(second)
                .any(|other: drivetrain::motor::Claim| claim.clashes_with(&other))
        })
    };
    assert!(clashes(&first, &Actuator::new(motor(2))));
    assert!(!clashes(&Actuator::new(motor(1)), &Actuator::new(motor(2))));
    assert!(clashes(&Actuator::new(motor(1)), &Actuator::new(motor(1))));
}

#[test]
fn bad_configurations_are_refused_with_the_limit() {
    let text = |outcome: Result<(), ConfigError>| outcome.unwrap_err().to_string();
    let made = |id| Motor::new(Model::RS02, id, operation());
    for id in [0, 128, 255] {
        assert_eq!(text(made(id).map(|_| ())), format!("id {id}: 1 to 127 are allowed"));
    }
    let torque = |limit| Motor::new(Model::RS02, 1, ImpedanceControl::new(limit).unwrap());
    assert_eq!(
        text(torque(17.01).map(|_| ())),
        "torque limit in Nm 17.01: above 0 and at most 17 is allowed"
    );
    for current in [0.0, -1.0, 16.1, f32::NAN] {
        assert!(Motor::new(Model::RS02, 1, Mode::current(current, 1.0)).is_err(), "{current}");
        assert!(Motor::new(Model::RS02, 1, Mode::velocity(rad_per_s(1.0), current)).is_err());
        assert!(Motor::new(Model::RS02, 1, Mode::position(rad_per_s(1.0), current)).is_err());
    }
    for velocity in [0.0, -1.0, 44.1, f32::NAN] {
        assert!(Motor::new(Model::RS02, 1, Mode::velocity(rad_per_s(velocity), 1.0)).is_err());
        assert!(Motor::new(Model::RS02, 1, Mode::position(rad_per_s(velocity), 1.0)).is_err());
    }
    for constant in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        assert!(Motor::new(Model::RS02, 1, Mode::current(1.0, constant)).is_err(), "{constant}");
    }
    let motor = made(1).unwrap();
    for micros in [0, 999, 5_000_001] {
        assert!(motor.with_timeout(Duration::from_micros(micros)).is_err(), "{micros}");
    }
    let cybergear = Motor::new(Model::CYBERGEAR, 1, operation()).unwrap();
    let refused = cybergear.with_timeout(Duration::from_millis(50)).map(|_| ());
    assert_eq!(text(refused), "time-out: not available for this model, its mode or its firmware");
    let mut motor = motor;
    assert_eq!(
        text(motor.write(Register::SupplyVoltage, 10.0)),
        "parameter 0x701C (SupplyVoltage) is read only"
    );
    assert_eq!(
        text(motor.write(Register::RunMode, 256.0)),
        "parameter 0x7005 (RunMode) cannot hold 256"
    );
    assert_eq!(motor.name_is(), "RS02 #1");
    assert_eq!(Bench::new(operation()).own.set_torque(1.0), Err(TargetError::Disarmed));
}

/// The name, as errors print it.
trait Named {
    fn name_is(&self) -> String;
}

impl Named for Motor {
    fn name_is(&self) -> String {
        drivetrain::motor::DriveProtocol::name(self).to_string()
    }
}

/// The shaft is at 2 rad, where a zero was asked for and not sent.
fn asked_for_a_zero() -> Bench {
    let mut bench = Bench::new(operation());
    bench.drive.shaft_mut().set_angle(2.0);
    bench.steps(300, |_| {});
    bench.own.motor_mut().set_zero().unwrap();
    bench
}

fn assert_at_zero(bench: &Bench) {
    assert!(bench.drive.shaft().angle_rad().abs() < 0.1, "{}", bench.drive.shaft().angle_rad());
}

/// The program sets the zero and arms in the same tick: the joint would be led to angles from the zero before.
#[test]
fn a_zero_that_was_not_sent_yet_holds_up_arming() {
    let mut bench = asked_for_a_zero();
    let refused = bench.own.arm(bench.now()).unwrap_err().to_string();
    assert!(refused.starts_with("RS02 #1: its "), "{refused}");
    bench.steps(200, |bench| _ = bench.own.set_torque(0.0));
    assert_at_zero(&bench);
    bench.own.arm(bench.now()).unwrap();
    bench.steps(100, |bench| bench.own.set_torque(0.0).unwrap());
    assert_at_zero(&bench);
}

/// The program arms, sets the zero and gives a target in one tick, or one after the other.
#[test]
fn a_zero_that_is_asked_for_once_armed_is_set_before_the_drive_is_enabled() {
    for (rest_ms, pause_ms) in [(0, 0), (0, 3), (200, 0), (200, 3), (200, 50)] {
        let mut bench = Bench::new(operation());
        bench.drive.shaft_mut().set_angle(2.0);
        bench.steps(300, |_| {});
        bench.own.arm(bench.now()).unwrap();
        bench.steps(rest_ms, |_| {});
        bench.own.motor_mut().set_zero().unwrap();
        bench.steps(pause_ms, |_| {});
        let target = Impedance { stiffness: 20.0, damping: 1.0, ..Impedance::FREE };
        bench.steps(1_000, |bench| {
            _ = bench.own.set_impedance(target);
            let angle_rad = bench.drive.shaft().angle_rad();
            assert!(angle_rad.abs() < 0.1 || angle_rad > 1.9, "{rest_ms}, {pause_ms}: {angle_rad}");
        });
        assert_at_zero(&bench);
    }
}

/// The answer to the enabling frame may be late: the last report is one of rest.
#[test]
fn a_zero_is_refused_from_the_enabling_frame_on_and_not_before() {
    let mut bench = Bench::new(operation());
    bench.steps(300, |_| {});
    bench.own.arm(bench.now()).unwrap();
    let (mut is_told, mut refusals) = (false, 0);
    bench.steps(300, |bench| {
        _ = bench.own.set_torque(0.0);
        is_told |= bench.frames.iter().any(|frame| kind(frame) == 3);
        let refused = is_told && bench.own.motor_mut().set_zero().is_err();
        assert_eq!(refused, is_told);
        refusals += u32::from(refused);
    });
    assert!(refusals > 200, "{refusals}");
    bench.own.disarm();
    bench.steps(100, |_| {});
    bench.own.motor_mut().set_zero().unwrap();
}

/// The driver refuses the frame with the zero, and takes all others.
#[test]
fn a_zero_that_no_driver_took_is_sent_later() {
    let mut bench = asked_for_a_zero();
    let mut refused = 0;
    for _ in 0..200 {
        if refused == 3 {
            break;
        }
        bench.now_us += 1_000;
        let now = bench.now();
        bench.own.update(Tick::new(now, 0.001));
        while let Some(frame) = bench.own.next_frame(0) {
            if kind(&frame) == 6 {
                refused += 1;
                assert!(Devices::put_back(&mut bench.own, &frame));
                break;
            }
            if let Some(answer) = bench.drive.hear(&frame) {
                _ = Devices::ingest(&mut bench.own, &answer, now);
            }
        }
    }
    assert_eq!(refused, 3, "the frame comes again");
    assert!((bench.drive.shaft().angle_rad() - 2.0).abs() < 0.1, "not sent yet");
    assert!(bench.own.arm(bench.now()).is_err());
    bench.steps(200, |bench| _ = bench.own.set_torque(0.0));
    assert_at_zero(&bench);
}
