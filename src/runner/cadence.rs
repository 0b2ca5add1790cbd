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

    /// Sets how many readings in a row without a later time mean that the clock stands, at least 1, instead of the limit that
    /// [`due`](Self::due) learns.
    ///
    /// Make it several times what a loop reads while the clock, if it counts in coarse ticks, shows one time: a step that comes by
    /// mistake relaxes every motor.
    ///
    /// # Examples
    /// A loop that waits 10 ms in each turn, for a clock in microseconds: zeros go out 0.2 s after the clock stopped.
    /// ```
    /// use drivetrain::dji::Bus;
    /// use drivetrain::runner::{Nb, Runner};
    /// use drivetrain::time::{Duration, Instant, ManualClock};
    /// # use drivetrain::sim::World;
    /// # let world = World::new(1);
    /// # let can = world.controller();
    ///
    /// let clock = ManualClock::new(Instant::START);
    /// let mut runner = Runner::new(Nb(can), &clock, Bus::new())
    ///     .with_period(Duration::from_millis(10))
    ///     .with_standstill_after(20);
    /// for _ in 0..100 {
    ///     clock.advance(Duration::from_millis(10));
    ///     assert!(runner.due().is_some_and(|tick| tick.dt_s() > 0.0));
    /// }
    /// assert!((1..20).all(|_| runner.due().is_none()));
    /// assert!(runner.due().is_some_and(|tick| tick.dt_s() == 0.0));
    /// ```
    #[must_use]
    pub fn with_standstill_after(mut self, readings: u32) -> Self {
        self.watch.standstill.fix(readings);
        self
    }

    /// Reads the clock and returns the step that is due, if any.
    ///
    /// If the clock stands or goes back, a step with a `dt_s` of 0 is due: its update sends zeros and relaxes every motor
    /// until it is armed again.
    ///
    /// A clock stands when too many readings in a row show no later time, by this method and by [`poll`](Self::poll). The limit is
    /// learned from the clock while it goes on: 100 times as many readings as it ever needed to show a later time, and at least
    /// 2 for each microsecond of its resolution; from 1000 to 200 000, and 200 000 until it has moved on once. 1600 received
    /// frames are as good as the limit.
    ///
    /// | loop | resolution of the clock | the step comes after |
    /// |---|---|--:|
    /// | polls 1 000 000 times a second | 1 µs | 1 ms |
    /// | the same | 1 ms | 0.1 s |
    /// | the same | 10 ms | 0.2 s |
    /// | wakes up each 0.25 ms | 1 µs | 0.25 s |
    /// | wakes up each ms | 1 µs | 1 s; 2 s if it is never early or late |
    /// | the same | 1 ms | 2 s |
    /// | the same | of a clock that has never moved | 200 s |
    /// | wakes up for each frame of 4 motors at 1 kHz | 1 µs | 0.15 s |
    ///
    /// Slower loops set a limit of their own: [`with_standstill_after`](Self::with_standstill_after).
    pub fn due(&mut self) -> Option<Tick> {
        let now = self.read_clock();
        if self.watch.standstill.take() {
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
            self.watch.standstill.restart(now);
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
