//! The thin shell over a CAN driver and a clock: the only part of the crate that does I/O.
//!
//! ```text
//! driver ──try_receive──> poll ──> device.ingest(frame, now)      bounded; others' frames are handed back
//! clock  ───────────────> due  ──> Tick                           1 kHz on a grid, overruns counted
//!                         tick ──> device.update ──> next_frame ──try_send──> driver
//!                                                     requeue <── refused, failed or evicted
//! ```
//!
//! Sending never loses a newest value: what the driver refuses, fails or evicts is offered again after the next
//! update, first, with the values of that update. What already waits in the controller cannot be called back through
//! `embedded-can`: up to one frame a mailbox with older values may still go out after a stop. A driver that can abort
//! them implements [`AbortPending`], and [`NbAbort`] then leaves no frame older than one period.
//!
//! # What it watches
//! A bus that is down or silent, overruns and a clock that does not go on are latched as [`ConditionEdge`]s beside those of
//! the motors; [`Runner::next_edge`] hands them out. [`Runner::heartbeat`] is for the hardware watchdog, which alone
//! can help when the loop itself stops.
//!
//! Nothing here is needed: a program can call [`Devices`] itself, as the examples `sans_io` and `async_sans_io` do.

mod abort;
mod edge;
mod port;
#[cfg(feature = "queue")]
mod queue;
mod statistics;
mod stop;
#[cfg(test)]
mod tests;
mod watch;

pub use abort::{AbortPending, NbAbort};
pub use edge::BusCondition;
pub use port::{BlockingTx, Nb, Port};
#[cfg(feature = "queue")]
pub use queue::{FrameQueue, FrameReceiver, FrameSender};
pub use statistics::{ErrorCounts, MeasuredLoad, Statistics};
pub use stop::EmergencyStop;

use crate::frame::CanFrame;
use crate::motor::{ArmError, Ask, Devices};
use crate::time::{Clock, ConditionEdge, Duration, Instant, Tick, Ticker};
use statistics::{Meter, increment};
use watch::Watch;

