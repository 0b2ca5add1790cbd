//! Both motors on pins that only remember, under the same cases.

use super::*;
use crate::control::PidConfig;
use crate::motor::{
    ArmError, Capability, Condition, HealthConfig, Link, OneOf, Reaction, TargetError,
    VelocityDrive,
};
use crate::time::{Duration, Instant, Tick};
use crate::units::AngularVelocity;
use core::cell::{Cell, RefCell};
use embedded_hal::{digital, pwm};
use std::string::ToString;
use std::vec::Vec;

/// The events of the pins in order, and the name of a broken pin.
#[derive(Default)]
struct Log {
    events: RefCell<Vec<(&'static str, u16)>>,
    broken: Cell<&'static str>,
}

struct Pin<'a> {
    name: &'static str,
    log: &'a Log,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Broken;

impl digital::Error for Broken {
    fn kind(&self) -> digital::ErrorKind {
        digital::ErrorKind::Other
    }
}

impl pwm::Error for Broken {
    fn kind(&self) -> pwm::ErrorKind {
        pwm::ErrorKind::Other
    }
}

impl digital::ErrorType for Pin<'_> {
    type Error = Broken;
}

impl pwm::ErrorType for Pin<'_> {
    type Error = Broken;
}

impl Pin<'_> {
    fn set(&mut self, value: u16) -> Result<(), Broken> {
        if self.log.broken.get() == self.name {
            return Err(Broken);
        }
        self.log.events.borrow_mut().push((self.name, value));
        Ok(())
    }
}

impl digital::OutputPin for Pin<'_> {
    fn set_low(&mut self) -> Result<(), Broken> {
        self.set(0)
    }
    fn set_high(&mut self) -> Result<(), Broken> {
        self.set(1)
    }
}

impl pwm::SetDutyCycle for Pin<'_> {
    fn max_duty_cycle(&self) -> u16 {
        20_000
    }
    fn set_duty_cycle(&mut self, duty: u16) -> Result<(), Broken> {
        self.set(duty)
    }
}

fn pin<'a>(name: &'static str, log: &'a Log) -> Pin<'a> {
    Pin { name, log }
}

impl BrushedConfig {
    /// A motor whose output range opens at once.
    const fn at_once(id: u8) -> Self {
        Self::new(id).with_opening(Duration::ZERO)
    }
}

/// An ESC whose output range opens at once.
fn at_once(log: &Log) -> RcPwm<Pin<'_>> {
    RcPwm::new(pin("esc", log)).with_opening(Duration::ZERO)
}

fn at_ms(ms: u64) -> Instant {
    Instant::from_micros(ms * 1_000)
}

fn tick(ms: u64) -> Tick {
    Tick::new(at_ms(ms), 0.001)
}

fn last(log: &Log) -> u16 {
    log.events.borrow().last().map_or(0, |(_, value)| *value)
}

mod brushed;
mod conversions;
mod holding;
mod rc;
