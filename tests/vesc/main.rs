//! Motors on VESC drives, with a drive that is written from the firmware: golden frames, targets, limits, rest, faults, a count that
//! wraps, and a drive that stops by itself.

#![cfg(test)]

mod bench;

use bench::{Bench, MODEL, SPEED, drive, looped};
use drivetrain::control::PidConfig;
use drivetrain::encoder::GearRatio;
use drivetrain::error::ConfigError;
use drivetrain::frame::CanFrame;
use drivetrain::motor::{
    Actuator, AngleDrive, Condition, Devices, DriveProtocol, Ingest, TargetError, Timeouts,
    VelocityDrive,
};
use drivetrain::sim::Drive;
use drivetrain::sim::DriveShaft;
use drivetrain::time::{Duration, Instant, Tick};
use drivetrain::units::{Angle, AngularVelocity};
use drivetrain::vesc::{Command, Feedback, Mode, Model, Motor, Rest};
use embedded_can::{ExtendedId, Frame, Id};
use serde_json::Value;

fn rad_s(value: f32) -> AngularVelocity {
    AngularVelocity::from_rad_per_s(value)
}

/// A decoder that shares nothing with the crate: packet, and value.
fn read(frame: &CanFrame) -> (u32, i64) {
    let Id::Extended(id) = frame.id() else { panic!("{frame:?}") };
    assert_eq!(id.as_raw() & 0xFF, 23, "{frame:?}");
    if id.as_raw() >> 8 == 8 {
        return (8, 0);
    }
    assert_eq!(frame.data().len(), 4, "{frame:?}");
    let value = frame.data().iter().fold(0_u32, |sum, byte| sum << 8 | u32::from(*byte));
    (id.as_raw() >> 8, i64::from(value.cast_signed()))
}

fn is_question(frame: &CanFrame) -> bool {
    read(frame).0 == 8
}

fn vector(id: &str) -> Value {
    let file: Value = serde_json::from_str(include_str!("../data/wire/vectors.json")).unwrap();
    let vectors = file["vectors"].as_array().unwrap();
    vectors.iter().find(|vector| vector["id"] == id).unwrap().clone()
}

fn bytes(value: &Value) -> Vec<u8> {
    let words = value.as_str().unwrap().split(' ');
    words.map(|byte| u8::from_str_radix(byte, 16).unwrap()).collect()
}

#[test]
fn commands_have_the_golden_bytes() {
    for (id, command) in [
        ("vesc.set_current", Command::Current(51.0)),
        ("vesc.set_duty", Command::Duty(0.5)),
        ("vesc.set_brake", Command::Brake(10.0)),
    ] {
        let vector = vector(id);
        let frame = command.frame(u8::try_from(vector["input"]["id"].as_u64().unwrap()).unwrap());
        assert_eq!(frame.data(), bytes(&vector["expect"]["data"]), "{id}");
        let Id::Extended(raw) = frame.id() else { panic!("{frame:?}") };
        assert_eq!(format!("0x{:08X}", raw.as_raw()), vector["expect"]["ext_id"].as_str().unwrap());
    }
}

#[test]
fn status_frames_have_the_golden_values() {
    let mut feedback = Feedback::default();
    for id in ["vesc.status1", "vesc.status5"] {
        let vector = vector(id);
        let raw = vector["input"]["ext_id"].as_str().unwrap();
        let raw = u32::from_str_radix(raw.trim_start_matches("0x"), 16).unwrap();
        let packet = u8::try_from(raw >> 8).unwrap();
        assert!(feedback.take(packet, &bytes(&vector["input"]["data"])));
    }
    assert_eq!(
        (feedback.erpm, feedback.current_a, feedback.duty),
        (Some(12_000), Some(5.5), Some(0.25))
    );
    assert_eq!((feedback.tachometer, feedback.supply_v), (Some(-600), Some(24.1)));
}

/// The layouts of `comm_can_send_status2` to `6` of the firmware, computed by hand.
#[test]
fn the_other_status_frames_have_their_scales() {
    let mut feedback = Feedback::default();
    assert!(feedback.take(14, &[0, 0, 0x30, 0x39, 0xFF, 0xFF, 0xFF, 0xFF]));
    assert_eq!(feedback.charge_ah, Some([1.2345, -0.0001]));
    assert!(feedback.take(15, &[0, 1, 0, 0, 0, 0, 0, 1]));
    assert_eq!(feedback.energy_wh, Some([6.5536, 0.0001]));
    assert!(feedback.take(16, &[0x01, 0x41, 0xFF, 0x9C, 0x00, 0x19, 0x46, 0x50]));
    assert_eq!((feedback.driver_c, feedback.motor_c), (Some(32.1), Some(-10.0)));
    assert_eq!((feedback.input_a, feedback.position_deg), (Some(2.5), Some(360.0)));
    assert!(feedback.take(58, &[0x0C, 0xE4, 0, 0, 0x03, 0xE8, 0xFE, 0x0C]));
    assert_eq!(feedback.inputs, Some([3.3, 0.0, 1.0, -0.5]));
    // The documentation calls status 6 packet 28, which the firmware has for something else.
    assert!(!feedback.take(28, &[0; 8]));
}