/// Moves frames between a driver and a device, at the pace of a clock.
///
/// Takes 660 bytes on a Cortex-M4F, without driver, clock and device (`docs/figures.md`).
///
/// # Examples
/// ```
/// use drivetrain::dji::{Bus, Config, M3508};
/// use drivetrain::runner::{Nb, Runner};
/// use drivetrain::time::{Duration, Instant, ManualClock};
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
/// let clock = ManualClock::new(Instant::START);
/// let mut bus = Bus::new();
/// bus.attach(Config::<M3508>::new(1))?;
/// let mut runner = Runner::new(Nb(can), &clock, bus);
/// for _ in 0..20 {
///     clock.advance(Duration::from_millis(1));
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
    /// The step that is due and was not run.
    waiting: Option<Tick>,
    turn: u32,
    statistics: Statistics,
    stop: Option<&'static EmergencyStop>,
    watch: Watch,
    meter: Meter,
    /// The frame that goes last in the next tick, because it failed as the first one.
    yields: Option<u32>,
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
            yields: None,
        }
    }

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

    /// Sets the bit rate, in bits a second, for [`measured_load`](Self::measured_load); 1 000 000 at first.
    #[must_use]
    pub fn with_bit_rate(mut self, bits_per_s: u32) -> Self {
        self.meter.set_bit_rate(bits_per_s);
        self
    }

    /// Watches an emergency stop.
    #[must_use]
    pub fn with_emergency_stop(mut self, stop: &'static EmergencyStop) -> Self {
        self.stop = Some(stop);
        self
    }

    /// Arms the device: nothing moves before.
    ///
    /// # Errors
    /// Names the reason, as [`Devices::arm`]; also a watched emergency stop, and a driver that takes no frames. A refused call
    /// counts as asking.
    pub fn arm(&mut self, tick: Tick) -> Result<(), ArmError> {
        let refusal = if self.stop.is_some_and(EmergencyStop::is_set) {
            ArmError::Stopped
        } else if self.is_bus_down() {
            ArmError::BusDown
        } else {
            return self.device.arm(tick.now());
        };
        // A refused request is a request.
        Ask::of(&mut self.device);
        Err(refusal)
    }

    /// Tells whether every motor takes targets; see [`Devices::is_armed`].
    #[must_use]
    pub fn is_armed(&mut self) -> bool {
        self.device.is_armed()
    }

    /// Takes an emergency stop back, the watched one and that of the device. The device stays disarmed.
    pub fn clear_emergency_stop(&mut self) {
        if let Some(stop) = self.stop {
            stop.clear();
        }
        self.device.clear_emergency_stop();
    }

    /// Runs one step: update, then send. An evicted frame of others is dropped.
    ///
    /// Costs 644 instructions on a Cortex-M4F, with 8 speed loops (`docs/figures.md`).
    pub fn tick(&mut self, tick: Tick) {
        self.tick_with(tick, |_| {});
    }

    /// Runs one step: update, then send. Hands frames of others that the driver evicted to `evicted`, if they
    /// have at most 8 bytes.
    pub fn tick_with(&mut self, tick: Tick, evicted: impl FnMut(&CanFrame)) {
        self.step(tick, |_| {}, evicted);
    }

    /// Runs one step: update, then `limit`, then send. In between, all that the loops ask for is known and nothing of it
    /// is on the wire: see [`scale_outputs`](crate::dji::Bus::scale_outputs) of a bus.
    ///
    /// For a limit over motors on two buses, nest the one call in the other's `limit`.
    pub fn tick_limited(&mut self, tick: Tick, limit: impl FnOnce(&mut D)) {
        self.step(tick, limit, |_| {});
    }

    fn step(&mut self, tick: Tick, limit: impl FnOnce(&mut D), mut evicted: impl FnMut(&CanFrame)) {
        self.waiting = None;
        if self.stop.is_some_and(EmergencyStop::is_set) {
            self.device.emergency_stop();
        }
        self.call_back(tick.now(), &mut evicted);
        self.device.update(tick);
        limit(&mut self.device);
        self.turn = self.turn.wrapping_add(1);
        self.send(tick.now(), &mut evicted);
        self.meter.finish(tick.now());
        if self.watch.finish(tick.now()) {
            increment(&mut self.statistics.bus_losses);
            self.device.trip();
        }
    }

    /// Calls back what was offered in the tick before and did not leave; hands frames of others to `others`.
    fn call_back(&mut self, now: Instant, others: &mut impl FnMut(&CanFrame)) {
        let Self { port, device, statistics, meter, watch, .. } = self;
        port.call_back(|frame| match frame {
            Some(frame) if device.requeue(&frame) => {
                increment(&mut statistics.evicted);
                meter.discount(&frame);
                watch.called_back(frame.header(), now);
            }
            frame => {
                increment(&mut statistics.evicted_unrelated);
                if let Some(frame) = frame {
                    others(&frame);
                }
            }
        });
    }

    fn count_sent(&mut self, frame: &CanFrame) {
        increment(&mut self.statistics.sent);
        self.meter.count(frame);
    }

    /// Returns what was counted.
    #[must_use]
    pub fn statistics(&mut self) -> Statistics {
        Statistics {
            superseded: self.device.superseded(),
            overruns: self.statistics.overruns.saturating_add(self.ticker.overruns()),
            clock_standstills: self.watch.standstills,
            clock_reversals: self.watch.reversals,
            ..self.statistics.with_sums()
        }
    }

    /// Tells whether some command frame was not sent for 100 ms, refused or given back by the driver; over when all are sent.
    #[must_use]
    pub const fn is_bus_down(&self) -> bool {
        self.has(BusCondition::Down)
    }

    /// Tells whether something is wrong with the bus now.
    #[must_use]
    pub const fn has(&self, condition: BusCondition) -> bool {
        self.watch.has(condition)
    }

    /// Returns the oldest change of a [`BusCondition`] that was not read yet, and takes it off the list.
    ///
    /// As long as a change waits, the same change is not noted again, so that none floods: [`Statistics`] has the numbers. Two
    /// beginnings in a row say that the condition ended in between. What concerns one motor only is an edge of that motor.
    ///
    /// # Examples
    /// A second without a tick, and a second in time:
    /// ```
    /// use drivetrain::dji::Bus;
    /// use drivetrain::runner::{Nb, Runner};
    /// use drivetrain::time::{Duration, Instant, ManualClock};
    /// # use drivetrain::sim::Simulation;
    /// # let world = Simulation::new(1);
    /// # let can = world.controller();
    ///
    /// let clock = ManualClock::new(Instant::START);
    /// let mut runner = Runner::new(Nb(can), &clock, Bus::new());
    /// runner.due();
    /// clock.advance(Duration::from_secs(1));
    /// for _ in 0..=1_000 {
    ///     if let Some(tick) = runner.due() {
    ///         runner.tick(tick);
    ///     }
    ///     clock.advance(Duration::from_millis(1));
    /// }
    /// let log: Vec<String> = core::iter::from_fn(|| runner.next_edge()).map(|edge| edge.to_string()).collect();
    /// assert_eq!(log, ["tick overrun began at 1000000 us", "tick overrun ended at 2000000 us"]);
    /// ```
    pub fn next_edge(&mut self) -> Option<ConditionEdge<BusCondition>> {
        self.watch.next_edge()
    }

    /// Takes all changes that were not read yet, the oldest first; see [`next_edge`](Self::next_edge).
    pub fn edges(&mut self) -> impl Iterator<Item = ConditionEdge<BusCondition>> + '_ {
        core::iter::from_fn(|| self.next_edge())
    }

    /// Returns a number that goes on with each tick in which the whole loop ran: received frames were looked for since
    /// the one before, the time went on, every loop was updated, and everything was offered to the driver. It wraps.
    ///
    /// Feed the hardware watchdog when it has changed, and only then: a loop that hangs, in a driver that waits for ever
    /// say, lets the watchdog bite, and a program that resets starts disarmed. A dead bus is no reason to reset, so what
    /// counts is that each part ran, not that it had something to do. [`poll`](Self::poll) and `poll_queue` count
    /// as looking for frames; a program that hands them to [`ingest`](Self::ingest) calls `poll(0)` beside it.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::dji::Bus;
    /// use drivetrain::runner::{Nb, Runner};
    /// use drivetrain::time::{Duration, Instant, ManualClock};
    /// # use drivetrain::sim::Simulation;
    /// # let world = Simulation::new(1);
    /// # let can = world.controller();
    /// # struct Watchdog { fed: u32 }
    /// # impl Watchdog { fn feed(&mut self) { self.fed += 1; } }
    /// # let mut watchdog = Watchdog { fed: 0 }; // independent, with a time-out of some ticks
    ///
    /// let clock = ManualClock::new(Instant::START);
    /// let mut runner = Runner::new(Nb(can), &clock, Bus::new());
    /// let mut beat = runner.heartbeat();
    /// for _ in 0..100 {
    ///     runner.poll(16);
    ///     if let Some(tick) = runner.due() {
    ///         runner.tick(tick);
    ///     }
    ///     if runner.heartbeat() != beat {
    ///         beat = runner.heartbeat();
    ///         watchdog.feed();
    ///     }
    ///     clock.advance(Duration::from_micros(100));
    /// }
    /// assert_eq!(watchdog.fed, 10); // once a tick
    /// ```
    #[must_use]
    pub const fn heartbeat(&self) -> u32 {
        self.watch.heartbeat
    }

    /// Returns how full the bus was in the last second, by the frames that came and went here; `None` in the first one.
    ///
    /// What the hardware filter drops is not seen.
    #[must_use]
    pub const fn measured_load(&self) -> Option<MeasuredLoad> {
        self.meter.last()
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

    /// Returns the driver: to send own frames beside those of the device, to recover from bus-off, to abort what
    /// waits in mailboxes.
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
