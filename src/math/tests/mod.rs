//! Tests, and sweeps for other modules.

mod wrap;

use super::*;
use core::f32::consts::PI;
use proptest::prelude::*;

/// Calls `check` with the bits of every `f32`, on two threads, as the machine of the checks has cores: one a sign, upward.
pub(crate) fn every_f32(check: impl Fn(u32) + Sync) {
    std::thread::scope(|scope| {
        for sign in [0, 1 << 31] {
            let check = &check;
            scope.spawn(move || (0..1 << 31).for_each(|bits| check(sign | bits)));
        }
    });
}

fn error_of_sin_cos(x: f32) -> f64 {
    let (sine, cosine) = sin_cos(x);
    let exact = f64::from(x).sin_cos();
    (f64::from(sine) - exact.0).abs().max((f64::from(cosine) - exact.1).abs())
}

fn worst_in(limit: f32, steps: u32) -> f64 {
    (0..=steps)
        .map(|step| limit * (2.0 * step as f32 / steps as f32 - 1.0))
        .map(error_of_sin_cos)
        .fold(0.0, f64::max)
}

#[test]
fn sin_cos_keeps_its_errors() {
    let (turn, thousand) = (worst_in(PI, 2_000_000), worst_in(1_000.0, 2_000_000));
    assert!(turn <= 1.6e-7, "{turn}");
    assert!(thousand <= 1.8e-7, "{thousand}");
}

#[test]
fn sin_cos_is_defined_everywhere() {
    for x in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        assert!(sin_cos(x).0.is_nan() && sin_cos(x).1.is_nan());
    }
    for x in [6.6e6, -6.6e6, 1e20, f32::MAX, f32::MIN] {
        assert_eq!(sin_cos(x), (0.0, 1.0));
    }
    assert_eq!(sin_cos(0.0), (0.0, 1.0));
}

fn worst_of_atan2(angle_of: fn(f32, f32) -> f32) -> f64 {
    let mut worst = 0.0_f64;
    for step in 0..200_000_i32 {
        let (sine, cosine) = (f64::from(step - 100_000) * 1e-5 * core::f64::consts::PI).sin_cos();
        for radius in [1e-10, 0.3, 7e8] {
            let (y, x) = ((sine * radius) as f32, (cosine * radius) as f32);
            let exact = f64::from(y).atan2(f64::from(x));
            let error = (f64::from(angle_of(y, x)) - exact).abs();
            worst = worst.max(error.min((error - core::f64::consts::TAU).abs()));
        }
    }
    worst
}

#[test]
fn atan2_keeps_its_error() {
    let (chosen, own) = (worst_of_atan2(atan2), worst_of_atan2(octant_atan2));
    assert!(chosen <= if cfg!(feature = "micromath") { 5e-3 } else { 2.7e-7 }, "{chosen}");
    assert!(own <= 2.7e-7, "{own}");
}

#[test]
fn atan2_of_the_axes_the_zero_vector_and_nan() {
    for angle_of in [atan2, octant_atan2] {
        let about = |angle: f32, expected: f32| {
            assert!((angle - expected).abs() < 5e-3, "{angle} {expected}")
        };
        about(angle_of(0.0, 1.0), 0.0);
        about(angle_of(1.0, 0.0), FRAC_PI_2);
        about(angle_of(0.0, -1.0).abs(), PI);
        about(angle_of(-1.0, 0.0), -FRAC_PI_2);
        assert_eq!(angle_of(0.0, 0.0), 0.0);
        assert_eq!(angle_of(-0.0, -0.0), 0.0);
        assert!(angle_of(f32::NAN, 1.0).is_nan() && angle_of(1.0, f32::NAN).is_nan());
        assert!(angle_of(f32::NAN, 0.0).is_nan() && angle_of(0.0, f32::NAN).is_nan());
    }
}

proptest! {
    #[test]
    fn sine_and_cosine_lie_on_the_unit_circle(x in -1e30_f32..1e30) {
        let (sine, cosine) = sin_cos(x);
        prop_assert!((sine * sine + cosine * cosine - 1.0).abs() < 5e-7);
    }

    #[test]
    fn sine_is_odd_and_cosine_is_even(x in -1000.0_f32..1000.0) {
        prop_assert_eq!(sin_cos(-x).0, -sin_cos(x).0);
        prop_assert_eq!(sin_cos(-x).1, sin_cos(x).1);
    }
}

fn units_off(root: f32, x: f32) -> f64 {
    let exact = f64::from(x).sqrt();
    let spacing = f64::from(f32::from_bits((exact as f32).to_bits() + 1)) - f64::from(exact as f32);
    ((f64::from(root) - exact) / spacing).abs()
}

#[test]
fn both_roots_are_within_a_unit_in_the_last_place() {
    let mut worst = (0.0_f64, 0.0_f64);
    for bits in (1..f32::INFINITY.to_bits()).step_by(2_003) {
        let x = f32::from_bits(bits);
        worst.0 = worst.0.max(units_off(sqrt(x), x));
        worst.1 = worst.1.max(units_off(newton(x), x));
    }
    assert!(worst.0 <= 1.0 && worst.1 <= 1.0, "{worst:?}");
    #[cfg(feature = "libm")]
    assert!(worst.0 <= 0.5, "{worst:?}");
}

#[test]
fn the_cube_root_is_within_two_units_in_the_last_place() {
    for bits in (0x0300_0000..f32::INFINITY.to_bits()).step_by(2_003) {
        let x = f32::from_bits(bits);
        let exact = f64::from(x).cbrt();
        assert!((f64::from(cube_root(x)) / exact - 1.0).abs() < 2.4e-7, "{x}");
    }
    assert_eq!((cube_root(0.0), cube_root(-1.0), cube_root(f32::NAN)), (0.0, 0.0, 0.0));
}

#[test]
fn a_negative_square_root_is_nan_and_the_ends_stay() {
    for root in [sqrt, newton] {
        assert!(
            root(-1e-30).is_nan() && root(f32::NAN).is_nan() && root(f32::NEG_INFINITY).is_nan()
        );
        assert_eq!((root(0.0), root(f32::INFINITY)), (0.0, f32::INFINITY));
    }
}
