/// Allowed raw commands of a motor: all commands between two ends. The range includes 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Range {
    lowest: i16,
    span: u16,
}

impl Range {
    /// Only 0.
    pub(super) const ZERO: Self = Self::within(0);

    /// Both directions up to `limit`, which must not be negative.
    pub(super) const fn within(limit: i16) -> Self {
        Self { lowest: -limit, span: 2 * limit.cast_unsigned() }
    }

    pub(super) const fn without_negative(self) -> Self {
        Self { lowest: 0, span: self.highest().cast_unsigned() }
    }

    pub(super) const fn without_positive(self) -> Self {
        Self { lowest: self.lowest, span: self.lowest.unsigned_abs() }
    }

    /// Tells whether a command is within the range. One comparison covers both ends: as unsigned, a value below the lowest is far above.
    #[inline]
    pub(super) const fn contains(self, raw: i32) -> bool {
        raw.wrapping_sub(self.lowest as i32).cast_unsigned() <= self.span as u32
    }

    /// Tells whether a command is not 0 and at an end of the range.
    pub(super) const fn is_end(self, raw: i16) -> bool {
        (raw < 0 && raw <= self.lowest) || (raw > 0 && raw >= self.highest())
    }

    /// Returns the nearest command within the range.
    pub(super) const fn nearest(self, raw: i32) -> i16 {
        if raw < self.lowest as i32 {
            return self.lowest;
        }
        if raw > self.highest() as i32 {
            return self.highest();
        }
        #[expect(clippy::cast_possible_truncation, reason = "between two of 16 bits")]
        let raw = raw as i16;
        raw
    }

    const fn highest(self) -> i16 {
        self.lowest.wrapping_add_unsigned(self.span)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Law: the nearest command is within the range, 0 is always within, and a command within is kept.
        #[test]
        fn the_nearest_is_within(limit in 0..=i16::MAX, raw: i32, negative: bool, positive: bool) {
            let range = Range::within(limit);
            let range = if negative { range } else { range.without_negative() };
            let range = if positive { range } else { range.without_positive() };
            let nearest = range.nearest(raw);
            prop_assert!(range.contains(nearest.into()) && range.contains(0));
            prop_assert!(nearest >= 0 || negative);
            prop_assert!(nearest <= 0 || positive);
            prop_assert_eq!(range.contains(raw), i32::from(nearest) == raw);
            let end = i32::from(limit);
            let allowed = (if negative { -end } else { 0 })..=(if positive { end } else { 0 });
            prop_assert_eq!(range.contains(raw), allowed.contains(&raw));
            prop_assert_eq!(range.is_end(nearest), nearest != 0 && !allowed.contains(&(i32::from(nearest) + i32::from(nearest.signum()))));
        }
    }
}
