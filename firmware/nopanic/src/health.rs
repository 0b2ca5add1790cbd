//! What is wrong with a motor.

use crate::opaque::Function;
use drivetrain::dji::{AnyHandle, Bus, Config, M3508};
use drivetrain::motor::{Condition, Conditions, Guard, HealthConfig, Reaction};

pub fn call_all() {
    Condition::as_str.call();
    Conditions::with.call();
    Conditions::without.call();
    Conditions::contains.call();
    Conditions::is_empty.call();
    (|conditions: Conditions| Conditions::iter(conditions).count()).call();
    HealthConfig::new.call();
    (|config: HealthConfig, condition: Condition, reaction: Reaction| {
        HealthConfig::with_reaction(config, condition, reaction)
    })
    .call();
    HealthConfig::with_temperatures.call();
    HealthConfig::with_stall.call();
    HealthConfig::with_stall_hold.call();
    HealthConfig::with_soft_limits.call();
    HealthConfig::validate.call();
    Guard::note.call();
    Guard::conditions.call();
    Guard::next_edge.call();
    Guard::relax_until_armed.call();
    Config::<M3508>::with_health.call();
    Bus::<(), 2>::with_loopback.call();
    Bus::<(), 2>::next_edge.call();
    (|bus: &Bus, motor: AnyHandle| Bus::health(bus, motor)).call();
    (|bus: &Bus, motor: AnyHandle| Bus::conditions(bus, motor)).call();
}
