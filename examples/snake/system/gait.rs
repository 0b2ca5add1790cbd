//! The serpenoid curve: every joint swings, each a little later than the one before.
//!
//! Source: S. Hirose, "Biologically Inspired Robots" (1993), chapter 2.

use super::JOINTS;
use drivetrain::math::sin_cos;
use std::f32::consts::TAU;

const AMPLITUDE_DEG: f32 = 30.0;
const FREQUENCY_HZ: f32 = 0.4;
/// One and a half waves along the body.
const PHASE_A_JOINT: f32 = 1.5 * TAU / JOINTS as f32;
/// The swing grows to its amplitude in this time.
pub(crate) const FADE_S: f32 = 1.5;

/// Returns the angle of a joint in degrees, `time_s` after the gait began; straight before.
pub(crate) fn angle_deg(joint: usize, time_s: f32) -> f32 {
    let share = (time_s / FADE_S).clamp(0.0, 1.0);
    let fade = share * share * (3.0 - 2.0 * share);
    let phase = TAU * FREQUENCY_HZ * time_s - PHASE_A_JOINT * joint as f32;
    fade * AMPLITUDE_DEG * sin_cos(phase).0
}
