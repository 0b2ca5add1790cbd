//! The watch over the loop: on time, with a clock that advances, with frames received and sent.

mod edge;

pub use edge::BusCondition;
pub(super) use edge::FrameKey;

use crate::motor::take_age;
use crate::time::{Duration, Instant, Tick};
use edge::{BusEdge, Edges, Unsent, WATCHED_FRAMES};

/// Merges a step that was not run with the next step: no elapsed time is lost, nor a clock that stood or went back.
pub(super) fn together(waiting: Tick, next: Tick) -> Tick {
    if next.dt_s() <= 0.0 {
        next
    } else if waiting.dt_s() <= 0.0 {
        waiting
    } else {
        Tick::new(next.now(), waiting.dt_s() + next.dt_s())
    }
}

/// Time without feedback, or with an unsent command frame, after which the bus counts as faulty.
const BUS_LOST_AFTER: Duration = Duration::from_millis(100);

/// A frame that the device no longer offers is forgotten: after this time, or after this number of ticks, in which each of many
/// devices has its turn. A frame sent seldom, such as the limits of a drive, may be refused once.
const FORGOTTEN_AFTER: (Duration, u8) = (Duration::from_secs(1), 32);

/// A program that polls once a period needs two of them to take a frame.
const LONGEST_WAIT_PERIODS: u64 = 3;

#[derive(Debug)]
pub(super) struct Watch {
    pub(super) edges: Edges,
    pub(super) standstill: Standstill,
    pub(super) heartbeat: u32,
    pub(super) standstills: u32,
    pub(super) reversals: u32,
    received: bool,
    heard: bool,
    heard_at: Option<Instant>,
    pub(super) reading: Instant,
    /// The driver had no received frame then, or the first poll had one.
    pub(super) drained: Instant,
    ticked: Option<Instant>,
    unsent: [Option<Unsent>; WATCHED_FRAMES],
    has_unsent: bool,
}

impl Watch {
    pub(super) const fn new() -> Self {
        Self {
            edges: Edges::new(),
            standstill: Standstill::new(),
            heartbeat: 0,
            standstills: 0,
            reversals: 0,
            received: false,
            heard: false,
            heard_at: None,
            reading: Instant::START,
            drained: Instant::from_micros(u64::MAX),
            ticked: None,
            unsent: [None; WATCHED_FRAMES],
            has_unsent: false,
        }
    }

    /// Notes that the program polled for received frames.
    pub(super) const fn receive_ran(&mut self) {
        self.received = true;
    }

    /// Notes feedback of some motor.
    pub(super) const fn hear(&mut self) {
        self.heard = true;
    }

    /// Notes a reading of the clock.
    #[inline]
    pub(super) fn read(&mut self, now: Instant) {
        self.standstill.read(now);
        if now < self.reading {
            self.go_back(now);
        }
        self.reading = now;
    }

    /// Returns the time of a frame handed out `now`: in doubt, when the driver was last empty.
    #[inline]
    pub(super) fn arrival(&mut self, now: Instant, period: Duration) -> Instant {
        let waited_us = now.as_micros().wrapping_sub(self.drained.as_micros());
        let is_fresh = waited_us <= LONGEST_WAIT_PERIODS * period.as_micros();
        if is_fresh { now } else { self.arrival_in_doubt(now, period) }
    }

    /// The same, also before the driver was ever seen empty, and after a set-back of the clock.
    #[cold]
    #[inline(never)]
    fn arrival_in_doubt(&mut self, now: Instant, period: Duration) -> Instant {
        self.drained = self.drained.min(now);
        now.min(self.last_arrival(period))
    }

    /// Tells whether frames may have waited in the driver for longer than [`LONGEST_WAIT_PERIODS`]; not before the first poll.
    pub(super) fn has_waiting(&self, period: Duration) -> bool {
        self.last_arrival(period) < self.reading
    }

