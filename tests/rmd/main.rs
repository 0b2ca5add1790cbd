//! Motors of MyActuator with a drive that is written from the manual: arming, targets, limits, rest, the holding brake, the time-out of
//! the drive, errors, and frames that are no feedback.

#![cfg(test)]

mod bench;
mod review;

use bench::{Bench, torque};
use drivetrain::control::PidConfig;
use drivetrain::error::ConfigError;
use drivetrain::frame::CanFrame;
use drivetrain::motor::{
    Actuator, AngleDrive, Condition, Devices, DriveProtocol, Impedance, ImpedanceControl, Ingest,
    Link, Timeouts, VelocityDrive,
};
use drivetrain::rmd::{Mode, Model, Motor};
use drivetrain::sim::Drive;
use drivetrain::time::{Duration, Instant, Tick};
use drivetrain::units::{Angle, AngularVelocity};
use embedded_can::Frame;
use std::f32::consts::TAU;

const MODEL: Model = Model::X8_120;

fn rad_s(value: f32) -> AngularVelocity {
    AngularVelocity::from_rad_per_s(value)
}

fn rad(value: f32) -> Angle {
    Angle::from_radians(value)
}

fn answer(data: [u8; 8]) -> CanFrame {
    CanFrame::standard(0x241, data).unwrap()
}

#[test]
fn a_motor_is_armed_when_its_state_and_its_angle_have_been_read() {
    let mut bench = Bench::new(MODEL, torque());
    let refused = |bench: &mut Bench| bench.own.arm(bench.now()).unwrap_err().to_string();
    assert_eq!(refused(&mut bench), "no feedback from RMD-X8-120 #1");
    bench.steps(5, |_| {});
    assert_eq!(refused(&mut bench), "RMD-X8-120 #1: its errorState is not known yet, ask again");
    bench.steps(150, |_| {});
    assert_eq!(bench.own.arm(bench.now()), Ok(()));
    assert_eq!(bench.drive.timeout_ms(), 0, "written when it is to be driven");
}

#[test]
fn each_mode_reaches_its_target_and_rests_after_a_disarm() {
    let mut damped = Bench::armed(MODEL, torque());
    damped.steps(1_500, |bench| bench.own.set_velocity((), rad_s(6.0)).unwrap());
    // A damper of 0.4 against a friction of 0.01 Nm s/rad.
    assert!((damped.drive.shaft().velocity_rad_per_s() - 5.85).abs() < 0.2);
    rests(damped);

    let loops = ImpedanceControl::new(4.0).unwrap().with_loops(
        PidConfig::new(10.0, 0.0, 0.0).with_output_limit(20.0),
        PidConfig::new(0.5, 2.0, 0.0),
    );
    let mut looped = Bench::armed(MODEL, loops.unwrap());
    looped.steps(2_000, |bench| bench.own.set_angle((), rad(-2.0)).unwrap());
    assert!((looped.drive.shaft().angle_rad() + 2.0).abs() < 0.02);
    rests(looped);

    let mut velocity = Bench::armed(MODEL, Mode::velocity(rad_s(20.0)));
    velocity.steps(1_000, |bench| bench.own.set_velocity((), rad_s(-6.0)).unwrap());
    assert!((velocity.drive.shaft().velocity_rad_per_s() + 6.0).abs() < 0.2);
    rests(velocity);

    let mut position = Bench::armed(MODEL, Mode::position_velocity(rad_s(8.0)));
    position.steps(2_000, |bench| {
        bench.own.set_angle((), rad(2.0)).unwrap();
        assert!(bench.drive.shaft().velocity_rad_per_s().abs() < 8.1);
    });
    assert!((position.drive.shaft().angle_rad() - 2.0).abs() < 0.01);
    rests(position);
}

/// Disarmed, the drive gives no torque from the next frames on.
fn rests(mut bench: Bench) {
    assert_eq!(bench.drive.timeout_ms(), 100);
    bench.own.disarm();
    bench.step();
    bench.steps(300, |bench| {
        assert!(bench.drive.shaft().torque_nm().abs() < 1e-9, "{:?}", bench.frames);
    });
}

