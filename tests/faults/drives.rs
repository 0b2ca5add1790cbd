//! F72 to F80: drives that are set up, enabled and watched by frames, of several families.

use crate::bench::{Bench, mit};
use crate::case::{Case, cases, drives, saw};
use crate::lk_bench;
use crate::vesc_bench::{self, drive, looped};
use drivetrain::damiao::{Register, Status};
use drivetrain::lk;
use drivetrain::motor::{AngleDrive, ArmError, CanDevice, Devices, Link, VelocityDrive};
use drivetrain::units::{Angle, AngularVelocity};
use drivetrain::vesc::Mode;

/// The cases of this file.
pub(crate) const CASES: &[Case] = cases![
    f72_a_drive_in_another_mode_or_with_other_ranges_is_not_armed_and_the_register_is_named,
    f73_the_drive_stops_by_itself_when_the_cable_is_cut_and_is_told_so_each_time,
    f74_an_error_of_the_drive_trips_and_is_cleared_and_does_not_come_back_by_itself,
    f75_a_drive_that_forgets_its_turns_does_not_unwind_them,
    f76_an_echo_or_a_command_that_is_read_back_is_no_feedback,
    f77_an_error_that_no_feedback_tells_is_asked_for_while_the_motor_drives,
    f78_a_fault_that_no_status_frame_tells_is_asked_for_and_trips,
    f79_a_lost_angle_frame_is_lost_feedback_although_the_motion_goes_on,
    f80_a_count_of_turns_that_wraps_or_begins_anew_moves_nothing,
];

#[cfg_attr(test, test)]
fn f72_a_drive_in_another_mode_or_with_other_ranges_is_not_armed_and_the_register_is_named() {
    for (number, value, text) in [
        (10, 2.0, "CTRL_MODE 2, the program needs 1"),
        (21, 12.566, "PMAX 12.566, the program needs 12.5"),
        (22, 45.0, "VMAX 45, the program needs 30"),
        (23, 20.0, "TMAX 20, the program needs 10"),
    ] {
        let mut bench = Bench::new(mit(), 1.0);
        bench.drive = bench.drive.with_register(number, value);
        bench.steps(100, |_| {});
        let refused = bench.own.arm(bench.now()).unwrap_err();
        assert!(
            matches!(refused, ArmError::Setting(_)) && refused.to_string().contains(text),
            "{refused}"
        );
        // The one who arms it all the same is refused too.
        let now = bench.now();
        CanDevice::engage(&mut bench.own, now);
        assert!(!Devices::is_armed(&mut bench.own));
        // Written, it is armed.
        let right =
            [1.0, 12.5, 30.0, 10.0][[10, 21, 22, 23].iter().position(|it| *it == number).unwrap()];
        let register = [
            Register::ControlMode,
            Register::PositionRange,
            Register::VelocityRange,
            Register::TorqueRange,
        ];
        let register = register.into_iter().find(|it| it.number() == number).unwrap();
        bench.own.motor_mut().write(register, right).unwrap();
        bench.steps(150, |_| {});
        assert_eq!(bench.own.motor().register(), Some((register, right)));
        assert_eq!(bench.own.arm(bench.now()), Ok(()), "{register:?}");
        saw(format_args!("{refused}"));
    }
}

#[cfg_attr(test, test)]
fn f73_the_drive_stops_by_itself_when_the_cable_is_cut_and_is_told_so_each_time() {
    let mut bench = Bench::armed(mit(), 1.0);
    let drive = |bench: &mut Bench| {
        _ = bench.own.set_velocity((), AngularVelocity::from_rad_per_s(6.0));
    };
    bench.steps(500, drive);
    assert!(bench.drive.is_enabled());
    bench.is_cut = true;
    bench.steps(95, drive);
    assert!(bench.drive.is_enabled(), "the time-out is 100 ms");
    bench.steps(10, drive);
    assert!(!bench.drive.is_enabled() && bench.drive.error() == Status::CommunicationLost as u8);
    saw("disabled by itself 96 to 105 ms after the last frame");
    // Its supply fails too, so it forgets the time-out. Back on the bus, arming writes it anew.
    bench.drive.lose_supply();
    bench.is_cut = false;
    bench.steps(300, |_| {});
    bench.own.arm(bench.now()).unwrap();
    bench.steps(300, drive);
    assert!(bench.drive.is_enabled());
    bench.is_cut = true;
    bench.steps(110, drive);
    assert!(!bench.drive.is_enabled());
}

