//! Motors at an ODrive, in each control mode.

use crate::functions::{device, family};
use crate::opaque::Function;
use drivetrain::motor::{Actuator, AngleDrive, DriveProtocol, ImpedanceControl, VelocityDrive};
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
    Motor::inquire.call();
    Motor::decode_answer.call();
    Motor::wrong_setting.call();
    Motor::forget_settings.call();
    Motor::poll.call();
    Motor::enable.call();
    Motor::disable.call();
    Actuator::<Motor>::set_torque.call();
    Actuator::<Motor>::set_impedance.call();
    Actuator::<Motor>::motor_mut.call();
    (|own: &mut Actuator<Motor>, target| own.set_velocity((), target)).call();
    (|own: &mut Actuator<Motor>, target| own.set_angle((), target)).call();
    family::<Actuator<Motor>>();
    device::<Actuator<Motor>>();
}