#[test]
fn a_value_that_is_not_finite_lets_the_shaft_go() {
    for value in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        for command in [Command::Speed(value), Command::Position(value), Command::Brake(value)] {
            assert_eq!(read(&command.frame(23)), (1, 0), "{command:?}");
        }
        let duty = read(&Command::Duty(value).frame(23));
        assert!(if value.is_nan() { duty == (1, 0) } else { duty.1.abs() == 100_000 });
    }
    assert_eq!(read(&Command::Current(1e30).frame(23)), (1, i64::from(i32::MAX)));
    assert_eq!(read(&Command::CurrentShare(-3.0).frame(23)), (10, -100_000));
    assert_eq!(read(&Command::BrakeShare(-3.0).frame(23)), (11, 0));
    assert_eq!(read(&Command::HandbrakeShare(0.25).frame(23)), (13, 25_000));
    assert_eq!(read(&Command::Handbrake(2.5).frame(23)), (12, 2_500));
    assert_eq!(read(&Command::Speed(-1234.9).frame(23)), (3, -1_234));
    assert_eq!(read(&Command::Position(90.0).frame(23)), (4, 90_000_000));
}

/// Disarmed, the drive gets nothing but the configured rest and questions, from the next frames on.
fn rests(mut bench: Bench) {
    for ends in 0..4 {
        bench.arm();
        let drive = |bench: &mut Bench| {
            _ = bench.own.set_velocity((), rad_s(30.0));
            _ = bench.own.set_angle((), Angle::from_radians(1.0));
            _ = bench.own.set_torque(0.2);
        };
        bench.steps(300, drive);
        assert!(!bench.frames.iter().all(|frame| read(frame) == (1, 0)), "driven");
        match ends {
            0 => bench.own.disarm(),
            1 => bench.own.emergency_stop(),
            2 => bench.is_cut = true,
            _ => {} // the program forgets its target
        }
        let wait = [0, 0, 11, 101][ends];
        bench.steps(wait, |_| {});
        bench.steps(200, |bench| {
            for frame in &bench.frames {
                assert!(read(frame) == (1, 0) || is_question(frame), "{ends}: {frame:?}");
            }
        });
        assert!(ends == 2 || bench.drive.shaft().torque_nm() == 0.0);
        bench.is_cut = false;
        bench.own.clear_emergency_stop();
        bench.own.disarm();
        bench.steps(300, |_| {});
    }
}

#[test]
fn each_mode_reaches_its_target_and_rests_afterwards() {
    let wheel = rad_s(60.0);
    let mut current = Bench::armed(Mode::current_with_speed_loop(SPEED).unwrap());
    current.steps(1_500, |bench| bench.own.set_velocity((), wheel).unwrap());
    assert!((current.drive.shaft().velocity_rad_per_s() - 60.0).abs() < 0.5);
    assert_eq!(current.own.set_angle((), Angle::ZERO), Err(TargetError::Unsupported));
    rests(current);

    let mut torque = Bench::armed(Mode::current());
    torque.steps(300, |bench| bench.own.set_torque(0.25).unwrap());
    assert!((torque.drive.shaft().torque_nm() - 0.25).abs() < 1e-4, "5 A of 0.05 Nm/A");
    assert!((torque.own.motor().vitals().effort - 0.25).abs() < 1e-4, "5 A of 20 A");
    assert_eq!(torque.own.set_velocity((), wheel), Err(TargetError::Unsupported));
    rests(torque);

    let mut velocity = Bench::armed(Mode::velocity());
    velocity.steps(500, |bench| bench.own.set_velocity((), wheel).unwrap());
    assert!((velocity.drive.shaft().velocity_rad_per_s() - 60.0).abs() < 1.0);
    rests(velocity);

    let loops = PidConfig::new(0.001, 0.02, 0.0);
    let mut duty = Bench::armed(Mode::duty(0.8, loops).unwrap());
    duty.steps(1_500, |bench| bench.own.set_velocity((), wheel).unwrap());
    assert!(
        (duty.drive.shaft().velocity_rad_per_s() - 60.0).abs() < 0.5,
        "{:?}",
        duty.drive.shaft()
    );
    rests(duty);

    let mut position = Bench::armed(Mode::position());
    position.steps(1_500, |bench| bench.own.set_angle((), Angle::from_radians(1.0)).unwrap());
    assert!((position.drive.shaft().angle_rad() - 1.0).abs() < 0.01);
    rests(position);
}

