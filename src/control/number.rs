//! Arithmetic with finite results, numbers of twice the precision of `f32`, and roots of functions.

use crate::math::{self, limited};
use core::ops::{Add, Div, Mul, Neg, Sub};

/// Returns `value`; if infinite, the largest number of its sign; if NaN, zero.
#[inline]
pub(super) const fn finite(value: f32) -> f32 {
    if value.abs() <= f32::MAX {
        value
    } else if value.is_nan() {
        0.0
    } else {
        f32::MAX.copysign(value)
    }
}

/// Returns the effort against dry friction: `gain` in the direction of `motion`, and zero at rest.
#[inline]
pub(super) const fn friction(gain: f32, motion: f32) -> f32 {
    if motion > 0.0 {
        gain
    } else if motion < 0.0 {
        -gain
    } else {
        0.0
    }
}

/// A sum without loss, of any size: a plain sum in `f32` of steps of 0.5 ms stands still at 16384 s. A part beyond `f32` is cut
/// off and lost.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub(super) struct Sum {
    value: f32,
    /// The part not yet contained in the value.
    rest: f32,
}

impl Sum {
    pub(super) const ZERO: Self = Self::from(0.0);

    pub(super) const fn from(value: f32) -> Self {
        Self { value, rest: 0.0 }
    }

    #[inline]
    pub(super) const fn add(&mut self, change: f32) {
        let change = self.rest + change;
        let value = self.value + change;
        let rest = change - (value - self.value);
        *self = if value.is_finite() { Self { value, rest } } else { Self::from(finite(value)) };
    }

    #[inline]
    pub(super) const fn value(self) -> f32 {
        self.value
    }

    /// Returns the difference to `other`, exact when the two are near; may overflow.
    #[inline]
    pub(super) const fn above(self, other: f32) -> f32 {
        self.value - other + self.rest
    }
}

/// A number as the sum of two `f32`, of 48 bits: 1 in 10^14.
///
/// For differences of large numbers: in `motion`, the distance after stopping, whose cube root is the time of a short move, so an error of
/// 1e-7 becomes an error of 5e-3; in `state_space`, a Riccati equation. The algorithms of Dekker (1971) and Knuth (TAOCP 2, 4.2.2) are used
/// without a fused multiply-add, which `core` lacks.
#[derive(Debug, Default, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub(super) struct Wide {
    high: f32,
    low: f32,
}

impl Wide {
    pub(super) const ZERO: Self = Self::of(0.0);
    pub(super) const THIRD: Self = Self { high: 1.0 / 3.0, low: -9.934_107e-9 };

    pub(super) const fn of(value: f32) -> Self {
        Self { high: value, low: 0.0 }
    }

    /// Returns the nearest `f32`.
    #[inline]
    pub(super) const fn narrow(self) -> f32 {
        self.high
    }

    /// Returns what the nearest `f32` leaves.
    #[inline]
    pub(super) const fn rest(self) -> f32 {
        self.low
    }

    /// Adds two numbers of which the first is not the smaller one.
    #[inline]
    fn renewed(high: f32, low: f32) -> Self {
        let sum = high + low;
        Self { high: sum, low: low - (sum - high) }
    }

    /// Returns the exact difference of two `f32`.
    #[inline]
    pub(super) fn difference(minuend: f32, subtrahend: f32) -> Self {
        Self::sum(minuend, -subtrahend)
    }

    #[inline]
    fn sum(a: f32, b: f32) -> Self {
        let high = a + b;
        let of_b = high - a;
        Self { high, low: (a - (high - of_b)) + (b - of_b) }
    }

    /// Returns the exact product of two `f32`.
    #[inline]
    pub(super) fn product(a: f32, b: f32) -> Self {
        let ((a_high, a_low), (b_high, b_low)) = (halves(a), halves(b));
        let high = a * b;
        let low = ((a_high * b_high - high) + a_high * b_low + a_low * b_high) + a_low * b_low;
        Self { high, low }
    }

