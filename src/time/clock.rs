//! Clocks: the trait, also of a cell set by hand, and the extension of a hardware counter.

use super::Instant;
use crate::error::ConfigError;
use core::cell::Cell;
use core::num::NonZeroU32;

/// A source of time for the runner.
///
/// An implementation must never go back and must not stand still while the loop runs; a step of one microsecond is the
/// resolution of the crate. A reading that goes back counts as no time passed.
///
/// Any closure `FnMut() -> Instant` is a clock, and so is `&Cell<Instant>`: a test sets the cell, and the tested object reads it.
///
/// # Examples
/// ```
/// use drivetrain::time::{Clock, Instant};
///
/// let mut reading = 0;
/// let mut clock = || {
///     reading += 10;
///     Instant::from_micros(reading)
/// };
/// assert_eq!(clock.now(), Instant::from_micros(10));
/// assert_eq!(clock.now(), Instant::from_micros(20));
///
/// let by_hand = core::cell::Cell::new(Instant::from_micros(5));
/// let mut shared = &by_hand;
/// by_hand.set(Instant::from_micros(3_000));
/// assert_eq!(Clock::now(&mut shared), Instant::from_micros(3_000));
/// ```
pub trait Clock {
    /// Reads the time.
    fn now(&mut self) -> Instant;
}

impl<F: FnMut() -> Instant> Clock for F {
    fn now(&mut self) -> Instant {
        self()
    }
}

/// A clock that stands until set, also backward, as a fault to test.
impl Clock for &Cell<Instant> {
    fn now(&mut self) -> Instant {
        self.get()
    }
}

/// The time since the first reading of the operating system's monotonic clock: `std::time::Instant::now()` is a clock that
/// starts at zero.
///
/// # Examples
/// ```
/// use drivetrain::time::{Clock, Instant};
///
/// let mut clock = std::time::Instant::now();
/// let first = Clock::now(&mut clock);
/// assert!(Clock::now(&mut clock) >= first);
/// ```
#[cfg(feature = "std")]
impl Clock for std::time::Instant {
    fn now(&mut self) -> Instant {
        Instant::START + super::Duration::from(self.elapsed())
    }
}

/// Extends a free-running 16- or 32-bit hardware counter to an [`Instant`] that never wraps.
///
/// The counter has to be read at least once in each wrap: 65 ms for 16 bits at 1 MHz. If a reading comes later, whole wraps are
/// lost, and the time is slow without a sign of the loss. No 64-bit division takes place, and no time is lost to rounding: the
/// remainder is carried.
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
/// # Ok::<(), drivetrain::error::ConfigError>(())
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

impl ExtendedCounter {
    /// In ticks a second: 10 ms to a wrap. A loop at 1 kHz may then miss nine periods, and feedback counts as late by then.
    const FASTEST_16_BIT: u32 = 0x1_0000 * 100;

    /// Takes the frequency of a counter that wraps at 2^16.
    ///
    /// # Errors
    /// Above 6 553 600 Hz, where the counter wraps in less than 10 ms: a loop that reads the counter each 1 ms and stalls once
    /// would lose a wrap. For 0 Hz, and for a frequency whose ratio to 1 MHz, in lowest terms `numerator / denominator`, does not
    /// leave room for the carried remainder: `(numerator + 1) * (denominator - 1)` must fit 32 bits. 999 983 Hz does not.
    pub const fn new_16_bit(ticks_per_second: u32) -> Result<Self, ConfigError> {
        let (value, most) = (ticks_per_second as f32, Self::FASTEST_16_BIT as f32);
        if ticks_per_second > Self::FASTEST_16_BIT {
            let parameter = "ticks_per_second of a counter of 16 bits without a prescaler";
            return Err(ConfigError::Range { parameter, value, least: 1.0, most });
        }
        Self::new(ticks_per_second, 0xFFFF)
    }

    /// Takes the frequency of a counter that wraps at 2^32.
    ///
    /// # Errors
    /// For 0 Hz and a frequency without such a ratio, as [`new_16_bit`](Self::new_16_bit). The fastest wraps in 1 s.
    pub const fn new_32_bit(ticks_per_second: u32) -> Result<Self, ConfigError> {
        Self::new(ticks_per_second, u32::MAX)
    }

