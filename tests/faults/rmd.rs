//! F89 to F91: drives whose time-out, echoes and holding brake are their own, by the example of MyActuator's.

use crate::bench as damiao;
use crate::case::{Case, cases, drives, saw};
use crate::rmd_bench::{Bench, torque};
use crate::robstride_bench as robstride;
use drivetrain::frame::CanFrame;
use drivetrain::motor::{Actuator, Devices, ImpedanceControl, VelocityDrive};
use drivetrain::rmd::{Mode, Model};
use drivetrain::time::Tick;
use drivetrain::units::AngularVelocity;

/// The cases of this file.
pub(crate) const CASES: &[Case] = cases![
    f89_a_command_that_a_drive_sends_back_after_its_timeout_is_no_feedback_and_trips,
    f90_a_drive_that_does_not_confirm_its_timeout_is_not_driven,
    f91_no_torque_is_sent_against_a_holding_brake,
];

fn rad_s(value: f32) -> AngularVelocity {
    AngularVelocity::from_rad_per_s(value)
}

#[cfg_attr(test, test)]
fn f89_a_command_that_a_drive_sends_back_after_its_timeout_is_no_feedback_and_trips() {
    let mut bench = Bench::armed(Model::X8_120, Mode::velocity(rad_s(20.0)));
    drives(&bench.own);
    bench.steps(500, |bench| bench.own.set_velocity((), rad_s(6.0)).unwrap());
    let before = *bench.own.motor().feedback().unwrap();
    bench.own.set_velocity((), rad_s(6.0)).unwrap();
    bench.now_us += 1_000;
    let now = bench.now();
    Devices::update(&mut bench.own, Tick::new(now, 0.001));
    while let Some(sent) = Devices::next_frame(&mut bench.own, 0) {
        let back = CanFrame::standard(0x241, *sent.bytes()).unwrap();
        _ = Devices::ingest(&mut bench.own, &back, now);
    }
    assert_eq!(bench.own.motor().feedback(), Some(&before));
    let mut after_ms = 0;
    while Devices::is_armed(&mut bench.own) {
        _ = bench.own.set_velocity((), rad_s(6.0));
        bench.step();
        after_ms += 1;
        assert!(after_ms <= 3);
    }
    bench.steps(300, |bench| {
        assert!(bench.own.set_velocity((), rad_s(6.0)).is_err());
        assert!(bench.drive.shaft().torque_nm() == 0.0);
    });
    saw(format_args!("tripped {after_ms} ms after the echo"));
}

#[cfg_attr(test, test)]
fn f90_a_drive_that_does_not_confirm_its_timeout_is_not_driven() {
    let mut bench = Bench::new(Model::X8_120, Mode::velocity(rad_s(20.0)));
    drives(&bench.own);
    bench.drive = bench.drive.refusing_timeouts();
    bench.steps(100, |_| {});
    bench.own.arm(bench.now()).unwrap();
    bench.steps(500, |bench| {
        _ = bench.own.set_velocity((), rad_s(6.0));
        assert!(bench.drive.shaft().torque_nm() == 0.0);
    });
    assert!(!Devices::is_armed(&mut bench.own));
    let refused = bench.own.arm(bench.now()).unwrap_err().to_string();
    assert!(refused.contains("CanRecvTime_MS 0, the program needs 100"), "{refused}");
    saw(refused);
    // It is the program that may do without.
    bench.own = Actuator::new(bench.own.motor().without_timeout());
    bench.steps(100, |_| {});
    bench.own.arm(bench.now()).unwrap();
    bench.steps(500, |bench| bench.own.set_velocity((), rad_s(6.0)).unwrap());
    assert!(bench.drive.shaft().velocity_rad_per_s() > 5.5);
    unconfirmed_by_damiao();
    unconfirmed_by_robstride();
}

type Passes = fn(&CanFrame) -> bool;

