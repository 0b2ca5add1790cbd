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

/// The motor of the example under a simulated clock.
struct Bench {
    motor: Actuator<MyMotor>,
    ms: u64,
    amperes: f32,
}

impl Bench {
    fn new() -> Self {
        Self { motor: Actuator::new(MyMotor::new(3).unwrap()), ms: 0, amperes: 0.0 }
    }

    /// A millisecond with feedback of the rotor, refused targets in rpm, and a good one as the last: the command is kept.
    fn step(&mut self, rotor_rpm: i16, targets_rpm: &[f32]) {
        self.ms += 1;
        let now = Instant::from_micros(1_000 * self.ms);
        let [low, high] = rotor_rpm.to_le_bytes();
        let feedback = CanFrame::of(StandardId::new(0x143).unwrap(), [low, high, 31]);
        assert_eq!(self.motor.ingest(&feedback, now), Ingest::Taken);
        if self.ms == 1 {
            self.motor.arm(now).unwrap();
        }
        let mut set = |rpm: &f32| self.motor.set_velocity((), AngularVelocity::from_rpm(*rpm));
        let (good, refused) = targets_rpm.split_last().unwrap();
        assert!(refused.iter().all(|rpm| set(rpm).is_err()));
        set(good).unwrap();
        self.motor.update(Tick::new(now, 0.001));
        while let Some(frame) = self.motor.next_frame(0) {
            let [a, b, c, d] = *frame.data() else { panic!("{frame:?}") };
            self.amperes = f32::from_le_bytes([a, b, c, d]);
        }
    }
}

/// A refused target takes the one before away, also where a good one comes in the same cycle: the loop of a blocked motor starts afresh, from zero.
#[test]
fn a_good_target_behind_a_refused_one_starts_afresh() {
    let mut bench = Bench::new();
    (0..500).for_each(|_| bench.step(0, &[20.0]));
    let whole = bench.amperes;
    bench.step(0, &[f32::NAN, 20.0]);
    let afresh = bench.amperes;
    assert!(whole > 1.0 && afresh.abs() < 0.05 * whole, "{afresh} A after {whole} A");
}

/// As in the example: 0.2 Nm for each ampere, 0.004 kg m² and friction at the output, a gear of 27.
fn fastest_rpm(target_rpm: f32) -> f32 {
    let mut bench = Bench::new();
    let (mut rad_per_s, mut fastest) = (0.0_f32, 0.0_f32);
    for _ in 0..1_000 {
        rad_per_s += (0.2 * bench.amperes - 0.01 * rad_per_s) / 0.004 * 0.001;
        let rpm = AngularVelocity::from_rad_per_s(rad_per_s).as_rpm();
        fastest = if rpm.abs() > fastest.abs() { rpm } else { fastest };
        #[expect(clippy::cast_possible_truncation, reason = "saturates")]
        bench.step((rpm * 27.0) as i16, &[target_rpm]);
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
