//! Arithmetic that stays finite.

/// Returns `value` within `lower..=upper`, which the caller knows to be in order.
#[inline]
pub(super) const fn limited(value: f32, lower: f32, upper: f32) -> f32 {
    if value > upper {
        upper
    } else if value < lower {
        lower
    } else {
        value
    }
}

/// Returns `value`, or the largest number of its sign when it is infinite, or zero when it is NaN.
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

/// Seconds that add up without loss, whatever their number: a plain sum in `f32` of steps of 0.5 ms stands still at 16384 s.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub(super) struct Elapsed {
    seconds: f32,
    /// What the sum could not take yet.
    rest: f32,
}

impl Elapsed {
    pub(super) const ZERO: Self = Self { seconds: 0.0, rest: 0.0 };

    #[cfg(test)]
    pub(super) const fn after(seconds: f32) -> Self {
        Self { seconds, rest: 0.0 }
    }

    #[inline]
    pub(super) const fn add(&mut self, dt_s: f32) {
        let change = self.rest + dt_s;
        let sum = self.seconds + change;
        self.rest = change - (sum - self.seconds);
        self.seconds = sum;
    }

    #[inline]
    pub(super) const fn seconds(self) -> f32 {
        self.seconds
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_second_of_a_day_takes_2000_half_milliseconds() {
        let mut elapsed = Elapsed::after(86_399.0);
        for _ in 0..2_000 {
            elapsed.add(0.000_5);
        }
        assert!((elapsed.seconds() - 86_400.0).abs() < 0.01, "{elapsed:?}");
    }
}
