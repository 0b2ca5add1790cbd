//! Motors of Damiao, in each control mode.

use crate::functions::{device, family};
use crate::opaque::Function;
use drivetrain::damiao::*;
use drivetrain::motor::{
    Actuator, AngleDrive, DriveProtocol, Impedance, ImpedanceControl, Order, VelocityDrive,
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
    Register::manual.call();
    Register::is_float.call();
    Register::is_writable.call();
    ImpedanceControl::new.call();
    ImpedanceControl::set_loops.call();
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
    Mode::position_velocity.call();
    Mode::velocity.call();
    Mode::force_position.call();
    (|control: ImpedanceControl| Mode::from(control)).call();
    motor();
}

fn motor() {
    (|model, id, mode: Mode| Motor::new(model, id, mode)).call();
    Motor::with_master_id.call();
    Motor::with_timeout.call();
    Motor::feedback.call();
    Motor::read.call();
    Motor::write.call();
    Motor::store.call();
    Motor::register.call();
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