/// The tachometer has 42 steps a turn here, the encoder 18 000.
#[test]
fn our_own_angle_loop_takes_tachometer_or_encoder() {
    for has_encoder in [false, true] {
        let motor = Motor::new(MODEL, 23, looped()).unwrap();
        let mut bench = Bench::of(if has_encoder { motor.with_encoder() } else { motor });
        bench.arm();
        bench.steps(2_000, |bench| bench.own.set_angle((), Angle::from_radians(-2.0)).unwrap());
        let angle = bench.drive.shaft().angle_rad();
        let within = if has_encoder { 0.01 } else { 0.2 };
        assert!((angle + 2.0).abs() < within, "{angle}");
        assert_eq!(bench.own.motor().position().is_some(), !has_encoder);
    }
}

#[test]
fn the_current_stays_within_the_limit_whatever_is_asked() {
    let mut bench = Bench::armed(looped());
    for step in 0..4_000_u32 {
        let sign = if step / 500 % 2 == 0 { 1.0 } else { -1.0 };
        match step / 1_000 {
            0 => bench.own.set_torque(sign * 1e6).unwrap(),
            1 => bench.own.set_velocity((), rad_s(sign * 1e6)).unwrap(),
            2 => bench.own.set_angle((), Angle::from_radians(sign * 3.0)).unwrap(),
            _ => bench.own.set_torque(sign * f32::MAX).unwrap(),
        }
        bench.step();
        for frame in &bench.frames {
            let (packet, value) = read(frame);
            assert!(packet == 8 || packet == 1 && value.abs() <= 20_000, "{frame:?}");
        }
    }
    assert!(bench.drive.shaft().torque_nm().abs() > 0.9, "the limit is reached");
}

#[test]
fn a_reversed_motor_behind_a_gear_has_its_units_at_the_output_shaft() {
    let gear = GearRatio::new(9, 1).unwrap();
    let model = Model { gear, ..MODEL };
    let mut bench = Bench::of(Motor::new(model, 23, Mode::current()).unwrap());
    bench.own = bench.own.reversed();
    // The bench's drive has no gear: 90 rad/s of its rotor are 10 of the output shaft, the other way round.
    bench.drive.shaft_mut().set_velocity(90.0);
    bench.step();
    let velocity = bench.own.velocity(()).unwrap().as_rad_per_s();
    assert!((velocity + 10.0).abs() < 0.01, "{velocity}");
    bench.arm();
    bench.steps(300, |bench| bench.own.set_torque(0.9).unwrap());
    // 0.9 Nm / (9 * 0.05 Nm/A) = 2 A.
    let (packet, value) = read(&bench.frames[0]);
    assert!(packet == 1 && (-2_000..=-1_999).contains(&value), "{value}");
}

#[test]
fn nothing_jumps_when_a_motor_far_from_its_target_is_armed() {
    let mut position = Bench::new(Mode::position());
    position.drive.shaft_mut().set_angle(1.5);
    position.arm();
    position.steps(40, |bench| {
        bench.own.set_angle((), Angle::from_radians(-1.5)).unwrap();
        let angle = bench.drive.shaft().angle_rad();
        let torque = bench.drive.shaft().torque_nm();
        assert!((angle - 1.5).abs() < 1.0 && torque.abs() < 2.0, "{angle} {torque}");
    });
    let first = read(&position.frames[0]);
    assert_eq!(first.0, 4);
    // A wheel that turns is neither braked nor driven at once, in the modes whose zero is a brake too.
    let loops = PidConfig::new(0.001, 0.02, 0.0);
    let mut duty = Bench::new(Mode::duty(1.0, loops).unwrap());
    duty.drive = duty.drive.with_shaft(DriveShaft::new(0.01, 0.0));
    duty.drive.shaft_mut().set_velocity(100.0);
    duty.arm();
    duty.steps(5, |bench| {
        bench.own.set_velocity((), rad_s(0.0)).unwrap();
        assert!(bench.drive.shaft().velocity_rad_per_s() > 90.0, "{:?}", bench.drive.shaft());
    });
    let mut velocity = Bench::new(Mode::velocity());
    velocity.drive.shaft_mut().set_velocity(100.0);
    velocity.arm();
    let before = velocity.drive.shaft().velocity_rad_per_s();
    velocity.steps(5, |bench| {
        bench.own.set_velocity((), rad_s(0.0)).unwrap();
        assert!(bench.drive.shaft().velocity_rad_per_s() > 0.9 * before);
    });
}

