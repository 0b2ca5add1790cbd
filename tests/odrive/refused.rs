//! Rest that waits for the bus, found by the fuzz target `drives`: no question goes first.

use crate::bench::{Bench, torque};
use drivetrain::frame::CanFrame;
use drivetrain::motor::{AngleDrive, Devices, VelocityDrive};
use drivetrain::odrive::{Firmware, Heartbeat, Mode};
use drivetrain::sim::Drive;
use drivetrain::time::Tick;
use drivetrain::units::{Angle, AngularVelocity};

/// Runs an update, and returns its frames.
fn update(bench: &mut Bench) -> Vec<CanFrame> {
    bench.now_us += 1_000;
    let now = bench.now();
    bench.own.update(Tick::new(now, 0.001));
    std::iter::from_fn(|| bench.own.next_frame(0)).collect()
}

/// Disarms a motor that is driven on a bus that refuses all frames for some updates; the first frames that pass have to bring rest.
fn rests_when_the_bus_is_free(mode: impl Into<Mode>, firmware: Firmware, set: fn(&mut Bench)) {
    let mode = mode.into();
    for refused in 0..60 {
        let mut bench = Bench::armed(mode, firmware);
        bench.steps(700, set);
        assert_eq!(bench.drive.state(), Heartbeat::CLOSED_LOOP);
        assert!(bench.drive.shaft().torque_nm().abs() > 0.001, "{firmware:?} {mode:?}");
        bench.own.disarm();
        for _ in 0..refused {
            for frame in update(&mut bench) {
                assert!(Devices::requeue(&mut bench.own, &frame));
            }
        }
        for frame in update(&mut bench) {
            bench.drive.hear(&frame);
        }
        bench.drive.step(1e-4);
        let torque_nm = bench.drive.shaft().torque_nm();
        assert!(torque_nm == 0.0, "{firmware:?} {mode:?}, {refused} updates refused");
    }
}

#[test]
fn rest_goes_before_questions_when_the_bus_has_refused_it() {
    for firmware in [Firmware::V0_5, Firmware::V0_6] {
        rests_when_the_bus_is_free(torque(), firmware, |bench| _ = bench.own.set_torque(1.0));
        rests_when_the_bus_is_free(Mode::velocity(2.0), firmware, |bench| {
            let target = AngularVelocity::from_rad_per_s(bench.drive.shaft().angle_rad() + 1.0);
            _ = bench.own.set_velocity((), target);
        });
        rests_when_the_bus_is_free(Mode::position(2.0), firmware, |bench| {
            let target = bench.drive.shaft().angle_rad() + 1.0;
            _ = bench.own.set_angle((), Angle::from_radians(target));
        });
    }
}

/// While a drive is being enabled it is polled by commands that leave the shaft as it is, and follows them as soon as it is enabled.
#[test]
fn a_drive_that_was_just_enabled_gets_rest_with_the_first_frame_after_its_target_is_lost() {
    let mut torques = 0;
    for until in 1..60 {
        let mut bench = Bench::armed(Mode::position(2.0), Firmware::V0_6);
        // The load has the drive's own loop hold the shaft.
        bench.drive.shaft_mut().set_load(1.0);
        bench.steps(until, |bench| _ = bench.own.set_angle((), Angle::from_radians(0.3)));
        torques += u32::from(bench.drive.shaft().torque_nm() != 0.0);
        // A target that is refused takes the one before away.
        assert!(bench.own.set_angle((), Angle::from_radians(f32::NAN)).is_err());
        for frame in update(&mut bench) {
            bench.drive.hear(&frame);
        }
        bench.drive.step(1e-4);
        assert!(bench.drive.shaft().torque_nm() == 0.0, "after {until} updates");
    }
    assert!(torques > 10, "{torques}");
}
