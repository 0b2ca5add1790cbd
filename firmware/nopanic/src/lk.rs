//! Motors of LK-TECH, in each control mode.

use crate::functions::actuator;
use crate::opaque::Function;
use drivetrain::lk::*;
use drivetrain::motor::ImpedanceControl;

pub fn call_all() {
    Series::amperes_per_count.call();
    Model::new.call();
    Model::name.call();
    Model::series.call();
    Model::gear.call();
    Model::torque_constant.call();
    Model::encoder_bits.call();
    Model::max_torque_nm.call();
    Command::encode.call();
    Feedback::decode.call();
    Feedback::decode_angle.call();
    Feedback::torque_nm.call();
    Feedback::velocity_rad_per_s.call();
    State::decode.call();
    Mode::position_velocity.call();
    Mode::velocity.call();
    Mode::velocity_with_torque_limit.call();
    (|control: ImpedanceControl| Mode::from(control)).call();
    motor();
}

fn motor() {
    (|model, id, mode: Mode| Motor::new(model, id, mode)).call();
    Motor::feedback.call();
    Motor::state.call();
    actuator::<Motor>();
}
