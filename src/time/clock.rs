use super::{Duration, Instant};
use core::cell::Cell;

/// A source of time for the runner.
///
/// An implementation must never go back and must not stand still while the loop runs; a step of one microsecond is the
/// resolution of the crate. A reading that goes back counts as no time passed.
///
/// Any closure `FnMut() -> Instant` is a clock.
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

/// A clock that stands until moved: share it by reference between a test and the tested object.
///
/// # Examples
/// ```
/// use drivetrain::time::{Clock, Duration, Instant, ManualClock};
///
/// let clock = ManualClock::new(Instant::START);
/// let mut shared = &clock;
/// clock.advance(Duration::from_millis(3));
/// assert_eq!(shared.now(), Instant::from_micros(3_000));
/// ```
#[derive(Debug, Default)]
pub struct ManualClock(Cell<Instant>);

impl ManualClock {
    /// Starts at `now`.
    #[must_use]
    pub const fn new(now: Instant) -> Self {
        Self(Cell::new(now))
    }

    /// Reads the time.
    #[must_use]
    pub fn now(&self) -> Instant {
        self.0.get()
    }

    /// Moves the time forward.
    pub fn advance(&self, duration: Duration) {
        self.set(self.now() + duration);
    }

    /// Sets the time, also backward, as a fault to test.
    pub fn set(&self, now: Instant) {
        self.0.set(now);
    }
}

impl Clock for &ManualClock {
    fn now(&mut self) -> Instant {
        ManualClock::now(self)
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
        Instant::START + Duration::from(self.elapsed())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
}
