//! Motors of LK-TECH with a drive that is written from the manual: arming, targets, limits, rest, turns, errors, frames that are
//! no feedback, and a bus with both directions on one id.

#![cfg(test)]

mod bench;
mod review;

use bench::{Bench, drive_of, torque};
use drivetrain::control::PidConfig;
use drivetrain::frame::CanFrame;
use drivetrain::lk::{Mode, Model, Motor, Series};
use drivetrain::motor::{
    Actuator, AngleDrive, Condition, Devices, DriveProtocol, Impedance, ImpedanceControl, Ingest,
    Link, VelocityDrive,
};
use drivetrain::sim::{Drive, DriveShaft};
use drivetrain::time::{Instant, Tick};
use drivetrain::units::{Angle, AngularVelocity};
use std::f32::consts::TAU;

const MODELS: [Model; 2] = [Model::MF9025_16T, Model::MG5010E_I10];
/// The echo of "off", "run" and "stop".
const ECHOES: [u8; 3] = [0x80, 0x88, 0x81];

fn rad_s(value: f32) -> AngularVelocity {
    AngularVelocity::from_rad_per_s(value)
}

fn rad(value: f32) -> Angle {
    Angle::from_radians(value)
}

fn frame(data: [u8; 8]) -> CanFrame {
    CanFrame::standard(0x141, data).unwrap()
}

#[test]
fn a_motor_is_armed_when_its_state_has_been_read() {
    let mut bench = Bench::new(Model::MF9025_16T, torque());
    let refused = |bench: &mut Bench| bench.own.arm(bench.now()).unwrap_err().to_string();
    assert_eq!(refused(&mut bench), "no feedback from MF9025-16T #1");
    bench.steps(5, |_| {});
    assert_eq!(refused(&mut bench), "MF9025-16T #1: its motorState is not known yet, ask again");
    bench.steps(40, |_| {});
    assert_eq!(
        refused(&mut bench),
        "MF9025-16T #1: its number of drives is not known yet, ask again"
    );
    bench.steps(80, |_| {});
    assert_eq!(bench.own.arm(bench.now()), Ok(()));
    assert!(!bench.drive.is_on(), "switched off at the start, and on when it is driven");
}

#[test]
fn each_mode_reaches_its_target_and_rests_after_a_disarm() {
    for model in MODELS {
        let mut damped = Bench::armed(model, torque());
        damped.steps(1_000, |bench| bench.own.set_velocity((), rad_s(6.0)).unwrap());
        assert!((damped.drive.shaft().velocity_rad_per_s() - 6.0).abs() < 0.2);
        rests(damped);

        let loops = ImpedanceControl::new(2.0).unwrap().with_loops(
            PidConfig::new(10.0, 0.0, 0.0).with_output_limit(20.0),
            PidConfig::new(0.5, 2.0, 0.0),
        );
        let mut looped = Bench::armed(model, loops.unwrap());
        looped.steps(1_500, |bench| bench.own.set_angle((), rad(-2.0)).unwrap());
        assert!((looped.drive.shaft().angle_rad() + 2.0).abs() < 0.02);
        rests(looped);

        let mut velocity = Bench::armed(model, Mode::velocity_with_torque_limit(rad_s(20.0), 2.0));
        velocity.steps(1_000, |bench| {
            bench.own.set_velocity((), rad_s(-6.0)).unwrap();
            assert!(bench.drive.shaft().torque_nm().abs() <= 2.001);
        });
        assert!((velocity.drive.shaft().velocity_rad_per_s() + 6.0).abs() < 0.2);
        rests(velocity);

        let mut position = Bench::armed(model, Mode::position_velocity(rad_s(8.0)));
        position.steps(2_000, |bench| {
            bench.own.set_angle((), rad(2.0)).unwrap();
            assert!(bench.drive.shaft().velocity_rad_per_s().abs() < 8.1);
        });
        assert!((position.drive.shaft().angle_rad() - 2.0).abs() < 0.02);
        rests(position);
    }
}

