//! When a step is due.

use super::statistics::increment;
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
    /// # use drivetrain::sim::Simulation;
    /// # let world = Simulation::new(1);
    /// # let can = world.controller();
    ///
    /// let clock = ManualClock::new(Instant::START);
    /// let mut runner = Runner::new(Nb(can), &clock, Bus::new())
    ///     .with_period(Duration::from_millis(10))
    ///     .with_standstill_after(20);
    /// for _ in 0..100 {
    ///     clock.advance(Duration::from_millis(10));
    ///     if let Some(tick) = runner.due() {
    ///         runner.tick(tick);
    ///     }
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
    ///
    /// A step that was not run stays due: it is returned again, until [`tick`](Self::tick) or its kin ran a step. When the next one
    /// comes due before, that one takes its place, with a `dt_s` that covers both, and the step that was left out is an overrun;
    /// one with a `dt_s` of 0 stays. So two runners can wait for each other:
    /// `let (Some(one), Some(other)) = (one.due(), other.due()) else { continue };` loses none.
    pub fn due(&mut self) -> Option<Tick> {
        let now = self.read_clock();
        if self.watch.standstill.take() {
            // Not after the last step that was run, so that it does not count as time that moved on.
            let last = self.ticker.last();
            let at = self.watch.ticked().map_or(last, |ticked| ticked.min(last));
            self.waiting = Some(Tick::new(at, 0.0));
            return self.waiting;
        }
        let before = self.ticker.overruns();
        let next = self.ticker.due(now);
        let mut is_late = self.ticker.overruns() != before;
        if let Some(next) = next {
            self.watch.standstill.restart(now);
            is_late |= self.waiting.is_some();
            self.waiting = Some(match self.waiting {
                None => next,
                Some(waiting) => {
                    increment(&mut self.statistics.overruns);
                    together(waiting, next)
                }
            });
        }
        if is_late {
            self.watch.edges.begin(BusCondition::TickOverrun, now);
        }
        self.waiting
    }

    pub(super) fn read_clock(&mut self) -> Instant {
        let now = self.clock.now();
        self.watch.read(now);
        now
    }
}

