//! Motors that are not on CAN.

use crate::opaque::{Function, any};
use core::convert::Infallible;
use core::hint::black_box;
use drivetrain::pwm::*;
use embedded_hal::{digital, pwm};

struct Channel;

impl pwm::ErrorType for Channel {
    type Error = Infallible;
}

impl pwm::SetDutyCycle for Channel {
    fn max_duty_cycle(&self) -> u16 {
        any()
    }
    fn set_duty_cycle(&mut self, duty: u16) -> Result<(), Infallible> {
        black_box(duty);
        Ok(())
    }
}

struct Pin;

impl digital::ErrorType for Pin {
    type Error = Infallible;
}

impl digital::OutputPin for Pin {
    fn set_low(&mut self) -> Result<(), Infallible> {
        black_box(false);
        Ok(())
    }
    fn set_high(&mut self) -> Result<(), Infallible> {
        black_box(true);
        Ok(())
    }
}

pub fn call_all() {
    brushed::<[Pin; 1]>();
    brushed::<(Pin, Pin)>();
    BrushedConfig::new.call();
    BrushedConfig::with_encoder.call();
    BrushedConfig::with_velocity_filter.call();
    BrushedConfig::with_speed_loop.call();
    BrushedConfig::with_limit.call();
    BrushedConfig::reversed.call();
    BrushedConfig::with_timeouts.call();
    BrushedConfig::with_opening.call();
    BrushedConfig::with_no_load_speed.call();
    BrushedConfig::with_health.call();
    BrushedConfig::validate.call();
    RcPwm::<Channel>::with_id.call();
    RcPwm::<Channel>::with_pulses_us.call();
    RcPwm::<Channel>::with_off_at_rest.call();
    RcPwm::<Channel>::with_arming_time.call();
    RcPwm::<Channel>::with_full_speed.call();
    RcPwm::<Channel>::with_timeouts.call();
    RcPwm::<Channel>::with_opening.call();
    RcPwm::<Channel>::new.call();
    RcPwm::<Channel>::arm.call();
    RcPwm::<Channel>::disarm.call();
    RcPwm::<Channel>::emergency_stop.call();
    RcPwm::<Channel>::clear_emergency_stop.call();
    RcPwm::<Channel>::is_armed.call();
    RcPwm::<Channel>::set_throttle.call();
    RcPwm::<Channel>::update.call();
    RcPwm::<Channel>::channel.call();
    RcPwm::<Channel>::guard.call();
    RcPwm::<Channel>::conditions.call();
    RcPwm::<Channel>::health.call();
    RcPwm::<Channel>::next_edge.call();
}

fn brushed<D: Direction>() {
    Brushed::<Channel, D>::new.call();
    Brushed::<Channel, D>::ingest_counts.call();
    Brushed::<Channel, D>::arm.call();
    Brushed::<Channel, D>::disarm.call();
    Brushed::<Channel, D>::emergency_stop.call();
    Brushed::<Channel, D>::clear_emergency_stop.call();
    Brushed::<Channel, D>::is_armed.call();
    Brushed::<Channel, D>::set_duty.call();
    Brushed::<Channel, D>::update.call();
    Brushed::<Channel, D>::counts.call();
    Brushed::<Channel, D>::duty.call();
    Brushed::<Channel, D>::channel.call();
    Brushed::<Channel, D>::direction.call();
    Brushed::<Channel, D>::guard.call();
    Brushed::<Channel, D>::conditions.call();
    Brushed::<Channel, D>::health.call();
    Brushed::<Channel, D>::next_edge.call();
}