#[test]
fn a_reversed_motor_turns_the_other_way_in_each_mode() {
    fn turns(mode: impl Into<Mode>, set: fn(&mut Actuator<Motor>)) -> (f32, f32) {
        let mut bench = Bench::new(MODEL, mode);
        bench.own = bench.own.reversed();
        bench.steps(100, |_| {});
        bench.own.arm(bench.now()).unwrap();
        bench.steps(1_500, |bench| set(&mut bench.own));
        let found = bench.own.angle(()).unwrap().as_radians();
        (bench.drive.shaft().angle_rad(), found)
    }
    let (true_rad, found) = turns(torque(), |own| own.set_torque(0.1).unwrap());
    assert!(true_rad < -1.0 && (found + true_rad).abs() < 0.05, "{true_rad}, {found}");
    let (true_rad, found) =
        turns(Mode::velocity(rad_s(8.0)), |own| own.set_velocity((), rad_s(2.0)).unwrap());
    assert!(true_rad < -1.0 && (found + true_rad).abs() < 0.02, "{true_rad}, {found}");
    let mode = Mode::position_velocity(rad_s(8.0));
    let (true_rad, found) = turns(mode, |own| own.set_angle((), rad(1.0)).unwrap());
    assert!((true_rad + 1.0).abs() < 0.01 && (found - 1.0).abs() < 0.01, "{true_rad}, {found}");
}

/// Feedback has whole degrees; the angle is nearer, also while the shaft turns and across 32767°.
#[test]
fn the_angle_is_finer_than_the_feedback() {
    for speed in [0.0_f32, 0.3, 6.0, -25.0] {
        let mut bench = Bench::armed(MODEL, Mode::velocity(rad_s(30.0)));
        bench.drive.shaft_mut().set_angle(571.0 * speed.signum());
        bench.steps(150, |_| {});
        _ = bench.own.arm(bench.now());
        bench.steps(300, |bench| bench.own.set_velocity((), rad_s(speed)).unwrap());
        bench.steps(1_000, |bench| {
            bench.own.set_velocity((), rad_s(speed)).unwrap();
            let known = bench.own.angle(()).unwrap().as_radians();
            // A cycle late, and a count and the precision of a large number.
            let allowed = 2.5e-3 * speed.abs() + 1.5e-3;
            let apart = (known - bench.drive.shaft().angle_rad()).abs();
            assert!(apart < allowed, "{speed} rad/s: {apart} rad");
        });
    }
}

/// A limit that is no whole number of counts holds all the same.
#[test]
fn no_command_is_beyond_the_torque_limit() {
    let mode = ImpedanceControl::new(0.515).unwrap().with_gains(400.0, 5.0).unwrap();
    let mut bench = Bench::armed(MODEL, mode);
    let mut most = 0.0_f32;
    bench.steps(3_000, |bench| {
        let target = if bench.now_us % 400_000 < 200_000 { 1.0 } else { -1.0 };
        bench.own.set_angle((), rad(target)).unwrap();
        most = most.max(bench.drive.shaft().torque_nm().abs());
    });
    assert!(most <= 0.515 && most > 0.48, "{most} Nm");
}

#[test]
fn nothing_jumps_when_a_motor_far_from_its_target_is_armed() {
    let there = rad(-1.5);
    let mut position = Bench::new(MODEL, Mode::position_velocity(rad_s(8.0)));
    position.drive.shaft_mut().set_angle(1.5 + 5.0 * TAU);
    position.steps(100, |_| {});
    position.own.arm(position.now()).unwrap();
    position.steps(60, |bench| bench.own.set_angle((), there).unwrap());
    let near = position.drive.shaft().angle_rad() - 5.0 * TAU;
    assert!((near - 1.5).abs() < 0.1, "60 ms after arming at {near}");
    position.steps(2_000, |bench| bench.own.set_angle((), there).unwrap());
    let end = position.drive.shaft().angle_rad();
    assert!((end - 5.0 * TAU - 1.5).abs() < TAU / 2.0 + 0.02, "the shortest way: {end}");
    assert!((end + 1.5).rem_euclid(TAU) < 0.02 || (end + 1.5).rem_euclid(TAU) > TAU - 0.02);

    let mut velocity = Bench::new(MODEL, Mode::velocity(rad_s(20.0)));
    velocity.drive.shaft_mut().set_velocity(5.0);
    velocity.steps(100, |_| {});
    velocity.own.arm(velocity.now()).unwrap();
    velocity.steps(60, |bench| {
        bench.own.set_velocity((), rad_s(-5.0)).unwrap();
        assert!(bench.drive.shaft().torque_nm().abs() < 3.0);
    });
}

