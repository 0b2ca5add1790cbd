/// A point in time: microseconds since a start chosen by the clock. It never wraps.
///
/// # Examples
/// ```
/// use drivetrain::time::{Duration, Instant};
///
/// let earlier = Instant::from_micros(1_000);
/// let later = earlier + Duration::from_millis(5);
/// assert_eq!(later.since(earlier), Duration::from_micros(5_000));
/// assert_eq!(earlier.since(later), Duration::ZERO);
/// ```
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Instant(u64);

impl Instant {
    /// The start of the clock.
    pub const START: Self = Self(0);

    /// Takes microseconds since the start of the clock.
    #[must_use]
    pub const fn from_micros(micros: u64) -> Self {
        Self(micros)
    }

    /// Returns microseconds since the start of the clock.
    #[must_use]
    pub const fn as_micros(self) -> u64 {
        self.0
    }

    /// Returns the time elapsed since `earlier`; zero when `earlier` is later.
    #[must_use]
    pub const fn since(self, earlier: Self) -> Duration {
        Duration::from_micros(self.0.saturating_sub(earlier.0))
    }

    /// Returns the low 32 bits: the stamp in a motor slot.
    #[expect(
        clippy::cast_possible_truncation,
        reason = "stamps are compared by wrapping difference"
    )]
    pub(crate) const fn stamp(self) -> u32 {
        self.0 as u32
    }
}

impl core::ops::Add<Duration> for Instant {
    type Output = Self;
    fn add(self, duration: Duration) -> Self {
        Self(self.0.saturating_add(duration.as_micros()))
    }
}

impl core::ops::Sub for Instant {
    type Output = Duration;
    fn sub(self, earlier: Self) -> Duration {
        self.since(earlier)
    }
}

/// A length of time in microseconds, never negative. Arithmetic saturates.
///
/// # Examples
/// ```
/// use drivetrain::time::Duration;
///
/// assert_eq!(Duration::from_millis(10).as_micros(), 10_000);
/// assert_eq!(Duration::from_secs_f32(0.001), Some(Duration::from_millis(1)));
/// assert_eq!(Duration::from_secs_f32(f32::NAN), None);
/// ```
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Duration(u64);

impl Duration {
    /// No time at all.
    pub const ZERO: Self = Self(0);
    /// The longest duration, about 584 000 years.
    pub const MAX: Self = Self(u64::MAX);

    /// Takes microseconds.
    #[must_use]
    pub const fn from_micros(micros: u64) -> Self {
        Self(micros)
    }

    /// Takes milliseconds.
    #[must_use]
    pub const fn from_millis(millis: u64) -> Self {
        Self(millis.saturating_mul(1_000))
    }

    /// Takes seconds.
    #[must_use]
    pub const fn from_secs(secs: u64) -> Self {
        Self(secs.saturating_mul(1_000_000))
    }

    /// Takes seconds, rounded to the nearest microsecond within the resolution of `f32`: 0 to 4294 s. `None` outside of
    /// this range, and for NaN.
    #[must_use]
    pub const fn from_secs_f32(secs: f32) -> Option<Self> {
        if secs >= 0.0 && secs <= 4294.0 {
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "0..=4.294e9"
            )]
            let micros = (secs * 1e6 + 0.5) as u32;
            Some(Self(micros as u64))
        } else {
            None
        }
    }

    /// Returns microseconds.
    #[must_use]
    pub const fn as_micros(self) -> u64 {
        self.0
    }

    /// Returns seconds, rounded to `f32`.
    #[must_use]
    pub const fn as_secs_f32(self) -> f32 {
        match self.micros_u32() {
            Some(micros) => micros as f32 * 1e-6,
            None => self.long_as_secs_f32(),
        }
    }

    /// Out of line: a 64-bit conversion would run for each short duration as well, and be dropped.
    #[cold]
    #[inline(never)]
    const fn long_as_secs_f32(self) -> f32 {
        self.0 as f32 * 1e-6
    }

    /// Adds; stays at [`MAX`](Self::MAX) rather than wrap.
    #[must_use]
    pub const fn saturating_add(self, other: Self) -> Self {
        Self(self.0.saturating_add(other.0))
    }

    /// Returns microseconds when they fit 32 bits: up to 71 minutes.
    pub(crate) const fn micros_u32(self) -> Option<u32> {
        #[expect(clippy::cast_possible_truncation, reason = "compared right after")]
        let low = self.0 as u32;
        if low as u64 == self.0 { Some(low) } else { None }
    }
}

impl core::ops::Add for Duration {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        self.saturating_add(other)
    }
}

/// Rounds down to whole microseconds, and saturates.
impl From<core::time::Duration> for Duration {
    fn from(duration: core::time::Duration) -> Self {
        Self::from_secs(duration.as_secs())
            .saturating_add(Self::from_micros(u64::from(duration.subsec_micros())))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_difference_of_two_instants_is_never_negative() {
        let (early, late) = (Instant::from_micros(5), Instant::from_micros(12));
        assert_eq!((late - early, early - late), (Duration::from_micros(7), Duration::ZERO));
    }

    #[test]
    fn seconds_round_to_the_nearest_microsecond() {
        assert_eq!(Duration::from_secs_f32(0.000_001_6), Some(Duration::from_micros(2)));
        let longest = Duration::from_secs_f32(4294.0).unwrap();
        assert!(longest.as_micros().abs_diff(4_294_000_000) < 256); // one part in 2^24
        for bad in [-0.1, 4295.0, f32::INFINITY, f32::NAN] {
            assert_eq!(Duration::from_secs_f32(bad), None);
        }
    }

    #[test]
    fn long_durations_keep_their_size_in_seconds() {
        assert!((Duration::from_secs(100_000).as_secs_f32() - 1e5).abs() < 0.1);
        assert!((Duration::from_millis(1).as_secs_f32() - 1e-3).abs() < 1e-10);
    }

    #[test]
    fn arithmetic_saturates() {
        assert_eq!(Duration::MAX + Duration::from_micros(1), Duration::MAX);
        assert_eq!(Duration::from_secs(u64::MAX), Duration::MAX);
        assert_eq!(Duration::from(core::time::Duration::MAX), Duration::MAX);
        assert_eq!(Duration::from(core::time::Duration::from_nanos(1_999)).as_micros(), 1);
    }
}
