//! Configuration of a motor: at the start, and while running.

use super::{NO_GAINS, Slot};
use crate::control::{Pid, PidConfig};
use crate::dji::codec::{ErrorTable, Range, to_raw};
use crate::dji::config::PlainConfig;
use crate::dji::error::SteepGain;
use crate::dji::outbox::Place;
use crate::dji::{AttachError, Facts};
use crate::encoder::{COUNTS_PER_TURN, Homing, Shaft};
use crate::error::ConfigError;
use crate::motor::{Capabilities, Capability, HealthConfig, MotorGuard, MotorName};
use core::f32::consts::TAU;

/// Makes the slot of a motor, validating its configuration.
pub(in crate::dji) const fn configured(
    facts: &'static Facts,
    config: &PlainConfig,
    place: Place,
    generation: u8,
) -> Result<Slot, AttachError> {
    let motor = MotorName::new(facts.name, config.id);
    macro_rules! parameter {
        ($name:expr) => {
            AttachError::Parameter { motor, parameter: $name }
        };
    }
    let full_scale = config.command_full_scale;
    if !(full_scale.is_finite() && full_scale > 0.0) {
        return Err(parameter!("nominal voltage"));
    }
    let limit = match config.limit {
        Some(limit) => limit,
        None => full_scale,
    };
    if !(limit > 0.0 && limit <= full_scale) {
        return Err(parameter!("command limit"));
    }
    let nm_per_a = match config.torque_constant_nm_per_a {
        Some(nm_per_a) => nm_per_a,
        None => facts.torque_constant_nm_per_a * config.gear.as_f32() / facts.gear.as_f32(),
    };
    if !(nm_per_a.is_finite() && nm_per_a > 0.0) {
        return Err(parameter!("torque constant"));
    }
    let sign = if config.reversed { -1.0 } else { 1.0 };
    let raw_per_unit = config.command_raw as f32 / full_scale;
    let limit_raw = to_raw(limit, raw_per_unit, config.command_raw);
    let rad_per_s_per_rpm = sign * (TAU / 60.0) / config.gear.as_f32();
    let fastest = no_load_velocity(facts, rad_per_s_per_rpm);
    let position = within(config.position, fastest);
    let speed = within(config.speed, limit);
    let (position_loop, speed_loop) = match (Pid::new(position), Pid::new(speed)) {
        (Ok(position), Ok(speed)) => (position, speed),
        (Err(error), _) | (_, Err(error)) => return Err(parameter!(error.parameter())),
    };
    if position.needs_setpoint() {
        return Err(parameter!(OPTION));
    }
    if let Some(gain) = steep_position(&position, facts) {
        let SteepGain { parameter, value, highest } = gain;
        return Err(AttachError::Gain { motor, parameter, value, highest });
    }
    if let Some(gain) = steep_speed(&speed, facts, rad_per_s_per_rpm) {
        let SteepGain { parameter, value, highest } = gain;
        return Err(AttachError::Gain { motor, parameter, value, highest });
    }
    if let Err(name) = config.health.validate() {
        return Err(parameter!(name));
    }
    let direct = config.gear.rotor() == config.gear.output();
    Ok(Slot {
        facts: Some(facts),
        shaft: Shaft::new(config.gear, config.reversed),
        rad_per_s_per_rpm,
        raw_per_unit: sign * raw_per_unit,
        nm_per_a,
        range: Range::within(limit_raw),
        full_limit: limit_raw,
        guard: MotorGuard::NEW.with(config.opening, config.resumes),
        speed: speed_loop,
        position: position_loop.core,
        generation,
        place,
        health: config.health,
        calm_word: calm_word(config.health, limit_raw),
        homing: if direct { Homing::Absolute } else { Homing::Relative },
        ..Slot::FREE
    })
}

/// Feed-forward, period, tracking, derivative of the error: a position loop has no setpoint, only an error.
const OPTION: &str = "option of the setpoint";

/// Returns the command below which a motor needs no full check.
const fn calm_word(health: &HealthConfig, full_limit: i16) -> u16 {
    // The lower of the bounds of a stall and of a runaway, which is half of the command.
    let effort = if health.stall_effort() < 0.5 { health.stall_effort() } else { 0.5 };
    to_raw(effort, full_limit as f32, full_limit).unsigned_abs()
}