/// The brake of a torque motor is opened by a frame of its own, which is confirmed late; that of the others opens by itself.
#[test]
fn a_torque_motor_is_driven_when_its_brake_is_open() {
    let mut bench = Bench::new(MODEL, torque());
    bench.drive = bench.drive.with_brake();
    bench.steps(100, |_| {});
    bench.own.arm(bench.now()).unwrap();
    let mut opened_ms = None;
    for ms in 0..400 {
        bench.own.set_torque(1.0).unwrap();
        bench.step();
        let torque_nm = bench.drive.shaft().torque_nm();
        assert!(torque_nm == 0.0 || !bench.drive.is_locked(), "{ms} ms: {torque_nm} Nm");
        opened_ms = opened_ms.or((!bench.drive.is_locked()).then_some(ms));
    }
    assert!(opened_ms.is_some_and(|ms| ms > 100), "{opened_ms:?}");
    assert!((bench.drive.shaft().torque_nm() - 1.0).abs() < 0.03);
    bench.own.disarm();
    bench.steps(3, |_| {});
    assert!(bench.drive.is_locked(), "off locks it");

    let mut position = Bench::new(MODEL, Mode::position_velocity(rad_s(8.0)));
    position.drive = position.drive.with_brake();
    position.steps(100, |_| {});
    position.own.arm(position.now()).unwrap();
    position.steps(2_000, |bench| bench.own.set_angle((), rad(1.0)).unwrap());
    assert!((position.drive.shaft().angle_rad() - 1.0).abs() < 0.01);
}

/// Whether "off" locks the brake is not public: what the motor released, it locks.
#[test]
fn a_brake_that_the_motor_released_is_locked_after_off() {
    for lost_ms in [0, 80] {
        let mut bench = Bench::new(MODEL, torque());
        bench.drive = bench.drive.with_brake().keeping_brake();
        bench.steps(100, |_| {});
        bench.own.arm(bench.now()).unwrap();
        bench.steps(400, |bench| bench.own.set_torque(0.5).unwrap());
        assert!(!bench.drive.is_locked());
        bench.own.disarm();
        bench.is_cut = true;
        bench.steps(lost_ms, |_| {});
        bench.is_cut = false;
        let (mut locked_us, mut sent) = (None, 0);
        bench.steps(1_000, |bench| {
            if bench.drive.is_locked() && locked_us.is_none() {
                locked_us = Some(bench.now_us);
            }
            sent += bench.frames.iter().filter(|frame| frame.bytes()[0] == 0x78).count();
        });
        assert!(locked_us.is_some() && sent == 1, "{locked_us:?}, {sent} frames");
    }
    // A motor that released no brake locks none.
    let mut bench = Bench::armed(MODEL, Mode::velocity(rad_s(20.0)));
    bench.steps(300, |bench| bench.own.set_velocity((), rad_s(6.0)).unwrap());
    bench.own.disarm();
    bench.steps(500, |bench| {
        assert!(bench.frames.iter().all(|frame| frame.bytes()[0] != 0x78));
    });
}

