//! Findings of reviews. `tests/families` has the frames after the motor was told to rest, at every moment, and the fuzz target `drives`
//! drawn frames.

use super::*;
use drivetrain::motor::Claim;

/// A second drive with the same id, or a motor attached twice, is a clash.
#[test]
fn both_directions_on_one_id_clash_with_each_other_motor_on_it() {
    let claims = |name: &'static str| -> Vec<Claim> {
        let model = Model::new(name, Series::Mf, 1.0, 0.3, 16).unwrap();
        Motor::new(model, 1, torque()).unwrap().claims().into_iter().collect()
    };
    let (one, other) = (claims("one"), claims("other"));
    assert!(!one[0].clashes_with(&one[1]));
    for (one, other) in one.iter().flat_map(|one| other.iter().map(move |other| (one, other))) {
        assert!(one.clashes_with(other));
    }
}

/// 0 in the field of a limit stands for none with some drives, and the share of the output is 0 right after arming.
#[test]
fn a_limit_is_never_sent_as_none() {
    fn limits(mode: impl Into<Mode>, set: fn(&mut Actuator<Motor>), code: u8) -> Vec<u16> {
        let mut bench = Bench::armed(Model::MF9025_16T, mode);
        let mut limits = Vec::new();
        bench.steps(400, |bench| {
            set(&mut bench.own);
            let data = bench.frames.iter().map(|frame| *frame.bytes());
            let commands = data.filter(|data| data[0] == code);
            limits.extend(commands.map(|data| u16::from_le_bytes([data[2], data[3]])));
        });
        limits
    }
    let velocity = Mode::velocity_with_torque_limit(rad_s(20.0), 2.0);
    let position = Mode::position_velocity(rad_s(8.0));
    let weak = Mode::velocity_with_torque_limit(rad_s(20.0), 0.006);
    let slow = Mode::position_velocity(rad_s(0.05));
    for (limits, most) in [
        (limits(weak, |own| _ = own.set_velocity((), rad_s(6.0)), 0xA2), 2),
        (limits(slow, |own| _ = own.set_angle((), rad(2.0)), 0xA4), 2),
        (limits(velocity, |own| _ = own.set_velocity((), rad_s(6.0)), 0xA2), 775),
        (limits(position, |own| _ = own.set_angle((), rad(2.0)), 0xA4), 458),
    ] {
        assert!(limits.iter().all(|limit| (1..=most).contains(limit)), "{limits:?}");
        assert!(limits.len() > 300 && limits.contains(&most), "{limits:?}");
    }
}

#[test]
fn a_question_for_the_state_that_is_read_back_is_no_state() {
    let mut motor = Motor::new(Model::MF9025_16T, 1, torque()).unwrap();
    for code in [0x9A, 0x9B] {
        assert!(!motor.decode_answer(&frame([code, 0, 0, 0, 0, 0, 0, 0])));
    }
    assert!(motor.state().is_none() && motor.is_enabled() == Some(false));
}

/// An answer that is older than the frame that switched the drive off.
#[test]
fn a_drive_that_was_on_before_is_switched_on_and_asked_again() {
    let mut motor = Motor::new(Model::MF9025_16T, 1, torque()).unwrap();
    motor.disable();
    assert!(motor.decode_answer(&frame([0x9A, 30, 0x60, 0x09, 0, 0, 0, 0])));
    assert_eq!(motor.is_enabled(), Some(true));
    let run = motor.enable(0).unwrap();
    assert_eq!((run.bytes()[0], motor.is_enabled()), (0x88, Some(false)));
    assert_eq!(motor.enable(1).unwrap().bytes()[0], 0x9A);
}

/// The question that enabled the drive and the one that takes the place of a command have the same bytes.
#[test]
fn a_question_that_the_bus_gives_back_while_driving_opens_nothing_anew() {
    let mut bench = Bench::armed(Model::MF9025_16T, torque());
    bench.steps(400, |bench| _ = bench.own.set_torque(1.0));
    let mut given_back = 0;
    for _ in 0..100 {
        _ = bench.own.set_torque(1.0);
        bench.now_us += 1_000;
        let now = bench.now();
        bench.own.update(Tick::new(now, 0.001));
        while let Some(frame) = bench.own.next_frame(0) {
            if frame.bytes()[0] == 0xA1 {
                let counts = i16::from_le_bytes([frame.bytes()[4], frame.bytes()[5]]);
                assert!(counts > 380, "{counts} of 387 after {given_back} questions");
                let answer = bench.drive.hear(&frame).unwrap();
                _ = Devices::ingest(&mut bench.own, &answer, now);
            } else {
                given_back += 1;
                assert!(Devices::requeue(&mut bench.own, &frame));
            }
        }
    }
    assert!(given_back > 2, "{given_back}");
}

/// A drive with an error that can be cleared goes on turning until it is off.
#[test]
fn off_goes_before_an_error_is_cleared_also_when_the_driver_gave_it_back() {
    let mut motor = Motor::new(Model::MF9025_16T, 1, torque()).unwrap();
    assert!(motor.decode_answer(&frame([0x9A, 30, 0x60, 0x09, 0, 0, 0, 8])));
    for _ in 0..5 {
        let off = motor.disable().unwrap();
        assert_eq!(off.bytes()[0], 0x80);
        motor.unsent(&off);
    }
    let sent = [motor.disable(), motor.disable(), motor.disable()];
    assert_eq!(sent.map(|frame| frame.unwrap().bytes()[0]), [0x80, 0x9B, 0x80]);
}
