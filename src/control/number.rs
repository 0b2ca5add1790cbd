//! Arithmetic with finite results.

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
}
