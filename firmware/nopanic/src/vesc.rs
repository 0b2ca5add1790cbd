//! Motors on VESC drives, in each control mode.

use crate::functions::actuator;
use crate::opaque::Function;
use drivetrain::vesc::*;

pub fn call_all() {
    Model::torque_limit_nm.call();
    Model::current_of.call();
    Model::erpm_of.call();
    Model::velocity_of.call();
    Command::frame.call();
    (|feedback: &mut Feedback, packet: u8, data: &[u8; 8], length: usize| {
        Feedback::take(feedback, packet, data.get(..length).unwrap_or_default())
    })
    .call();
    Mode::current.call();
    Mode::current_with_speed_loop.call();
    Mode::current_with_loops.call();
    Mode::duty.call();
    Mode::velocity.call();
    Mode::velocity_with_standstill.call();
    Mode::position.call();
    motor();
}

fn motor() {
    Motor::new.call();
    Motor::with_rest.call();
    Motor::with_encoder.call();
    Motor::without_fault_code.call();
    Motor::feedback.call();
    Motor::position.call();
    actuator::<Motor>();
}