/// A step in the place of one that was not run and the next one: no time that passed is lost, nor a clock that stood or went back.
fn together(waiting: Tick, next: Tick) -> Tick {
    if next.dt_s() <= 0.0 {
        next
    } else if waiting.dt_s() <= 0.0 {
        waiting
    } else {
        Tick::new(next.now(), waiting.dt_s() + next.dt_s())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dji::{Bus, Config, M3508};
    use crate::frame::CanFrame;
    use crate::motor::Condition;
    use crate::runner::Nb;
    use crate::time::ManualClock;
    use embedded_can::ErrorKind;

    /// Takes every frame, and counts those that drive.
    #[derive(Default)]
    struct Sink {
        driving: u32,
    }

    impl embedded_can::nb::Can for Sink {
        type Frame = CanFrame;
        type Error = ErrorKind;
        fn transmit(&mut self, frame: &CanFrame) -> nb::Result<Option<CanFrame>, ErrorKind> {
            self.driving += u32::from(*frame.bytes() != [0; 8]);
            Ok(None)
        }
        fn receive(&mut self) -> nb::Result<CanFrame, ErrorKind> {
            Err(nb::Error::WouldBlock)
        }
    }

    fn at_us(us: u64) -> Instant {
        Instant::from_micros(us)
    }

    type TestRunner<'c> = Runner<Nb<Sink>, &'c ManualClock, Bus>;

    /// A motor that is driven, just after the step at 10 ms.
    fn driving(clock: &ManualClock) -> TestRunner<'_> {
        clock.set(at_us(10_000));
        let mut bus = Bus::new();
        let wheel = bus.attach(Config::<M3508>::at_once(1)).unwrap();
        let mut runner = Runner::new(Nb(Sink::default()), clock, bus);
        let tick = runner.due().unwrap();
        _ = runner.ingest(&CanFrame::standard(0x201, [0; 8]).unwrap(), clock.now());
        runner.arm(tick).unwrap();
        runner.device_mut().set_raw(wheel, 900).unwrap();
        runner.tick(tick);
        assert_eq!((runner.port_mut().0.driving, runner.due()), (1, None));
        runner
    }

    #[test]
    fn a_step_that_was_not_run_stays_due_and_the_next_one_covers_both() {
        let clock = ManualClock::default();
        let mut runner = driving(&clock);
        clock.set(at_us(11_000));
        let first = runner.due();
        assert_eq!(first, Some(Tick::new(at_us(11_000), 0.001)));
        clock.set(at_us(11_900));
        assert_eq!(runner.due(), first);
        assert_eq!((runner.statistics().overruns, runner.next_edge()), (0, None));
        clock.set(at_us(13_100));
        let both = runner.due().unwrap();
        assert_eq!((both.now(), both.dt_s()), (at_us(13_100), 0.001 + 0.002_1));
        // 11 ms was left out by the program, 12 ms by the clock.
        assert_eq!(runner.statistics().overruns, 2);
        assert!(runner.has(BusCondition::TickOverrun));
        runner.tick(both);
        assert_eq!(runner.due(), None);
        clock.set(at_us(14_000));
        let next = runner.due().unwrap();
        assert!((next.dt_s() - 0.000_9).abs() < 1e-9 && runner.statistics().overruns == 2);
    }

    #[test]
    fn a_step_by_hand_takes_the_place_of_the_one_that_is_due() {
        let clock = ManualClock::default();
        let mut runner = driving(&clock);
        clock.set(at_us(11_000));
        assert!(runner.due().is_some());
        runner.tick(Tick::new(at_us(11_000), 0.001));
        assert_eq!(runner.due(), None);
    }

    /// The zeros of a clock that stands or went back are sent, however many steps the program leaves out.
    #[test]
    fn a_step_without_a_length_stays_due_until_it_is_run() {
        for back in [false, true] {
            let clock = ManualClock::default();
            let mut runner = driving(&clock).with_standstill_after(50);
            if back {
                clock.set(at_us(3_000));
            }
            let stopped = (0..51).find_map(|_| runner.due()).unwrap();
            assert_eq!((stopped.dt_s(), stopped.now() <= at_us(10_000)), (0.0, true), "{back}");
            for ms in 1..20 {
                clock.set(stopped.now() + Duration::from_millis(ms));
                assert_eq!(runner.due(), Some(stopped), "{back}");
            }
            assert!(runner.is_armed());
            runner.tick(stopped);
            assert!(!runner.is_armed() && runner.port_mut().0.driving == 1);
            let told = core::iter::from_fn(|| runner.device_mut().next_edge());
            assert!(told.into_iter().any(|edge| edge.condition == Condition::ClockFault));
            assert_eq!(runner.due(), None);
        }
    }

    /// `let (Some(one), Some(other)) = (one.due(), other.due()) else { continue };` with a clock that goes on in between.
    #[test]
    fn two_runners_that_wait_for_each_other_lose_no_step() {
        let clock = ManualClock::new(at_us(0));
        let [mut one, mut other] =
            [(); 2].map(|()| Runner::new(Nb(Sink::default()), &clock, Bus::new()));
        let (mut steps, mut time_s) = ([0; 2], [0.0; 2]);
        for turn in 0..100_000 {
            let first = one.due();
            clock.advance(Duration::from_micros(turn % 5));
            let second = other.due();
            clock.advance(Duration::from_micros(13 - turn % 5));
            let (Some(first), Some(second)) = (first, second) else { continue };
            for (index, (runner, tick)) in
                [(&mut one, first), (&mut other, second)].into_iter().enumerate()
            {
                runner.tick(tick);
                steps[index] += 1;
                time_s[index] += tick.dt_s();
            }
        }
        assert_eq!((one.statistics().overruns, other.statistics().overruns), (0, 0));
        assert_eq!(steps, [1_300; 2]);
        assert!(time_s.iter().all(|time_s| (time_s - 1.3_f32).abs() < 2e-3), "{time_s:?}");
    }

    #[test]
    fn a_clock_that_repeats_itself_for_200_000_readings_stands() {
        let clock = ManualClock::new(at_us(7));
        let mut runner = Runner::new(Nb(Sink::default()), &clock, Bus::new());
        let standstills = |runner: &mut TestRunner<'_>, readings| {
            for _ in 0..readings {
                if let Some(tick) = runner.due() {
                    runner.tick(tick);
                }
            }
            runner.statistics().clock_standstills
        };
        assert_eq!(standstills(&mut runner, 200_000), 0); // the first one is new
        assert_eq!(standstills(&mut runner, 1), 1);
        assert_eq!(standstills(&mut runner, 199_999), 1);
        assert_eq!(standstills(&mut runner, 1), 2);
        let edge = runner.next_edge().unwrap();
        assert_eq!((edge.condition, edge.began), (BusCondition::ClockStandstill, true));
        assert_eq!(runner.heartbeat(), 0);
    }
}
