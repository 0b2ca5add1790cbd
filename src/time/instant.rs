use super::Duration;

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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_difference_of_two_instants_is_never_negative() {
        let (early, late) = (Instant::from_micros(5), Instant::from_micros(12));
        assert_eq!((late - early, early - late), (Duration::from_micros(7), Duration::ZERO));
    }
}