    fn last_arrival(&self, period: Duration) -> Instant {
        self.drained + Duration::from_micros(LONGEST_WAIT_PERIODS * period.as_micros())
    }

    /// Returns the time of the last step that was run.
    pub(super) const fn ticked(&self) -> Option<Instant> {
        self.ticked
    }

    fn stand(&mut self, now: Instant) {
        self.standstills = self.standstills.saturating_add(1);
        self.edges.begin(BusCondition::ClockStandstill, now);
    }

    fn go_back(&mut self, now: Instant) {
        self.reversals = self.reversals.saturating_add(1);
        self.edges.begin(BusCondition::ClockReversal, now);
        // Counted once, in the reading or in the tick.
        self.ticked = self.ticked.filter(|ticked| *ticked < now);
        self.reading = now;
    }

    /// Notes a frame taken by the driver. The frame counts as sent if it does not come back until the end of the next
    /// tick.
    #[inline]
    pub(super) fn accepted(&mut self, header: u32, now: Instant) {
        if self.has_unsent {
            self.accept_unsent(header, now);
        }
    }

    /// Ends a tick, after everything was offered to the driver. Returns whether the bus was lost just now.
    pub(super) fn finish(&mut self, now: Instant) -> bool {
        match self.ticked {
            Some(before) if now == before => self.stand(now),
            Some(before) if now < before => self.go_back(now),
            _ if core::mem::take(&mut self.received) => {
                self.heartbeat = self.heartbeat.wrapping_add(1);
            }
            _ => {}
        }
        self.ticked = Some(now);
        self.listen(now);
        if self.edges.is_calm {
            // Neither down nor silent, and no repeated condition.
            return self.has_unsent && self.watch_sending(now);
        }
        self.edges.end_calm(now);
        self.watch_sending(now)
    }

    fn listen(&mut self, now: Instant) {
        if core::mem::take(&mut self.heard) {
            self.heard_at = Some(now);
            if !self.edges.is_calm {
                self.edges.end(BusCondition::Silent, now);
            }
        } else if let Some(heard_at) = &mut self.heard_at {
            // The clock may have gone back.
            *heard_at = now.min(*heard_at);
            if now.since(*heard_at) >= BUS_LOST_AFTER {
                self.edges.begin(BusCondition::Silent, now);
            }
        }
    }

    fn accept_unsent(&mut self, header: u32, now: Instant) {
        for place in &mut self.unsent {
            let Some(unsent) = place.as_mut().filter(|unsent| unsent.key.fits(header)) else {
                continue;
            };
            if unsent.stays_sent(now) {
                *place = None;
            } else {
                (unsent.offered, unsent.is_accepted) = (now.stamp(), true);
                (unsent.tries, unsent.idle) = (0, 0);
            }
        }
    }

    /// Notes a frame not taken by the driver; returns the number of refusals in a row.
    pub(super) fn refused(&mut self, key: FrameKey, now: Instant) -> u8 {
        let Some(unsent) = self.unsent_of(key) else {
            self.begin_unsent(key, now);
            return 1;
        };
        if core::mem::take(&mut unsent.is_accepted) {
            // The frame of an earlier tick was taken and stayed.
            (unsent.since, unsent.returns) = (now.stamp(), false);
        }
        (unsent.offered, unsent.idle) = (now.stamp(), 0);
        unsent.tries = unsent.tries.saturating_add(1);
        unsent.tries
    }

    /// Notes a frame that the driver had taken and gave back.
    pub(super) fn evicted(&mut self, key: FrameKey, now: Instant) {
        match self.unsent_of(key) {
            Some(unsent) => {
                (unsent.is_accepted, unsent.offered, unsent.idle) = (false, now.stamp(), 0);
            }
            None => self.begin_unsent(key, now),
        }
    }

