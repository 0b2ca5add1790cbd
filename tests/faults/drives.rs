//! F72 to F74: drives that are set up, enabled and watched by frames, by the example of Damiao's.

use crate::bench::{Bench, mit};
use crate::case::{Case, cases, saw};
use drivetrain::damiao::{Register, Status};
use drivetrain::motor::{ArmError, CanDevice, Devices, VelocityDrive};
use drivetrain::units::AngularVelocity;

/// The cases of this file.
pub(crate) const CASES: &[Case] = cases![
    f72_a_drive_in_another_mode_or_with_other_ranges_is_not_armed_and_the_register_is_named,
    f73_the_drive_stops_by_itself_when_the_cable_is_cut_and_is_told_so_each_time,
    f74_an_error_of_the_drive_trips_and_is_cleared_and_does_not_come_back_by_itself,
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
    let drive = |bench: &mut Bench<_>| {
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
    let drive = |bench: &mut Bench<_>| {
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
