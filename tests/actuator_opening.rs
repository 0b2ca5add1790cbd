//! The motor of the example `custom_motor` reaches its velocity without swinging, though its range opens meanwhile.

#![cfg(test)]

use drivetrain::frame::CanFrame;
use drivetrain::motor::{Actuator, Devices, Ingest, VelocityDrive};
use drivetrain::time::{Instant, Tick};
use drivetrain::units::AngularVelocity;
use embedded_can::{Frame, StandardId};

#[expect(dead_code, reason = "the example's own main and simulation")]
#[path = "../examples/custom_motor.rs"]
mod custom_motor;
use custom_motor::MyMotor;

/// The motor of the example, which stands: its current after so many ms of a target, the last with targets that come before it.
fn amperes_of_blocked(millis: u64, before_last: &[f32]) -> f32 {
    let mut motor = Actuator::new(MyMotor::new(3).unwrap());
    let (feedback, mut amperes) = (CanFrame::of(StandardId::new(0x143).unwrap(), [0, 0, 31]), 0.0);
    for ms in 1..=millis {
        let now = Instant::from_micros(1_000 * ms);
        assert_eq!(motor.ingest(&feedback, now), Ingest::Taken);
        if ms == 1 {
            motor.arm(now).unwrap();
        }
        for rpm in before_last.iter().filter(|_| ms == millis) {
            assert!(motor.set_velocity((), AngularVelocity::from_rpm(*rpm)).is_err());
        }
        motor.set_velocity((), AngularVelocity::from_rpm(20.0)).unwrap();
        motor.update(Tick::new(now, 0.001));
        while let Some(frame) = motor.next_frame(0) {
            let [a, b, c, d] = *frame.data() else { panic!("{frame:?}") };
            amperes = f32::from_le_bytes([a, b, c, d]);
        }
    }
    amperes
}

/// A refused target takes the one before away, also where a good one comes in the same cycle: the loop starts afresh, from zero.
#[test]
fn a_good_target_behind_a_refused_one_starts_afresh() {
    let (whole, afresh) = (amperes_of_blocked(500, &[]), amperes_of_blocked(500, &[f32::NAN]));
    assert!(whole > 1.0 && afresh.abs() < 0.05 * whole, "{afresh} A after {whole} A");
}

/// As in the example: 0.2 Nm for each ampere, 0.004 kg m² and friction at the output, a gear of 27.
fn fastest_rpm(target_rpm: f32) -> f32 {
    let mut motor = Actuator::new(MyMotor::new(3).unwrap());
    let target = AngularVelocity::from_rpm(target_rpm);
    let (mut amperes, mut rad_per_s, mut fastest) = (0.0_f32, 0.0_f32, 0.0_f32);
    for ms in 1..=1_000 {
        let now = Instant::from_micros(1_000 * ms);
        rad_per_s += (0.2 * amperes - 0.01 * rad_per_s) / 0.004 * 0.001;
        let rpm = AngularVelocity::from_rad_per_s(rad_per_s).as_rpm();
        fastest = if rpm.abs() > fastest.abs() { rpm } else { fastest };
        #[expect(clippy::cast_possible_truncation, reason = "saturates")]
        let [low, high] = ((rpm * 27.0) as i16).to_le_bytes();
        let feedback = CanFrame::of(StandardId::new(0x143).unwrap(), [low, high, 31]);
        assert_eq!(motor.ingest(&feedback, now), Ingest::Taken);
        if ms == 1 {
            motor.arm(now).unwrap();
        }
        motor.set_velocity((), target).unwrap();
        motor.update(Tick::new(now, 0.001));
        while let Some(frame) = motor.next_frame(0) {
            let [a, b, c, d] = *frame.data() else { panic!("{frame:?}") };
            amperes = f32::from_le_bytes([a, b, c, d]);
        }
    }
    fastest
}

#[test]
fn a_loop_that_hears_of_the_open_share_does_not_swing() {
    for target in [-400.0, -150.0, 60.0, 150.0, 400.0] {
        let fastest = fastest_rpm(target);
        assert!(fastest / target < 1.1, "{fastest} rpm for {target}");
    }
}
