use super::ROUND;
use core::f32::consts::{PI, TAU};

/// Returns the angle in [-π, π) that points the same way as `x`, both in radians.
///
/// The error is at most 4e-7 up to ±10 000 rad; beyond, it is at most the spacing of `f32` at `x`. Past four million
/// turns, where that spacing is a third of a turn, the result is some angle in the range.
/// The ends are the `f32` nearest to ±π. NaN and infinity give NaN.
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
    // The upper part has 12 bits, so up to 4096 turns times it is exact.
    const UPPER: f32 = 6.283_203;
    const LOWER: f32 = -1.781_782e-5;
    let turns = (x * (1.0 / TAU) + ROUND) - ROUND;
    let rest = x - turns * UPPER - turns * LOWER;
    if rest.abs() < PI { rest } else { at_the_edge(rest, x) }
}

/// Returns the angle in [0, 2π) that points the same way as `x`, both in radians.
///
/// Errors, NaN and infinity as in [`wrap_pi`]. What rounding would put on 2π, such as a tiny negative angle, is 0.
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
/// bits (360.0, 8192.0), it takes one division; beyond, a division of integers for every 8 bits of the quotient, 36 at most. NaN and infinity give
/// NaN, and so does a period that is zero, negative or not finite.
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

/// Returns the value of [`wrap`], to within the spacing of `f32` at `x`, where that is within half a period, the ends not
/// included; otherwise a value that is not. Fewer instructions than [`wrap`], for ways of a few periods.
#[inline]
pub(crate) const fn rest(x: f32, period: f32) -> f32 {
    let turns = (x / period + ROUND) - ROUND;
    x - turns * period
}

/// Returns the value in [0, `period`) that differs from `x` by whole periods.
///
/// NaN, infinity and bad periods as in [`wrap`]. The result is the `f32` nearest to the exact value; where that is `period` itself,
/// as for a tiny negative value, it is 0.
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

