//! Motors of MyActuator, in each control mode.

use crate::functions::{device, family};
use crate::opaque::Function;
use drivetrain::motor::{AngleDrive, ImpedanceControl, Own, OwnMotor, VelocityDrive};
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
    motor::<ImpedanceControl>();
    motor::<PositionVelocity>();
    motor::<Velocity>();
}

fn motor<M: Mode + 'static>() {
    Motor::<M>::new.call();
    Motor::<M>::reversed.call();
    Motor::<M>::with_timeout.call();
    Motor::<M>::without_timeout.call();
    Motor::<M>::reset_drive.call();
    Motor::<M>::feedback.call();
    Motor::<M>::state.call();
    Motor::<M>::inquire.call();
    Motor::<M>::decode_answer.call();
    Motor::<M>::wrong_setting.call();
    Motor::<M>::forget_settings.call();
    Motor::<M>::poll.call();
    Own::<Motor<M>>::set_impedance.call();
    Own::<Motor<M>>::motor_mut.call();
    (|own: &mut Own<Motor<M>>, target| own.set_velocity((), target)).call();
    (|own: &mut Own<Motor<M>>, target| own.set_angle((), target)).call();
    family::<Own<Motor<M>>>();
    device::<Own<Motor<M>>>();
}
