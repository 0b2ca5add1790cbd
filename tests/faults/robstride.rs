//! F85 to F88: drives whose run mode, angle and faults come apart from their feedback, by the example of RobStride's.

use crate::bench as damiao;
use crate::case::{Case, cases, drives, saw};
use crate::robstride_bench as robstride;
use drivetrain::motor::{AngleDrive, ArmError, Devices, Impedance, ImpedanceControl};
use drivetrain::robstride::{Mode, Model};
use drivetrain::sim::RobStrideDrive;
use drivetrain::units::{Angle, AngularVelocity};

/// The cases of this file.
pub(crate) const CASES: &[Case] = cases![
    f85_a_drive_that_forgets_its_run_mode_gets_it_before_arming_and_is_refused_if_it_does_not_take_it,
    f86_beyond_the_range_of_the_feedback_there_is_no_angle_and_no_command_that_needs_one,
    f87_a_fault_that_only_a_report_tells_trips_and_is_cleared,
    f88_a_drive_is_enabled_without_current_and_does_not_go_on_to_its_old_target,
];

#[cfg_attr(test, test)]
fn f85_a_drive_that_forgets_its_run_mode_gets_it_before_arming_and_is_refused_if_it_does_not_take_it()
 {
    let slow = AngularVelocity::from_rad_per_s(10.0);
    let mut bench = robstride::Bench::new(Mode::velocity(slow, 8.0));
    drives(&bench.own);
    for _ in 0..2 {
        bench.steps(150, |_| {});
        assert_eq!(bench.drive.parameter(0x7005), Some(2.0));
        assert_eq!(bench.own.arm(bench.now()), Ok(()));
        Devices::disarm(&mut bench.own);
        bench.drive.lose_supply();
        assert_eq!(bench.drive.parameter(0x7005), Some(0.0));
    }
    let mut old = robstride::Bench::new(Mode::position(slow, 8.0));
    old.drive = RobStrideDrive::of(Model::CYBERGEAR, 1);
    old.steps(300, |_| {});
    let refused = old.own.arm(old.now()).unwrap_err();
    assert!(matches!(refused, ArmError::Setting(_)), "{refused}");
    assert!(refused.to_string().contains("run_mode 0, the program needs 5"), "{refused}");
    saw(format_args!("{refused}"));
}

#[cfg_attr(test, test)]
fn f86_beyond_the_range_of_the_feedback_there_is_no_angle_and_no_command_that_needs_one() {
    for model in [Model::RS02, Model::CYBERGEAR] {
        let spring = ImpedanceControl::new(3.0).unwrap();
        let mut bench = robstride::Bench::of(model, spring);
        drives(&bench.own);
        bench.drive.shaft_mut().set_angle(12.4);
        bench.steps(150, |_| {});
        bench.own.arm(bench.now()).unwrap();
        let angle = Angle::from_radians(12.4);
        let hold = Impedance { angle, stiffness: 20.0, damping: 0.5, ..Impedance::FREE };
        bench.steps(400, |bench| _ = bench.own.set_impedance(hold));
        assert!(bench.drive.is_enabled());
        // Somebody turns it on by hand.
        for step in 0_u16..100 {
            bench.drive.shaft_mut().set_angle(12.4 + 0.01 * f32::from(step));
            _ = bench.own.set_impedance(hold);
            bench.step();
            let is_beyond = bench.drive.shaft().angle_rad() > 12.6;
            assert!(!is_beyond || bench.own.angle(()).is_none(), "{step}");
            assert!(!is_beyond || bench.drive.shaft().torque_nm().abs() < 0.001, "{step}");
        }
        assert_eq!(bench.own.angle(()), None);
    }
    let mut bench = damiao::Bench::new(ImpedanceControl::new(3.0).unwrap(), 1.0);
    drives(&bench.own);
    bench.drive.shaft_mut().set_angle(12.3);
    bench.steps(150, |_| {});
    bench.own.arm(bench.now()).unwrap();
    let angle = Angle::from_radians(12.3);
    let hold = Impedance { angle, stiffness: 20.0, damping: 0.5, ..Impedance::FREE };
    bench.steps(400, |bench| _ = bench.own.set_impedance(hold));
    assert!(bench.drive.is_enabled() && bench.own.angle(()).is_some());
    for step in 0_u16..100 {
        bench.drive.shaft_mut().set_angle(12.3 + 0.01 * f32::from(step));
        _ = bench.own.set_impedance(hold);
        bench.step();
        let is_beyond = bench.drive.shaft().angle_rad() > 12.52;
        assert!(!is_beyond || bench.own.angle(()).is_none(), "{step}");
        assert!(!is_beyond || bench.drive.shaft().torque_nm().abs() < 0.003, "{step}");
    }
    assert_eq!(bench.own.angle(()), None);
    saw("rest from the first feedback beyond 12.57 rad, of Damiao 12.5 rad");
}

#[cfg_attr(test, test)]
fn f87_a_fault_that_only_a_report_tells_trips_and_is_cleared() {
    let mut bench = robstride::Bench::armed(robstride::operation());
    drives(&bench.own);
    bench.steps(300, |bench| _ = bench.own.set_torque(0.5));
    // Over-voltage, and the drive goes on.
    let mut failed = bench.drive;
    failed.fail(1 << 3);
    let now = bench.now();
    _ = Devices::ingest(&mut bench.own, &failed.report(), now);
    bench.step();
    assert_eq!(bench.own.health().error_code, 35);
    bench.steps(3, |bench| assert!(!bench.drive.is_enabled()));
    assert!(!Devices::is_armed(&mut bench.own));
    assert!(matches!(bench.own.arm(bench.now()), Err(ArmError::Faulty(_))));
    bench.steps(200, |_| {});
    assert_eq!(bench.own.motor().reported_faults(), 0);
    assert_eq!(bench.own.arm(bench.now()), Ok(()));
    saw("tripped with code 35, 32 and the bit of over-voltage");
}

#[cfg_attr(test, test)]
fn f88_a_drive_is_enabled_without_current_and_does_not_go_on_to_its_old_target() {
    for model in [Model::RS02, Model::CYBERGEAR] {
        let mode = Mode::position(AngularVelocity::from_rad_per_s(10.0), 8.0);
        let mut bench = robstride::Bench::of(model, mode);
        drives(&bench.own);
        bench.drive.shaft_mut().set_angle(3.0);
        bench.steps(150, |_| {});
        bench.own.arm(bench.now()).unwrap();
        bench.steps(400, |bench| {
            _ = bench.own.set_angle((), Angle::from_radians(3.0));
            assert!((bench.drive.shaft().angle_rad() - 3.0).abs() < 0.01);
        });
        assert!(bench.drive.is_enabled() && bench.drive.parameter(0x7018) == Some(8.0));
    }
    saw("the shaft moved less than 0.01 rad, its old target was 3 rad away");
}
