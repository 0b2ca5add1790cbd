//! The thin shell over a CAN driver and a clock: the only part of the crate that does I/O.
//!
//! ```text
//! driver ──try_receive──> poll ──> device.ingest(frame, now)      bounded; others' frames are handed back
//! clock  ───────────────> due  ──> Tick                           1 kHz on a grid, overruns counted
//!                         tick ──> device.update ──> next_frame ──try_send──> driver
//!                                          put_back, requeue <── refused, failed or evicted
//! ```
//!
//! Sending never loses a newest value. Each poll offers frames again that the driver refused or evicted since the update, so the places
//! of a controller limit no number of frames; with more frames than places, poll oftener than once a period, and choose a
//! [period](Runner::with_period) in which the bus carries all frames. A failed frame, and a frame of an earlier update, are offered again
//! after the next update, first, with the values of that update. Frames pending in the controller cannot be called back through
//! `embedded-can`: up to one frame a mailbox with older values may still go out after a stop. A driver able to abort
//! pending frames implements [`AbortPending`], and [`NbAbort`] then leaves no frame older than one period.
//!
//! # Supervision
//! A bus down or silent, overruns and a standing clock are latched as [`Edge`](crate::time::Edge)s
//! beside those of the motors; [`Runner::next_edge`] returns these edges. [`Runner::heartbeat`] is for the hardware watchdog,
//! the only remedy when the loop itself stops.
//!
//! Nothing here is needed: a program can call [`Devices`] itself, as the examples `sans_io` and `async_sans_io` do.

mod port;
#[cfg(feature = "queue")]
mod queue;
mod statistics;
mod stop;
mod supervision;
#[cfg(test)]
mod tests;
mod watch;

pub use port::{BlockingTx, Nb, Port};
#[cfg(feature = "queue")]
pub use queue::{FrameQueue, FrameReceiver, FrameSender};
pub use statistics::Statistics;
pub use stop::{AbortPending, EmergencyStop, NbAbort};
pub use watch::BusCondition;

use crate::frame::CanFrame;
use crate::motor::{Devices, Ingest};
use crate::time::{Clock, Duration, Instant, Tick, Ticker};
use embedded_can::ErrorKind;
use port::{Pending, Received, Sending};
use statistics::{Meter, Tally, increment};
use stop::WatchedStop;
use watch::{Watch, together};

/// Number of frames for one reading of the clock: frames in the driver arrived before the reading, and frames arriving
/// meanwhile look older by the processing time of the others.
const FRAMES_A_READING: usize = 16;

/// Moves frames between a driver and a device, at the pace of a clock.
///
/// Takes 708 bytes on a Cortex-M4F, without driver, clock and device (`docs/figures.md`).
///
/// # Examples
/// ```
/// use drivetrain::dji::{Bus, Config, M3508};
/// use drivetrain::runner::{Nb, Runner};
/// use core::cell::Cell;
/// use drivetrain::time::{Duration, Instant};
/// # use drivetrain::frame::CanFrame;
/// # struct Loopback(Option<CanFrame>);
/// # impl embedded_can::nb::Can for Loopback {
/// #     type Frame = CanFrame;
/// #     type Error = embedded_can::ErrorKind;
/// #     fn transmit(&mut self, f: &CanFrame) -> nb::Result<Option<CanFrame>, Self::Error> { Ok(self.0.replace(*f)) }
/// #     fn receive(&mut self) -> nb::Result<CanFrame, Self::Error> { self.0.take().ok_or(nb::Error::WouldBlock) }
/// # }
/// # let can = Loopback(None);
///
/// let clock = Cell::new(Instant::START);
/// let mut bus = Bus::new();
/// bus.attach(Config::<M3508>::new(1))?;
/// let mut runner = Runner::new(Nb(can), &clock, bus);
/// for _ in 0..20 {
///     clock.set(clock.get() + Duration::from_millis(1));
///     runner.poll(16);
///     if let Some(tick) = runner.due() {
///         runner.tick(tick);
///     }
/// }
/// assert_eq!(runner.statistics().sent, 3); // zeros at first, and as a keep-alive every 10 ms
/// # Ok::<(), drivetrain::dji::AttachError>(())
/// ```
#[derive(Debug)]
pub struct Runner<P, K, D> {
    port: P,
    clock: K,
    device: D,
    ticker: Ticker,
    /// The step due and not run yet.
    waiting: Option<Tick>,
    turn: u32,
    statistics: Statistics,
    stop: Option<WatchedStop>,
    watch: Watch,
    meter: Meter,
    pending: Pending,
}

impl<P: Port, K: Clock, D: Devices> Runner<P, K, D> {
    /// Takes driver, clock and device; ticks at 1 kHz.
    #[must_use]
    pub const fn new(port: P, clock: K, device: D) -> Self {
        Self {
            port,
            clock,
            device,
            ticker: Ticker::new(Duration::from_millis(1)),
            waiting: None,
            turn: 0,
            statistics: Statistics::NONE,
            stop: None,
            watch: Watch::new(),
            meter: Meter::new(),
            pending: Pending::NONE,
        }
    }