/// Returns the capabilities of the motor with its loops.
pub(in crate::dji) fn capabilities(slot: &Slot) -> Capabilities {
    let Some(facts) = slot.facts else { return Capabilities::NONE };
    let set = Capabilities::of(&[Capability::Raw, facts.control, Capability::Feedback]);
    [
        (Capability::Velocity, slot.has_speed_loop()),
        (Capability::Angle, slot.has_position_loop()),
        (Capability::Position, slot.has_position_loop()),
        (Capability::Temperature, facts.has_temperature),
        (Capability::ErrorCodes, facts.errors != ErrorTable::None),
        (Capability::AbsoluteAngle, slot.shaft.is_direct()),
    ]
    .into_iter()
    .filter(|(_, offered)| *offered)
    .fold(set, |set, (capability, _)| set.with(capability))
}

/// Changes the gains of the speed loop without a jump of its output.
pub(in crate::dji) fn set_speed_loop(
    slot: &mut Slot,
    config: PidConfig,
) -> Result<(), ConfigError> {
    let facts = slot.facts.ok_or(super::DETACHED)?;
    let limit = f32::from(slot.full_limit) / slot.raw_per_unit.abs();
    let steep = steep_speed(&config, facts, slot.rad_per_s_per_rpm);
    slot.rest_loops();
    let replaced = checked(slot.has_speed_loop(), config, limit, steep)
        .and_then(|config| slot.speed.set_config(config));
    slot.apply_rules();
    replaced
}

/// Changes the gains of the position loop without a jump of its output.
pub(in crate::dji) fn set_position_loop(
    slot: &mut Slot,
    config: PidConfig,
) -> Result<(), ConfigError> {
    let facts = slot.facts.ok_or(super::DETACHED)?;
    let limit = no_load_velocity(facts, slot.rad_per_s_per_rpm);
    if config.needs_setpoint() {
        return Err(ConfigError::Unusable(OPTION));
    }
    let steep = steep_position(&config, facts);
    slot.rest_loops();
    let replaced = checked(slot.has_position_loop(), config, limit, steep)
        .and_then(|config| slot.position.as_pid(|pid| pid.set_config(config)));
    slot.apply_rules();
    replaced
}

/// Returns the velocity of the output shaft without load: the limit of a position loop.
const fn no_load_velocity(facts: &Facts, rad_per_s_per_rpm: f32) -> f32 {
    facts.rotor_no_load_rpm() as f32 * rad_per_s_per_rpm.abs()
}

/// Narrows the output of a loop to ±`limit`, if there is a loop.
const fn within(config: Option<PidConfig>, limit: f32) -> PidConfig {
    let Some(config) = config else { return NO_GAINS };
    let (lower, upper) = config.output_range();
    let lower = if lower < -limit { -limit } else { lower };
    let upper = if upper > limit { limit } else { upper };
    config.with_output_range(lower, upper)
}

/// Returns the configuration for an existing loop, narrowed to ±`limit`.
fn checked(
    is_there: bool,
    config: PidConfig,
    limit: f32,
    steep: Option<SteepGain>,
) -> Result<PidConfig, ConfigError> {
    if !is_there {
        return Err(ConfigError::Unusable("handle of a motor without this loop"));
    }
    if let Some(SteepGain { parameter, value, highest }) = steep {
        let (value, most) = (value as f32, highest as f32);
        return Err(ConfigError::Range { parameter, value, least: 0.0, most });
    }
    Ok(within(Some(config), limit))
}

/// Returns the proportional gain of a speed loop if its command for an error of one rpm of the rotor, the resolution of the feedback,
/// exceeds the whole command range of the model.
const fn steep_speed(
    config: &PidConfig,
    facts: &Facts,
    rad_per_s_per_rpm: f32,
) -> Option<SteepGain> {
    let steepest = facts.command_full_scale / rad_per_s_per_rpm.abs();
    beyond(config, "kp of the speed loop", steepest)
}

/// Returns the proportional gain of a position loop if its command for an error of one count of the encoder exceeds the no-load speed of
/// the model. The gearbox divides both.
const fn steep_position(config: &PidConfig, facts: &Facts) -> Option<SteepGain> {
    let steepest = facts.rotor_no_load_rpm() as f32 / 60.0 * COUNTS_PER_TURN as f32;
    beyond(config, "kp of the position loop", steepest)
}

/// Returns a gain above the steepest. NaN and infinity are refused with the other gains.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
const fn beyond(config: &PidConfig, parameter: &'static str, steepest: f32) -> Option<SteepGain> {
    let (kp, ..) = config.gains();
    if !(kp > steepest && kp.is_finite()) {
        return None;
    }
    let whole = kp as u32;
    let value = if kp > whole as f32 { whole.saturating_add(1) } else { whole };
    Some(SteepGain { parameter, value, highest: steepest as u32 })
}
