//! The methods of a runner beside its cycle: settings, arming, frames of a queue, counters and conditions.

use super::{BusCondition, EmergencyStop, Port, Runner, Statistics, WatchedStop};
#[cfg(feature = "queue")]
use super::{FrameReceiver, statistics::Tally};
use crate::motor::{ArmError, BusLoad, Devices, ask};
use crate::time::{Clock, Duration, Edge, Tick, Ticker};
#[cfg(feature = "queue")]
use crate::{frame::CanFrame, motor::Ingest};

impl<P: Port, K: Clock, D: Devices> Runner<P, K, D> {
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
    /// use core::cell::Cell;
    /// use drivetrain::time::{Duration, Instant};
    /// # use drivetrain::sim::Simulation;
    /// # let world = Simulation::new(1);
    /// # let can = world.controller();
    ///
    /// let clock = Cell::new(Instant::START);
    /// let mut runner = Runner::new(Nb(can), &clock, Bus::new())
    ///     .with_period(Duration::from_millis(10))
    ///     .with_standstill_after(20);
    /// for _ in 0..100 {
    ///     clock.set(clock.get() + Duration::from_millis(10));
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

    /// Watches an emergency stop: see [`EmergencyStop`].
    #[must_use]
    pub fn with_emergency_stop(mut self, stop: &'static EmergencyStop) -> Self {
        self.stop = Some(WatchedStop::new(stop));
        self
    }

    /// Arms the device: nothing moves before.
    ///
    /// # Errors
    /// Names the reason, as [`Devices::arm`]; also a watched emergency stop, and a driver that takes no frames. If motors are
    /// missing on a full bus, the error has the [measured load](Self::measured_load). A refused call counts as a request.
    pub fn arm(&mut self, tick: Tick) -> Result<(), ArmError> {
        let is_stopped = self.stop.as_ref().is_some_and(WatchedStop::is_set);
        let Some(refusal) = ArmError::around(is_stopped, self.is_bus_down()) else {
            let outcome = self.device.arm(tick.now());
            let has_waiting = self.watch.has_waiting(self.ticker.period());
            return outcome.map_err(|refusal| refusal.on_bus(self.meter.last(), has_waiting));
        };
        // A refused request is a request.
        ask(&mut self.device);
        Err(refusal)
    }

    /// Returns whether every motor takes targets; see [`Devices::is_armed`].
    #[must_use]
    pub fn is_armed(&mut self) -> bool {
        self.device.is_armed()
    }

    /// Clears the watched emergency stop and the stop of the device. The device stays disarmed; a stop that no tick has seen disarms the
    /// device first.
    pub fn clear_emergency_stop(&mut self) {
        if let Some(stop) = &mut self.stop {
            if stop.take() {
                self.device.emergency_stop();
            }
            stop.clear();
        }
        self.device.clear_emergency_stop();
    }

    /// Takes at most `budget` frames from a queue, with the times of their arrival; drops frames of others. Returns the
    /// number of frames.
    #[cfg(feature = "queue")]
    pub fn poll_queue(&mut self, queue: &mut FrameReceiver<'_>, budget: usize) -> usize {
        self.poll_queue_with(queue, budget, |_| {})
    }

    /// Takes at most `budget` frames from a queue, with the times of their arrival, and hands frames of others to
    /// `unrelated`. Returns the number of frames.
    ///
    /// Frames dropped by the queue since the last call are noted as [`lost`](Statistics::lost).
    ///
    /// # Examples
    /// ```
    /// use drivetrain::dji::{Bus, Config, M3508};
    /// use drivetrain::frame::CanFrame;
    /// use drivetrain::runner::{BusCondition, FrameQueue, Nb, Runner};
    /// use core::cell::Cell;
    /// use drivetrain::time::Instant;
    /// # use drivetrain::sim::Simulation;
    /// # let world = Simulation::new(1);
    /// # let can = world.controller();
    ///
    /// let clock = Cell::new(Instant::from_micros(9));
    /// let mut bus = Bus::new();
    /// bus.attach(Config::<M3508>::new(1))?;
    /// let mut runner = Runner::new(Nb(can), &clock, bus);
    /// let mut queue = FrameQueue::<4>::new();
    /// let (mut interrupt, mut received) = queue.split();
    /// let frame = CanFrame::standard(0x201, [0; 8]).ok_or("not an 11-bit id")?;
    /// for at in 1..=5 {
    ///     interrupt.push(&frame, Instant::from_micros(at)); // there is room for three
    /// }
    /// assert_eq!(runner.poll_queue_with(&mut received, 16, |_| {}), 3);
    /// assert_eq!(runner.statistics().lost, 2);
    /// assert!(runner.has(BusCondition::ReceiveOverrun));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[cfg(feature = "queue")]
    pub fn poll_queue_with(
        &mut self,
        queue: &mut FrameReceiver<'_>,
        budget: usize,
        mut unrelated: impl FnMut(&CanFrame),
    ) -> usize {
        self.watch.receive_ran();
        self.note_lost(queue.take_dropped());
        let (mut tally, mut frames) = (Tally::default(), 0);
        while frames < budget {
            let Some((frame, arrived)) = queue.pop() else { break };
            frames += 1;
            if self.take(&frame, arrived, &mut tally) == Ingest::Unrelated {
                unrelated(&frame);
            }
        }
        self.enter(frames, &tally);
        self.watch.standstill.receive(frames);
        if self.pending.waits {
            self.send_waiting();
        }
        frames
    }

