//! Motors of RobStride, in each run mode.

use crate::functions::{device, family};
use crate::opaque::{Function, any};
use drivetrain::motor::{AngleDrive, ImpedanceControl, Own, OwnMotor, Settings, VelocityDrive};
use drivetrain::robstride::*;

pub fn call_all() {
    Model::new.call();
    Model::with_position_range.call();
    Model::with_gain_ranges.call();
    Model::name.call();
    Model::ranges.call();
    Model::most.call();
    Model::count.call();
    Model::pmax_rad.call();
    Model::vmax_rad_per_s.call();
    Model::tmax_nm.call();
    Model::current_a.call();
    Model::has_timeout.call();
    Model::can_store.call();
    Command::encode.call();
    Feedback::decode.call();
    Feedback::angle.call();
    Feedback::fault_code.call();
    Register::index.call();
    Register::is_float.call();
    Register::is_writable.call();
    settings();
    Position::new.call();
    Velocity::new.call();
    Current::new.call();
    motor::<ImpedanceControl>();
    motor::<Position>();
    motor::<Velocity>();
    motor::<Current>();
}

fn settings() {
    Settings::<Register, 3>::new.call();
    Settings::<Register, 3>::forget.call();
    Settings::<Register, 3>::request.call();
    Settings::<Register, 3>::answer.call();
    Settings::<Register, 3>::complete.call();
    Settings::<Register, 3>::inquire.call();
    Settings::<Register, 3>::ask.call();
    Settings::<Register, 3>::asked.call();
    Settings::<Register, 3>::take.call();
    (|asked: &Settings<Register, 3>| Settings::wrong(asked, |_: Register, _| any())).call();
}

fn motor<M: Mode + 'static>() {
    Motor::<M>::new.call();
    Motor::<M>::with_host_id.call();
    Motor::<M>::with_timeout.call();
    Motor::<M>::feedback.call();
    Motor::<M>::reported_faults.call();
    Motor::<M>::read.call();
    Motor::<M>::write.call();
    Motor::<M>::store.call();
    Motor::<M>::set_zero.call();
    Motor::<M>::set_id.call();
    Motor::<M>::register.call();
    Motor::<M>::inquire.call();
    Motor::<M>::decode_answer.call();
    Motor::<M>::wrong_setting.call();
    Motor::<M>::forget_settings.call();
    Motor::<M>::poll.call();
    (|own: &mut Own<Motor<M>>, target| own.set_velocity((), target)).call();
    (|own: &mut Own<Motor<M>>, target| own.set_angle((), target)).call();
    family::<Own<Motor<M>>>();
    device::<Own<Motor<M>>>();
}