#[cfg_attr(test, test)]
fn f74_an_error_of_the_drive_trips_and_is_cleared_and_does_not_come_back_by_itself() {
    let mut bench = Bench::armed(mit(), 1.0);
    let drive = |bench: &mut Bench| {
        _ = bench.own.set_velocity((), AngularVelocity::from_rad_per_s(6.0));
    };
    bench.steps(300, drive);
    bench.drive.fail(Status::Overload as u8);
    bench.steps(300, drive);
    assert!(!bench.drive.is_enabled() && bench.drive.error() == 0, "cleared, and still disabled");
    assert!(!Devices::is_armed(&mut bench.own));
    saw("cleared, disabled and disarmed");
    bench.steps(150, |_| {});
    assert_eq!(bench.own.arm(bench.now()), Ok(()));
    bench.steps(300, drive);
    assert!(bench.drive.is_enabled());
}

#[cfg_attr(test, test)]
fn f75_a_drive_that_forgets_its_turns_does_not_unwind_them() {
    // Two turns and two thirds, by a third each.
    let turned = || {
        let mode = lk::Mode::position_velocity(AngularVelocity::from_rad_per_s(8.0));
        let mut bench = lk_bench::Bench::armed(lk::Model::MF9025_16T, mode);
        for third in 1..=8_u8 {
            let target = Angle::from_turns(f32::from(third) / 3.0);
            bench.steps(1_000, |bench| bench.own.set_angle((), target).unwrap());
        }
        bench
    };
    let there = Angle::from_turns(8.0 / 3.0);
    // Off and on again: the drive begins to count anew.
    let mut bench = turned();
    let before = bench.drive.shaft().angle_rad();
    bench.steps(300, |_| {});
    assert!(!bench.drive.is_on());
    bench.steps(300, |bench| {
        bench.own.set_angle((), there).unwrap();
        assert!((bench.drive.shaft().angle_rad() - before).abs() < 0.02);
    });
    assert!(bench.drive.is_on());
    saw("off and on again: it stays");
    // It loses its supply while it holds, and is on at once.
    let mut bench = turned();
    bench.drive.lose_supply();
    let mut after = None;
    for ms in 0..100 {
        _ = bench.own.set_angle((), there);
        bench.step();
        if after.is_none() && !bench.drive.is_on() {
            after = Some(ms);
        }
    }
    let moved = (bench.drive.shaft().angle_rad() - before).abs();
    assert!(
        after.is_some_and(|ms| ms <= 34) && moved < 1.0,
        "{after:?} ms, {moved} rad with the way of a shaft that coasts"
    );
    assert!(!Devices::is_armed(&mut bench.own));
    saw(format_args!("reset: off after {after:?} ms, having moved {moved:.2} rad of 16.8"));
}

#[cfg_attr(test, test)]
fn f76_an_echo_or_a_command_that_is_read_back_is_no_feedback() {
    let mut bench = lk_bench::Bench::armed(lk::Model::MF9025_16T, lk_bench::torque());
    bench.steps(300, |bench| bench.own.set_torque(0.5).unwrap());
    let (feedback, mut heard) = (*bench.own.motor().feedback().unwrap(), 0);
    for _ in 0..150 {
        _ = bench.own.set_torque(0.5);
        bench.now_us += 1_000;
        let now = bench.now();
        Devices::update(&mut bench.own, drivetrain::time::Tick::new(now, 0.001));
        while let Some(sent) = Devices::next_frame(&mut bench.own, 0) {
            // "Off", "run" and "stop" are echoed, all others come back as they were sent.
            for code in [sent.bytes()[0], 0x80, 0x88, 0x81] {
                let mut data = *sent.bytes();
                data[0] = code;
                let back = drivetrain::frame::CanFrame::standard(0x141, data).unwrap();
                _ = Devices::ingest(&mut bench.own, &back, now);
                heard += 1;
            }
        }
    }
    assert_eq!(bench.own.motor().feedback(), Some(&feedback));
    assert_eq!(bench.own.guard().link(), Link::Offline);
    let refused = bench.own.arm(bench.now());
    assert!(refused.is_err());
    saw(format_args!("{heard} frames on the id of the feedback, none of them taken for it"));
}

