//! Findings of reviews. `tests/families` has the frames after the motor was told to rest, at every moment, and the fuzz target `drives`
//! drawn frames.

use super::*;

/// 0 in the field of the limit stands for none, and the share of the output is 0 right after arming.
#[test]
fn a_limit_is_never_sent_as_none() {
    for (limit, most) in [(8.0, 458), (0.05, 2)] {
        let mut bench = Bench::armed(MODEL, Mode::position_velocity(rad_s(limit)));
        let mut limits = Vec::new();
        bench.steps(600, |bench| {
            bench.own.set_angle((), rad(2.0)).unwrap();
            let data = bench.frames.iter().map(|frame| *frame.bytes());
            let commands = data.filter(|data| data[0] == 0xA4);
            limits.extend(commands.map(|data| u16::from_le_bytes([data[2], data[3]])));
        });
        assert!(limits.iter().all(|limit| (1..=most).contains(limit)), "{limits:?}");
        assert!(limits.len() > 300 && limits.contains(&most), "{limits:?}");
    }
}

/// The echo of a question reads like an angle of 0, with which a position motor would go round by all of its turns.
#[test]
fn a_question_that_is_sent_back_is_no_answer() {
    let mut bench = Bench::armed(MODEL, Mode::position_velocity(rad_s(8.0)));
    bench.drive.shaft_mut().set_angle(30.0);
    bench.steps(200, |_| {});
    _ = bench.own.arm(bench.now());
    bench.steps(500, |bench| bench.own.set_angle((), rad(30.0)).unwrap());
    let there = bench.own.angle(()).unwrap();
    let now = bench.now();
    for code in [0x92, 0x9A, 0x9C, 0xA1, 0xA4] {
        let echo = answer([code, 0, 0, 0, 0, 0, 0, 0]);
        _ = Devices::ingest(&mut bench.own, &echo, now);
        assert_eq!(bench.own.angle(()), Some(there), "{code:X}");
        assert!(bench.own.motor().state().is_some_and(|state| state.supply_v > 40.0), "{code:X}");
    }
    bench.steps(2, |bench| _ = bench.own.set_angle((), rad(30.0)));
    assert!(!Devices::is_armed(&mut bench.own), "the drive has timed out, or begun anew");
}

/// Each mode, and each command of it that could be sent back by a drive whose time is over.
#[test]
fn a_command_that_is_sent_back_is_never_feedback() {
    fn heard(mode: impl Into<Mode>, set: fn(&mut Actuator<Motor>)) {
        let mode = mode.into();
        let mut bench = Bench::armed(MODEL, mode);
        bench.steps(400, |bench| set(&mut bench.own));
        let before = *bench.own.motor().feedback().unwrap();
        let mut sent_back = 0;
        for _ in 0..40 {
            set(&mut bench.own);
            bench.now_us += 1_000;
            let now = bench.now();
            bench.own.update(Tick::new(now, 0.001));
            while let Some(sent) = bench.own.next_frame(0) {
                _ = Devices::ingest(&mut bench.own, &answer(*sent.bytes()), now);
                sent_back += 1;
            }
        }
        assert!(sent_back >= 40 && bench.own.motor().feedback() == Some(&before), "{mode:?}");
    }
    heard(torque(), |own| _ = own.set_torque(0.5));
    heard(Mode::velocity(rad_s(20.0)), |own| _ = own.set_velocity((), rad_s(6.0)));
    heard(Mode::position_velocity(rad_s(8.0)), |own| _ = own.set_angle((), rad(2.0)));
}

/// Two frames may be made before one is sent: a drive that is not known to be off is sent nothing else.
#[test]
fn off_goes_before_the_reset_and_the_lock_of_the_brake() {
    let mut motor = Motor::new(MODEL, 1, torque()).unwrap();
    let echo = |code| answer([code, 0, 0, 0, 0, 0, 0, 0]);
    let sound = answer([0x9A, 30, 0, 1, 0xE0, 1, 0, 0]);
    let confirmed = answer([0xB3, 0, 0, 0, 100, 0, 0, 0]);
    for (sent, answered) in [sound, confirmed, echo(0x77)].iter().enumerate() {
        motor.enable(u8::try_from(sent).unwrap());
        assert!(motor.decode_answer(answered));
    }
    assert_eq!(motor.is_enabled(), Some(true));
    // From before it was enabled.
    assert!(motor.decode_answer(&echo(0x80)));
    motor.reset_drive();
    let mut codes = Vec::new();
    for is_heard in [false, true, true, true, true, true] {
        let frame = motor.disable().unwrap();
        codes.push(frame.bytes()[0]);
        if is_heard && frame.bytes()[0] != 0x76 {
            assert!(motor.decode_answer(&answer(*frame.bytes())));
        }
    }
    assert_eq!(codes, [0x80, 0x80, 0x76, 0x80, 0x78, 0x80]);
}

/// A state and a confirmation from before the drive was switched off do not enable it.
#[test]
fn nothing_heard_before_enables_the_drive() {
    let mut motor = Motor::new(MODEL, 1, torque()).unwrap();
    let sound = answer([0x9A, 30, 0, 1, 0xE0, 1, 0, 0]);
    let confirmed = answer([0xB3, 0, 0, 0, 100, 0, 0, 0]);
    let released = answer([0x77, 0, 0, 0, 0, 0, 0, 0]);
    for early in [sound, confirmed, released] {
        assert!(motor.decode_answer(&early));
    }
    assert_eq!(motor.is_enabled(), Some(false));
    let mut codes = Vec::new();
    for (sent, answered) in [(0, &sound), (1, &released)] {
        codes.push(motor.enable(sent).unwrap().bytes()[0]);
        assert_eq!(motor.is_enabled(), Some(false));
        assert!(motor.decode_answer(answered));
    }
    // The time-out is in the memory of the drive already.
    assert_eq!(codes, [0x9A, 0x77]);
    assert_eq!(motor.is_enabled(), Some(true));
    // Late feedback forgets the settings, and is no reset.
    motor.forget_settings();
    assert_eq!(motor.is_enabled(), Some(true));
    motor.disable();
    assert_eq!(motor.is_enabled(), Some(false));
}

#[test]
fn a_time_out_that_the_driver_gives_back_is_written_when_the_driver_takes_it() {
    let mut bench = Bench::armed(MODEL, torque());
    bench.refused = Some(0xB3);
    bench.steps(400, |bench| {
        _ = bench.own.set_torque(1.0);
        assert!(bench.drive.shaft().torque_nm().abs() < 1e-9);
    });
    assert_eq!((bench.drive.timeout_ms(), bench.own.motor().wrong_setting()), (0, None));
    bench.refused = None;
    bench.steps(400, |bench| _ = bench.own.set_torque(1.0));
    assert_eq!(bench.drive.timeout_ms(), 100);
    assert!(bench.drive.shaft().torque_nm() > 0.9);
}

#[test]
fn a_reset_that_the_driver_gives_back_is_sent_again() {
    let mut bench = Bench::new(MODEL, torque());
    bench.steps(100, |_| {});
    bench.own.motor_mut().reset_drive();
    bench.refused = Some(0x76);
    let mut resets = 0;
    let mut count = |bench: &mut Bench| {
        resets += bench.frames.iter().filter(|frame| frame.bytes()[0] == 0x76).count();
    };
    bench.steps(500, &mut count);
    bench.refused = None;
    bench.steps(500, &mut count);
    bench.steps(500, |bench| {
        assert!(bench.frames.iter().all(|frame| frame.bytes()[0] != 0x76));
    });
    assert!(resets > 3, "{resets}");
}
