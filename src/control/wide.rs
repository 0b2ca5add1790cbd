use crate::math;
use core::ops::{Add, Div, Mul, Neg, Sub};

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

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

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