    /// Notes a frame called back after a whole tick in the controller.
    #[cold]
    pub(super) fn called_back(&mut self, key: FrameKey, now: Instant) {
        self.evicted(key, now);
        if let Some(unsent) = self.unsent_of(key) {
            unsent.returns = true;
        }
    }

    #[inline(never)]
    fn unsent_of(&mut self, key: FrameKey) -> Option<&mut Unsent> {
        self.unsent.iter_mut().flatten().find(|unsent| unsent.key == key)
    }

    fn begin_unsent(&mut self, key: FrameKey, now: Instant) {
        if let Some(place) = self.unsent.iter_mut().find(|unsent| unsent.is_none()) {
            *place = Some(Unsent {
                key,
                since: now.stamp(),
                offered: now.stamp(),
                is_accepted: false,
                returns: false,
                tries: 1,
                idle: 0,
            });
            self.has_unsent = true;
        }
    }

    fn watch_sending(&mut self, now: Instant) -> bool {
        let mut lost = false;
        for place in &mut self.unsent {
            let Some(unsent) = place else { continue };
            let stays_sent = unsent.stays_sent(now);
            let waits = take_age(now, &mut unsent.since);
            let is_forgotten = take_age(now, &mut unsent.offered) >= FORGOTTEN_AFTER.0
                || unsent.idle >= FORGOTTEN_AFTER.1;
            unsent.idle = unsent.idle.saturating_add(1);
            if stays_sent || is_forgotten {
                *place = None;
            } else if !unsent.is_accepted || unsent.returns {
                lost |= waits >= BUS_LOST_AFTER;
            }
        }
        self.has_unsent = self.unsent.iter().any(Option::is_some);
        if lost {
            return self.edges.begin(BusCondition::Down, now);
        }
        self.edges.end(BusCondition::Down, now);
        false
    }

    pub(super) const fn has(&self, condition: BusCondition) -> bool {
        self.edges.is_active(condition)
    }

    pub(super) fn next_edge(&mut self) -> Option<BusEdge> {
        self.edges.next()
    }
}

/// The largest limit, valid until the clock has advanced once. A fast loop takes 0.1 s to 1 s for so many readings.
const MOST_READINGS: u32 = 200_000;

/// The smallest learned limit.
const LEAST_READINGS: u32 = 1_000;

/// Ratio of the limit to the most readings that the clock ever needed to show a later time.
const TIMES_THE_LONGEST: u32 = 100;

/// Readings in a microsecond of the clock's resolution: a fast loop polls 1 000 000 times a second.
const READINGS_A_MICRO: u32 = 2;

/// Number of received frames equal to the limit, for loops sleeping until a frame arrives: a bus of 1 Mbit/s takes 80 ms
/// and more for these.
const FRAMES: u32 = 1_600;

/// Any frame takes longer than so many µs on a bus of 1 Mbit/s.
const FRAME_US: u32 = 40;

/// Counts readings that show no later time, and learns their usual number.
#[derive(Debug)]
pub(super) struct Standstill {
    limit: u32,
    is_fixed: bool,
    /// The latest reading since the last step.
    furthest: Option<Instant>,
    readings: u32,
    frames: u32,
    /// As many frames may arrive between two steps of the clock: they do not count unless there are more.
    free_frames: u32,
    longest: u32,
    /// At least the resolution of the clock, in µs: the smallest advance, or difference of two.
    finest: u32,
    advance: u32,
}

impl Standstill {
    pub(super) const fn new() -> Self {
        Self {
            limit: MOST_READINGS,
            is_fixed: false,
            furthest: None,
            readings: 0,
            frames: 0,
            free_frames: 0,
            longest: 0,
            finest: u32::MAX,
            advance: 0,
        }
    }

    /// Sets the limit, at least 1; nothing is learned then.
    pub(super) const fn fix(&mut self, readings: u32) {
        self.limit = if readings == 0 { 1 } else { readings };
        self.is_fixed = true;
    }