/// Disarmed, the drive gives no torque from the next frames on, and is off.
fn rests(mut bench: Bench) {
    bench.own.disarm();
    bench.step();
    bench.steps(50, |bench| {
        assert!(bench.drive.shaft().torque_nm().abs() < 1e-9, "{:?}", bench.frames);
    });
    assert!(!bench.drive.is_on());
}

#[test]
fn a_reversed_motor_turns_the_other_way_in_each_mode() {
    let reversed = |bench: &mut Bench| bench.own = bench.own.reversed();
    let mut torqued = Bench::new(Model::MG5010E_I10, torque());
    reversed(&mut torqued);
    torqued.steps(100, |_| {});
    torqued.own.arm(torqued.now()).unwrap();
    torqued.steps(300, |bench| bench.own.set_velocity((), rad_s(3.0)).unwrap());
    assert!(torqued.drive.shaft().velocity_rad_per_s() < -2.5);
    assert!(torqued.own.velocity(()).unwrap().as_rad_per_s() > 2.5);

    let mut position = Bench::new(Model::MG5010E_I10, Mode::position_velocity(rad_s(8.0)));
    position.own = position.own.reversed();
    position.steps(100, |_| {});
    position.own.arm(position.now()).unwrap();
    position.steps(1_500, |bench| bench.own.set_angle((), rad(1.0)).unwrap());
    assert!((position.drive.shaft().angle_rad() + 1.0).abs() < 0.02);
}

#[test]
fn a_spring_crosses_the_zero_of_the_encoder_without_a_jump() {
    let mut bench = Bench::new(Model::MF9025_16T, ImpedanceControl::new(2.0).unwrap());
    bench.drive.shaft_mut().set_angle(TAU - 0.05);
    bench.steps(100, |_| {});
    bench.own.arm(bench.now()).unwrap();
    let beyond =
        Impedance { angle: rad(TAU + 0.3), stiffness: 4.0, damping: 0.3, ..Impedance::FREE };
    bench.steps(2_000, |bench| {
        bench.own.set_impedance(beyond).unwrap();
        assert!(bench.drive.shaft().torque_nm().abs() < 1.5);
    });
    assert!((bench.drive.shaft().angle_rad() - TAU - 0.3).abs() < 0.01);
}

/// A limit that is no whole number of counts holds all the same.
#[test]
fn no_command_is_beyond_the_torque_limit() {
    for model in MODELS {
        let mode = ImpedanceControl::new(0.5).unwrap().with_gains(400.0, 5.0).unwrap();
        let mut bench = Bench::armed(model, mode);
        let mut most = 0.0_f32;
        bench.steps(3_000, |bench| {
            let target = if bench.now_us % 400_000 < 200_000 { 1.0 } else { -1.0 };
            bench.own.set_angle((), rad(target)).unwrap();
            most = most.max(bench.drive.shaft().torque_nm().abs());
        });
        assert!(most <= 0.5 && most > 0.48, "{most} Nm");
    }
}

#[test]
fn nothing_jumps_when_a_motor_far_from_its_target_is_armed() {
    for model in MODELS {
        let there = rad(-1.5);
        let mut position = Bench::new(model, Mode::position_velocity(rad_s(8.0)));
        // Some turns away, so that the drive's own count is another one than that of its encoder.
        position.drive.shaft_mut().set_angle(1.5 + 5.0 * TAU);
        position.steps(100, |_| {});
        position.own.arm(position.now()).unwrap();
        position.steps(60, |bench| bench.own.set_angle((), there).unwrap());
        let near = position.drive.shaft().angle_rad() - 5.0 * TAU;
        assert!((near - 1.5).abs() < 0.1, "60 ms after arming at {near}");
        position.steps(2_000, |bench| bench.own.set_angle((), there).unwrap());
        let end = position.drive.shaft().angle_rad() - 5.0 * TAU;
        let rest = (end + 1.5).rem_euclid(TAU);
        // The angle of a geared motor is counted from the rotor's at the start.
        let is_there = rest.min(TAU - rest) < 0.02;
        assert!(is_there || model.gear() > 1.0, "{end}");
        assert!((position.own.angle(()).unwrap() - there).as_radians().rem_euclid(TAU) < 0.02);

        let mut velocity = Bench::new(model, Mode::velocity(rad_s(20.0)));
        velocity.drive.shaft_mut().set_velocity(5.0);
        velocity.steps(100, |_| {});
        velocity.own.arm(velocity.now()).unwrap();
        velocity.steps(60, |bench| {
            bench.own.set_velocity((), rad_s(-5.0)).unwrap();
            assert!(bench.drive.shaft().torque_nm().abs() < 3.0);
        });
    }
}

