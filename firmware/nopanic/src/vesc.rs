//! Motors on VESC drives, in each control mode.

use crate::functions::{device, family};
use crate::opaque::Function;
use drivetrain::motor::{AngleDrive, Own, OwnMotor, VelocityDrive};
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
    CurrentControl::new.call();
    CurrentControl::with_speed_loop.call();
    CurrentControl::with_loops.call();
    Duty::new.call();
    Velocity::new.call();
    Velocity::with_standstill.call();
    motor::<CurrentControl>();
    motor::<Duty>();
    motor::<Velocity>();
    motor::<Position>();
}

fn motor<M: Mode + 'static>() {
    Motor::<M>::new.call();
    Motor::<M>::with_rest.call();
    Motor::<M>::with_encoder.call();
    Motor::<M>::without_fault_code.call();
    Motor::<M>::feedback.call();
    Motor::<M>::position.call();
    Motor::<M>::inquire.call();
    Motor::<M>::decode_answer.call();
    Motor::<M>::wrong_setting.call();
    Motor::<M>::forget_settings.call();
    Own::<Motor<M>>::set_torque.call();
    Own::<Motor<M>>::motor_mut.call();
    (|own: &mut Own<Motor<M>>, target| own.set_velocity((), target)).call();
    (|own: &mut Own<Motor<M>>, target| own.set_angle((), target)).call();
    family::<Own<Motor<M>>>();
    device::<Own<Motor<M>>>();
}