    /// Notes received frames: time passed.
    #[expect(clippy::cast_possible_truncation, reason = "2^32 frames take a day")]
    pub(super) const fn receive(&mut self, frames: usize) {
        self.frames = self.frames.saturating_add(frames as u32);
    }

    /// Notes a reading of the clock.
    #[inline]
    pub(super) fn read(&mut self, now: Instant) {
        match self.furthest {
            Some(furthest) if now <= furthest => self.readings = self.readings.saturating_add(1),
            Some(furthest) => {
                self.learn(now.since(furthest).micros_u32().unwrap_or(u32::MAX));
                self.restart(now);
            }
            None => self.restart(now),
        }
    }

    #[inline(never)]
    fn learn(&mut self, advance: u32) {
        let difference = advance.abs_diff(core::mem::replace(&mut self.advance, advance));
        let finest = if difference == 0 { advance } else { difference.min(advance) };
        if self.readings <= self.longest && finest >= self.finest {
            return;
        }
        // The first reading lay within a step of the clock. A step half as long as the one before is left to the next one.
        if difference == advance {
            return;
        }
        self.longest = self.longest.max(self.readings);
        self.finest = self.finest.min(finest);
        if !self.is_fixed {
            let usual = self.longest.saturating_mul(TIMES_THE_LONGEST);
            let coarse = self.finest.saturating_mul(READINGS_A_MICRO);
            self.limit = usual.max(coarse).clamp(LEAST_READINGS, MOST_READINGS);
            self.free_frames = self.finest / FRAME_US;
        }
    }

    /// Counts from this time on: the clock may have gone back to it.
    pub(super) const fn restart(&mut self, now: Instant) {
        self.furthest = Some(now);
        (self.readings, self.frames) = (0, 0);
    }

    /// Returns whether the clock stands; true once for each full count.
    pub(super) const fn take(&mut self) -> bool {
        let mut passed = self.readings;
        if self.frames > self.free_frames {
            let a_frame = if self.limit < FRAMES { 1 } else { self.limit / FRAMES };
            passed = passed.saturating_add(self.frames.saturating_mul(a_frame));
        }
        let stands = passed >= self.limit;
        if stands {
            (self.readings, self.frames) = (0, 0);
        }
        stands
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dji::{Bus, Config, M3508};
    use crate::frame::CanFrame;
    use crate::motor::Condition;
    use crate::runner::{Nb, Runner};
    use core::cell::Cell;

    use embedded_can::ErrorKind;

    /// Takes every frame, and counts frames that drive.
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

    type TestRunner<'c> = Runner<Nb<Sink>, &'c Cell<Instant>, Bus>;

    /// A driven motor, just after the step at 10 ms.
    fn driving(clock: &Cell<Instant>) -> TestRunner<'_> {
        clock.set(at_us(10_000));
        let mut bus = Bus::new();
        let wheel = bus.attach(Config::<M3508>::at_once(1)).unwrap();
        let mut runner = Runner::new(Nb(Sink::default()), clock, bus);
        let tick = runner.due().unwrap();
        _ = runner.ingest(&CanFrame::standard(0x201, [0; 8]).unwrap(), clock.get());
        runner.arm(tick).unwrap();
        runner.device_mut().set_raw(wheel, 900).unwrap();
        runner.tick(tick);
        assert_eq!((runner.port_mut().0.driving, runner.due()), (1, None));
        runner
    }

