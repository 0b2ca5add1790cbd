use super::Instant;
use core::num::NonZeroU32;

/// Extends a free-running 16- or 32-bit hardware counter to an [`Instant`] that never wraps.
///
/// It has to be read at least once in each wrap of the counter (65 ms for 16 bits at 1 MHz). No 64-bit
/// division takes place, and no time is lost to rounding: the remainder is carried.
///
/// # Examples
/// ```
/// use drivetrain::time::{ExtendedCounter, Instant};
///
/// let mut time = ExtendedCounter::new_16_bit(1_000_000)?;
/// assert_eq!(time.extend(65_000), Instant::from_micros(65_000));
/// assert_eq!(time.extend(100), Instant::from_micros(65_636)); // wrapped once
///
/// let mut cycles = ExtendedCounter::new_32_bit(168_000_000)?; // the Cortex-M cycle counter
/// assert_eq!(cycles.extend(168_000), Instant::from_micros(1_000));
/// # Ok::<(), drivetrain::time::CounterError>(())
/// ```
#[derive(Debug, Clone, Copy)]
pub struct ExtendedCounter {
    micros: u64,
    last: u32,
    remainder: u32,
    mask: u32,
    numerator: u32,
    denominator: NonZeroU32,
}

/// The frequency of a counter that cannot be extended without loss.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct CounterError {
    /// The refused frequency.
    pub ticks_per_second: u32,
}

impl core::fmt::Display for CounterError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(
            f,
            "a counter of {} Hz has no exact ratio to 1 MHz that fits 32 bits: use a rounder frequency",
            self.ticks_per_second
        )
    }
}

impl core::error::Error for CounterError {}

impl ExtendedCounter {
    /// Takes the frequency of a counter that wraps at 2^16.
    ///
    /// # Errors
    /// For 0 Hz, and for a frequency whose ratio to 1 MHz is not exact in 32 bits (8 388 593 Hz, say).
    pub const fn new_16_bit(ticks_per_second: u32) -> Result<Self, CounterError> {
        Self::new(ticks_per_second, 0xFFFF)
    }

    /// Takes the frequency of a counter that wraps at 2^32.
    ///
    /// # Errors
    /// As [`new_16_bit`](Self::new_16_bit).
    pub const fn new_32_bit(ticks_per_second: u32) -> Result<Self, CounterError> {
        Self::new(ticks_per_second, u32::MAX)
    }

    const fn new(ticks_per_second: u32, mask: u32) -> Result<Self, CounterError> {
        let error = CounterError { ticks_per_second };
        let (mut divisor, mut rest) = (ticks_per_second, 1_000_000);
        while rest != 0 {
            (divisor, rest) = (rest, divisor % rest);
        }
        let (numerator, denominator) = (1_000_000 / divisor, ticks_per_second / divisor);
        let Some(denominator) = NonZeroU32::new(denominator) else { return Err(error) };
        if numerator.checked_mul(denominator.get()).is_none() {
            return Err(error);
        }
        Ok(Self { micros: 0, last: 0, remainder: 0, mask, numerator, denominator })
    }

    /// Takes a reading of the counter and returns the time since reading 0.
    pub const fn extend(&mut self, raw: u32) -> Instant {
        let ticks = raw.wrapping_sub(self.last) & self.mask;
        self.last = raw;
        let denominator = self.denominator.get();
        let (whole, rest) = (ticks / denominator, ticks % denominator);
        let part = rest * self.numerator + self.remainder;
        self.remainder = part % denominator;
        self.micros += whole as u64 * self.numerator as u64 + (part / denominator) as u64;
        Instant::from_micros(self.micros)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_frequency_without_exact_ratio_is_refused_by_name() {
        for ticks_per_second in [0, 4_294_967_291, 8_388_593] {
            assert_eq!(
                ExtendedCounter::new_32_bit(ticks_per_second).err(),
                Some(CounterError { ticks_per_second })
            );
        }
        let refused = std::format!("{}", CounterError { ticks_per_second: 8_388_593 });
        assert!(refused.starts_with("a counter of 8388593 Hz has no exact ratio"), "{refused}");
    }

    #[test]
    fn a_start_away_from_zero_is_time_since_reading_zero() {
        let mut time = ExtendedCounter::new_32_bit(1_000_000).unwrap();
        assert_eq!(time.extend(u32::MAX).as_micros(), u64::from(u32::MAX));
        assert_eq!(time.extend(0).as_micros(), 1 << 32);
    }

    proptest! {
        /// Law: after any readings, the extended time is floor(total ticks / frequency) in microseconds.
        #[test]
        fn no_tick_is_lost_for_common_frequencies(
            frequency in prop::sample::select(&[32_768_u32, 1_000_000, 1_125_000, 25_000_000, 72_000_000, 168_000_000, 480_000_000][..]),
            wide in any::<bool>(),
            steps in prop::collection::vec(any::<u32>(), 1..200),
        ) {
            let mask = if wide { u32::MAX } else { 0xFFFF };
            let mut time = if wide { ExtendedCounter::new_32_bit(frequency) } else { ExtendedCounter::new_16_bit(frequency) }.unwrap();
            let mut total = 0_u128;
            for step in steps {
                total += u128::from(step & mask);
                #[expect(clippy::cast_possible_truncation, reason = "the counter wraps")]
                let raw = total as u32 & mask;
                let expected = total * 1_000_000 / u128::from(frequency);
                prop_assert_eq!(u128::from(time.extend(raw).as_micros()), expected);
            }
        }
    }
}