#[test]
fn a_drive_that_does_not_take_its_timeout_is_not_driven_and_the_error_names_it() {
    let mut bench = Bench::new(MODEL, Mode::velocity(rad_s(20.0)));
    bench.drive = bench.drive.refusing_timeouts();
    bench.steps(100, |_| {});
    bench.own.arm(bench.now()).unwrap();
    bench.steps(300, |bench| {
        _ = bench.own.set_velocity((), rad_s(6.0));
        assert!(!bench.drive.is_on() || bench.drive.shaft().torque_nm() == 0.0);
    });
    assert!(!Devices::is_armed(&mut bench.own));
    let refused = bench.own.arm(bench.now()).unwrap_err().to_string();
    let text = "RMD-X8-120 #1 has CanRecvTime_MS 0, the program needs 100";
    assert!(refused.starts_with(text), "{refused}");

    let motor = *bench.own.motor();
    bench.own = Actuator::new(motor.without_timeout());
    bench.steps(100, |_| {});
    bench.own.arm(bench.now()).unwrap();
    bench.steps(500, |bench| bench.own.set_velocity((), rad_s(6.0)).unwrap());
    assert!(bench.drive.shaft().velocity_rad_per_s() > 5.5 && bench.drive.timeout_ms() == 0);
}

/// The memory of the drive wears: the time-out is written once for as long as the drive is heard, and at most 8 times in a row.
#[test]
fn the_timeout_is_not_written_again_and_again() {
    let mut bench = Bench::armed(MODEL, Mode::velocity(rad_s(20.0)));
    let mut written = 0;
    for _ in 0..20 {
        for ms in 0..400 {
            if ms < 200 {
                _ = bench.own.set_velocity((), rad_s(1.0));
            }
            bench.step();
            written += bench.frames.iter().filter(|frame| frame.bytes()[0] == 0xB3).count();
        }
    }
    assert_eq!(written, 1);

    let mut silent = Bench::armed(MODEL, Mode::velocity(rad_s(20.0)));
    let mut written = 0;
    for _ in 0..1_000 {
        _ = silent.own.set_velocity((), rad_s(1.0));
        silent.now_us += 1_000;
        let now = silent.now();
        silent.own.update(Tick::new(now, 0.001));
        while let Some(frame) = silent.own.next_frame(0) {
            let answer = silent.drive.hear(&frame);
            if frame.bytes()[0] == 0xB3 {
                written += 1;
            } else if let Some(answer) = answer {
                _ = Devices::ingest(&mut silent.own, &answer, now);
            }
        }
    }
    assert_eq!(written, 8);
    assert!(!Devices::is_armed(&mut silent.own), "and not driven");
}

/// The cable is cut for longer than the time-out of the drive. It comes to rest by itself. The simulated drive goes on with the command
/// before when frames come again, so the second frame is rest or off, whatever question is due by then.
#[test]
fn a_drive_whose_cable_is_cut_stops_and_does_not_go_on_by_itself() {
    fn stops(mode: impl Into<Mode>, set: fn(&mut Actuator<Motor>), cut_ms: u32) {
        let mode = mode.into();
        let mut bench = Bench::armed(MODEL, mode);
        bench.steps(800, |bench| set(&mut bench.own));
        assert!(bench.drive.is_on());
        bench.is_cut = true;
        bench.steps(cut_ms, |bench| set(&mut bench.own));
        assert!(!bench.drive.is_on() && bench.drive.shaft().torque_nm() == 0.0);
        bench.is_cut = false;
        set(&mut bench.own);
        bench.step();
        bench.steps(540, |bench| {
            set(&mut bench.own);
            let torque_nm = bench.drive.shaft().torque_nm();
            assert!(torque_nm == 0.0, "{mode:?}, {cut_ms} ms: {torque_nm} Nm");
        });
        assert!(!Devices::is_armed(&mut bench.own), "{mode:?}, {cut_ms} ms");
    }
    for cut_ms in (102..145).chain([400, 2_500]) {
        stops(torque(), |own| _ = own.set_torque(0.5), cut_ms);
        stops(Mode::velocity(rad_s(9.0)), |own| _ = own.set_velocity((), rad_s(6.0)), cut_ms);
        let position = Mode::position_velocity(rad_s(8.0));
        stops(position, |own| _ = own.set_angle((), rad(3.0)), cut_ms);
    }
}