    /// Takes at most `budget` received frames from the driver, as [`poll_with`](Self::poll_with); frames of others are dropped. Returns how many
    /// came.
    ///
    /// Costs 590 instructions on a Cortex-M4F, for 8 frames of motors (`docs/figures.md`).
    pub fn poll(&mut self, budget: usize) -> usize {
        self.poll_with(budget, |_| {})
    }

    /// Takes at most `budget` received frames from the driver and hands frames of others to `unrelated`. Returns the
    /// number of frames.
    ///
    /// Never waits, continues after errors, and ends: an error counts against the budget as well. The clock is read for
    /// each 16 frames, which have the same time.
    ///
    /// The budget has to be above the number of frames between two polls, so that each poll finds the driver empty: 16 for 8 motors at 1 kHz. If
    /// the program pauses, or the budget is smaller, a frame is stamped three [periods](Self::with_period) after the driver was last found
    /// empty, at the latest. The age of this stamp makes the motors late or offline until the driver is empty. An error is no empty driver.
    pub fn poll_with(&mut self, budget: usize, mut unrelated: impl FnMut(&CanFrame)) -> usize {
        self.watch.receive_ran();
        let (mut frame, mut now) = (CanFrame::EMPTY, Instant::START);
        let mut tally = Tally::default();
        // Frames of other kinds do not count towards the frames of a reading.
        let (mut frames, mut foreign) = (0, 0);
        for _ in 0..budget {
            match self.port.try_receive(&mut frame) {
                Received::Frame => {
                    if frames % FRAMES_A_READING == 0 {
                        now = self.read_arrival();
                    }
                    frames += 1;
                    if self.take(&frame, now, &mut tally) == Ingest::Unrelated {
                        unrelated(&frame);
                    }
                }
                Received::Foreign => {
                    foreign += 1;
                    increment(&mut self.statistics.unrelated);
                }
                Received::Empty => {
                    self.drain(frames > 0);
                    break;
                }
                Received::Failed(kind) => self.note_failure(kind),
            }
        }
        self.enter(frames, &tally);
        // Frames since the last reading.
        let waited = frames.checked_sub(1).map_or(0, |before| before % FRAMES_A_READING + 1);
        self.watch.standstill.receive(waited);
        if self.pending.waits {
            self.send_waiting();
        }
        frames + foreign
    }

    /// Takes one frame received elsewhere, for example in an interrupt, with the time of its arrival.
    pub fn ingest(&mut self, frame: &CanFrame, now: Instant) -> Ingest {
        let mut tally = Tally::default();
        let outcome = self.take(frame, now, &mut tally);
        self.enter(1, &tally);
        self.watch.standstill.receive(1);
        outcome
    }

    #[inline(always)]
    fn take(&mut self, frame: &CanFrame, now: Instant, tally: &mut Tally) -> Ingest {
        if !frame.is_whole() {
            self.meter.count_other(frame);
            tally.others += 1;
        }
        let outcome = self.device.ingest(frame, now);
        if outcome != Ingest::Taken {
            tally.reject(outcome);
        }
        outcome
    }

    /// Counts the frames of one call.
    #[expect(clippy::cast_possible_truncation, reason = "a budget of 2^32 frames takes a day")]
    fn enter(&mut self, frames: usize, tally: &Tally) {
        let frames = frames as u32;
        self.meter.count_whole(frames.saturating_sub(tally.others));
        if self.statistics.enter(frames, tally) > 0 {
            self.watch.hear();
        }
    }