#[test]
fn the_configured_rest_is_what_a_foreign_decoder_reads() {
    for (rest, expected) in [
        (Rest::Release, (1, 0)),
        (Rest::Brake(4.0), (2, 4_000)),
        (Rest::Handbrake(3.0), (12, 3_000)),
    ] {
        let motor = Motor::new(MODEL, 23, Mode::current()).unwrap().with_rest(rest).unwrap();
        let mut bench = Bench::of(motor);
        bench.steps(100, |bench| {
            assert!(bench.frames.iter().all(|f| is_question(f) || read(f) == expected));
        });
        bench.own.arm(bench.now()).unwrap();
        bench.steps(250, |bench| bench.own.set_torque(0.3).unwrap());
        assert_eq!(read(&bench.frames[0]), (1, 6_000));
        bench.own.disarm();
        bench.step();
        assert!(bench.frames.iter().any(|f| read(f) == expected), "{:?}", bench.frames);
        bench.steps(3_000, |_| {});
        let shaft = bench.drive.shaft();
        assert_eq!(shaft.velocity_rad_per_s().abs() < 0.01, rest != Rest::Release);
    }
}

/// A speed of 0 lets the shaft go, a duty of 0 brakes.
#[test]
fn a_target_of_zero_lets_go_or_brakes_by_mode_and_configuration() {
    let turning = |mode: Mode| {
        let mut bench = Bench::armed(mode);
        bench.steps(500, |bench| bench.own.set_velocity((), rad_s(60.0)).unwrap());
        bench.steps(200, |bench| bench.own.set_velocity((), rad_s(0.0)).unwrap());
        bench
    };
    let coasts = turning(Mode::velocity());
    assert_eq!(read(&coasts.frames[0]), (1, 0));
    assert!(coasts.drive.shaft().velocity_rad_per_s() > 50.0);
    let brakes = turning(Mode::velocity_with_standstill(Rest::Brake(10.0)));
    assert_eq!(read(&brakes.frames[0]), (2, 10_000));
    assert!(brakes.drive.shaft().velocity_rad_per_s().abs() < 55.0);
    let mut duty = Bench::armed(Mode::duty(1.0, PidConfig::new(0.001, 0.02, 0.0)).unwrap());
    duty.drive.shaft_mut().set_velocity(60.0);
    duty.steps(1_000, |bench| bench.own.set_velocity((), rad_s(0.0)).unwrap());
    assert!(duty.drive.shaft().velocity_rad_per_s().abs() < 1.0);
}

#[test]
fn a_motor_is_armed_when_the_drive_has_said_that_it_has_no_fault() {
    let mut bench = Bench::new(Mode::current());
    let refused = |bench: &mut Bench| bench.own.arm(bench.now()).unwrap_err().to_string();
    assert_eq!(refused(&mut bench), "no feedback from 6374 #23");
    let now = bench.now();
    let status = bench.drive.report(9).unwrap();
    _ = Devices::ingest(&mut bench.own, &status, now);
    assert_eq!(refused(&mut bench), "6374 #23: its fault code is not known yet, ask again");
    bench.steps(200, |bench| bench.drive.fail(7));
    assert!(refused(&mut bench).contains("6374 #23"), "{}", refused(&mut bench));
    bench.steps(800, |_| {});
    assert_eq!(bench.own.arm(bench.now()), Ok(()));
}

#[test]
fn a_drive_that_never_answers_is_armed_only_where_the_program_says_so() {
    for asks in [true, false] {
        let motor = Motor::new(MODEL, 23, Mode::current()).unwrap();
        let mut own = Actuator::new(if asks { motor } else { motor.without_fault_code() });
        let mut now = Instant::START;
        for ms in 1..200 {
            now = Instant::from_micros(1_000 * ms);
            _ = Devices::ingest(&mut own, &drive(23).report(9).unwrap(), now);
            own.update(Tick::new(now, 0.001));
            while let Some(frame) = own.next_frame(0) {
                assert!(asks || read(&frame) == (1, 0));
            }
        }
        assert_eq!(own.arm(now).is_ok(), !asks);
    }
}

#[test]
fn a_fault_while_driven_trips_with_its_code_and_does_not_come_back_by_itself() {
    let mut bench = Bench::armed(Mode::current_with_speed_loop(SPEED).unwrap());
    let drive = |bench: &mut Bench| _ = bench.own.set_velocity((), rad_s(60.0));
    bench.steps(1_000, drive);
    while bench.own.next_edge().is_some() {}
    bench.drive.fail(4);
    bench.steps(60, drive);
    assert_eq!(bench.own.health().error_code, 4);
    assert!(!Devices::is_armed(&mut bench.own), "asked within 50 ms");
    let edges: Vec<_> = std::iter::from_fn(|| bench.own.next_edge()).collect();
    let text = format!("{edges:?}");
    assert!(edges.iter().any(|edge| edge.condition == Condition::Fault && edge.began), "{text}");
    // The drive follows again after half a second, and nobody drives it.
    bench.steps(1_500, drive);
    assert_eq!(bench.drive.fault(), 0);
    assert!(bench.drive.shaft().torque_nm() == 0.0 && !Devices::is_armed(&mut bench.own));
}

