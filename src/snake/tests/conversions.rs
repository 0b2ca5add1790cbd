//! Every `f32` that may be asked for.

use crate::math::tests::every_f32;
use crate::snake::slot::to_pulses;

#[test]
#[ignore = "2^32 angles and speeds: by .ci/run"]
fn every_f32_becomes_the_nearest_pulse() {
    /// Of 65536 in a turn.
    const PULSES: f64 = 65_536.0 / core::f64::consts::TAU;
    every_f32(|bits| {
        let radians = f32::from_bits(bits);
        let pulses = f64::from(to_pulses(radians));
        let exact = f64::from(radians) * PULSES;
        let exact = exact.clamp(i32::MIN.into(), i32::MAX.into());
        let is_near = (pulses - exact).abs() <= 0.5 + exact.abs() * 1.8e-7;
        assert!(is_near || radians.is_nan() && pulses == 0.0, "{radians:e}: {pulses}");
    });
    std::println!("exhaustive: pulses of a joint: 4294967296 values");
}
