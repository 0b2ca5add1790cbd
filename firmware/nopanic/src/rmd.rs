//! Motors of MyActuator, in each control mode.

use crate::functions::actuator;
use crate::opaque::Function;
use drivetrain::motor::ImpedanceControl;
use drivetrain::rmd::*;

pub fn call_all() {
    Model::new.call();
    Model::name.call();
    Model::torque_constant.call();
    Model::max_current_a.call();
    Model::max_torque_nm.call();
    Command::encode.call();
    Feedback::decode.call();
    Feedback::decode_angle.call();
    Feedback::torque_nm.call();
    State::decode.call();
    Mode::position_velocity.call();
    Mode::velocity.call();
    Mode::velocity_with_torque_limit.call();
    (|control: ImpedanceControl| Mode::from(control)).call();
    motor();
}

fn motor() {
    (|model, id, mode: Mode| Motor::new(model, id, mode)).call();
    Motor::with_timeout.call();
    Motor::without_timeout.call();
    Motor::reset_drive.call();
    Motor::feedback.call();
    Motor::state.call();
    actuator::<Motor>();
}