#[test]
fn an_angle_that_no_longer_comes_is_late_feedback() {
    let mut bench = Bench::armed(looped());
    let drive = |bench: &mut Bench| _ = bench.own.set_angle((), Angle::from_radians(2.0));
    bench.steps(100, drive);
    bench.reports = vec![9]; // status 5 ends, status 1 goes on
    bench.steps(12, drive);
    bench.steps(300, |bench| {
        drive(bench);
        assert!(
            bench.frames.iter().all(|f| is_question(f) || read(f) == (1, 0)),
            "{:?}",
            bench.frames
        );
    });
    assert!(!Devices::is_armed(&mut bench.own), "lost after 100 ms");
    assert_eq!(bench.own.angle(()), None);
    // A motor that controls a velocity does not mind, and has no angle.
    let mut wheel = Bench::new(Mode::current_with_speed_loop(SPEED).unwrap());
    wheel.reports = vec![9];
    wheel.arm();
    wheel.steps(500, |bench| bench.own.set_velocity((), rad_s(30.0)).unwrap());
    assert_eq!((wheel.own.angle(()), wheel.own.motor().position()), (None, None));
    assert!((wheel.drive.shaft().velocity_rad_per_s() - 30.0).abs() < 3.0);
}

#[test]
fn a_count_that_wraps_turns_the_shaft_no_other_way() {
    let mut bench = Bench::new(looped());
    bench.drive.set_tachometer(i32::MAX - 3);
    bench.arm();
    let here = bench.own.angle(()).unwrap();
    let first = bench.own.motor().position().unwrap();
    let target = here + Angle::from_radians(2.0);
    bench.steps(2_000, |bench| {
        bench.own.set_angle((), target).unwrap();
        assert!(bench.drive.shaft().angle_rad() > -0.1);
    });
    assert!((bench.drive.shaft().angle_rad() - 2.0).abs() < 0.2);
    let way = bench.own.motor().position().unwrap().as_angle() - first.as_angle();
    assert!(bench.own.motor().feedback().tachometer.unwrap() < 0, "it has wrapped");
    let turns = bench.own.motor().position().unwrap().turns() - first.turns();
    assert!(turns.abs() <= 1, "{turns} {way:?}");
}

#[test]
fn a_drive_that_restarts_is_armed_anew_where_the_shaft_is() {
    let mut bench = Bench::armed(looped());
    bench.steps(1_500, |bench| bench.own.set_angle((), Angle::from_radians(2.5)).unwrap());
    // The firmware needs more than 100 ms until it reports.
    bench.is_cut = true;
    bench.drive.lose_supply();
    bench.steps(150, |bench| _ = bench.own.set_angle((), Angle::from_radians(2.5)));
    bench.is_cut = false;
    bench.steps(500, |bench| {
        assert!(bench.own.set_angle((), Angle::from_radians(2.5)).is_err());
        assert!(bench.drive.shaft().torque_nm() == 0.0);
    });
    bench.own.arm(bench.now()).unwrap();
    let before = bench.drive.shaft().angle_rad();
    bench.steps(20, |bench| bench.own.set_angle((), Angle::from_radians(2.5)).unwrap());
    assert!((bench.drive.shaft().angle_rad() - before).abs() < 0.05, "it opens from where it is");
}

#[test]
fn the_drive_stops_by_itself_after_its_own_time_out() {
    let mut bench = Bench::new(Mode::current());
    bench.drive = drive(23).with_timeout(0.1, 5.0);
    bench.arm();
    bench.steps(500, |bench| bench.own.set_torque(0.3).unwrap());
    bench.is_cut = true;
    let before = bench.drive.shaft().velocity_rad_per_s();
    bench.steps(95, |_| {});
    assert!(bench.drive.shaft().velocity_rad_per_s() > before, "it goes on");
    bench.steps(2_000, |_| {});
    assert!(bench.drive.shaft().velocity_rad_per_s().abs() < 0.1, "braked by 5 A");
}