/// Off clears the turns of the drive, so a position that counts from before would turn the shaft by all of them.
#[test]
fn a_position_motor_that_was_off_with_many_turns_does_not_unwind_them() {
    let mut bench = Bench::armed(Model::MF9025_16T, Mode::position_velocity(rad_s(30.0)));
    // Eight thirds of a turn in steps of a third, by the shortest way each.
    for third in 1..=8_u8 {
        let target = rad(TAU / 3.0 * f32::from(third));
        bench.steps(1_000, |bench| bench.own.set_angle((), target).unwrap());
    }
    let far = bench.drive.shaft().angle_rad();
    assert!((far - TAU * 8.0 / 3.0).abs() < 0.02, "{far}");
    bench.steps(300, |_| {}); // no target: off
    assert!(!bench.drive.is_on());
    bench.own.disarm();
    bench.steps(200, |_| {});
    bench.own.arm(bench.now()).unwrap();
    bench.steps(500, |bench| {
        bench.own.set_angle((), rad(TAU * 2.0 / 3.0)).unwrap();
        assert!((bench.drive.shaft().angle_rad() - far).abs() < 0.02);
    });
    assert!(bench.drive.is_on());
}

/// The output opens when the angle is known, not before: the first position is where the shaft is, however late the answer comes.
#[test]
fn no_position_is_sent_before_the_angle_of_the_drive_is_known() {
    let mut bench = Bench::armed(Model::MF9025_16T, Mode::position_velocity(rad_s(8.0)));
    bench.drive.shaft_mut().set_angle(1.0 + 3.0 * TAU);
    bench.steps(20, |_| {});
    let mut positions = Vec::new();
    for ms in 0..400 {
        bench.own.set_angle((), rad(-1.0)).unwrap();
        bench.now_us += 1_000;
        let now = bench.now();
        bench.own.update(Tick::new(now, 0.001));
        while let Some(sent) = bench.own.next_frame(0) {
            let [code, _, _, _, a, b, c, d] = *sent.bytes();
            if code == 0xA4 {
                assert!(ms >= 300, "{ms} ms: {sent:?}");
                positions.push(f64::from(i32::from_le_bytes([a, b, c, d])) / 100.0);
            }
            let answer = bench.drive.hear(&sent);
            if let Some(answer) = answer.filter(|_| code != 0x92 || ms >= 300) {
                _ = Devices::ingest(&mut bench.own, &answer, now);
            }
        }
        bench.drive.step(0.001);
    }
    // Off has cleared the turns: the shaft is at 57.3°.
    assert!((positions[0] - 57.3).abs() < 1.0, "{positions:?}");
    assert!(positions.windows(2).all(|pair| (pair[0] - pair[1]).abs() < 2.0), "{positions:?}");
}

