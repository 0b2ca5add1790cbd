//! Motors of MyActuator, in each control mode.

use crate::functions::{device, family};
use crate::opaque::Function;
use drivetrain::motor::{Actuator, AngleDrive, DriveProtocol, ImpedanceControl, VelocityDrive};
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
    Motor::inquire.call();
    Motor::decode_answer.call();
    Motor::wrong_setting.call();
    Motor::forget_settings.call();
    Motor::poll.call();
    Actuator::<Motor>::set_impedance.call();
    Actuator::<Motor>::motor_mut.call();
    (|own: &mut Actuator<Motor>, target| own.set_velocity((), target)).call();
    (|own: &mut Actuator<Motor>, target| own.set_angle((), target)).call();
    family::<Actuator<Motor>>();
    device::<Actuator<Motor>>();
}
