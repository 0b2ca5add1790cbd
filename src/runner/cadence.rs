//! When a step is due.

use super::{BusCondition, Port, Runner};
use crate::motor::Devices;
use crate::time::{Clock, Duration, Instant, Tick, Ticker};

impl<P: Port, K: Clock, D: Devices> Runner<P, K, D> {
    /// Sets another period than 1 ms.
    #[must_use]
    pub fn with_period(mut self, period: Duration) -> Self {
        self.ticker = Ticker::new(period);
        self
    }

    /// Reads the clock and returns the step that is due, if any.
    ///
    /// If the clock stands or goes back, a step with a `dt_s` of 0 is due: its update sends zeros and relaxes every motor
    /// until it is armed again. A clock stands when 200 000 readings show the same time; a received frame counts as 125.
    pub fn due(&mut self) -> Option<Tick> {
        let now = self.read_clock();
        if self.watch.take_standstill() {
            // Not after the last step that was run, so that it does not count as time that moved on.
            let last = self.ticker.last();
            return Some(Tick::new(
                self.watch.ticked().map_or(last, |ticked| ticked.min(last)),
                0.0,
            ));
        }
        let before = self.ticker.overruns();
        let tick = self.ticker.due(now);
        if tick.is_some() {
            self.watch.begin_step(now);
        }
        if self.ticker.overruns() != before {
            self.watch.edges.begin(BusCondition::TickOverrun, now);
        }
        tick
    }

    pub(super) fn read_clock(&mut self) -> Instant {
        let now = self.clock.now();
        self.watch.read(now);
        now
    }
}
