//! The shooter.

use crate::opaque::Function;
use drivetrain::shooter::*;

pub fn call_all() {
    Shooter::with_tolerance.call();
    Shooter::with_heat.call();
    Shooter::with_jam_after.call();
    Shooter::with_tries.call();
    Shooter::with_loader_gain.call();
    Shooter::with_heat_without_referee.call();
    Shooter::feed_velocity.call();
    Shooter::new.call();
    Shooter::update.call();
    Shooter::state.call();
    ShooterState::is_fault.call();
    Shooter::shots.call();
    Shooter::tries.call();
    Shooter::heat.call();
}