    #[inline]
    pub(super) fn squared(self) -> Self {
        let (a_high, a_low) = halves(self.high);
        let high = self.high * self.high;
        let low = ((a_high * a_high - high) + 2.0 * a_high * a_low) + a_low * a_low;
        Self::renewed(high, low + 2.0 * self.high * self.low)
    }

    /// Returns `1 / value`.
    #[inline]
    pub(super) fn reciprocal(value: f32) -> Self {
        let high = 1.0 / value;
        let product = Self::product(high, value);
        let rest = (1.0 - product.high) - product.low;
        Self::renewed(high, high * rest)
    }

    /// Returns the square root, and zero of a negative number.
    #[inline]
    pub(super) fn root(self) -> Self {
        let high = math::quick_root(self.high);
        if high <= 0.0 {
            return Self::ZERO;
        }
        let rest = self - Self::of(high).squared();
        Self::renewed(high, 0.5 * rest.high / high)
    }

    /// Returns the lesser one of two.
    #[inline]
    pub(super) fn lesser(self, other: Self) -> Self {
        if (self - other).high < 0.0 { self } else { other }
    }

    /// Returns zero for a negative number.
    #[inline]
    pub(super) const fn positive(self) -> Self {
        if self.high > 0.0 { self } else { Self::ZERO }
    }

    /// Returns the half, or another product with a power of two.
    #[inline]
    pub(super) const fn scaled(self, power_of_two: f32) -> Self {
        Self { high: power_of_two * self.high, low: power_of_two * self.low }
    }
}

/// Splits a number into two halves of 12 bits.
#[inline]
fn halves(value: f32) -> (f32, f32) {
    let far = 4_097.0 * value;
    let high = far - (far - value);
    (high, value - high)
}

impl Add for Wide {
    type Output = Self;

    #[inline]
    fn add(self, other: Self) -> Self {
        let sum = Self::sum(self.high, other.high);
        Self::renewed(sum.high, sum.low + (self.low + other.low))
    }
}

impl Add<f32> for Wide {
    type Output = Self;

    #[inline]
    fn add(self, other: f32) -> Self {
        let sum = Self::sum(self.high, other);
        Self::renewed(sum.high, sum.low + self.low)
    }
}

impl Neg for Wide {
    type Output = Self;

    #[inline]
    fn neg(self) -> Self {
        Self { high: -self.high, low: -self.low }
    }
}

impl Sub for Wide {
    type Output = Self;

    #[inline]
    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl Sub<f32> for Wide {
    type Output = Self;

    #[inline]
    fn sub(self, other: f32) -> Self {
        self + -other
    }
}

impl Mul for Wide {
    type Output = Self;

    #[inline]
    fn mul(self, other: Self) -> Self {
        let product = Self::product(self.high, other.high);
        let low = self.high * other.low + self.low * other.high;
        Self::renewed(product.high, product.low + low)
    }
}

impl Div for Wide {
    type Output = Self;

    #[inline]
    fn div(self, other: Self) -> Self {
        let first = self.high / other.high;
        let rest = self - other * first;
        let second = rest.high / other.high;
        let third = (rest - other * second).high / other.high;
        Self::renewed(first, second) + third
    }
}

impl Mul<f32> for Wide {
    type Output = Self;

