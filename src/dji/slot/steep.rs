//! Gains whose scale is impossible for the model.

use crate::control::PidConfig;
use crate::dji::Facts;
use crate::encoder::COUNTS_PER_TURN;

/// Names the proportional gain of a speed loop with which an error of one rpm of the rotor, the finest that feedback tells, asks
/// for more than the whole command range of the model.
pub(super) const fn speed(
    config: &PidConfig,
    facts: &Facts,
    rad_per_s_per_rpm: f32,
) -> Option<&'static str> {
    let steepest = facts.command_full_scale / rad_per_s_per_rpm.abs();
    if exceeds(config, steepest) { Some("kp of the speed loop") } else { None }
}

/// Names the proportional gain of a position loop with which an error of one count of the encoder asks for more than the no-load
/// speed of the model. The gearbox divides both.
pub(super) const fn position(config: &PidConfig, facts: &Facts) -> Option<&'static str> {
    let steepest = facts.rotor_no_load_rpm() as f32 / 60.0 * COUNTS_PER_TURN as f32;
    if exceeds(config, steepest) { Some("kp of the position loop") } else { None }
}

/// NaN and infinity are refused with the other gains.
const fn exceeds(config: &PidConfig, steepest: f32) -> bool {
    let (kp, ..) = config.gains();
    kp > steepest && kp.is_finite()
}