/// A time-out of the drive that is shorter than that of the motor: the drive has stopped, and the motor learns it by the command that is
/// sent back.
#[test]
fn a_drive_that_timed_out_unnoticed_trips_the_motor() {
    for has_report in [true, false] {
        let mode = Mode::velocity(rad_s(20.0));
        let motor = Motor::new(MODEL, 1, mode).unwrap();
        let mut bench = Bench::new(MODEL, mode);
        let ages = [60, 200].map(Duration::from_millis);
        let patient = Timeouts::new().with_feedback(ages[0], ages[1]).unwrap();
        let motor = motor.with_timeout(Duration::from_millis(20)).unwrap();
        bench.own = Actuator::new(motor).with_timeouts(patient);
        bench.steps(100, |_| {});
        bench.own.arm(bench.now()).unwrap();
        bench.steps(500, |bench| bench.own.set_velocity((), rad_s(6.0)).unwrap());
        assert_eq!(bench.drive.timeout_ms(), 20);
        // What is sent is lost, what the drive sends is not.
        for _ in 0..40 {
            _ = bench.own.set_velocity((), rad_s(6.0));
            bench.now_us += 1_000;
            let now = bench.now();
            bench.own.update(Tick::new(now, 0.001));
            while bench.own.next_frame(0).is_some() {}
            bench.drive.step(0.001);
            if let Some(report) = bench.drive.next_frame().filter(|_| has_report) {
                assert_eq!(Devices::ingest(&mut bench.own, &report, now), Ingest::Taken);
            }
        }
        assert!(!bench.drive.is_on());
        bench.steps(20, |bench| _ = bench.own.set_velocity((), rad_s(6.0)));
        assert!(!Devices::is_armed(&mut bench.own), "report {has_report}");
    }
}

#[test]
fn a_drive_that_resets_while_it_is_driven_trips_and_does_not_go_on() {
    let mut bench = Bench::armed(MODEL, Mode::position_velocity(rad_s(8.0)));
    for third in 1..=8_u8 {
        let target = rad(TAU / 3.0 * f32::from(third));
        bench.steps(1_000, |bench| bench.own.set_angle((), target).unwrap());
    }
    let before = bench.drive.shaft().angle_rad();
    assert!((before - TAU * 8.0 / 3.0).abs() < 0.02);
    bench.drive.lose_supply();
    bench.steps(3_000, |bench| {
        _ = bench.own.set_angle((), rad(TAU * 8.0 / 3.0));
        assert!((bench.drive.shaft().angle_rad() - before).abs() < 0.1);
    });
    assert!(!Devices::is_armed(&mut bench.own));
    // It counts from another turn now. Armed again, it stays where it is.
    bench.steps(200, |_| {});
    bench.drive.shaft_mut().set_velocity(0.0);
    let before = bench.drive.shaft().angle_rad();
    bench.own.arm(bench.now()).unwrap();
    bench.steps(1_000, |bench| {
        bench.own.set_angle((), rad(TAU * 8.0 / 3.0)).unwrap();
        let moved = (bench.drive.shaft().angle_rad() - before).abs();
        assert!(moved < 0.15, "{moved} rad: no turn");
    });
    assert!(bench.drive.is_on());
}

#[test]
fn lost_feedback_switches_the_drive_off_and_it_goes_on_when_it_is_heard() {
    let mut bench = Bench::armed(MODEL, Mode::velocity(rad_s(20.0)));
    bench.steps(500, |bench| bench.own.set_velocity((), rad_s(6.0)).unwrap());
    // The drive hears, and is not heard.
    for _ in 0..30 {
        _ = bench.own.set_velocity((), rad_s(6.0));
        bench.now_us += 1_000;
        let now = bench.now();
        bench.own.update(Tick::new(now, 0.001));
        while let Some(frame) = bench.own.next_frame(0) {
            bench.drive.hear(&frame);
        }
        bench.drive.step(0.001);
    }
    assert!(bench.drive.shaft().torque_nm() == 0.0);
    bench.steps(500, |bench| _ = bench.own.set_velocity((), rad_s(6.0)));
    assert!(bench.drive.is_on(), "late, not lost: it goes on with the target that is set anew");
}

