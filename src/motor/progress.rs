//! Whether time moves on from update to update.

use crate::time::{Duration, Instant};

/// The rule of time of every device: an update has to lie after the update before it, and not before the arming.
///
/// Ages mean nothing where it does not: the device sends zeros in that cycle, and is to be armed again.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Progress {
    last: Option<Instant>,
    begun: Instant,
}

impl Progress {
    pub(crate) const NEW: Self = Self { last: None, begun: Instant::START };

    /// Takes the time of an update; returns by how much time moved on, `None` if it did not. The next update has to lie after
    /// it in either case.
    pub(crate) fn advance(&mut self, now: Instant) -> Option<Duration> {
        let step = Self::step(self.last, self.begun, now);
        self.last = Some(now);
        // No target is left that an update before the arming could make younger.
        self.begun = self.begun.min(now);
        step
    }

    /// Takes the time of arming: targets are stamped with it, so that no update may lie before it.
    pub(crate) fn begin(&mut self, now: Instant) {
        self.begun = self.begun.max(now);
    }

    /// The rule itself; the first update has a step of zero.
    #[inline]
    pub(crate) fn step(last: Option<Instant>, begun: Instant, now: Instant) -> Option<Duration> {
        let moves_on = last.is_none_or(|last| last < now) && begun <= now;
        moves_on.then(|| now.since(last.unwrap_or(now)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_update_lies_after_the_one_before_and_not_before_the_arming() {
        let mut progress = Progress::NEW;
        let mut advance = |micros| progress.advance(Instant::from_micros(micros)).is_some();
        assert_eq!(
            [0, 5, 5, 6, 4, 4, 5].map(&mut advance),
            [true, true, false, true, false, false, true]
        );
        progress.begin(Instant::from_micros(9));
        progress.begin(Instant::from_micros(3));
        let mut advance = |micros| progress.advance(Instant::from_micros(micros)).is_some();
        assert_eq!([8, 9, 9].map(&mut advance), [false, true, false]);
    }

    #[test]
    fn the_end_of_all_time_stands() {
        let mut progress = Progress::NEW;
        let end = Instant::from_micros(u64::MAX);
        assert_eq!([end; 3].map(|now| progress.advance(now).is_some()), [true, false, false]);
    }
}