/// The half turn itself, what rounding left on the wrong side of it, and arguments too large to hold a remainder.
#[cold]
#[inline(never)]
const fn at_the_edge(rest: f32, x: f32) -> f32 {
    if !x.is_finite() {
        return f32::NAN;
    }
    let near = if rest >= PI {
        rest - TAU
    } else if rest < -PI {
        rest + TAU
    } else {
        rest
    };
    // Here `x` holds no remainder any more: the spacing of f32 is more than a turn.
    if near >= -PI && near < PI { near } else { 0.0 }
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

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "exact results are the rule under test")]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn spacing(x: f32) -> f64 {
        f64::from(f32::from_bits(x.abs().to_bits() + 1)) - f64::from(x.abs())
    }

    /// How far `wrapped` is from `x` by the nearest whole number of periods.
    fn congruence(wrapped: f32, x: f32, period: f64) -> f64 {
        let difference = f64::from(wrapped) - f64::from(x);
        (difference - (difference / period).round() * period).abs()
    }

    #[test]
    fn half_a_period_either_way_is_the_lower_end() {
        assert_eq!(wrap(180.0, 360.0), -180.0);
        assert_eq!(wrap(-180.0, 360.0), -180.0);
        assert_eq!(wrap(540.0, 360.0), -180.0);
        assert_eq!((wrap_pi(PI), wrap_pi(-PI)), (-PI, -PI));
    }

    #[test]
    fn the_upper_end_is_never_reached() {
        for tiny in [-f32::MIN_POSITIVE, -1e-30, -1e-9, -1e-6, -1e-5] {
            assert!(wrap_positive(tiny, 360.0) < 360.0 && wrap_tau(tiny) < TAU);
        }
        let below = f32::from_bits(360.0_f32.to_bits() - 1);
        assert_eq!(wrap_positive(below, 360.0), below);
        assert_eq!(wrap_positive(360.0, 360.0), 0.0);
    }

    #[test]
    fn what_is_not_an_angle_is_nan() {
        for x in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            assert!(wrap_pi(x).is_nan() && wrap_tau(x).is_nan());
            assert!(wrap(x, 360.0).is_nan() && wrap_positive(x, 360.0).is_nan());
        }
    }

    #[test]
    fn a_bad_period_is_nan() {
        for period in [0.0, -0.0, -360.0, f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            assert!(
                wrap(10.0, period).is_nan() && wrap_positive(10.0, period).is_nan(),
                "{period}"
            );
            assert!(wrap(0.0, period).is_nan() && wrap_positive(-1e9, period).is_nan(), "{period}");
        }
    }

    #[test]
    fn huge_arguments_stay_in_range() {
        for x in [1e7, 3e7, -6.1e8, 1e20, f32::MAX, f32::MIN] {
            assert!((-PI..PI).contains(&wrap_pi(x)) && (0.0..TAU).contains(&wrap_tau(x)));
            for period in [1e-30, 0.1, 360.0, 1e30] {
                assert!((-0.5 * period..0.5 * period).contains(&wrap(x, period)));
                assert!((0.0..period).contains(&wrap_positive(x, period)));
            }
        }
    }

    /// At 1e10 the result was 0, and past 46 000 turns it was off by up to the spacing of `f32`.
    #[test]
    fn huge_arguments_are_wrapped_exactly() {
        assert_eq!((wrap(1e10, 360.0), wrap(-1e10, 360.0)), (-80.0, 80.0));
        assert_eq!((wrap_positive(1e10, 360.0), wrap_positive(-1e10, 360.0)), (280.0, 80.0));
        // 2^128 less 2^104, in integers of 128 bits.
        let rest = ((1_u128 << 127) % 360 * 2 + 360 - (1_u128 << 104) % 360) % 360;
        assert_eq!(
            f64::from(wrap_positive(f32::MAX, 360.0)),
            f64::from(u16::try_from(rest).unwrap())
        );
        // 2^24 - 1 times 2^253, by 11: the rest is 10.
        assert_eq!(wrap(f32::MAX, f32::from_bits(11)), -f32::from_bits(1));
        assert_eq!(wrap(f32::MAX, f32::MIN_POSITIVE), 0.0);
    }

    /// Of doubles, `%` is exact, and so is each `f32` as a double.
    fn expected(x: f32, period: f32) -> f64 {
        let (x, period) = (f64::from(x), f64::from(period));
        let rest = x % period;
        if rest >= 0.5 * period {
            rest - period
        } else if rest < -0.5 * period {
            rest + period
        } else {
            rest
        }
    }

    #[test]
    fn wrapped_angles_keep_their_error() {
        let worst = (-2_000_000..=2_000_000_i32)
            .map(|step| step as f32 * 0.005)
            .map(|x| congruence(wrap_pi(x), x, core::f64::consts::TAU))
            .fold(0.0, f64::max);
        assert!(worst <= 4e-7, "{worst}");
    }

    fn any_x() -> impl Strategy<Value = f32> {
        prop_oneof![
            -1e4_f32..1e4,
            -1e9_f32..1e9,
            any::<f32>().prop_filter("finite", |x| x.is_finite())
        ]
    }

    proptest! {
        #[test]
        fn results_are_in_range(x in any_x(), period in 1e-3_f32..1e6) {
            prop_assert!((-0.5 * period..0.5 * period).contains(&wrap(x, period)));
            prop_assert!((0.0..period).contains(&wrap_positive(x, period)));
            prop_assert!((-PI..PI).contains(&wrap_pi(x)) && (0.0..TAU).contains(&wrap_tau(x)));
        }

        /// Law: the result is the exact remainder, whatever the number of periods.
        #[test]
        fn every_finite_argument_is_wrapped_exactly(
            x in any_x(),
            period in prop_oneof![
                Just(360.0_f32), Just(TAU), Just(0.1_f32), 1e-3_f32..1e6, f32::MIN_POSITIVE..f32::MAX, 1e-38_f32..1e-30,
            ],
            turns in -5000_i16..5000, part in -0.6_f32..0.6,
        ) {
            for x in [x, (f32::from(turns) + part) * period] {
                if x.is_finite() {
                    prop_assert_eq!(f64::from(wrap(x, period)), expected(x, period), "{} by {}", x, period);
                }
            }
        }

        #[test]
        fn results_are_congruent_to_within_the_spacing_of_the_argument(x in any_x(), period in 1e-3_f32..1e6) {
            let period = period.max((x.abs() / 4.0e6).min(1e30));
            let x = x.clamp(-1e36, 1e36);
            let slack = spacing(x) + 1e-7 * f64::from(period);
            prop_assert!(congruence(wrap(x, period), x, f64::from(period)) <= slack);
            prop_assert!(congruence(wrap_positive(x, period), x, f64::from(period)) <= slack);
            if x.abs() < 2.5e7 {
                prop_assert!(congruence(wrap_pi(x), x, core::f64::consts::TAU) <= spacing(x) + 4e-7);
            }
        }

        #[test]
        fn wrapping_twice_is_wrapping_once(x in any_x(), period in 1e-3_f32..1e6) {
            let once = wrap(x, period);
            prop_assert_eq!(wrap(once, period), once);
            prop_assert_eq!(wrap_pi(wrap_pi(x)), wrap_pi(x));
        }

        #[test]
        fn whole_periods_change_nothing(x in -180_i16..180, sixteenths in 0_u8..16, turns in -1000_i16..1000) {
            let angle = f32::from(x) + f32::from(sixteenths) / 16.0;
            prop_assert_eq!(wrap(angle + 360.0 * f32::from(turns), 360.0), wrap(angle, 360.0));
        }
    }
}