    const fn new(ticks_per_second: u32, mask: u32) -> Result<Self, ConfigError> {
        let error = ConfigError::Ratio { ticks_per_second };
        let (mut divisor, mut rest) = (ticks_per_second, 1_000_000);
        while rest != 0 {
            (divisor, rest) = (rest, divisor % rest);
        }
        let (numerator, denominator) = (1_000_000 / divisor, ticks_per_second / divisor);
        let Some(denominator) = NonZeroU32::new(denominator) else { return Err(error) };
        // The largest rest of a division, scaled, and the largest remainder: `extend` adds the two.
        if (denominator.get() - 1).checked_mul(numerator + 1).is_none() {
            return Err(error);
        }
        Ok(Self { micros: 0, last: 0, remainder: 0, mask, numerator, denominator })
    }

    /// Takes a reading of the counter and returns the time since reading 0.
    ///
    /// A reading below the last one is a wrap. The time stays at its largest value, 584 000 years, rather than wrap.
    pub const fn extend(&mut self, raw: u32) -> Instant {
        let ticks = raw.wrapping_sub(self.last) & self.mask;
        self.last = raw;
        let denominator = self.denominator.get();
        let (whole, rest) = (ticks / denominator, ticks % denominator);
        let part = rest * self.numerator + self.remainder;
        self.remainder = part % denominator;
        let step = whole as u64 * self.numerator as u64 + (part / denominator) as u64;
        self.micros = self.micros.saturating_add(step);
        Instant::from_micros(self.micros)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::string::ToString;
    use std::vec::Vec;

    #[test]
    fn a_closure_is_a_clock() {
        fn read(clock: &mut impl Clock) -> Instant {
            clock.now()
        }
        assert_eq!(read(&mut || Instant::from_micros(7)), Instant::from_micros(7));
    }

    #[cfg(feature = "std")]
    #[test]
    fn the_clock_of_the_operating_system_counts_from_its_creation() {
        let mut clock = std::time::Instant::now();
        let start = std::time::Instant::now();
        while start.elapsed().as_millis() < 1 {}
        assert!(Clock::now(&mut clock) >= Instant::from_micros(1_000));
    }

    #[test]
    fn a_frequency_without_exact_ratio_is_refused_by_name() {
        for ticks_per_second in [0, 4_294_967_291, 8_388_593, 268_435_250] {
            assert_eq!(
                ExtendedCounter::new_32_bit(ticks_per_second).err(),
                Some(ConfigError::Ratio { ticks_per_second })
            );
        }
        let refused = ExtendedCounter::new_32_bit(8_388_593).unwrap_err().to_string();
        assert!(refused.starts_with("a counter of 8388593 Hz has no exact ratio"), "{refused}");
    }

    #[test]
    fn a_counter_that_wraps_faster_than_a_loop_reads_it_is_refused() {
        for ticks_per_second in [6_553_601, 84_000_000, u32::MAX] {
            let refused = ExtendedCounter::new_16_bit(ticks_per_second).err();
            let (value, most) = (ticks_per_second as f32, 6_553_600.0);
            let parameter = "ticks_per_second of a counter of 16 bits without a prescaler";
            assert_eq!(refused, Some(ConfigError::Range { parameter, value, least: 1.0, most }));
        }
        assert!(ExtendedCounter::new_16_bit(6_553_600).is_ok());
        assert!(ExtendedCounter::new_32_bit(84_000_000).is_ok());
        let refused = ExtendedCounter::new_16_bit(84_000_000).unwrap_err().to_string();
        assert!(
            refused.ends_with("without a prescaler 84000000: 1 to 6553600 are allowed"),
            "{refused}"
        );
    }

    #[test]
    fn a_start_away_from_zero_is_time_since_reading_zero() {
        let mut time = ExtendedCounter::new_32_bit(1_000_000).unwrap();
        assert_eq!(time.extend(u32::MAX).as_micros(), u64::from(u32::MAX));
        assert_eq!(time.extend(0).as_micros(), 1 << 32);
    }

    #[test]
    fn a_slow_counter_that_swings_for_ever_stays_at_the_end_of_time() {
        let mut time = ExtendedCounter::new_32_bit(1).unwrap();
        let times: Vec<Instant> = (0..10_000).map(|step| time.extend(step % 2)).collect();
        assert!(times.is_sorted());
        assert_eq!(times.last(), Some(&Instant::from_micros(u64::MAX)));
    }

    fn greatest_common_divisor(a: u128, b: u128) -> u128 {
        if b == 0 { a } else { greatest_common_divisor(b, a % b) }
    }

    /// Frequencies of all kinds, most of them where `(numerator + 1) * (denominator - 1)` is near 2^32.
    fn frequency() -> impl Strategy<Value = u32> {
        let near = (0_u32..=6, 0_u32..=6, -500_i64..5_000).prop_map(|(twos, fives, off)| {
            let numerator = 2_u32.pow(twos) * 5_u32.pow(fives);
            let denominator = i64::from(u32::MAX / (numerator + 1)).saturating_add(off).max(1);
            let hertz = denominator.unsigned_abs() * u64::from(1_000_000 / numerator);
            u32::try_from(hertz).unwrap_or(u32::MAX)
        });
        prop_oneof![3 => near, 1 => any::<u32>(), 2 => (0_u32..7_000).prop_map(|khz| khz * 1_000)]
    }

    proptest! {
        /// Law: a frequency is accepted exactly when a wrap takes 10 ms and the scaled rest and the remainder fit 32 bits; each reading then
        /// gives floor(total ticks / frequency) in microseconds, in the arithmetic of 128 bits.
        #[test]
        fn a_frequency_is_refused_or_no_reading_loses_a_tick(
            frequency in frequency(),
            wide in any::<bool>(),
            steps in prop::collection::vec((any::<u32>(), 0_u32..4), 1..100),
        ) {
            let made = if wide { ExtendedCounter::new_32_bit(frequency) } else { ExtendedCounter::new_16_bit(frequency) };
            let divisor = greatest_common_divisor(frequency.into(), 1_000_000).max(1);
            let (numerator, denominator) = (1_000_000 / divisor, u128::from(frequency) / divisor);
            let fits = denominator > 0 && (numerator + 1) * (denominator - 1) <= u32::MAX.into();
            let is_slow = wide || frequency <= 6_553_600;
            prop_assert_eq!(made.is_ok(), fits && is_slow, "{} / {}", numerator, denominator);
            let Ok(mut time) = made else { return Ok(()) };
            let mask = if wide { u32::MAX } else { 0xFFFF };
            let mut total = 0_u128;
            for (step, short_of_whole) in steps {
                // Most steps leave one of the largest rests, where an intermediate is largest.
                let whole = u128::from(step & mask) / denominator * denominator;
                let near = whole + denominator.saturating_sub(u128::from(short_of_whole));
                let step = if near <= mask.into() && short_of_whole > 0 { near } else { (step & mask).into() };
                total += step;
                #[expect(clippy::cast_possible_truncation, reason = "the counter wraps")]
                let raw = total as u32 & mask;
                let expected = total * 1_000_000 / u128::from(frequency);
                prop_assert_eq!(u128::from(time.extend(raw).as_micros()), expected.min(u64::MAX.into()));
            }
        }

        /// Law: after any readings, the extended time is floor(total ticks / frequency) in microseconds.
        #[test]
        fn no_tick_is_lost_for_common_frequencies(
            frequency in prop::sample::select(&[32_768_u32, 1_000_000, 1_125_000, 6_000_000, 25_000_000, 72_000_000, 168_000_000, 480_000_000][..]),
            wide in any::<bool>(),
            steps in prop::collection::vec(any::<u32>(), 1..200),
        ) {
            let mask = if wide { u32::MAX } else { 0xFFFF };
            let made = if wide { ExtendedCounter::new_32_bit(frequency) } else { ExtendedCounter::new_16_bit(frequency) };
            let Ok(mut time) = made else {
                prop_assert!(!wide && frequency > 6_553_600);
                return Ok(());
            };
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