    #[inline]
    fn mul(self, other: f32) -> Self {
        let product = Self::product(self.high, other);
        Self::renewed(product.high, product.low + self.low * other)
    }
}

/// Returns the lesser one of two, and the second if the first is NaN.
pub(super) const fn lesser(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// Returns how far away a function passes zero at most, that is below zero by `depth` and bends upward by `bend` at least.
pub(super) fn reach(depth: f32, slope: f32, bend: f32) -> f32 {
    let root = math::quick_root(slope * slope + 2.0 * bend * depth);
    if slope > 0.0 { 2.0 * depth / (slope + root) } else { (root - slope) / bend }
}

/// Finds where a function passes zero upward, which it does once between `low` and `high`.
///
/// A step of the share `close` is the last one: the next one would be of its square.
pub(super) fn root<const STEPS: u32>(
    [low, high]: [f32; 2],
    guess: f32,
    close: f32,
    function: impl Fn(f32) -> (f32, f32),
) -> f32 {
    let (mut low, mut high, mut x) = (low, high, guess);
    for _ in 0..STEPS {
        let (value, slope) = function(x);
        if value > 0.0 {
            high = x;
        } else {
            low = x;
        }
        let step = value / slope;
        let next = x - step;
        if step.abs() <= close * x.abs() {
            return limited(next, low, high);
        }
        x = if next >= low && next <= high { next } else { 0.5 * (low + high) };
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_last_second_of_a_day_takes_2000_half_milliseconds() {
        let mut elapsed = Sum::from(86_399.0);
        for _ in 0..2_000 {
            elapsed.add(0.000_5);
        }
        assert!((elapsed.value() - 86_400.0).abs() < 0.01, "{elapsed:?}");
    }

    #[test]
    fn a_differentiator_beyond_f32_stays_at_the_largest_number_and_returns_at_once() {
        for way in [1.0_f32, -1.0] {
            let mut sum = Sum::from(f32::MAX.copysign(way));
            for change in [f32::MAX, f32::INFINITY, 1e32] {
                sum.add(change.copysign(way));
                assert_eq!(sum, Sum::from(f32::MAX.copysign(way)));
            }
            sum.add(-f32::MAX.copysign(way));
            assert_eq!(sum, Sum::ZERO);
        }
    }

    proptest! {
        #[test]
        fn a_sum_is_that_of_twice_the_precision(
            start in -1e6_f32..1e6, changes in prop::collection::vec(-0.1_f32..0.1, 1..500),
        ) {
            let mut sum = Sum::from(start);
            let mut exact = f64::from(start);
            for change in changes {
                sum.add(change);
                exact += f64::from(change);
                // Half a spacing of the value, and a number that the rests round.
                prop_assert!((f64::from(sum.value()) - exact).abs() <= 6.1e-8 * exact.abs() + 1e-6);
                let above = f64::from(sum.above(sum.value())) + f64::from(sum.value());
                prop_assert!((above - exact).abs() <= 2e-6);
            }
        }
    }

    fn exact(value: Wide) -> f64 {
        f64::from(value.high) + f64::from(value.low)
    }

    fn any() -> impl Strategy<Value = Wide> {
        (-1e6_f32..1e6, -0.5_f32..0.5)
            .prop_map(|(high, part)| Wide::renewed(high, part * high.abs() * f32::EPSILON))
    }

    proptest! {
        #[test]
        fn results_have_48_bits(a in any(), b in any(), c in -1e3_f32..1e3) {
            let (x, y, z) = (exact(a), exact(b), f64::from(c));
            let largest = x.abs() + y.abs();
            prop_assert!((exact(a + b) - (x + y)).abs() <= 1e-13 * largest);
            prop_assert!((exact(a - b) - (x - y)).abs() <= 1e-13 * largest);
            prop_assert!((exact(a + c) - (x + z)).abs() <= 1e-13 * (x.abs() + z.abs()));
            prop_assert!((exact(a * b) - x * y).abs() <= 1e-13 * (x * y).abs() + 1e-30);
            prop_assert!((exact(a * c) - x * z).abs() <= 1e-13 * (x * z).abs() + 1e-30);
            prop_assert!((exact(a.squared()) - x * x).abs() <= 1e-13 * (x * x).abs() + 1e-30);
            if b.high.abs() > 1e-3 {
                prop_assert!((exact(a / b) - x / y).abs() <= 1e-13 * (x / y).abs() + 1e-30);
            }
            if a.high > 1e-3 {
                prop_assert!((exact(a.root()) / x.sqrt() - 1.0).abs() <= 1e-13);
                let reciprocal = exact(Wide::reciprocal(a.high)) * f64::from(a.high);
                prop_assert!((reciprocal - 1.0).abs() <= 1e-13);
            }
        }
    }

    #[test]
    fn what_has_no_root_gives_zero() {
        for none in [-1.0, 0.0, f32::NAN] {
            assert_eq!(Wide::of(none).root(), Wide::ZERO);
        }
    }
}
