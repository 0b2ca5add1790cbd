//! Gains whose scale is impossible for the model.

use crate::control::PidConfig;
use crate::dji::{Facts, SteepGain};
use crate::encoder::COUNTS_PER_TURN;

/// Returns the proportional gain of a speed loop with which an error of one rpm of the rotor, the finest that feedback tells, asks
/// for more than the whole command range of the model.
pub(super) const fn speed(
    config: &PidConfig,
    facts: &Facts,
    rad_per_s_per_rpm: f32,
) -> Option<SteepGain> {
    let steepest = facts.command_full_scale / rad_per_s_per_rpm.abs();
    beyond(config, "kp of the speed loop", steepest)
}

/// Returns the proportional gain of a position loop with which an error of one count of the encoder asks for more than the no-load
/// speed of the model. The gearbox divides both.
pub(super) const fn position(config: &PidConfig, facts: &Facts) -> Option<SteepGain> {
    let steepest = facts.rotor_no_load_rpm() as f32 / 60.0 * COUNTS_PER_TURN as f32;
    beyond(config, "kp of the position loop", steepest)
}

/// NaN and infinity are refused with the other gains.
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
