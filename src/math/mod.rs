//! The few elementary functions of motor control, in `f32`, small and fast on a Cortex-M4F.
//!
//! | function | result | largest error, measured |
//! |---|---|---|
//! | [`sin_cos`] | sine and cosine, `const` | 1.6e-7 in ±π, 1.8e-7 up to ±1000 |
//! | [`sqrt`] | square root | half a unit in the last place; 1 unit without `libm` |
//! | [`atan2`] | angle of a vector, -π..=π | 2.7e-7; 0.005 with `micromath` |
//! | [`wrap_pi`], [`wrap_tau`] | an angle in [-π, π) or [0, 2π), `const` | 4e-7 up to ±10 000 |
//! | [`wrap`], [`wrap_positive`] | the same for any period, `const` | 0; `wrap_positive` rounds its sum once |
//!
//! Nothing here panics, and NaN in gives NaN out. `f32::sin` and its like do not exist without `std`, and the
//! portable ones cost a thousand instructions on a target without `f64` hardware.
//!
//! ```
//! use drivetrain::math;
//!
//! const QUARTER: (f32, f32) = math::sin_cos(core::f32::consts::FRAC_PI_2);
//! assert!(QUARTER.0 == 1.0 && QUARTER.1.abs() < 2e-7);
//! assert_eq!(math::wrap(370.0, 360.0), 10.0);
//! ```

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "exact results are the rule under test")]
#[expect(clippy::cast_possible_truncation, reason = "f64 is the reference, f32 under test")]
pub(crate) mod tests;

#[cfg(any(test, not(feature = "micromath")))]
use core::f32::consts::FRAC_PI_2;
use core::f32::consts::{FRAC_2_PI, PI, TAU};

/// Added to and taken from a number of at most 2^22, leaves the nearest integer: 1.5 * 2^23, whose last bit counts ones.
const ROUND: f32 = 12_582_912.0;

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

/// Returns the angle in [-π, π) of the same direction as `x`, both in radians.
///
/// The error is at most 4e-7 up to ±10 000 rad; beyond, the error is at most the spacing of `f32` at `x`. Past four
/// million turns, where the spacing is a third of a turn, the result is some angle in the range. The ends are the `f32`
/// nearest to ±π. NaN and infinity give NaN.
///
/// Costs 18 instructions on a Cortex-M4F (`docs/figures.md`).
///
/// # Examples
/// ```
/// use core::f32::consts::PI;
/// use drivetrain::math::wrap_pi;
///
/// assert!((wrap_pi(1.5 * PI) + 0.5 * PI).abs() < 1e-6);
/// assert_eq!(wrap_pi(PI), -PI);
/// ```
#[must_use]
#[inline]
pub const fn wrap_pi(x: f32) -> f32 {
    // The upper part has 12 bits, so its product with up to 4096 turns is exact.
    const UPPER: f32 = 6.283_203;
    const LOWER: f32 = -1.781_782e-5;
    let turns = (x * (1.0 / TAU) + ROUND) - ROUND;
    let rest = x - turns * UPPER - turns * LOWER;
    if rest.abs() < PI { rest } else { at_the_edge(rest, x) }
}

/// Returns the angle in [0, 2π) of the same direction as `x`, both in radians.
///
/// Errors, NaN and infinity as in [`wrap_pi`]. A result that rounding would put on 2π, such as a tiny negative angle,
/// is 0.
///
/// # Examples
/// ```
/// use drivetrain::math::wrap_tau;
///
/// assert!((wrap_tau(-1.0) - 5.283_185_3).abs() < 1e-6);
/// assert_eq!(wrap_tau(-1e-20), 0.0);
/// ```
#[must_use]
#[inline]
pub const fn wrap_tau(x: f32) -> f32 {
    positive(wrap_pi(x), TAU)
}

/// Returns the value in [-`period`/2, `period`/2) that differs from `x` by whole periods.
///
/// Exact for every finite `x` and every normal `period`. Within one period, and within 4096 periods of at most 12 significant
/// bits (360.0, 8192.0), wrapping takes one division; beyond, a division of integers for every 8 bits of the quotient, 36 at
/// most. NaN and infinity give NaN, and so does a period of zero, a negative or an infinite period.
///
/// # Examples
/// ```
/// use drivetrain::math::wrap;
///
/// assert_eq!(wrap(10.0 - 350.0, 360.0), 20.0); // from 350 to 10 degrees is +20
/// assert_eq!(wrap(350.0 - 10.0, 360.0), -20.0);
/// assert_eq!(wrap(180.0, 360.0), -180.0);
/// assert_eq!(wrap(1e10, 360.0), -80.0); // 27 777 778 turns less 80 degrees
/// ```
#[must_use]
#[inline]
pub const fn wrap(x: f32, period: f32) -> f32 {
    // The product of two numbers of 12 bits has 24, as many as `f32`.
    const LOWER_BITS: u32 = 0xFFF;
    const MOST_TURNS: f32 = 4096.0;
    let turns = (x / period + ROUND) - ROUND;
    let rest = x - turns * period;
    let exact_turns = if period.to_bits() & LOWER_BITS == 0 { MOST_TURNS } else { 1.0 };
    if turns.abs() <= exact_turns && rest.abs() < 0.5 * period { rest } else { far(x, period) }
}

