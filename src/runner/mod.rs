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
//! them is reached with [`Runner::port_mut`].
//!
//! Nothing here is needed: a program can call [`CanDevice`] itself, as the examples `sans_io` and `async_sans_io` do.

mod port;
#[cfg(feature = "queue")]
mod queue;
mod statistics;
mod stop;
#[cfg(test)]
mod tests;

pub use port::{BlockingTx, Nb, Port, Received, Sent};
#[cfg(feature = "queue")]
pub use queue::{FrameQueue, FrameReceiver, FrameSender};
pub use statistics::{ErrorCounts, Statistics};
pub use stop::EmergencyStop;

use crate::frame::CanFrame;
use crate::motor::{ArmError, CanDevice, Ingest};
use crate::time::{Clock, Duration, Instant, Tick, Ticker};
use statistics::increment;

/// Without a frame accepted for this long, although some wait, the bus counts as lost.
const BUS_LOST_AFTER: Duration = Duration::from_millis(100);

/// A bound on the frames of one tick, for devices that would offer frames for ever.
const FRAMES_A_TICK: usize = 64;

/// Moves frames between a driver and a device, at the pace of a clock.
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
    turn: u32,
    statistics: Statistics,
    stop: Option<&'static EmergencyStop>,
    unsent_since: Option<Instant>,
    bus_down: bool,
}

impl<P: Port, K: Clock, D: CanDevice> Runner<P, K, D> {
    /// Takes driver, clock and device; ticks at 1 kHz.
    #[must_use]
    pub const fn new(port: P, clock: K, device: D) -> Self {
        Self {
            port,
            clock,
            device,
            ticker: Ticker::new(Duration::from_millis(1)),
            turn: 0,
            statistics: Statistics {
                received: 0,
                taken: 0,
                unrelated: 0,
                malformed: 0,
                receive_errors: NO_ERRORS,
                offered: 0,
                sent: 0,
                refused: 0,
                send_errors: NO_ERRORS,
                evicted: 0,
                evicted_unrelated: 0,
                superseded: 0,
                overruns: 0,
                bus_losses: 0,
            },
            stop: None,
            unsent_since: None,
            bus_down: false,
        }
    }

    /// Sets another period than 1 ms.
    #[must_use]
    pub fn with_period(mut self, period: Duration) -> Self {
        self.ticker = Ticker::new(period);
        self
    }

    /// Watches an emergency stop.
    #[must_use]
    pub fn with_emergency_stop(mut self, stop: &'static EmergencyStop) -> Self {
        self.stop = Some(stop);
        self
    }

    /// Takes at most `budget` received frames from the driver; frames of others are dropped. Returns how many came.
    pub fn poll(&mut self, budget: usize) -> usize {
        self.poll_with(budget, |_| {})
    }

    /// Takes at most `budget` received frames from the driver and hands those of others to `unrelated`. Returns how
    /// many came.
    ///
    /// Never waits, goes on after errors, and ends: an error counts against the budget as well.
    pub fn poll_with(&mut self, budget: usize, mut unrelated: impl FnMut(&CanFrame)) -> usize {
        let mut frames = 0;
        for _ in 0..budget {
            match self.port.try_receive() {
                Received::Frame(frame) => {
                    frames += 1;
                    let now = self.clock.now();
                    if self.ingest(&frame, now) == Ingest::Unrelated {
                        unrelated(&frame);
                    }
                }
                Received::Foreign => {
                    frames += 1;
                    increment(&mut self.statistics.received);
                    increment(&mut self.statistics.unrelated);
                }
                Received::Empty => break,
                Received::Failed(kind) => self.statistics.receive_errors.count(kind),
            }
        }
        frames
    }

    /// Takes one frame that was received elsewhere, in an interrupt say, with the time of its arrival.
    pub fn ingest(&mut self, frame: &CanFrame, now: Instant) -> Ingest {
        increment(&mut self.statistics.received);
        let outcome = self.device.ingest(frame, now);
        increment(match outcome {
            Ingest::Taken => &mut self.statistics.taken,
            Ingest::Unrelated => &mut self.statistics.unrelated,
            Ingest::Malformed(_) => &mut self.statistics.malformed,
        });
        outcome
    }

    /// Reads the clock and returns the step that is due, if any.
    pub fn due(&mut self) -> Option<Tick> {
        let now = self.clock.now();
        self.ticker.due(now)
    }

    /// Arms the device: nothing moves before.
    ///
    /// # Errors
    /// Names what stands in the way; see [`CanDevice::arm`]. Also while the driver takes no frames.
    #[expect(clippy::result_large_err, reason = "no heap, and arming is rare")]
    pub fn arm(&mut self, tick: Tick) -> Result<(), ArmError> {
        if self.stop.is_some_and(EmergencyStop::is_set) {
            return Err(ArmError::Stopped);
        }
        if self.bus_down {
            return Err(ArmError::BusDown);
        }
        self.device.arm(tick.now())
    }

    /// Tells whether every motor takes targets; see [`CanDevice::is_armed`].
    #[must_use]
    pub fn is_armed(&self) -> bool {
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
    pub fn tick(&mut self, tick: Tick) {
        self.tick_with(tick, |_| {});
    }

    /// Runs one step: update, then send. Hands frames of others that the driver evicted to `evicted`.
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
        if self.stop.is_some_and(EmergencyStop::is_set) {
            self.device.emergency_stop();
        }
        self.device.update(tick);
        limit(&mut self.device);
        self.turn = self.turn.wrapping_add(1);
        for _ in 0..FRAMES_A_TICK {
            let Some(frame) = self.device.next_frame(self.turn) else { break };
            increment(&mut self.statistics.offered);
            match self.port.try_send(&frame) {
                Sent::Accepted => self.count_sent(),
                Sent::Evicted(other) => {
                    self.count_sent();
                    if self.device.requeue(&other) {
                        increment(&mut self.statistics.evicted);
                    } else {
                        increment(&mut self.statistics.evicted_unrelated);
                        evicted(&other);
                    }
                }
                Sent::Full => {
                    increment(&mut self.statistics.refused);
                    self.keep(&frame, tick.now());
                    break;
                }
                Sent::Failed(kind) => {
                    self.statistics.send_errors.count(kind);
                    self.keep(&frame, tick.now());
                }
            }
        }
        self.watch_bus(tick.now());
    }

    fn count_sent(&mut self) {
        increment(&mut self.statistics.sent);
        self.unsent_since = None;
        self.bus_down = false;
    }

    fn keep(&mut self, frame: &CanFrame, now: Instant) {
        self.device.requeue(frame);
        self.unsent_since.get_or_insert(now);
    }

    fn watch_bus(&mut self, now: Instant) {
        let lost = self.unsent_since.is_some_and(|since| now.since(since) >= BUS_LOST_AFTER);
        if lost && !self.bus_down {
            self.bus_down = true;
            increment(&mut self.statistics.bus_losses);
            self.device.disarm();
        }
    }

    /// Returns what was counted.
    #[must_use]
    pub fn statistics(&self) -> Statistics {
        Statistics {
            superseded: self.device.superseded(),
            overruns: self.ticker.overruns(),
            ..self.statistics
        }
    }

    /// Tells whether no frame could be sent for 100 ms; the next one that the driver takes ends it.
    #[must_use]
    pub const fn is_bus_down(&self) -> bool {
        self.bus_down
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

const NO_ERRORS: ErrorCounts =
    ErrorCounts { overrun: 0, bit: 0, stuff: 0, crc: 0, form: 0, acknowledge: 0, other: 0 };