    /// Counts received frames lost before this call, for example in a queue of the application. 0 changes nothing.
    pub fn note_lost(&mut self, frames: u32) {
        if frames > 0 {
            self.statistics.lost = self.statistics.lost.saturating_add(frames);
            let now = self.read_clock();
            self.watch.edges.begin(BusCondition::ReceiveOverrun, now);
        }
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

    /// Returns the load of the bus in the last window of a second or a little more, by the frames sent and received here;
    /// `None` in the first window.
    ///
    /// Frames are counted by their length. Compare the result with [`Bus::load`](crate::dji::Bus::load), calculated from the
    /// rates of the motors: if the measured load is above, another node sends, or an ESC has another rate.
    ///
    /// # Limits
    /// **Frames dropped by the filter of the controller are not counted**, nor are frames lost in an overrun, error frames
    /// and repetitions. A sent frame counts when the driver takes it, and no longer when the driver gives it back.
    ///
    /// # Examples
    /// Three M3508 at 1 kHz, whose three feedback frames of 8 bytes are the only traffic:
    /// ```
    /// use drivetrain::dji::{Bus, Config, M3508};
    /// use drivetrain::runner::{Nb, Runner};
    /// use drivetrain::sim::{MotorConfig, Simulation};
    /// use drivetrain::time::Duration;
    ///
    /// let world = Simulation::new(1);
    /// let mut bus = Bus::new();
    /// for id in 1..=3 {
    ///     world.attach(MotorConfig::m3508(id))?;
    ///     bus.attach(Config::<M3508>::new(id))?;
    /// }
    /// let mut runner = Runner::new(Nb(world.controller()), world.clock(), bus);
    /// for _ in 0..2_100 {
    ///     world.advance(Duration::from_millis(1));
    ///     runner.poll(16);
    ///     if let Some(tick) = runner.due() {
    ///         runner.tick(tick);
    ///     }
    /// }
    /// let load = runner.measured_load().ok_or("two seconds are over")?;
    /// assert!((load.nominal() - 0.333).abs() < 0.03, "{load}"); // and a zero frame each 10 ms
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub const fn measured_load(&self) -> Option<BusLoad> {
        self.meter.last()
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
    /// use core::cell::Cell;
    /// use drivetrain::time::{Duration, Instant};
    /// # use drivetrain::sim::Simulation;
    /// # let world = Simulation::new(1);
    /// # let can = world.controller();
    ///
    /// let clock = Cell::new(Instant::START);
    /// let mut runner = Runner::new(Nb(can), &clock, Bus::new());
    /// runner.due();
    /// clock.set(clock.get() + Duration::from_secs(1));
    /// for _ in 0..=1_000 {
    ///     if let Some(tick) = runner.due() {
    ///         runner.tick(tick);
    ///     }
    ///     clock.set(clock.get() + Duration::from_millis(1));
    /// }
    /// let log: Vec<String> = core::iter::from_fn(|| runner.next_edge()).map(|edge| edge.to_string()).collect();
    /// assert_eq!(log, ["tick overrun began at 1000000 us", "tick overrun ended at 2000000 us"]);
    /// ```
    pub fn next_edge(&mut self) -> Option<Edge<BusCondition>> {
        self.watch.next_edge()
    }

    /// Takes all unread edges, the oldest first; see [`next_edge`](Self::next_edge).
    pub fn edges(&mut self) -> impl Iterator<Item = Edge<BusCondition>> + '_ {
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
    /// use core::cell::Cell;
    /// use drivetrain::time::{Duration, Instant};
    /// # use drivetrain::sim::Simulation;
    /// # let world = Simulation::new(1);
    /// # let can = world.controller();
    /// # struct Watchdog { fed: u32 }
    /// # impl Watchdog { fn feed(&mut self) { self.fed += 1; } }
    /// # let mut watchdog = Watchdog { fed: 0 }; // independent, with a time-out of some ticks
    ///
    /// let clock = Cell::new(Instant::START);
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
    ///     clock.set(clock.get() + Duration::from_micros(100));
    /// }
    /// assert_eq!(watchdog.fed, 10); // once a tick
    /// ```
    #[must_use]
    pub const fn heartbeat(&self) -> u32 {
        self.watch.heartbeat
    }
}