/// After its supply came back the drive is on and counts from zero: a position that counts from before is some turns away.
#[test]
fn a_drive_that_resets_while_it_holds_a_position_trips_before_it_has_gone_far() {
    for silent_ms in [0, 3, 6, 9, 30] {
        let mut bench = Bench::armed(Model::MF9025_16T, Mode::position_velocity(rad_s(8.0)));
        for third in 1..=8_u8 {
            let target = rad(TAU / 3.0 * f32::from(third));
            bench.steps(1_000, |bench| bench.own.set_angle((), target).unwrap());
        }
        let before = bench.drive.shaft().angle_rad();
        bench.drive.lose_supply();
        let target = |bench: &mut Bench| _ = bench.own.set_angle((), rad(TAU * 8.0 / 3.0));
        bench.is_cut = true;
        bench.steps(silent_ms, target);
        bench.is_cut = false;
        // Without a silence it takes until the next question: 32 commands.
        bench.steps(60, |bench| {
            target(bench);
            let torque_nm = bench.drive.shaft().torque_nm();
            assert!(torque_nm.abs() < 0.1 || silent_ms < 6, "{silent_ms} ms: {torque_nm} Nm");
        });
        let moved = (bench.drive.shaft().angle_rad() - before).abs();
        assert!(moved < 0.5, "{silent_ms} ms: {moved} rad");
        bench.steps(300, target);
        assert!(!bench.drive.is_on() || silent_ms == 30, "{silent_ms} ms");
        assert_eq!(Devices::is_armed(&mut bench.own), silent_ms == 30, "late alone does not trip");
    }
}

#[test]
fn lost_feedback_switches_the_drive_off_and_it_goes_on_when_it_is_heard() {
    for mode in [Mode::velocity(rad_s(20.0)), Mode::velocity_with_torque_limit(rad_s(20.0), 1.0)] {
        let mut bench = Bench::armed(Model::MF9025_16T, mode);
        bench.steps(500, |bench| bench.own.set_velocity((), rad_s(6.0)).unwrap());
        assert!(bench.drive.is_on());
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
        assert!(!bench.drive.is_on() && bench.drive.shaft().torque_nm() == 0.0);
        bench.steps(500, |bench| _ = bench.own.set_velocity((), rad_s(6.0)));
        assert!(bench.drive.is_on(), "late, not lost: it goes on with the target that is set anew");
    }
}

/// The drive has no time-out: what the manual says, and what the module says.
#[test]
fn a_drive_whose_cable_is_cut_goes_on_with_its_last_command() {
    let mut bench = Bench::armed(Model::MF9025_16T, Mode::velocity(rad_s(20.0)));
    bench.steps(500, |bench| bench.own.set_velocity((), rad_s(6.0)).unwrap());
    bench.is_cut = true;
    bench.steps(1_000, |_| {});
    assert!(bench.drive.shaft().velocity_rad_per_s() > 5.0);
    assert_eq!(bench.own.guard().link(), Link::Offline);
    bench.is_cut = false;
    bench.steps(20, |_| {});
    assert!(!bench.drive.is_on(), "off as soon as it hears");
}

#[test]
fn an_error_of_the_drive_is_an_edge_with_its_code_and_is_cleared_after_off() {
    let mut bench = Bench::armed(Model::MG5010E_I10, torque());
    bench.steps(300, |bench| bench.own.set_velocity((), rad_s(3.0)).unwrap());
    while bench.own.next_edge().is_some() {}
    bench.drive.fail(0b1000);
    let mut switching = Vec::new();
    bench.steps(300, |bench| {
        _ = bench.own.set_velocity((), rad_s(3.0));
        let codes = bench.frames.iter().map(|frame| frame.bytes()[0]);
        switching.extend(codes.filter(|code| [0x80, 0x9B].contains(code)));
        assert_eq!(
            bench.own.health().error_code,
            bench.own.motor().state().map_or(0, |state| state.errors)
        );
    });
    assert_eq!(switching[..2], [0x80, 0x9B]);
    let edges: Vec<_> = std::iter::from_fn(|| bench.own.next_edge()).collect();
    let error = edges.iter().find(|edge| edge.condition == Condition::Fault).unwrap();
    assert!(error.began, "{edges:?}");
    assert_eq!(edges.iter().filter(|edge| edge.condition == Condition::Fault).count(), 2);
    assert!(
        !Devices::is_armed(&mut bench.own) && !bench.drive.is_on() && bench.drive.errors() == 0
    );
    bench.steps(200, |_| {});
    assert_eq!(bench.own.arm(bench.now()), Ok(()));
}