#[test]
fn two_drives_on_a_bus_with_neighbouring_ids_hear_only_their_own() {
    let motor = |id| {
        let mode = Mode::current_with_speed_loop(SPEED).unwrap();
        Actuator::new(Motor::new(MODEL, id, mode).unwrap())
    };
    let mut robot = [motor(0), motor(253)];
    let mut drives = [drive(0), drive(253)];
    for ms in 1..1_500_u64 {
        let now = Instant::from_micros(1_000 * ms);
        for drive in &drives {
            assert_eq!(robot.ingest(&drive.report(9).unwrap(), now), Ingest::Taken);
        }
        robot.update(Tick::new(now, 0.001));
        while let Some(frame) = robot.next_frame(0) {
            for drive in &mut drives {
                if let Some(answer) = drive.hear(&frame) {
                    assert_eq!(robot.ingest(&answer, now), Ingest::Taken);
                }
            }
        }
        drives.iter_mut().for_each(|drive| drive.step(0.001));
        if ms == 100 {
            robot.arm(now).unwrap();
        }
        if ms > 100 {
            robot[0].set_velocity((), rad_s(30.0)).unwrap();
            robot[1].set_velocity((), rad_s(-50.0)).unwrap();
        }
    }
    let speeds = drives.map(|drive| drive.shaft().velocity_rad_per_s());
    assert!((speeds[0] - 30.0).abs() < 0.5 && (speeds[1] + 50.0).abs() < 0.5, "{speeds:?}");
}

#[test]
fn damaged_and_foreign_frames_change_nothing() {
    let mut bench = Bench::new(Mode::position());
    bench.steps(100, |_| {});
    let before = *bench.own.motor().feedback();
    let now = bench.now();
    let extended = |raw| Id::Extended(ExtendedId::new(raw).unwrap());
    for packet in [9, 14, 15, 16, 27, 58] {
        for length in 0..8 {
            let is_whole = packet == 27 && length == 6;
            let frame = CanFrame::new(extended(packet << 8 | 23), &[0x55; 8][..length]).unwrap();
            let outcome = Devices::ingest(&mut bench.own, &frame, now);
            assert_eq!(outcome.is_malformed(), !is_whole, "{frame:?}");
            if !is_whole {
                assert_eq!(bench.own.motor().feedback(), &before);
            } else {
                let right = bench.drive.report(27).unwrap();
                _ = Devices::ingest(&mut bench.own, &right, now);
            }
        }
    }
    for raw in [0x916, 0x918, 0x1_0917, 0x0017_0917, 0x8FE, 0x1C17, 0x1117] {
        let frame = CanFrame::new(extended(raw), &[0x55; 8]).unwrap();
        assert_eq!(Devices::ingest(&mut bench.own, &frame, now), Ingest::Unrelated, "{raw:X}");
        assert_eq!(bench.own.motor().feedback(), &before);
    }
    assert_eq!(bench.own.motor().feedback(), &before);
}

#[test]
fn another_program_that_commands_the_drive_is_a_second_master_and_a_tool_that_asks_is_none() {
    let extended = |raw| Id::Extended(ExtendedId::new(raw).unwrap());
    for (raw, is_rival) in
        [(0x017, true), (0x317, true), (0xD17, true), (0x817, false), (0x118, false)]
    {
        let mut bench = Bench::new(Mode::current());
        bench.steps(100, |_| {});
        let frame = CanFrame::new(extended(raw), &[0, 0, 0, 1]).unwrap();
        bench.steps(5, |bench| {
            let now = bench.now();
            _ = Devices::ingest(&mut bench.own, &frame, now);
        });
        assert_eq!(bench.own.arm(bench.now()).is_err(), is_rival, "{raw:X}");
    }
}

#[test]
fn slow_status_frames_need_time_outs_that_say_so() {
    let slow = Timeouts::new()
        .with_feedback(Duration::from_millis(50), Duration::from_millis(200))
        .unwrap();
    for (timeouts, drives) in [(Timeouts::new(), false), (slow, true)] {
        let mut bench = Bench::new(Mode::current_with_speed_loop(SPEED).unwrap());
        bench.own = bench.own.with_timeouts(timeouts);
        bench.arm();
        let mut refused = 0;
        for ms in 0..1_000 {
            // 50 Hz, as at delivery.
            bench.reports = if ms % 20 == 0 { vec![9] } else { Vec::new() };
            bench.step();
            refused += u32::from(bench.own.set_velocity((), rad_s(30.0)).is_err());
        }
        assert_eq!(refused == 0, drives, "{refused}");
    }
}

