//! Motors on the pins of a microcontroller.

use super::*;
use drivetrain::pwm::{Brushed, BrushedConfig, RcPwm};
use drivetrain::time::Duration;
use embedded_hal::{digital, pwm};
use std::convert::Infallible;

pub(crate) struct Pin(u16);

impl digital::ErrorType for Pin {
    type Error = Infallible;
}
impl digital::OutputPin for Pin {
    fn set_low(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
    fn set_high(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}
impl pwm::ErrorType for Pin {
    type Error = Infallible;
}
impl pwm::SetDutyCycle for Pin {
    fn max_duty_cycle(&self) -> u16 {
        20_000
    }
    fn set_duty_cycle(&mut self, duty: u16) -> Result<(), Infallible> {
        self.0 = duty;
        Ok(())
    }
}

macro_rules! calls {
    () => {
        fn link(&self) -> [Link; 1] {
            [self.guard().link()]
        }
        fn is_armed(&self) -> [bool; 1] {
            [Self::is_armed(self)]
        }
        fn relax(&mut self) -> [bool; 1] {
            [false]
        }
        fn conditions(&self) -> [Conditions; 1] {
            [Self::conditions(self)]
        }
        fn next_edge(&mut self) -> Option<(usize, Edge<Condition, MotorName>)> {
            Self::next_edge(self).map(|edge| (0, edge))
        }
        fn disarm(&mut self) {
            Self::disarm(self);
        }
        fn stop(&mut self) {
            self.emergency_stop();
        }
        fn clear_stop(&mut self) {
            self.clear_emergency_stop();
        }
    };
}

/// The ESC takes no time to arm.
pub(crate) fn esc(setup: Setup) -> RcPwm<Pin> {
    RcPwm::new(Pin(0)).with_arming_time(Duration::ZERO).with_opening(setup.opening)
}

impl Subject<1> for RcPwm<Pin> {
    const RULES: [Rules; 1] = [Rules {
        late_us: None,
        arms_later: true,
        resolution: 0.0015,
        rivals: Rivals::Never,
        ..OWN
    }];

    calls!();

    fn hear(&mut self, _now: Instant) {}
    fn arm(&mut self, _now: Instant) -> Result<(), Refusal> {
        Self::arm(self).map_err(refusal)
    }
    fn set(&mut self, value: f32) -> [Result<(), TargetError>; 1] {
        [self.set_throttle(value)]
    }
    fn outputs(&mut self, tick: Tick) -> [f64; 1] {
        self.update(tick).unwrap();
        [(f64::from(self.channel().0) - 1_500.0).abs() / 500.0]
    }
}

pub(crate) fn brushed(setup: Setup) -> Brushed<Pin, [Pin; 1]> {
    let config = BrushedConfig::new(1)
        .with_encoder(2_000.0, 16)
        .with_health(health(setup))
        .with_opening(setup.opening);
    Brushed::new(Pin(0), [Pin(0)], config).unwrap()
}

impl Subject<1> for Brushed<Pin, [Pin; 1]> {
    const RULES: [Rules; 1] = [Rules { rivals: Rivals::Never, ..OWN }];

    calls!();

    fn hear(&mut self, now: Instant) {
        self.ingest_counts(0, now);
    }
    fn arm(&mut self, now: Instant) -> Result<(), Refusal> {
        Self::arm(self, now).map_err(refusal)
    }
    fn set(&mut self, value: f32) -> [Result<(), TargetError>; 1] {
        [self.set_duty(value)]
    }
    fn outputs(&mut self, tick: Tick) -> [f64; 1] {
        self.update(tick).unwrap();
        [f64::from(self.channel().0) / 20_000.0]
    }
}