    #[test]
    fn a_step_not_run_stays_due_and_the_next_step_covers_both() {
        let clock = Cell::<Instant>::default();
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
    fn a_step_by_hand_replaces_the_due_step() {
        let clock = Cell::<Instant>::default();
        let mut runner = driving(&clock);
        clock.set(at_us(11_000));
        assert!(runner.due().is_some());
        runner.tick(Tick::new(at_us(11_000), 0.001));
        assert_eq!(runner.due(), None);
    }

    /// The zeros of a standing or reversed clock are sent, regardless of the steps left out by the program.
    #[test]
    fn a_step_without_a_length_stays_due_until_it_is_run() {
        for back in [false, true] {
            let clock = Cell::<Instant>::default();
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

    #[test]
    fn zeros_are_sent_by_a_clock_that_stands_behind_a_reading_and_before_a_step_left_out() {
        let clock = Cell::<Instant>::default();
        let mut runner = driving(&clock).with_standstill_after(50);
        clock.set(at_us(11_000));
        assert!(runner.due().is_some(), "left out");
        for reading in [11_900, 11_500] {
            clock.set(at_us(reading));
            assert!(runner.due().is_some_and(|tick| tick.dt_s() > 0.0));
        }
        let stopped = (0..60).find_map(|_| runner.due().filter(|tick| tick.dt_s() == 0.0)).unwrap();
        assert_eq!(stopped.now(), at_us(10_000), "the last step that was run");
        runner.tick(stopped);
        assert!(!runner.is_armed());
    }

    /// `let (Some(one), Some(other)) = (one.due(), other.due()) else { continue };` with a clock that advances in
    /// between.
    #[test]
    fn two_runners_that_wait_for_each_other_lose_no_step() {
        let clock = Cell::new(at_us(0));
        let [mut one, mut other] =
            [(); 2].map(|()| Runner::new(Nb(Sink::default()), &clock, Bus::new()));
        let (mut steps, mut time_s) = ([0; 2], [0.0; 2]);
        for turn in 0..100_000 {
            let first = one.due();
            clock.set(clock.get() + Duration::from_micros(turn % 5));
            let second = other.due();
            clock.set(clock.get() + Duration::from_micros(13 - turn % 5));
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
        let clock = Cell::new(at_us(7));
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

    fn exactly(header: u32) -> FrameKey {
        let frame = CanFrame::standard(u16::try_from(header).unwrap(), [0; 8]).unwrap();
        FrameKey::of(&mut Bus::new(), &frame)
    }

    /// A drive's limits, each 101 ms, refused each time: the frames of the other devices pass.
    #[test]
    fn a_frame_that_is_sent_seldom_and_refused_each_time_is_no_lost_bus() {
        let mut watch = Watch::new();
        for ms in 1..1_000 {
            let now = Instant::from_micros(1_000 * ms);
            if ms % 101 == 1 {
                watch.refused(exactly(0x0C5), now);
            }
            assert!(!watch.finish(now), "{ms} ms");
        }
    }

    /// Thirty devices take turns, and the driver takes no frame: each frame is offered in each thirtieth tick.
    #[test]
    fn turns_of_many_devices_do_not_hide_a_lost_bus() {
        let mut watch = Watch::new();
        let lost = (1..300_u32).find(|ms| {
            let now = Instant::from_micros(1_000 * u64::from(*ms));
            watch.refused(exactly(0x100 + ms % 30), now);
            watch.finish(now)
        });
        assert!(lost.is_some_and(|ms| (100..150).contains(&ms)), "{lost:?}");
    }
}

#[cfg(test)]
mod standstill_tests {
    use super::*;
    use proptest::prelude::*;

    /// Reads a clock of this resolution after each of these gaps in ns, `times` times in a row; returns how often the clock
    /// counted as standing.
    fn stood(resolution_us: u64, phases: &[(u64, u32)]) -> usize {
        let (mut standstill, mut ns, mut stood) = (Standstill::new(), 12_345_678, 0);
        let mut heard_ns = ns;
        for (gap_ns, times) in phases {
            for _ in 0..*times {
                ns += gap_ns;
                // As many frames as a bus of 1 Mbit/s carries.
                while heard_ns + 111_000 <= ns {
                    heard_ns += 111_000;
                    standstill.receive(1);
                }
                let us = ns / 1_000 / resolution_us * resolution_us;
                standstill.read(Instant::from_micros(us));
                stood += usize::from(standstill.take());
            }
        }
        stood
    }

    /// Reads a clock of this resolution each `gap_us` for 2 s, then a standing clock; returns the time until detection in
    /// µs.
    fn noticed_us(resolution_us: u64, gap_us: u64) -> u64 {
        let mut standstill = Standstill::new();
        let mut now = Instant::START;
        for us in (0..2_000_000).step_by(usize::try_from(gap_us).unwrap()) {
            // Loops are never quite regular.
            let us = us + us / gap_us % 7 * gap_us / 10;
            now = Instant::from_micros(us / resolution_us * resolution_us);
            standstill.read(now);
            assert!(!standstill.take());
        }
        let stands = |standstill: &mut Standstill| {
            standstill.read(now);
            standstill.take()
        };
        (1..).find(|_| stands(&mut standstill)).unwrap() * gap_us
    }

    #[test]
    fn a_clock_that_stands_is_noticed_within_a_second_by_any_loop_of_a_kilohertz_or_more() {
        let ms = |us| us / 1_000;
        assert_eq!(ms(noticed_us(1, 1)), 1);
        assert_eq!(ms(noticed_us(1, 10)), 10);
        assert_eq!(ms(noticed_us(1, 250)), 250);
        assert_eq!(ms(noticed_us(1, 1_000)), 1_000);
        // Ticks of 1 ms and of 10 ms, polled 1 000 000 times a second.
        assert!((95..=100).contains(&ms(noticed_us(1_000, 1))));
        assert!((185..=200).contains(&ms(noticed_us(10_000, 1))));
        assert!((490..=500).contains(&ms(noticed_us(1_000, 250))));
        // The clock may be read faster at any time.
        assert!((1_990..=2_000).contains(&ms(noticed_us(1_000, 1_000))));
    }

    #[test]
    fn a_fast_loop_after_a_slow_one_and_a_short_first_step_are_no_standstill() {
        assert_eq!(stood(10_000, &[(315_040, 12_086), (501, 19_142)]), 0);
        assert_eq!(stood(3_087, &[(100, 200_000)]), 0);
    }

    #[test]
    fn a_limit_that_was_set_is_kept() {
        for (fixed, limit) in [(0, 1), (100, 100), (1_000_000, 1_000_000)] {
            let mut standstill = Standstill::new();
            standstill.fix(fixed);
            for ms in 1..100 {
                standstill.read(Instant::from_micros(1_000 * ms));
            }
            let now = Instant::from_micros(99_000);
            let stands = |standstill: &mut Standstill| {
                standstill.read(now);
                standstill.take()
            };
            assert!((1..limit).all(|_| !stands(&mut standstill)));
            assert!(stands(&mut standstill));
        }
    }

    fn gap_ns() -> impl Strategy<Value = u64> {
        prop_oneof![501..2_000_u64, 2_000..1_000_000_u64, 1_000_000..20_000_000_u64]
    }

    proptest! {
        /// Law: a running clock of any resolution never counts as standing, for any change of the loop's pace, up to 2
        /// 000 000 readings a second.
        #[test]
        fn a_clock_that_goes_on_never_stands(
            resolution_us in prop_oneof![1..100_u64, 100..1_000_u64, Just(1_000), Just(10_000)],
            phases in prop::collection::vec((gap_ns(), 1..20_000_u32), 1..6),
        ) {
            prop_assert_eq!(stood(resolution_us, &phases), 0);
        }

        /// Law: nor when the pace is the same all the time, up to 10 000 000 readings a second.
        #[test]
        fn a_clock_that_is_read_at_one_pace_never_stands(
            resolution_us in prop_oneof![1..20_000_u64, Just(1_000), Just(10_000)],
            gap_ns in 100..1_000_000_u64,
        ) {
            prop_assert_eq!(stood(resolution_us, &[(gap_ns, 200_000)]), 0);
        }
    }
}