/// Returns the value of [`wrap`] for a period of twice `half`, to within the spacing of `f32` at `x`, in fewer instructions and without a
/// call.
///
/// Beyond 4 million periods, where `x` holds no remainder any more, the value is any within half a period; for NaN and infinity
/// the value is zero.
#[inline]
pub(crate) const fn shortest(x: f32, half: f32) -> f32 {
    if x.abs() < half {
        return x;
    }
    let period = half + half;
    let turns = (x / period + ROUND) - ROUND;
    let rest = x - turns * period;
    if rest.abs() < half {
        return rest;
    }
    folded(rest, half, period)
}

/// Returns a rest at the half turn itself, or rounded to the wrong side of it, on the right side; zero where the argument held no
/// remainder any more.
#[inline]
const fn folded(rest: f32, half: f32, period: f32) -> f32 {
    let near = if rest >= half {
        rest - period
    } else if rest < -half {
        rest + period
    } else {
        rest
    };
    if near >= -half && near < half { near } else { 0.0 }
}

/// Returns `value` within `lower..=upper`; the caller guarantees their order.
#[inline]
pub(crate) const fn limited(value: f32, lower: f32, upper: f32) -> f32 {
    if value > upper {
        upper
    } else if value < lower {
        lower
    } else {
        value
    }
}

/// Returns the value in [0, `period`) that differs from `x` by whole periods.
///
/// NaN, infinity and bad periods as in [`wrap`]. The result is the `f32` nearest to the exact value; if the nearest is `period`
/// itself, as for a tiny negative value, the result is 0.
///
/// # Examples
/// ```
/// use drivetrain::math::wrap_positive;
///
/// assert_eq!(wrap_positive(-90.0, 360.0), 270.0);
/// assert_eq!(wrap_positive(-1e-20, 360.0), 0.0);
/// ```
#[must_use]
#[inline]
pub const fn wrap_positive(x: f32, period: f32) -> f32 {
    positive(wrap(x, period), period)
}

const fn positive(wrapped: f32, period: f32) -> f32 {
    let shifted = if wrapped < 0.0 { wrapped + period } else { wrapped };
    if shifted >= period { 0.0 } else { shifted }
}

/// The half turn itself, a value rounded to the wrong side of it, and arguments too large to hold a remainder.
#[cold]
#[inline(never)]
const fn at_the_edge(rest: f32, x: f32) -> f32 {
    if !x.is_finite() {
        return f32::NAN;
    }
    folded(rest, PI, TAU)
}

/// [`wrap`] by long division of the significands, in digits of 8 bits.
#[cold]
#[inline(never)]
const fn far(x: f32, period: f32) -> f32 {
    const DIGIT: u32 = 8;
    let half = 0.5 * period;
    if !(half > 0.0 && period < f32::INFINITY && x.is_finite()) {
        return f32::NAN;
    }
    let ((dividend, x_exponent), (divisor, exponent)) = (parts(x.abs()), parts(period));
    let mut rest = x.abs();
    if x_exponent >= exponent {
        let mut digits = x_exponent - exponent;
        let mut remainder = remainder(dividend, divisor);
        while digits > 0 {
            let shift = if digits < DIGIT { digits } else { DIGIT };
            remainder = self::remainder(remainder << shift, divisor);
            digits -= shift;
        }
        rest = scaled(remainder, exponent);
    }
    let rest = rest.copysign(x);
    if rest >= half {
        rest - period
    } else if rest < -half {
        rest + period
    } else {
        rest
    }
}

/// Returns the significand of a positive number, of 24 bits, and the power of two of its last bit, plus 150.
const fn parts(value: f32) -> (u32, u32) {
    const HIDDEN: u32 = 1 << 23;
    let (exponent, fraction) = (value.to_bits() >> 23, value.to_bits() & (HIDDEN - 1));
    if exponent == 0 { (fraction, 1) } else { (fraction | HIDDEN, exponent) }
}

const fn remainder(dividend: u32, divisor: u32) -> u32 {
    match dividend.checked_rem(divisor) {
        Some(remainder) => remainder,
        None => 0, // never: a period is above zero
    }
}

/// Puts a number together again from its [`parts`].
#[expect(clippy::cast_precision_loss, reason = "24 bits")]
const fn scaled(significand: u32, exponent: u32) -> f32 {
    // The power of two of 2^-149 to 2^-127 is no normal number.
    let bits = if exponent > 23 { (exponent - 23) << 23 } else { 1 << (exponent - 1) };
    significand as f32 * f32::from_bits(bits)
}