#[test]
fn bad_configurations_are_refused_with_the_limit() {
    let refused =
        |model| Motor::new(model, 1, Mode::position()).map(|_| ()).unwrap_err().to_string();
    assert_eq!(
        Motor::new(MODEL, 254, Mode::position()).unwrap_err().to_string(),
        "id 254: 0 to 253 are allowed"
    );
    assert!(
        Motor::new(MODEL, 0, Mode::position()).is_ok()
            && Motor::new(MODEL, 253, Mode::position()).is_ok()
    );
    assert!(refused(Model { pole_pairs: 0, ..MODEL }).starts_with("pole_pairs 0"));
    for wrong in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        assert!(
            refused(Model { torque_constant_nm_per_a: wrong, ..MODEL }).contains("torque_constant")
        );
        assert!(refused(Model { current_limit_a: wrong, ..MODEL }).contains("current_limit_a"));
        assert!(refused(Model { max_velocity: rad_s(wrong), ..MODEL }).contains("max_velocity"));
        assert!(Mode::duty(wrong, SPEED).is_err());
        let motor = Motor::new(MODEL, 1, Mode::position()).unwrap();
        assert!(motor.with_rest(Rest::Brake(wrong)).is_err());
        let mode = Mode::velocity_with_standstill(Rest::Handbrake(wrong));
        assert!(Motor::new(MODEL, 1, mode).is_err());
    }
    assert!(
        refused(Model { current_limit_a: 1_001.0, ..MODEL }).ends_with("at most 1000 is allowed")
    );
    assert!(
        refused(Model { torque_constant_nm_per_a: 1e-45, current_limit_a: 1e-3, ..MODEL })
            .contains("torque")
    );
    assert!(refused(Model { max_velocity: rad_s(1e7), ..MODEL }).contains("16777216"));
    let motor = Motor::new(MODEL, 1, Mode::position()).unwrap();
    let beyond = motor.with_rest(Rest::Brake(20.001)).unwrap_err();
    assert_eq!(
        beyond,
        ConfigError::Limit { parameter: "current of rest in A", value: 20.001, most: 20.0 }
    );
    assert!(matches!(
        Mode::duty(0.5, PidConfig::new(f32::NAN, 0.0, 0.0)),
        Err(ConfigError::Negative("kp"))
    ));
}

/// A drive that answered before the answers were lost may have any fault now.
#[test]
fn a_drive_that_no_longer_answers_is_not_armed() {
    let mut bench = Bench::new(Mode::current());
    bench.steps(100, |_| {});
    assert_eq!(bench.own.motor().feedback().fault, Some(0));
    for ms in 0..100_u64 {
        bench.now_us += 1_000;
        let now = bench.now();
        _ = Devices::ingest(&mut bench.own, &bench.drive.report(9).unwrap(), now);
        bench.own.update(Tick::new(now, 0.001));
        while bench.own.next_frame(0).is_some() {}
        assert!(ms < 60 || bench.own.motor().feedback().fault.is_none());
    }
    let refused = bench.own.arm(bench.now()).unwrap_err().to_string();
    assert_eq!(refused, "6374 #23: its fault code is not known yet, ask again");
}

/// Late feedback makes the motor forget what it knows of the drive, but not how often the count has wrapped: 2^32 is no whole
/// number of turns, so the angle would jump.
#[test]
fn late_feedback_after_a_wrap_does_not_turn_the_angle() {
    let mut bench = Bench::new(looped());
    bench.drive.set_tachometer(i32::MAX - 5);
    bench.arm();
    let target = bench.own.angle(()).unwrap() + Angle::from_radians(2.0);
    bench.steps(1_500, |bench| bench.own.set_angle((), target).unwrap());
    assert!(bench.own.motor().feedback().tachometer.unwrap() < 0, "it has wrapped");
    let before = bench.own.angle(()).unwrap();
    bench.is_cut = true;
    bench.steps(15, |bench| _ = bench.own.set_angle((), target));
    bench.is_cut = false;
    bench.steps(40, |bench| _ = bench.own.set_angle((), target));
    assert!(bench.own.is_armed(), "late, not lost");
    let after = bench.own.angle(()).unwrap();
    assert!((after - before).as_radians().abs() < 0.2, "{before:?} {after:?}");
    assert!((bench.drive.shaft().angle_rad() - 2.0).abs() < 0.2);
}

/// The current loop of a wheel without load would go on to the end of the drive's speed.
#[test]
fn a_velocity_target_keeps_within_the_largest_of_the_model() {
    let model = Model { max_velocity: rad_s(50.0), ..MODEL };
    let mode = Mode::current_with_speed_loop(SPEED).unwrap();
    let mut bench = Bench::of(Motor::new(model, 23, mode).unwrap());
    bench.arm();
    bench.steps(2_000, |bench| {
        bench.own.set_velocity((), rad_s(1e6)).unwrap();
        assert!(bench.drive.shaft().velocity_rad_per_s() < 58.0);
    });
    assert!((bench.drive.shaft().velocity_rad_per_s() - 50.0).abs() < 0.5);
    let mut own = Bench::of(Motor::new(model, 23, Mode::velocity()).unwrap());
    own.arm();
    // The drive's own current is no runaway, although no command of ours asks for it.
    own.steps(500, |bench| bench.own.set_velocity((), rad_s(-1e6)).unwrap());
    // 50 rad/s are 3342 electrical rpm.
    assert_eq!(read(&own.frames[0]), (3, -3_342));
}