/// Each of the drives has its settings read before arming, and is silent on the way to be enabled.
fn unconfirmed_by_damiao() {
    let drive = |bench: &mut damiao::Bench| _ = bench.own.set_velocity((), rad_s(6.0));
    let cases: [(Passes, &str); 3] = [
        (|it| it.header() != 0x7FF || it.bytes()[3] != 9, "does not report its TIMEOUT"),
        (|it| it.header() != 0x7FF || it.bytes()[2..4] != [0x55, 9], "has TIMEOUT 0"),
        (|it| it.header() != 0x7FF || it.bytes()[3] != 10, "does not report its CTRL_MODE"),
    ];
    for (passes, text) in cases {
        let mut bench = damiao::Bench::armed(damiao::mit(), 1.0);
        drives(&bench.own);
        if text.contains("CTRL_MODE") {
            bench.steps(300, drive);
        }
        bench.passes = passes;
        bench.steps(300, |_| {});
        let mut asked = 0;
        bench.steps(300, |bench| {
            drive(bench);
            let is_armed = Devices::is_armed(&mut bench.own);
            asked += u32::from(is_armed && bench.frames.iter().any(|it| it.header() == 0x7FF));
            assert!(!bench.drive.is_enabled());
        });
        assert!((8..=12).contains(&asked) && !Devices::is_armed(&mut bench.own), "{asked}");
        let refused = bench.own.arm(bench.now()).unwrap_err().to_string();
        assert!(refused.contains(text) && refused.contains(", the program needs "), "{refused}");
        saw(refused);
        bench.passes = |_| true;
        bench.steps(150, |_| {});
        assert_eq!(bench.own.arm(bench.now()), Ok(()), "{text}");
        bench.steps(300, drive);
        assert!(bench.drive.is_enabled(), "{text}");
    }
}

fn unconfirmed_by_robstride() {
    let drive = |bench: &mut robstride::Bench| _ = bench.own.set_velocity((), rad_s(6.0));
    let cases: [(Passes, &str); 3] = [
        (|it| it.bytes()[..2] != [0x28, 0x70], "does not report its canTimeout"),
        (
            |it| it.header() >> 24 & 0x1F != 18 || it.bytes()[..2] != [0x28, 0x70],
            "has canTimeout 0",
        ),
        (|it| it.bytes()[..2] != [0x0B, 0x70], "does not report its limit_torque"),
    ];
    for (passes, text) in cases {
        let mode = ImpedanceControl::new(3.0).unwrap().with_gains(20.0, 0.6).unwrap();
        let mut bench = robstride::Bench::armed(mode);
        drives(&bench.own);
        bench.passes = passes;
        bench.steps(300, |bench| {
            drive(bench);
            assert!(!bench.drive.is_enabled());
        });
        assert!(!Devices::is_armed(&mut bench.own), "{text}");
        let refused = bench.own.arm(bench.now()).unwrap_err().to_string();
        assert!(refused.contains(text) && refused.contains(", the program needs "), "{refused}");
        saw(refused);
        bench.passes = |_| true;
        bench.steps(150, |_| {});
        assert_eq!(bench.own.arm(bench.now()), Ok(()), "{text}");
        bench.steps(300, drive);
        assert!(bench.drive.is_enabled(), "{text}");
    }
}

#[cfg_attr(test, test)]
fn f91_no_torque_is_sent_against_a_holding_brake() {
    let mut bench = Bench::new(Model::X8_120, torque());
    drives(&bench.own);
    bench.drive = bench.drive.with_brake();
    bench.steps(100, |_| {});
    bench.own.arm(bench.now()).unwrap();
    let mut opened_ms = None;
    for ms in 0..500 {
        bench.own.set_torque(2.0).unwrap();
        bench.step();
        assert!(bench.drive.shaft().torque_nm() == 0.0 || !bench.drive.is_locked(), "{ms} ms");
        if opened_ms.is_none() && !bench.drive.is_locked() {
            opened_ms = Some(ms);
        }
    }
    assert!((bench.drive.shaft().torque_nm() - 2.0).abs() < 0.03);
    bench.own.disarm();
    bench.steps(3, |_| {});
    assert!(bench.drive.is_locked());
    saw(format_args!("driven when the brake was open, {opened_ms:?} ms after the first target"));
}