#[test]
fn an_error_is_an_edge_with_its_code_and_goes_away_with_its_cause_or_by_a_reset() {
    for (error, code) in [(0x0002_u16, 2), (0x0004, 3), (0x1000, 13)] {
        let mut bench = Bench::armed(MODEL, torque());
        bench.steps(300, |bench| bench.own.set_velocity((), rad_s(3.0)).unwrap());
        while bench.own.next_edge().is_some() {}
        bench.drive.set_reasons(error);
        bench.steps(300, |bench| _ = bench.own.set_velocity((), rad_s(3.0)));
        assert_eq!(bench.own.health().error_code, code);
        let edges = std::iter::from_fn(|| bench.own.next_edge());
        let faults: Vec<_> = edges.filter(|edge| edge.condition == Condition::Fault).collect();
        assert!(faults.len() == 1 && faults[0].began, "{faults:?}");
        assert!(!Devices::is_armed(&mut bench.own));
        let refused = bench.own.arm(bench.now());
        assert!(matches!(refused, Err(drivetrain::motor::ArmError::Faulty(_))), "{refused:?}");
        bench.drive.set_reasons(0);
        bench.steps(400, |_| {});
        // A stall stays.
        assert_eq!(bench.drive.errors(), error & 2);
        if error == 2 {
            assert!(bench.own.arm(bench.now()).is_err());
            bench.own.motor_mut().reset_drive();
            bench.steps(2_000, |_| {});
            assert_eq!(bench.drive.errors(), 0);
        }
        assert_eq!(bench.own.arm(bench.now()), Ok(()));
    }
}

#[test]
fn a_reset_is_sent_once_and_a_driven_motor_forgets_it() {
    let mut bench = Bench::armed(MODEL, Mode::velocity(rad_s(20.0)));
    bench.steps(500, |bench| bench.own.set_velocity((), rad_s(6.0)).unwrap());
    bench.own.motor_mut().reset_drive();
    bench.steps(500, |bench| {
        bench.own.set_velocity((), rad_s(6.0)).unwrap();
        assert!(bench.frames.iter().all(|frame| frame.bytes()[0] != 0x76));
    });
    bench.own.disarm();
    bench.steps(500, |bench| assert!(bench.frames.iter().all(|frame| frame.bytes()[0] != 0x76)));
    bench.own.motor_mut().reset_drive();
    let mut codes = Vec::new();
    bench.steps(1_000, |bench| {
        let sent = bench.frames.iter().map(|frame| frame.bytes()[0]);
        codes.extend(sent.filter(|code| [0x76, 0x80].contains(code)));
    });
    assert_eq!(codes[..2], [0x76, 0x80]);
    assert_eq!(codes.iter().filter(|code| **code == 0x76).count(), 1);
}

#[test]
fn a_frame_of_another_length_is_malformed_and_changes_nothing() {
    let mut bench = Bench::armed(MODEL, torque());
    bench.steps(300, |bench| bench.own.set_torque(0.1).unwrap());
    let before = *bench.own.motor().feedback().unwrap();
    for length in 0..8_u8 {
        for code in [0x9C, 0xA1, 0x9A, 0x92, 0xB3, 0x77, 0x80] {
            let data = [code, 50, 1, 2, 3, 4, 5, 6];
            let frame = CanFrame::standard(0x241, data).unwrap();
            let short = CanFrame::new(frame.id(), &data[..usize::from(length)]).unwrap();
            let now = bench.now();
            let outcome = Devices::ingest(&mut bench.own, &short, now);
            assert_eq!(outcome, Ingest::WrongLength(length));
        }
    }
    assert_eq!(bench.own.motor().feedback(), Some(&before));
    // The answer of another drive, and of a drive with the older protocol on the id of the commands.
    let now = bench.now();
    for id in [0x242, 0x141] {
        let frame = CanFrame::standard(id, [0xA1, 50, 1, 2, 3, 4, 5, 6]).unwrap();
        assert_eq!(Devices::ingest(&mut bench.own, &frame, now), Ingest::Unrelated);
    }
    assert!(
        drivetrain::motor::CanDevice::second_master(&bench.own).is_some(),
        "a command that another node sends"
    );
    assert_eq!(bench.own.motor().feedback(), Some(&before));
    // The report of a time-out may have no data beside its code.
    let short = CanFrame::new(answer([0; 8]).id(), &[0xF1]).unwrap();
    assert_eq!(Devices::ingest(&mut bench.own, &short, now), Ingest::Taken);
    bench.steps(2, |bench| _ = bench.own.set_torque(0.1));
    assert!(!Devices::is_armed(&mut bench.own));
}

