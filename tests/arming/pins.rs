//! Motors on pins: `arm` of each.

use crate::{PAUSE_MS, at_ms};
use drivetrain::motor::{ArmError, TargetError};
use drivetrain::pwm::{Brushed, BrushedConfig, RcPwm};
use drivetrain::time::Tick;
use embedded_hal::{digital, pwm};

/// A pin or channel that remembers its duty.
#[derive(Default)]
struct Pin(u16);

impl digital::ErrorType for Pin {
    type Error = core::convert::Infallible;
}

impl pwm::ErrorType for Pin {
    type Error = core::convert::Infallible;
}

impl digital::OutputPin for Pin {
    fn set_low(&mut self) -> Result<(), Self::Error> {
        Ok(())
    }
    fn set_high(&mut self) -> Result<(), Self::Error> {
        Ok(())
    }
}

impl pwm::SetDutyCycle for Pin {
    fn max_duty_cycle(&self) -> u16 {
        20_000
    }
    fn set_duty_cycle(&mut self, duty: u16) -> Result<(), Self::Error> {
        self.0 = duty;
        Ok(())
    }
}

struct Bench {
    motor: Brushed<Pin, (Pin, Pin)>,
    ms: u64,
}

impl Bench {
    fn new() -> Self {
        let config = BrushedConfig::new(3).with_encoder(1_320.0, 16);
        let pins = (Pin::default(), Pin::default());
        Self { motor: Brushed::new(Pin::default(), pins, config).unwrap(), ms: 1_000 }
    }

    /// Some milliseconds with counts; the duty of the last one.
    fn run(&mut self, ms: u64) -> u16 {
        for _ in 0..ms {
            self.ms += 1;
            let counts = (u32::try_from(self.ms).unwrap() * 10) & 0xFFFF;
            self.motor.ingest_counts(counts, at_ms(self.ms));
            _ = self.motor.set_duty(0.5);
            self.motor.update(Tick::new(at_ms(self.ms), 0.001)).unwrap();
        }
        self.motor.channel().0
    }
}

#[test]
fn a_brushed_motor_refuses_without_counts_and_under_a_stop() {
    let mut bench = Bench::new();
    assert!(matches!(bench.motor.arm(at_ms(bench.ms)), Err(ArmError::Missing(_))));
    assert!(!bench.motor.is_armed());
    bench.run(PAUSE_MS);
    bench.motor.emergency_stop();
    assert_eq!(bench.motor.arm(at_ms(bench.ms)), Err(ArmError::Stopped));
    assert_eq!((bench.motor.is_armed(), bench.run(5)), (false, 0));
    assert_eq!(bench.motor.set_duty(0.5), Err(TargetError::Disarmed));
    bench.motor.clear_emergency_stop();
    assert_eq!((bench.motor.is_armed(), bench.run(PAUSE_MS)), (false, 0));
    assert_eq!(bench.motor.arm(at_ms(bench.ms)), Ok(()));
    assert!(bench.run(300) > 0);
    // Silent again.
    bench.motor.disarm();
    bench.ms += 11;
    assert!(matches!(bench.motor.arm(at_ms(bench.ms)), Err(ArmError::Missing(_))));
    assert!(!bench.motor.is_armed());
}

struct Esc {
    esc: RcPwm<Pin>,
    ms: u64,
}

impl Esc {
    fn arm(&mut self) {
        _ = self.esc.arm();
    }

    /// Some milliseconds at full throttle; whether it is armed then, and its duty.
    fn run(&mut self, ms: u64) -> (bool, u16) {
        for _ in 0..ms {
            self.ms += 1;
            _ = self.esc.set_throttle(1.0);
            self.esc.update(Tick::new(at_ms(self.ms), 0.001)).unwrap();
        }
        (self.esc.is_armed(), self.esc.channel().0)
    }
}

/// It arms for 2 s; the stop comes before, in between, and is taken back before these are over.
#[test]
fn an_rc_esc_does_not_arm_through_a_stop() {
    let esc = RcPwm::new(Pin::default());
    let mut esc = Esc { esc, ms: 1_000 };
    let (_, idle) = esc.run(PAUSE_MS);
    let before: fn(&mut Esc) = |esc| {
        esc.esc.emergency_stop();
        esc.arm();
        esc.run(1_000);
    };
    let within: fn(&mut Esc) = |esc| {
        esc.arm();
        esc.run(1_000);
        esc.esc.emergency_stop();
    };
    for stop in [before, within] {
        stop(&mut esc);
        for ms in [500, 4_000] {
            assert_eq!(esc.run(ms), (false, idle));
            esc.esc.clear_emergency_stop();
            assert_eq!(esc.run(4_000), (false, idle), "it waits to be armed");
            stop(&mut esc);
        }
        esc.esc.clear_emergency_stop();
        esc.run(PAUSE_MS);
    }
    esc.arm();
    let (armed, duty) = esc.run(4_000);
    assert!(armed && duty > idle, "{duty} and {idle}");
}