    /// Reads the clock and returns the step that is due, if any.
    ///
    /// If the clock stands, or goes back behind the last tick, a step with a `dt_s` of 0 is due: its update sends zeros and relaxes every motor
    /// until armed again.
    ///
    /// A clock stands when too many readings in a row, by this method and by [`poll`](Self::poll), show no later time. The limit
    /// is learned from the running clock: 100 times the most readings ever needed to show a later time, and at least 2 for each
    /// microsecond of its resolution; from 1000 to 200 000, and 200 000 until the clock has advanced twice. So a running clock does not count
    /// as standing up to 2 000 000 readings a second. Received frames count too, 1600 of them as much as the limit, once a full bus
    /// needs more than a step of the clock for the frames since the last step. The times below are those without a frame.
    ///
    /// | loop | resolution of the clock | the step comes after |
    /// |---|---|--:|
    /// | polls 1 000 000 times a second | 1 µs | 1 ms |
    /// | the same | 1 ms | 0.1 s |
    /// | the same | 10 ms | 0.2 s |
    /// | wakes up each 0.25 ms | 1 µs | 0.25 s |
    /// | wakes up each ms | 1 µs | 1 s; 2 s if never early or late |
    /// | the same | 1 ms | 2 s |
    /// | the same | 10 ms | 20 s |
    /// | the same | of a clock that has never moved | 200 s |
    /// | wakes up for each frame of 4 motors at 1 kHz (with these frames) | 1 µs | 0.1 s |
    ///
    /// Slower loops set a limit of their own: [`with_standstill_after`](Self::with_standstill_after).
    ///
    /// A step that was not run stays due: further calls return the same step until [`tick`](Self::tick) or a sibling has run a
    /// step. When the next step comes due before, the next step takes its place, with a `dt_s` that covers both, and the step
    /// left out is an overrun; a step with a `dt_s` of 0 stays. So two runners can wait for each other:
    /// `let (Some(one), Some(other)) = (one.due(), other.due()) else { continue };` loses none.
    ///
    /// Costs 112 instructions on a Cortex-M4F, when a step is due (`docs/figures.md`).
    ///
    /// Costs 130 instructions on a Cortex-M4F, when none is due (`docs/figures.md`).
    pub fn due(&mut self) -> Option<Tick> {
        let now = self.read_clock();
        if self.watch.standstill.take() {
            // Not after the last step that was run, so that the step does not count as advancing
            // time.
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

    #[inline(never)]
    fn read_clock(&mut self) -> Instant {
        let now = self.clock.now();
        self.watch.read(now);
        now
    }

    /// Notes that the driver has no frame left. `is_read` tells whether this poll has read the clock.
    #[inline(never)]
    fn drain(&mut self, is_read: bool) {
        self.watch.drained = if is_read { self.watch.reading } else { self.clock.now() };
    }

    /// Reads the clock, and returns the time of a frame handed out now.
    #[inline(never)]
    fn read_arrival(&mut self) -> Instant {
        let now = self.read_clock();
        self.watch.arrival(now, self.ticker.period())
    }

    #[cold]
    #[inline(never)]
    fn note_failure(&mut self, kind: ErrorKind) {
        self.statistics.receive_errors.count(kind);
        if kind == ErrorKind::Overrun {
            let now = self.read_clock();
            self.watch.edges.begin(BusCondition::ReceiveOverrun, now);
        }
    }

    /// Runs one step: update, then send. Drops frames of others that the driver evicts.
    ///
    /// Costs 649 instructions on a Cortex-M4F, with 8 speed loops (`docs/figures.md`).
    pub fn tick(&mut self, tick: Tick) {
        self.tick_with(tick, |_| {});
    }

    /// Runs one step: update, then send. Hands evicted frames of others to `evicted`, if they have at most 8 bytes.
    pub fn tick_with(&mut self, tick: Tick, evicted: impl FnMut(&CanFrame)) {
        self.step(tick, |_| {}, evicted);
    }

    /// Runs one step: update, then `limit`, then send. In between, all outputs of the loops are known and none is on the
    /// wire: see [`scale_outputs`](crate::dji::Bus::scale_outputs) of a bus.
    ///
    /// For a limit over motors on two buses, nest one call in the `limit` of the other.
    pub fn tick_limited(&mut self, tick: Tick, limit: impl FnOnce(&mut D)) {
        self.step(tick, limit, |_| {});
    }

    fn step(&mut self, tick: Tick, limit: impl FnOnce(&mut D), mut evicted: impl FnMut(&CanFrame)) {
        self.waiting = None;
        self.pending.hand_over(&mut evicted);
        self.pending.was_stopped = self.stop.as_mut().is_some_and(WatchedStop::take);
        if self.pending.was_stopped {
            self.device.emergency_stop();
        }
        self.sending(tick.now()).call_back(&mut evicted);
        self.device.update(tick);
        limit(&mut self.device);
        self.turn = self.turn.wrapping_add(1);
        self.sending(tick.now()).send(&mut evicted);
        self.meter.finish(tick.now());
        if self.watch.finish(tick.now()) {
            increment(&mut self.statistics.bus_losses);
            self.device.trip();
        }
    }

    /// Offers the frames of the last tick that found no place: within its period, and unless something was stopped since.
    #[cold]
    #[inline(never)]
    fn send_waiting(&mut self) {
        let now = self.read_clock();
        let is_fresh = |ticked| ticked <= now && now.since(ticked) < self.ticker.period();
        let is_stopped = self.stop.as_ref().is_some_and(WatchedStop::is_set)
            && !self.pending.was_stopped
            || self.pending.was_armed && !self.device.is_armed();
        let has_place = self.pending.evicted.is_none();
        if has_place && self.watch.ticked().is_some_and(is_fresh) && !is_stopped {
            self.sending(now).send_later();
        }
    }

    /// The parts that sending needs.
    #[inline(always)]
    const fn sending(&mut self, now: Instant) -> Sending<'_, P, D> {
        let Self { port, device, statistics, meter, watch, pending, turn, .. } = self;
        Sending { port, device, statistics, meter, watch, pending, turn: *turn, now }
    }

    /// Returns the device.
    #[must_use]
    pub const fn device(&self) -> &D {
        &self.device
    }

    /// Returns the device, to set targets.
    #[must_use]
    pub const fn device_mut(&mut self) -> &mut D {
        &mut self.device
    }

    /// Returns the driver: to send own frames beside those of the device, to recover from bus-off, to abort pending
    /// frames.
    #[must_use]
    pub const fn port_mut(&mut self) -> &mut P {
        &mut self.port
    }

    /// Gives driver, clock and device back.
    #[must_use]
    pub fn into_parts(self) -> (P, K, D) {
        (self.port, self.clock, self.device)
    }
}
