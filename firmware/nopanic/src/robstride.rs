//! Motors of RobStride, in each run mode.

use crate::functions::actuator;
use crate::opaque::Function;
use drivetrain::motor::ImpedanceControl;
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
    Register::manual.call();
    Register::is_float.call();
    Register::is_writable.call();
    Mode::position.call();
    Mode::velocity.call();
    Mode::current.call();
    (|control: ImpedanceControl| Mode::from(control)).call();
    motor();
}

fn motor() {
    (|model, id, mode: Mode| Motor::new(model, id, mode)).call();
    Motor::with_host_id.call();
    Motor::with_timeout.call();
    Motor::feedback.call();
    Motor::reported_faults.call();
    Motor::read.call();
    Motor::write.call();
    Motor::store.call();
    Motor::set_zero.call();
    Motor::set_id.call();
    Motor::register.call();
    actuator::<Motor>();
}
