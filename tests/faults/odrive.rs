//! F81 to F84: drives whose state comes apart from their feedback, by the example of ODrive's.

use crate::axle::{Bench, torque};
use crate::case::{Case, cases, drives, saw};
use drivetrain::motor::{Devices, DriveProtocol, VelocityDrive};
use drivetrain::odrive::{Firmware, Heartbeat, Mode};
use drivetrain::units::AngularVelocity;

/// The cases of this file.
pub(crate) const CASES: &[Case] = cases![
    f81_estimates_that_stop_beside_a_heartbeat_rest_the_motor_and_a_heartbeat_that_stops_trips_it,
    f82_a_refused_closed_loop_is_a_fault_with_its_reason_and_requested_once,
    f83_an_axis_that_runs_in_another_mode_is_idle_before_it_is_set_up,
    f84_the_watchdog_of_the_drive_stops_it_and_its_error_is_cleared_by_the_program_alone,
];

fn drive(bench: &mut Bench) {
    _ = bench.own.set_velocity((), AngularVelocity::from_rad_per_s(5.0));
}

#[cfg_attr(test, test)]
fn f81_estimates_that_stop_beside_a_heartbeat_rest_the_motor_and_a_heartbeat_that_stops_trips_it() {
    for firmware in [Firmware::V0_5, Firmware::V0_6] {
        let mut bench = Bench::armed(torque(), firmware);
        drives(&bench.own);
        bench.drive = bench.drive.with_periods(0.002, 0.002);
        bench.steps(400, |bench| bench.own.set_torque(1.0).unwrap());
        assert!(bench.drive.shaft().torque_nm() > 0.99);
        bench.lost = Some(0x09);
        bench.steps(12, |bench| _ = bench.own.set_torque(1.0));
        bench.steps(100, |bench| {
            _ = bench.own.set_torque(1.0);
            assert!(bench.drive.shaft().torque_nm() == 0.0);
        });
        assert!(bench.own.motor().heartbeat().is_some());
        saw("0 Nm 12 ms after the last estimates, with a heartbeat each 2 ms");
    }
    let mut bench = Bench::armed(Mode::velocity(3.0), Firmware::V0_5);
    bench.steps(400, drive);
    bench.lost = Some(0x01);
    bench.steps(510, drive);
    assert!(bench.drive.state() == Heartbeat::IDLE && !Devices::is_armed(&mut bench.own));
    saw("idle and disarmed 510 ms after the last heartbeat");
}

#[cfg_attr(test, test)]
fn f82_a_refused_closed_loop_is_a_fault_with_its_reason_and_requested_once() {
    let mut bench = Bench::armed(Mode::velocity(3.0), Firmware::V0_6);
    drives(&bench.own);
    bench.drive.refuse(14);
    let (mut codes, mut requests) = (Vec::new(), 0);
    bench.steps(900, |bench| {
        drive(bench);
        codes.push(bench.own.motor().vitals().error_code);
        let is_request = |data: &[u8]| bench.has_sent(0x07) && data == [8, 0, 0, 0];
        requests += bench.frames.iter().filter(|frame| is_request(&frame.bytes()[..4])).count();
    });
    assert!(codes.contains(&78) && requests == 1, "{requests}");
    assert!(!Devices::is_armed(&mut bench.own) && bench.drive.state() == Heartbeat::IDLE);
    saw("error code 78 and disarmed");
}

#[cfg_attr(test, test)]
fn f83_an_axis_that_runs_in_another_mode_is_idle_before_it_is_set_up() {
    let mut bench = Bench::new(torque(), Firmware::V0_6);
    drives(&bench.own);
    bench.drive.set_state(Heartbeat::CLOSED_LOOP);
    bench.arm();
    let mut was_idle = false;
    bench.steps(400, |bench| {
        bench.own.set_torque(0.5).unwrap();
        was_idle |= bench.drive.state() == Heartbeat::IDLE;
        let torque_nm = bench.drive.shaft().torque_nm();
        assert!(torque_nm == 0.0 || was_idle && bench.drive.modes() == (1, 1));
    });
    assert!(was_idle && bench.drive.state() == Heartbeat::CLOSED_LOOP);
    saw("idle, torque mode, closed loop");
}

#[cfg_attr(test, test)]
fn f84_the_watchdog_of_the_drive_stops_it_and_its_error_is_cleared_by_the_program_alone() {
    let mut bench = Bench::new(Mode::velocity(3.0), Firmware::V0_5);
    drives(&bench.own);
    bench.drive = bench.drive.with_watchdog(0.1);
    bench.arm();
    bench.steps(400, drive);
    bench.is_cut = true;
    bench.steps(95, drive);
    assert_eq!(bench.drive.state(), Heartbeat::CLOSED_LOOP);
    bench.steps(10, drive);
    assert!(bench.drive.state() == Heartbeat::IDLE && bench.drive.error() == 0x800);
    saw("idle by itself 96 to 105 ms after the last frame");
    bench.is_cut = false;
    bench.steps(400, drive);
    assert!(bench.drive.state() == Heartbeat::IDLE && !Devices::is_armed(&mut bench.own));
    bench.steps(150, |_| {});
    assert!(bench.own.arm(bench.now()).is_err());
    bench.own.motor_mut().clear_errors();
    bench.steps(300, |_| {});
    assert_eq!(bench.own.arm(bench.now()), Ok(()));
    bench.steps(400, drive);
    assert_eq!(bench.drive.state(), Heartbeat::CLOSED_LOOP);
}