/// Questions take the place of commands, and their answers are no feedback: none of them makes a motor late.
#[test]
fn a_motor_that_is_updated_250_times_a_second_is_never_late() {
    fn runs(mode: impl Into<Mode>, set: fn(&mut Actuator<Motor>)) {
        let mut bench = Bench::new(MODEL, mode);
        for tick in 0..2_000_u32 {
            bench.now_us += 3_000;
            bench.step();
            (0..30).for_each(|_| bench.drive.step(1e-4));
            if tick == 100 {
                bench.own.arm(bench.now()).unwrap();
            }
            if tick > 100 {
                set(&mut bench.own);
            }
            assert!(tick < 10 || bench.own.guard().link() == Link::Online, "{tick}");
        }
        assert!(Devices::is_armed(&mut bench.own));
    }
    runs(torque(), |own| own.set_torque(0.0).unwrap_or_default());
    runs(Mode::velocity(rad_s(20.0)), |own| _ = own.set_velocity((), rad_s(2.0)));
    runs(Mode::position_velocity(rad_s(8.0)), |own| _ = own.set_angle((), rad(1.0)));
}

#[test]
fn two_motors_on_a_bus_hear_their_actuator_drives_alone() {
    let motor = |id| Actuator::new(Motor::new(MODEL, id, torque()).unwrap());
    let mut robot = [motor(1), motor(2)];
    let drive = |id| drivetrain::sim::RmdDrive::new(id, 2.4);
    let mut drives = [drive(1), drive(2)];
    for ms in 0..1_500_u64 {
        let now = Instant::from_micros(1_000 * (ms + 1));
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
            robot[0].set_velocity((), rad_s(3.0)).unwrap();
            robot[1].set_velocity((), rad_s(-5.0)).unwrap();
        }
    }
    let speeds = drives.map(|drive| drive.shaft().velocity_rad_per_s());
    assert!((speeds[0] - 3.0).abs() < 0.2 && (speeds[1] + 5.0).abs() < 0.2, "{speeds:?}");
}

#[test]
fn an_impedance_crosses_turns_without_a_jump() {
    let mut bench = Bench::new(MODEL, ImpedanceControl::new(4.0).unwrap());
    bench.drive.shaft_mut().set_angle(TAU - 0.05);
    bench.steps(100, |_| {});
    bench.own.arm(bench.now()).unwrap();
    let beyond =
        Impedance { angle: rad(TAU + 0.3), stiffness: 4.0, damping: 0.3, ..Impedance::FREE };
    bench.steps(2_000, |bench| {
        bench.own.set_impedance(beyond).unwrap();
        assert!(bench.drive.shaft().torque_nm().abs() < 1.6);
    });
    assert!((bench.drive.shaft().angle_rad() - TAU - 0.3).abs() < 0.02);
}

#[test]
fn what_the_drive_has_no_field_for_is_refused() {
    let mode = Mode::velocity_with_torque_limit(rad_s(10.0), 2.0);
    let error = Motor::new(MODEL, 1, mode).unwrap_err();
    assert_eq!(error, ConfigError::Unsupported("torque limit of a velocity"));
    assert!(error.to_string().starts_with("torque limit of a velocity"), "{error}");
    for ms in [0, 9, 60_001] {
        let motor = Motor::new(MODEL, 1, torque()).unwrap();
        assert!(motor.with_timeout(Duration::from_millis(ms)).is_err(), "{ms} ms");
    }
}