#[test]
fn a_drive_with_an_error_that_stays_is_not_armed() {
    let mut bench = Bench::new(Model::MF9025_16T, torque());
    bench.drive.set_reasons(1);
    bench.steps(1_000, |_| {});
    let refused = bench.own.arm(bench.now());
    assert!(matches!(refused, Err(drivetrain::motor::ArmError::Faulty(_))), "{refused:?}");
    assert!(!Devices::is_armed(&mut bench.own));
    let edges = std::iter::from_fn(|| bench.own.next_edge());
    assert_eq!(edges.filter(|edge| edge.condition == Condition::Fault).count(), 1);
    bench.drive.set_reasons(0);
    bench.steps(400, |_| {});
    assert_eq!(bench.own.arm(bench.now()), Ok(()), "cleared by itself");
}

/// The trap of the protocol: echoes on the id of the feedback, read as position 0.
#[test]
fn an_echo_is_never_feedback() {
    let mut bench = Bench::new(Model::MF9025_16T, torque());
    bench.drive.shaft_mut().set_angle(2.0);
    bench.steps(100, |_| {});
    let before = bench.own.angle(()).unwrap();
    for code in ECHOES {
        let mut motor = *bench.own.motor();
        let echo = frame([code, 0, 0, 0, 0, 0, 0, 0]);
        assert_eq!(motor.decode(&echo), Ingest::Unrelated);
        let feedback = *motor.feedback().unwrap();
        motor.decode_answer(&echo);
        assert_eq!(motor.feedback(), Some(&feedback));
    }
    assert_eq!(bench.own.angle(()), Some(before));
    assert!((before.as_radians() - 2.0).abs() < 1e-3);
    // Echoes alone keep no motor alive.
    for _ in 0..150 {
        bench.now_us += 1_000;
        let now = bench.now();
        bench.own.update(Tick::new(now, 0.001));
        while let Some(sent) = bench.own.next_frame(0) {
            if ECHOES.contains(&sent.bytes()[0]) {
                _ = Devices::ingest(&mut bench.own, &sent, now);
            }
        }
    }
    assert_eq!(bench.own.guard().link(), Link::Offline);
}

/// A driver that hands back what was sent, without a drive.
#[test]
fn commands_that_are_read_back_are_no_feedback_and_count_as_another_controller() {
    fn looped(mode: impl Into<Mode>, set: fn(&mut Actuator<Motor>)) {
        let mut bench = Bench::armed(Model::MF9025_16T, mode);
        for tick in 0..400 {
            set(&mut bench.own);
            if tick < 200 {
                bench.step();
                continue;
            }
            bench.now_us += 1_000;
            let now = bench.now();
            bench.own.update(Tick::new(now, 0.001));
            while let Some(sent) = bench.own.next_frame(0) {
                let feedback = bench.own.motor().feedback().copied();
                _ = Devices::ingest(&mut bench.own, &sent, now);
                assert_eq!(bench.own.motor().feedback().copied(), feedback, "{sent:?}");
            }
        }
        assert_eq!(bench.own.guard().link(), Link::Offline);
        assert!(drivetrain::motor::CanDevice::second_master(&bench.own).is_some());
    }
    looped(torque(), |own| _ = own.set_torque(1.0));
    looped(Mode::velocity(rad_s(20.0)), |own| _ = own.set_velocity((), rad_s(6.0)));
    let limited = Mode::velocity_with_torque_limit(rad_s(20.0), 2.0);
    looped(limited, |own| _ = own.set_velocity((), rad_s(-6.0)));
    looped(Mode::position_velocity(rad_s(8.0)), |own| _ = own.set_angle((), rad(2.0)));
}

#[test]
fn feedback_at_zero_degrees_celsius_is_feedback() {
    let mut bench = Bench::new(Model::MF9025_16T, torque());
    bench.drive.set_temperature(0);
    bench.drive.shaft_mut().set_angle(1.0);
    bench.steps(100, |_| {});
    bench.own.arm(bench.now()).unwrap();
    bench.steps(1_000, |bench| bench.own.set_velocity((), rad_s(6.0)).unwrap());
    assert!((bench.drive.shaft().velocity_rad_per_s() - 6.0).abs() < 0.2);
    bench.drive.set_temperature(-20);
    bench.steps(300, |bench| bench.own.set_velocity((), rad_s(6.0)).unwrap());
    assert_eq!(bench.own.health().temperature_c, Some(-20));
}

