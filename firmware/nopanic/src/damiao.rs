//! Motors of Damiao, in each control mode.

use crate::functions::{device, family};
use crate::opaque::{Function, any};
use drivetrain::damiao::*;
use drivetrain::motor::{
    AngleDrive, Impedance, ImpedanceControl, Order, Own, OwnMotor, Settings, VelocityDrive,
};

pub fn call_all() {
    Model::new.call();
    Model::name.call();
    Model::ranges.call();
    Model::most.call();
    Model::count.call();
    Model::pmax_rad.call();
    Model::vmax_rad_per_s.call();
    Model::tmax_nm.call();
    Command::encode.call();
    Feedback::decode.call();
    Feedback::angle.call();
    Status::is_error.call();
    Status::error_code.call();
    Register::number.call();
    Register::is_float.call();
    Register::is_writable.call();
    ImpedanceControl::new.call();
    ImpedanceControl::with_gains.call();
    ImpedanceControl::with_loops.call();
    ImpedanceControl::torque_limit_nm.call();
    ImpedanceControl::effort.call();
    ImpedanceControl::capabilities.call();
    (|control: &mut ImpedanceControl,
      order: Order,
      angle,
      velocity,
      ends: (Impedance, Impedance)| {
        ImpedanceControl::step(control, order, angle, velocity, &ends.0, &ends.1)
    })
    .call();
    ImpedanceControl::reset.call();
    Impedance::is_finite.call();
    settings();
    PositionVelocity::new.call();
    Velocity::new.call();
    ForcePosition::new.call();
    motor::<ImpedanceControl>();
    motor::<PositionVelocity>();
    motor::<Velocity>();
    motor::<ForcePosition>();
}

fn settings() {
    Settings::<Register, 4>::new.call();
    Settings::<Register, 4>::forget.call();
    Settings::<Register, 4>::request.call();
    Settings::<Register, 4>::answer.call();
    Settings::<Register, 4>::complete.call();
    Settings::<Register, 4>::inquire.call();
    Settings::<Register, 4>::ask.call();
    Settings::<Register, 4>::asked.call();
    Settings::<Register, 4>::take.call();
    (|asked: &Settings<Register, 4>| Settings::wrong(asked, |_: Register, _| any())).call();
}

fn motor<M: Mode + 'static>() {
    Motor::<M>::new.call();
    Motor::<M>::with_master_id.call();
    Motor::<M>::with_timeout.call();
    Motor::<M>::feedback.call();
    Motor::<M>::read.call();
    Motor::<M>::write.call();
    Motor::<M>::store.call();
    Motor::<M>::register.call();
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
