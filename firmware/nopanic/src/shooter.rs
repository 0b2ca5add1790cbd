//! The shooter.

use crate::opaque::Function;
use drivetrain::shooter::*;

pub fn call_all() {
    ShooterConfig::new.call();
    ShooterConfig::with_tolerance.call();
    ShooterConfig::with_heat.call();
    ShooterConfig::with_jam_after.call();
    ShooterConfig::with_tries.call();
    ShooterConfig::with_loader_gain.call();
    ShooterConfig::with_heat_without_referee.call();
    ShooterConfig::feed_velocity.call();
    Shooter::new.call();
    Shooter::update.call();
    Shooter::state.call();
    Shooter::shots.call();
    Shooter::tries.call();
    Shooter::heat.call();
}
