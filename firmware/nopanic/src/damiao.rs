//! Motors of Damiao, in each control mode.

use crate::functions::actuator;
use crate::opaque::Function;
use drivetrain::damiao::*;
use drivetrain::motor::{Impedance, ImpedanceControl, Order};

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
    actuator::<Motor>();
}