/// Heat opens less of the range: 5 A of 20 A at a quarter.
#[test]
fn the_share_of_the_order_scales_the_current() {
    use drivetrain::motor::{DriveProtocol, Order, Target};
    use drivetrain::time::TimeStep;
    for (share, expected) in [(1.0, 20_000), (0.25, 5_000), (0.0, 0)] {
        for (target, sign) in [
            (Target::Torque(1e3), 1),
            (Target::Velocity(rad_s(-300.0)), -1),
            (Target::Angle(Angle::from_radians(3.0)), 1),
        ] {
            let mut motor = Motor::new(MODEL, 23, looped()).unwrap();
            _ = motor.decode(&drive(23).report(9).unwrap());
            _ = motor.decode_answer(&drive(23).report(27).unwrap());
            let frame = motor.control(Order { target, share, step: TimeStep::of(0.001) });
            let (packet, value) = read(&frame);
            let most = i64::from(sign) * expected;
            assert!(packet == 1 && value.abs() <= expected && value * most >= 0, "{frame:?}");
        }
    }
}

/// The velocity loop takes over from the torque before it, and leaves it.
#[test]
fn a_velocity_after_a_torque_begins_with_the_current_of_the_torque() {
    use drivetrain::motor::{DriveProtocol, Order, Target};
    use drivetrain::time::TimeStep;
    let mut motor = Motor::new(MODEL, 23, looped()).unwrap();
    _ = motor.decode(&drive(23).report(9).unwrap());
    _ = motor.decode_answer(&drive(23).report(27).unwrap());
    let mut current = |target| {
        let order = Order { target, share: 1.0, step: TimeStep::of(0.001) };
        read(&motor.control(order))
    };
    let (_, torque) = current(Target::Torque(0.2));
    let commands = (0..300).map(|_| current(Target::Velocity(rad_s(-1.0))));
    // Without the questions.
    let currents: Vec<i64> =
        commands.filter_map(|(packet, value)| (packet == 1).then_some(value)).collect();
    assert!(torque > 0 && (currents[0] - torque).abs() <= 1, "{torque}, {currents:?}");
    let steps = currents.windows(2).map(|pair| pair[0] - pair[1]);
    // 1 rad/s times 1 Nm/rad in 1 ms, at 0.05 Nm/A.
    assert!(steps.clone().all(|step| (0..=40).contains(&step)), "{currents:?}");
    assert!(steps.sum::<i64>() > 5_000, "{currents:?}");
}

/// A motor that was armed while another program drove the shaft, or a hand: no order before the first feedback after a loss.
#[test]
fn targets_between_a_loss_and_the_first_feedback_send_nothing() {
    let mut bench = Bench::armed(looped());
    bench.steps(300, |bench| bench.own.set_angle((), Angle::from_radians(1.0)).unwrap());
    bench.is_cut = true;
    bench.steps(11, |_| {});
    bench.steps(120, |bench| {
        _ = bench.own.set_angle((), Angle::from_radians(-3.0));
        assert!(bench.frames.iter().all(|f| is_question(f) || read(f) == (1, 0)));
    });
    bench.is_cut = false;
    bench.steps(50, |bench| {
        assert!(bench.own.set_angle((), Angle::from_radians(-3.0)).is_err());
    });
}

/// A wheel by the loop of the drive, with a zero for the angle of its encoder: status 1 at 1 kHz, status 4 at 20 Hz.
#[test]
fn an_angle_that_comes_20_times_a_second_is_no_jump() {
    for rad_per_s in [20.0, 40.0, 150.0] {
        let motor = Motor::new(MODEL, 23, Mode::velocity()).unwrap().with_encoder();
        let mut bench = Bench::of(motor);
        bench.own = bench.own.with_zero(Angle::ZERO).unwrap();
        bench.arm();
        for ms in 0..3_000 {
            bench.reports = if ms % 50 == 0 { vec![16, 9] } else { vec![9] };
            bench.own.set_velocity((), AngularVelocity::from_rad_per_s(rad_per_s)).unwrap();
            bench.step();
        }
        let velocity = bench.own.motor().velocity().as_rad_per_s();
        assert!(bench.own.is_armed() && velocity > 0.9 * rad_per_s, "{velocity} of {rad_per_s}");
    }
}
