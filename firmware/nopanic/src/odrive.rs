//! Motors at an ODrive, in each control mode.

use crate::functions::actuator;
use crate::opaque::Function;
use drivetrain::motor::ImpedanceControl;
use drivetrain::odrive::*;

pub fn call_all() {
    Model::new.call();
    Model::name.call();
    Model::torque_constant.call();
    Command::frame.call();
    Feedback::decode.call();
    Heartbeat::decode.call();
    Heartbeat::error_code.call();
    Mode::velocity.call();
    Mode::position.call();
    Mode::position_with_filter.call();
    Mode::position_with_trajectory.call();
    (|control: ImpedanceControl| Mode::from(control)).call();
    motor();
}

fn motor() {
    (|model, firmware, node, velocity, mode: Mode| {
        Motor::new(model, firmware, node, velocity, mode)
    })
    .call();
    Motor::with_gear.call();
    Motor::with_endpoints.call();
    Motor::feedback.call();
    Motor::heartbeat.call();
    Motor::errors.call();
    Motor::clear_errors.call();
    Motor::stop.call();
    actuator::<Motor>();
}
