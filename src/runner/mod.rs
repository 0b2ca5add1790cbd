//! The thin shell over a CAN driver and a clock: the only part of the crate that does I/O.
//!
//! ```text
//! driver ──try_receive──> poll ──> device.ingest(frame, now)      bounded; others' frames are handed back
//! clock  ───────────────> due  ──> Tick                           1 kHz on a grid, overruns counted
//!                         tick ──> device.update ──> next_frame ──try_send──> driver
//!                                                     requeue <── refused, failed or evicted
//! ```
//!
//! Sending never loses a newest value: a frame refused, failed or evicted by the driver is offered again after the next
//! update, first, with the values of that update. Frames pending in the controller cannot be called back through
//! `embedded-can`: up to one frame a mailbox with older values may still go out after a stop. A driver able to abort
//! pending frames implements [`AbortPending`], and [`NbAbort`] then leaves no frame older than one period.
//!
//! # Supervision
//! A bus down or silent, overruns and a standing clock are latched as [`ConditionEdge`]s beside those of the motors;
//! [`Runner::next_edge`] returns these edges. [`Runner::heartbeat`] is for the hardware watchdog, the only remedy when the
//! loop itself stops.
//!
//! Nothing here is needed: a program can call [`Devices`] itself, as the examples `sans_io` and `async_sans_io` do.

mod port;
#[cfg(feature = "queue")]
mod queue;
mod statistics;
mod stop;
#[cfg(test)]
mod tests;
mod watch;

pub use port::{BlockingTx, Nb, Port};
#[cfg(feature = "queue")]
pub use queue::{FrameQueue, FrameReceiver, FrameSender};
pub use statistics::{ErrorCounts, Statistics};
pub use stop::{AbortPending, EmergencyStop, NbAbort};
pub use watch::BusCondition;

use crate::frame::CanFrame;
use crate::motor::{ArmError, Ask, Devices};
use crate::time::{Clock, ConditionEdge, Duration, Instant, Tick, Ticker};
use statistics::{Meter, increment};
use watch::Watch;

/// Moves frames between a driver and a device, at the pace of a clock.
///
/// Takes 676 bytes on a Cortex-M4F, without driver, clock and device (`docs/figures.md`).
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
    /// The step due and not run yet.
    waiting: Option<Tick>,
    turn: u32,
    statistics: Statistics,
    stop: Option<&'static EmergencyStop>,
    watch: Watch,
    meter: Meter,
    /// A frame that failed as the first, and therefore goes last in the next tick.
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

    /// Sets the number of readings in a row without a later time after which the clock counts as standing, at least 1,
    /// instead of the limit learned by [`due`](Self::due).
    ///
    /// If the clock counts in coarse ticks, choose several times the number of readings within one of them: a step by mistake
    /// relaxes every motor.
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
    /// Names the reason, as [`Devices::arm`]; also a watched emergency stop, and a driver that takes no frames. If motors are
    /// missing on a full bus, the error has the [measured load](Self::measured_load). A refused call counts as a request.
    pub fn arm(&mut self, tick: Tick) -> Result<(), ArmError> {
        let refusal = if self.stop.is_some_and(EmergencyStop::is_set) {
            ArmError::Stopped
        } else if self.is_bus_down() {
            ArmError::BusDown
        } else {
            return self.device.arm(tick.now()).map_err(|refusal| match refusal {
                ArmError::Missing(missing) => ArmError::Missing(missing.on_bus(self.meter.last())),
                other => other,
            });
        };
        // A refused request is a request.
        Ask::of(&mut self.device);
        Err(refusal)
    }

    /// Returns whether every motor takes targets; see [`Devices::is_armed`].
    #[must_use]
    pub fn is_armed(&mut self) -> bool {
        self.device.is_armed()
    }

    /// Clears the watched emergency stop and the stop of the device. The device stays disarmed.
    pub fn clear_emergency_stop(&mut self) {
        if let Some(stop) = self.stop {
            stop.clear();
        }
        self.device.clear_emergency_stop();
    }

    /// Runs one step: update, then send. Drops frames of others that the driver evicts.
    ///
    /// Costs 643 instructions on a Cortex-M4F, with 8 speed loops (`docs/figures.md`).
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

    /// Calls back the frames offered in the tick before that did not leave; hands frames of others to `others`.
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

    /// Returns the counters.
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

    /// Returns whether some command frame was not sent for 100 ms, refused or given back by the driver; over when all are sent.
    #[must_use]
    pub const fn is_bus_down(&self) -> bool {
        self.has(BusCondition::Down)
    }

    /// Returns whether something is wrong with the bus now.
    #[must_use]
    pub const fn has(&self, condition: BusCondition) -> bool {
        self.watch.has(condition)
    }

    /// Returns the oldest unread edge of a [`BusCondition`], and removes it from the list.
    ///
    /// While an edge is unread, the same edge is not latched again, so no condition floods: [`Statistics`] has the numbers.
    /// Two beginnings in a row mean that the condition ended in between. A change of one motor is an edge of that motor.
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

    /// Takes all unread edges, the oldest first; see [`next_edge`](Self::next_edge).
    pub fn edges(&mut self) -> impl Iterator<Item = ConditionEdge<BusCondition>> + '_ {
        core::iter::from_fn(|| self.next_edge())
    }

    /// Returns a counter of the ticks in which the whole loop ran: received frames were polled since the tick before,
    /// time advanced, every loop was updated, and every frame was offered to the driver. The counter wraps.
    ///
    /// Feed the hardware watchdog when the counter has changed, and only then: a hanging loop, for example in a driver
    /// waiting for ever, lets the watchdog bite, and a reset program starts disarmed. A dead bus is no reason to reset,
    /// so each part has to run, with or without work to do. [`poll`](Self::poll) and `poll_queue` count as polling; a
    /// program that hands frames to [`ingest`](Self::ingest) also calls `poll(0)`.
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