#[cfg_attr(test, test)]
fn f77_an_error_that_no_feedback_tells_is_asked_for_while_the_motor_drives() {
    let mut bench = lk_bench::Bench::armed(lk::Model::MG5010E_I10, lk_bench::torque());
    drives(&bench.own);
    let drive = |bench: &mut lk_bench::Bench| {
        _ = bench.own.set_velocity((), AngularVelocity::from_rad_per_s(3.0));
    };
    bench.steps(300, drive);
    bench.drive.fail(0b1000);
    let mut after = 0;
    while Devices::is_armed(&mut bench.own) {
        bench.steps(1, drive);
        after += 1;
        assert!(after <= 34);
    }
    bench.steps(300, drive);
    assert!(!bench.drive.is_on() && bench.drive.errors() == 0, "off, and then cleared");
    assert!(!Devices::is_armed(&mut bench.own));
    saw(format_args!("disarmed {after} ms after the error"));
    bench.steps(150, |_| {});
    assert_eq!(bench.own.arm(bench.now()), Ok(()));
}

#[cfg_attr(test, test)]
fn f78_a_fault_that_no_status_frame_tells_is_asked_for_and_trips() {
    let mut bench = vesc_bench::Bench::armed(Mode::velocity());
    drives(&bench.own);
    let wheel = AngularVelocity::from_rad_per_s(60.0);
    bench.steps(500, |bench| bench.own.set_velocity((), wheel).unwrap());
    bench.drive.fail(4);
    let mut asked = 0;
    while Devices::is_armed(&mut bench.own) && asked < 100 {
        _ = bench.own.set_velocity((), wheel);
        bench.step();
        asked += 1;
    }
    assert!(asked <= 52, "{asked} ms");
    assert_eq!(bench.own.health().error_code, 4);
    saw(format_args!("tripped with code 4 after {asked} ms"));
    // The drive follows commands again after half a second. It gets none, until the program arms it as a gesture.
    bench.steps(1_000, |bench| {
        assert!(bench.own.set_velocity((), wheel).is_err());
        assert!(bench.drive.shaft().torque_nm() == 0.0);
    });
    assert_eq!(bench.own.arm(bench.now()), Ok(()));
}

#[cfg_attr(test, test)]
fn f79_a_lost_angle_frame_is_lost_feedback_although_the_motion_goes_on() {
    let mut bench = vesc_bench::Bench::armed(looped());
    drives(&bench.own);
    let turn = |bench: &mut vesc_bench::Bench| {
        _ = bench.own.set_angle((), Angle::from_radians(3.0));
    };
    bench.steps(150, turn);
    assert!(bench.drive.shaft().velocity_rad_per_s() > 1.0, "on its way");
    bench.reports.retain(|packet| *packet != 27);
    bench.steps(12, turn);
    bench.steps(150, |bench| {
        turn(bench);
        assert!(bench.drive.shaft().torque_nm() == 0.0);
    });
    assert!(!Devices::is_armed(&mut bench.own) && bench.own.angle(()).is_none());
    saw("at rest within 12 ms after the last status 5, with status 1 at 1 kHz");
}

#[cfg_attr(test, test)]
fn f80_a_count_of_turns_that_wraps_or_begins_anew_moves_nothing() {
    let mut bench = vesc_bench::Bench::new(looped());
    drives(&bench.own);
    bench.drive = drive(23);
    bench.drive.set_tachometer(i32::MAX);
    bench.arm();
    let here = bench.own.angle(()).unwrap();
    bench.drive.shaft_mut().set_angle(0.2); // past the end of the count
    bench.steps(500, |bench| {
        bench.own.set_angle((), here).unwrap();
        assert!(bench.drive.shaft().angle_rad().abs() < 0.5);
    });
    // A restart takes the drive more than 100 ms.
    bench.is_cut = true;
    bench.drive.lose_supply();
    bench.steps(110, |_| {});
    bench.is_cut = false;
    bench.steps(300, |bench| {
        assert!(bench.own.set_angle((), here).is_err());
        assert!(bench.drive.shaft().torque_nm() == 0.0);
    });
    saw("one turn of the count of 2^32 steps, and one restart");
}
