//! Motors of LK-TECH, in each control mode.

use crate::functions::{device, family};
use crate::opaque::Function;
use drivetrain::lk::*;
use drivetrain::motor::{Actuator, AngleDrive, DriveProtocol, ImpedanceControl, VelocityDrive};

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
