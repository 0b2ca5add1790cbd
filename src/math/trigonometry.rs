use super::ROUND;
use core::f32::consts::FRAC_2_PI;
#[cfg(any(test, not(feature = "micromath")))]
use core::f32::consts::FRAC_PI_2;

/// Returns the sine and the cosine of `x` radians.
///
/// The largest error is 1.6e-7 in ±π and 1.8e-7 up to ±1000; beyond, the error grows with the spacing of `f32` at `x`
/// (half of it, 0.03 at a million). Past 6.5 million radians, where neighbouring values lie half a radian apart, the
/// angle counts as 0. NaN and infinity give NaN. Takes the same number of instructions for every argument.
///
/// A quarter turn is taken off in two parts (Cody and Waite), the rest goes through minimax polynomials.
///
/// Costs 58 instructions on a Cortex-M4F (`docs/figures.md`).
///
/// # Examples
/// ```
/// use drivetrain::math::sin_cos;
///
/// const THIRTY_DEGREES: (f32, f32) = sin_cos(core::f32::consts::FRAC_PI_6);
/// assert!((THIRTY_DEGREES.0 - 0.5).abs() < 2e-7 && (THIRTY_DEGREES.1 - 0.866_025_4).abs() < 2e-7);
/// assert!(sin_cos(f32::INFINITY).0.is_nan());
/// ```
#[must_use]
#[inline]
pub const fn sin_cos(x: f32) -> (f32, f32) {
    const LARGEST: f32 = 6.5e6;
    // The upper part has 12 bits, so its product with up to 4096 quarter turns is exact.
    const UPPER: f32 = 1.570_800_8;
    const LOWER: f32 = -4.454_455e-6;
    let x = if x.abs() > LARGEST { x * 0.0 } else { x };
    let shifted = x * FRAC_2_PI + ROUND;
    let quadrant = shifted.to_bits();
    let quarters = shifted - ROUND;
    let rest = x - quarters * UPPER - quarters * LOWER;
    let square = rest * rest;
    let sine = rest
        + rest * square * (-0.166_666_51 + square * (0.008_331_978 + square * -0.000_194_955_68));
    let cosine = 1.0 - 0.5 * square + square * square * (0.041_661_277 + square * -0.001_365_240_3);
    let (sine, cosine) = if quadrant & 1 == 0 { (sine, cosine) } else { (cosine, sine) };
    (
        f32::from_bits(sine.to_bits() ^ ((quadrant & 2) << 30)),
        f32::from_bits(cosine.to_bits() ^ ((quadrant.wrapping_add(1) & 2) << 30)),
    )
}

/// Returns the angle of the vector (`x`, `y`) in radians, -π..=π, counter-clockwise from the x axis.
///
/// The largest error is 2.7e-7; with the feature `micromath`, 0.005, at fewer instructions, for vectors of a length
/// from 1e-15 to 1e15, and on the negative x axis either of ±π. The zero vector has the angle 0. NaN in either argument
/// gives NaN; infinity may give NaN.
///
/// Costs 63 instructions on a Cortex-M4F (`docs/figures.md`).
///
/// # Examples
/// ```
/// use core::f32::consts::{FRAC_PI_2, FRAC_PI_4};
/// use drivetrain::math::atan2;
///
/// assert!((atan2(1.0, 0.0) - FRAC_PI_2).abs() < 0.005);
/// assert!((atan2(-2.0, 2.0) + FRAC_PI_4).abs() < 0.005);
/// ```
#[must_use]
pub fn atan2(y: f32, x: f32) -> f32 {
    #[cfg(feature = "micromath")]
    {
        if y == 0.0 && x == 0.0 { 0.0 } else { micromath::F32Ext::atan2(y, x) }
    }
    #[cfg(not(feature = "micromath"))]
    {
        octant_atan2(y, x)
    }
}

/// Arc tangent of the flatter side over the steeper side by a minimax polynomial, then unfolded to the full turn. π and its half are
/// sums of two numbers each.
#[cfg(any(test, not(feature = "micromath")))]
const fn octant_atan2(y: f32, x: f32) -> f32 {
    const LOWER_PI: f32 = -8.742_278e-8;
    let steep = y.abs() > x.abs();
    let (short, long) = if steep { (x.abs(), y.abs()) } else { (y.abs(), x.abs()) };
    if long == 0.0 {
        return short; // the zero vector, or NaN
    }
    let slope = short / long;
    let z = slope * slope;
    let series = -0.333_331_53
        + z * (0.199_937_73
            + z * (-0.142_110_56
                + z * (0.106_660_04
                    + z * (-0.075_522_125
                        + z * (0.043_211_836 + z * (-0.016_367_914 + z * 0.002_920_688_6))))));
    let octant = slope + slope * z * series;
    let quadrant = if steep { FRAC_PI_2 - (octant - 0.5 * LOWER_PI) } else { octant };
    let half = if x < 0.0 { core::f32::consts::PI - (quadrant - LOWER_PI) } else { quadrant };
    half.copysign(y)
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "exact results are the rule under test")]
#[expect(clippy::cast_possible_truncation, reason = "f64 is the reference, f32 under test")]
mod tests {
    use super::*;
    use core::f32::consts::PI;
    use proptest::prelude::*;

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
            let (sine, cosine) =
                (f64::from(step - 100_000) * 1e-5 * core::f64::consts::PI).sin_cos();
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
}