#[test]
fn malformed_and_foreign_frames_change_nothing() {
    let mut bench = Bench::new(Model::MF9025_16T, torque());
    bench.steps(50, |_| {});
    let motor = *bench.own.motor();
    let now = bench.now();
    let data = [0xA1, 30, 1, 0, 2, 0, 3, 0];
    for length in 0..8 {
        let id = embedded_can::StandardId::new(0x141).unwrap();
        let short = embedded_can::Frame::new(id, &data[..length]).unwrap();
        assert!(Devices::ingest(&mut bench.own, &short, now).is_malformed());
    }
    for id in [0x140, 0x142, 0x160, 0x241, 0x280, 0x141 + 0x100] {
        let foreign = CanFrame::standard(id, data).unwrap();
        assert_eq!(Devices::ingest(&mut bench.own, &foreign, now), Ingest::Unrelated);
    }
    for code in [0x00, 0x19, 0x30, 0x60, 0x90, 0x94, 0x9D, 0xA0, 0xA2, 0xA4, 0xA8, 0xB3, 0xFF] {
        let other = frame([code, 30, 1, 0, 2, 0, 3, 0]);
        assert_eq!(Devices::ingest(&mut bench.own, &other, now), Ingest::Unrelated, "{code:X}");
    }
    assert_eq!(bench.own.motor().feedback(), motor.feedback());
    assert_eq!(bench.own.motor().state(), motor.state());

    let model = Model::new("of 14 bits", Series::Mf, 1.0, 0.32, 14).unwrap();
    let mut coarse = Motor::new(model, 1, torque()).unwrap();
    assert!(coarse.decode(&frame([0xA1, 30, 0, 0, 0, 0, 0, 0x40])).is_malformed());
    assert_eq!(coarse.feedback(), None);
}

#[test]
fn turns_are_counted_over_the_ends_of_each_encoder() {
    for bits in 14..=16 {
        let model = Model::new("any", Series::Mg, 10.0, 1.0, bits).unwrap();
        let mut bench = Bench::new(model, torque());
        bench.drive = drive_of(&model).with_shaft(DriveShaft::new(0.01, 0.0));
        bench.steps(50, |_| {});
        for speed in [20.0, -35.0] {
            bench.drive.shaft_mut().set_velocity(speed);
            bench.steps(2_000, |bench| {
                let known = bench.own.angle(()).unwrap().as_radians();
                let late = speed.abs() * 2e-3;
                assert!((known - bench.drive.shaft().angle_rad()).abs() < late + 1e-3);
            });
        }
    }
}

/// Questions take the place of commands, and their answers are no feedback: none of them makes a motor late.
#[test]
fn a_motor_that_is_updated_250_times_a_second_is_never_late() {
    fn runs(mode: impl Into<Mode>, set: fn(&mut Actuator<Motor>)) {
        let mut bench = Bench::new(Model::MF9025_16T, mode);
        let mut off = 0;
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
            off += u32::from(tick > 120 && !bench.drive.is_on());
            assert!(tick < 10 || bench.own.guard().link() == Link::Online, "{tick}");
        }
        assert_eq!(off, 0);
    }
    runs(torque(), |own| own.set_torque(0.0).unwrap_or_default());
    runs(Mode::velocity(rad_s(20.0)), |own| _ = own.set_velocity((), rad_s(2.0)));
    runs(Mode::position_velocity(rad_s(8.0)), |own| _ = own.set_angle((), rad(1.0)));
}

#[test]
fn two_motors_on_a_bus_hear_their_actuator_drives_alone() {
    let motor = |id| Actuator::new(Motor::new(Model::MF9025_16T, id, torque()).unwrap());
    let mut robot = [motor(1), motor(2)];
    let mut drives = [1, 2].map(|id| drivetrain::sim::LkDrive::of(Model::MF9025_16T, id));
    for ms in 0..1_200_u64 {
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
