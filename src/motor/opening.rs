//! How the output range of a motor opens after arming.

use crate::time::{Duration, Instant};

/// The time in which the output range of a motor opens after arming, unless configured otherwise: 0.2 s.
pub const OPENING: Duration = Duration::from_millis(200);

/// The output range of a motor since it was armed: from zero, in proportion to time, to the whole.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Opening {
    time: Duration,
    began: Option<Instant>,
}

impl Opening {
    pub(crate) const fn new(time: Duration) -> Self {
        Self { time, began: None }
    }

    pub(crate) const fn begin(&mut self, now: Instant) {
        self.began = Some(now);
    }

    /// Returns the share of the output range that is open, 0 to 1. A time before the beginning gives 0.
    pub(crate) fn share(&mut self, now: Instant) -> f32 {
        let Some(began) = self.began else { return 1.0 };
        let passed = now.since(began);
        if passed >= self.time {
            self.began = None;
            return 1.0;
        }
        passed.as_secs_f32() / self.time.as_secs_f32()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_range_opens_in_proportion_to_time_and_stays_open() {
        let at_ms = |ms: u64| Instant::from_micros(1_000 * ms);
        let mut opening = Opening::new(OPENING);
        assert_eq!(opening.share(at_ms(5)).to_bits(), 1.0_f32.to_bits(), "never closed");
        opening.begin(at_ms(1_000));
        let shares = [990, 1_000, 1_100, 1_200, 1_000].map(|ms| opening.share(at_ms(ms)));
        assert_eq!(shares.map(f32::to_bits), [0.0, 0.0, 0.5, 1.0, 1.0].map(f32::to_bits));
        let mut at_once = Opening::new(Duration::ZERO);
        at_once.begin(at_ms(1));
        assert_eq!(at_once.share(at_ms(1)).to_bits(), 1.0_f32.to_bits());
    }
}
