/// Returns the square root of `x`; NaN for a negative `x`.
///
/// Rounded correctly with the feature `libm`; within one unit in the last place otherwise. `micromath` is never used
/// here: its square root is up to 6 % off.
///
/// Costs 52 instructions on a Cortex-M4F (`docs/figures.md`).
///
/// # Examples
/// ```
/// assert_eq!(drivetrain::math::sqrt(2.25), 1.5);
/// assert!(drivetrain::math::sqrt(-1.0).is_nan());
/// ```
#[must_use]
pub fn sqrt(x: f32) -> f32 {
    #[cfg(feature = "libm")]
    {
        libm::sqrtf(x)
    }
    #[cfg(not(feature = "libm"))]
    {
        newton(x)
    }
}

/// Returns the cube root of a positive `x`, to two units in the last place, and 0 for every `x` that is not above 1e-37.
///
/// A third of the exponent for a start with an error of 5 % at most, then three steps of Newton's rule.
pub(crate) const fn cube_root(x: f32) -> f32 {
    if x.is_nan() || x <= 1e-37 {
        return 0.0;
    }
    let mut root = f32::from_bits(x.to_bits() / 3 + 0x2A51_19F2);
    root = (2.0 * root + x / (root * root)) * (1.0 / 3.0);
    root = (2.0 * root + x / (root * root)) * (1.0 / 3.0);
    (2.0 * root + x / (root * root)) * (1.0 / 3.0)
}

/// Returns the square root of a positive `x`, to one unit in the last place, and 0 for every `x` that is not above 1.2e-38; NaN for infinity.
///
/// A third of the instructions of [`sqrt`]: half of the exponent for an inverse root with an error of 3.5 % at most, two steps of
/// Newton's rule without a division, and one for the root itself.
#[inline]
pub(crate) const fn quick_root(x: f32) -> f32 {
    if x.is_nan() || x <= f32::MIN_POSITIVE {
        return 0.0;
    }
    let half = 0.5 * x;
    let mut inverse = f32::from_bits(0x5F37_59DF - (x.to_bits() >> 1));
    inverse *= 1.5 - half * inverse * inverse;
    inverse *= 1.5 - half * inverse * inverse;
    let root = x * inverse;
    root + 0.5 * inverse * (x - root * root)
}

/// The same for every `x`.
#[cfg(any(test, not(feature = "libm")))]
const fn newton(x: f32) -> f32 {
    const SCALE: f32 = 16_777_216.0; // 4096 squared
    if x < 0.0 {
        return f32::NAN;
    }
    if !(x > 0.0 && x < f32::INFINITY) {
        return x; // zero, infinity, NaN
    }
    if x <= f32::MIN_POSITIVE { quick_root(x * SCALE) / 4096.0 } else { quick_root(x) }
}

#[cfg(test)]
#[expect(clippy::cast_possible_truncation, reason = "f64 is the reference, f32 under test")]
mod tests {
    use super::*;

    fn units_off(root: f32, x: f32) -> f64 {
        let exact = f64::from(x).sqrt();
        let spacing =
            f64::from(f32::from_bits((exact as f32).to_bits() + 1)) - f64::from(exact as f32);
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
                root(-1e-30).is_nan()
                    && root(f32::NAN).is_nan()
                    && root(f32::NEG_INFINITY).is_nan()
            );
            assert_eq!((root(0.0), root(f32::INFINITY)), (0.0, f32::INFINITY));
        }
    }
}
