//! Motors at an ODrive, in each control mode.

use crate::functions::{device, family};
use crate::opaque::Function;
use drivetrain::motor::{AngleDrive, ImpedanceControl, Own, OwnMotor, VelocityDrive};
use drivetrain::odrive::*;

pub fn call_all() {
    Model::new.call();
    Model::name.call();
    Model::torque_constant.call();
    Command::frame.call();
    Feedback::decode.call();
    Heartbeat::decode.call();
    Heartbeat::error_code.call();
    Velocity::new.call();
    Position::new.call();
    Position::with_filter.call();
    Position::with_trajectory.call();
    motor::<ImpedanceControl>();
    motor::<Velocity>();
    motor::<Position>();
}

fn motor<M: Mode + 'static>() {
    Motor::<M>::new.call();
    Motor::<M>::with_gear.call();
    Motor::<M>::reversed.call();
    Motor::<M>::with_endpoints.call();
    Motor::<M>::feedback.call();
    Motor::<M>::heartbeat.call();
    Motor::<M>::errors.call();
    Motor::<M>::clear_errors.call();
    Motor::<M>::stop.call();
    Motor::<M>::inquire.call();
    Motor::<M>::decode_answer.call();
    Motor::<M>::wrong_setting.call();
    Motor::<M>::forget_settings.call();
    Motor::<M>::poll.call();
    Motor::<M>::enable.call();
    Motor::<M>::disable.call();
    Own::<Motor<M>>::set_torque.call();
    Own::<Motor<M>>::set_impedance.call();
    Own::<Motor<M>>::motor_mut.call();
    (|own: &mut Own<Motor<M>>, target| own.set_velocity((), target)).call();
    (|own: &mut Own<Motor<M>>, target| own.set_angle((), target)).call();
    family::<Own<Motor<M>>>();
    device::<Own<Motor<M>>>();
}
