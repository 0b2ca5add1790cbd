//! Frames through the driver: received ones to the device, commands from it.

#[cfg(feature = "queue")]
use super::FrameReceiver;
use super::statistics::{Tally, increment};
use super::{BusCondition, Runner};
use crate::frame::CanFrame;
use crate::motor::{Devices, Ingest};
use crate::time::{Clock, Instant};
use embedded_can::{Error, ErrorKind};

/// A CAN driver as the runner needs it: implemented by [`Nb`], [`NbAbort`](super::NbAbort) and [`BlockingTx`].
///
/// Several drivers implement both traits of `embedded-can`, whose methods have the same names, so the choice is a
/// newtype. A driver with neither trait gets `embedded_can::nb::Can` by a newtype of its own.
pub trait Port: Driver {}

/// Transfer of frames to and from a driver. Sealed: outside of this module, a [`Port`] is made from the traits of
/// `embedded-can`.
pub trait Driver {
    /// Offers a frame to the driver; if the driver evicts a frame, writes it over `evicted`.
    fn try_send(&mut self, frame: &CanFrame, evicted: &mut CanFrame) -> Sent;

    /// Asks the driver for a received frame, and writes the frame over `frame`.
    fn try_receive(&mut self, frame: &mut CanFrame) -> Received;

    /// Calls back the frames pending in the controller, if the driver can; `None` for a frame other than a classic CAN
    /// frame.
    fn call_back(&mut self, _back: impl FnMut(Option<CanFrame>)) {}
}

/// Result of offering a frame to the driver.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[must_use]
pub enum Sent {
    /// The frame waits in the controller.
    Accepted,
    /// The frame waits in the controller, in the place of a frame of lower priority, now in the argument.
    Evicted,
    /// The frame waits in the controller, in the place of a frame other than a classic CAN frame of at most 8 bytes.
    EvictedForeign,
    /// There is no place now.
    Full,
    /// The driver reports an error; the frame was not taken.
    Failed(ErrorKind),
}

/// Result of asking the driver for a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[must_use]
pub enum Received {
    /// A frame, now in the argument.
    Frame,
    /// A frame other than a classic CAN frame of at most 8 bytes.
    Foreign,
    /// Nothing now.
    Empty,
    /// The driver reports an error.
    Failed(ErrorKind),
}

/// A driver that implements `embedded_can::nb::Can`: never waits.
#[derive(Debug, Clone, Copy)]
pub struct Nb<C>(pub C);

impl<C: embedded_can::nb::Can> Port for Nb<C> {}

impl<C: embedded_can::nb::Can> Driver for Nb<C> {
    // The length of the frame is known at its origin: no loop copies its bytes then.
    #[inline(always)]
    fn try_send(&mut self, frame: &CanFrame, evicted: &mut CanFrame) -> Sent {
        let Some(frame) = frame.convert() else { return Sent::Failed(ErrorKind::Form) };
        match self.0.transmit(&frame) {
            Ok(None) => Sent::Accepted,
            Ok(Some(other)) if evicted.copy_from(&other) => Sent::Evicted,
            Ok(Some(_)) => Sent::EvictedForeign,
            Err(nb::Error::WouldBlock) => Sent::Full,
            Err(nb::Error::Other(error)) => Sent::Failed(error.kind()),
        }
    }

    #[inline]
    fn try_receive(&mut self, frame: &mut CanFrame) -> Received {
        match self.0.receive() {
            Ok(received) if frame.copy_from(&received) => Received::Frame,
            Ok(_) => Received::Foreign,
            Err(nb::Error::WouldBlock) => Received::Empty,
            Err(nb::Error::Other(error)) => Received::Failed(error.kind()),
        }
    }
}

/// A driver that implements `embedded_can::blocking::Can`: sends only.
///
/// Sending waits until the driver has a place: on a bus that stands still, for ever. A blocking receive waits for a
/// frame by contract, so the runner never calls it: feed received frames to [`Runner::ingest`](super::Runner::ingest),
/// from an interrupt through the queue (feature `queue`) for example.
#[derive(Debug, Clone, Copy)]
pub struct BlockingTx<C>(pub C);

impl<C: embedded_can::blocking::Can> Port for BlockingTx<C> {}

impl<C: embedded_can::blocking::Can> Driver for BlockingTx<C> {
    fn try_send(&mut self, frame: &CanFrame, _: &mut CanFrame) -> Sent {
        let Some(frame) = frame.convert() else { return Sent::Failed(ErrorKind::Form) };
        match self.0.transmit(&frame) {
            Ok(()) => Sent::Accepted,
            Err(error) => Sent::Failed(error.kind()),
        }
    }

    fn try_receive(&mut self, _: &mut CanFrame) -> Received {
        Received::Empty
    }
}

/// Number of frames for one reading of the clock: frames in the driver arrived before the reading, and frames arriving
/// meanwhile look older by the processing time of the others.
const FRAMES_A_READING: usize = 16;

/// Upper bound on the frames of one tick, for devices with an endless supply of frames.
const FRAMES_A_TICK: usize = 64;

/// Number of failures in a row after which a frame takes another turn. A driver whose errors alternate with successes
/// would fail an earlier change as well.
const PATIENCE: u8 = 3;

impl<P: Port, K: Clock, D: Devices> Runner<P, K, D> {
    /// Takes at most `budget` received frames from the driver; frames of others are dropped. Returns how many came.
    ///
    /// Costs 535 instructions on a Cortex-M4F, for 8 frames of motors (`docs/figures.md`).
    pub fn poll(&mut self, budget: usize) -> usize {
        self.poll_with(budget, |_| {})
    }

    /// Takes at most `budget` received frames from the driver and hands frames of others to `unrelated`. Returns the
    /// number of frames.
    ///
    /// Never waits, continues after errors, and ends: an error counts against the budget as well. The clock is read for
    /// each 16 frames: a frame has the time of the first of its 16.
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
                        now = self.read_clock();
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
                Received::Empty => break,
                Received::Failed(kind) => self.note_failure(kind),
            }
        }
        self.enter(frames, &tally);
        // Frames since the last reading.
        let waited = frames.checked_sub(1).map_or(0, |before| before % FRAMES_A_READING + 1);
        self.watch.standstill.receive(waited);
        frames + foreign
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

    /// Takes at most `budget` frames from a queue, with the times of their arrival; drops frames of others. Returns the
    /// number of frames.
    #[cfg(feature = "queue")]
    pub fn poll_queue(&mut self, queue: &mut FrameReceiver<'_>, budget: usize) -> usize {
        self.poll_queue_with(queue, budget, |_| {})
    }

    /// Takes at most `budget` frames from a queue, with the times of their arrival, and hands frames of others to
    /// `unrelated`. Returns the number of frames.
    ///
    /// Frames dropped by the queue since the last call are noted as [`lost`](super::Statistics::lost).
    ///
    /// # Examples
    /// ```
    /// use drivetrain::dji::{Bus, Config, M3508};
    /// use drivetrain::frame::CanFrame;
    /// use drivetrain::runner::{BusCondition, FrameQueue, Nb, Runner};
    /// use drivetrain::time::{Instant, ManualClock};
    /// # use drivetrain::sim::Simulation;
    /// # let world = Simulation::new(1);
    /// # let can = world.controller();
    ///
    /// let clock = ManualClock::new(Instant::from_micros(9));
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
        frames
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
        let taken = frames.saturating_sub(tally.rejected);
        let unrelated = tally.rejected.saturating_sub(tally.malformed);
        let counted = &mut self.statistics;
        counted.taken = counted.taken.saturating_add(taken);
        if tally.rejected > 0 {
            counted.unrelated = counted.unrelated.saturating_add(unrelated);
            counted.malformed = counted.malformed.saturating_add(tally.malformed);
        }
        if taken > 0 {
            self.watch.hear();
        }
    }

    /// Counts received frames lost before this call, for example in a queue of the application. 0 changes nothing.
    pub fn note_lost(&mut self, frames: u32) {
        if frames > 0 {
            self.statistics.lost = self.statistics.lost.saturating_add(frames);
            let now = self.read_clock();
            self.watch.edges.begin(BusCondition::ReceiveOverrun, now);
        }
    }
}

impl<P: Port, K: Clock, D: Devices> Runner<P, K, D> {
    /// Offers the frames of one tick to the driver; hands evicted frames of others to `evicted`.
    pub(super) fn send(&mut self, now: Instant, evicted: &mut impl FnMut(&CanFrame)) {
        if self.yields.is_some() {
            return self.send_rest(0, None, now, evicted);
        }
        let mut other = CanFrame::EMPTY;
        for sent in 0..FRAMES_A_TICK {
            let Some(frame) = self.device.next_frame(self.turn) else { break };
            let outcome = self.port.try_send(&frame, &mut other);
            if outcome != Sent::Accepted {
                return self.send_rest(sent, Some((frame, outcome, other)), now, evicted);
            }
            self.note_accepted(&frame, now);
        }
    }

    /// Offers the frames after a frame not simply taken by the driver, and all frames of a tick in which a frame takes
    /// another turn.
    ///
    /// A frame without a place goes first in the next tick. A frame that fails again and again takes another turn: the
    /// last after the first, otherwise the first. So a driver with one failing call in each tick, always the first or
    /// always the last, keeps no frame from the bus.
    #[cold]
    #[inline(never)]
    fn send_rest(
        &mut self,
        sent: usize,
        mut offered: Option<(CanFrame, Sent, CanFrame)>,
        now: Instant,
        evicted: &mut impl FnMut(&CanFrame),
    ) {
        let yields = self.yields.take();
        let (mut held, mut goes_first, mut refused) = (None, None, None);
        let mut is_first = sent == 0;
        for _ in sent..FRAMES_A_TICK {
            let (frame, outcome, other) = match offered.take() {
                Some(offered) => offered,
                None => {
                    let frame = match self.device.next_frame(self.turn) {
                        Some(frame) if yields == Some(frame.header()) && held.is_none() => {
                            held = Some(frame);
                            continue;
                        }
                        Some(frame) => frame,
                        None => match held.take() {
                            Some(frame) => frame,
                            None => break,
                        },
                    };
                    let mut other = CanFrame::EMPTY;
                    (frame, self.port.try_send(&frame, &mut other), other)
                }
            };
            match outcome {
                Sent::Accepted => self.note_accepted(&frame, now),
                Sent::Evicted => {
                    self.count_sent(&frame);
                    if self.device.requeue(&other) {
                        increment(&mut self.statistics.evicted);
                        self.meter.discount(&other);
                        // Before the frame that took its place: both may have one id.
                        self.watch.evicted(other.header(), now);
                    } else {
                        increment(&mut self.statistics.evicted_unrelated);
                        evicted(&other);
                    }
                    if other.header() != frame.header() {
                        self.watch.accepted(frame.header(), now);
                    }
                }
                Sent::EvictedForeign => {
                    self.count_sent(&frame);
                    increment(&mut self.statistics.evicted_unrelated);
                    self.watch.accepted(frame.header(), now);
                }
                Sent::Full => {
                    increment(&mut self.statistics.refused);
                    self.watch.refused(frame.header(), now);
                    refused = Some(frame);
                    break;
                }
                Sent::Failed(kind) => {
                    self.statistics.send_errors.count(kind);
                    let tries = self.watch.refused(frame.header(), now);
                    if tries >= PATIENCE && !is_first && goes_first.is_none() {
                        goes_first = Some(frame);
                    } else {
                        self.device.requeue(&frame);
                        if tries >= PATIENCE && is_first {
                            self.yields = Some(frame.header());
                        }
                    }
                }
            }
            is_first = false;
        }
        // The frame given back last goes first.
        for frame in [held, goes_first, refused].into_iter().flatten() {
            self.device.requeue(&frame);
        }
    }

    fn note_accepted(&mut self, frame: &CanFrame, now: Instant) {
        self.count_sent(frame);
        self.watch.accepted(frame.header(), now);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dji::{Bus, Config, M3508};
    use crate::runner::Runner;
    use crate::time::{Instant, ManualClock, Tick};
    use embedded_can::{Frame, Id};
    use std::vec::Vec;

    /// Of up to 64 bytes.
    #[derive(Debug, Clone, PartialEq)]
    struct FdFrame(Id, Vec<u8>);

    impl Frame for FdFrame {
        fn new(id: impl Into<Id>, data: &[u8]) -> Option<Self> {
            (data.len() <= 64).then(|| Self(id.into(), data.into()))
        }
        fn new_remote(_: impl Into<Id>, _: usize) -> Option<Self> {
            None
        }
        fn is_extended(&self) -> bool {
            matches!(self.0, Id::Extended(_))
        }
        fn is_remote_frame(&self) -> bool {
            false
        }
        fn id(&self) -> Id {
            self.0
        }
        fn dlc(&self) -> usize {
            self.1.len()
        }
        fn data(&self) -> &[u8] {
            &self.1
        }
    }

    /// Gives back a frame of another program for each frame taken.
    struct Full {
        length: usize,
    }

    impl embedded_can::nb::Can for Full {
        type Frame = FdFrame;
        type Error = ErrorKind;
        fn transmit(&mut self, frame: &FdFrame) -> nb::Result<Option<FdFrame>, ErrorKind> {
            assert!(frame.dlc() <= 8);
            Ok(FdFrame::new(embedded_can::StandardId::MAX, &[0; 64][..self.length]))
        }
        fn receive(&mut self) -> nb::Result<FdFrame, ErrorKind> {
            Err(nb::Error::WouldBlock)
        }
    }

    #[test]
    fn an_evicted_frame_of_others_is_counted_even_if_too_long_to_be_handed_back() {
        for (length, handed_back) in [(8, 1), (12, 0), (64, 0)] {
            let clock = ManualClock::new(Instant::from_micros(1_000));
            let mut bus = Bus::new();
            bus.attach(Config::<M3508>::new(1)).unwrap();
            let mut runner = Runner::new(Nb(Full { length }), &clock, bus);
            let mut evicted = 0;
            runner.tick_with(Tick::new(clock.now(), 0.001), |_| evicted += 1);
            let s = runner.statistics();
            assert_eq!((s.sent, s.evicted_unrelated, s.evicted), (1, 1, 0), "{length}");
            assert_eq!(evicted, handed_back, "{length}");
            assert_eq!(s.offered, s.sent + s.refused + s.send_errors.total());
            assert!(!runner.is_bus_down());
        }
    }

    /// Gives frames of several lengths, all of the id 0x201.
    struct Lengths(Vec<usize>);

    impl embedded_can::nb::Can for Lengths {
        type Frame = FdFrame;
        type Error = ErrorKind;
        fn transmit(&mut self, _: &FdFrame) -> nb::Result<Option<FdFrame>, ErrorKind> {
            Ok(None)
        }
        fn receive(&mut self) -> nb::Result<FdFrame, ErrorKind> {
            let length = self.0.pop().ok_or(nb::Error::WouldBlock)?;
            let id = embedded_can::StandardId::new(0x201).unwrap();
            Ok(FdFrame(id.into(), std::vec![0; length]))
        }
    }

    #[test]
    fn a_frame_of_another_kind_does_not_change_the_time_of_the_frames_after() {
        for place in [0, 1, 8, 16] {
            let clock = ManualClock::new(Instant::from_micros(10_000_000));
            let mut bus = Bus::new();
            let wheel = bus.attach(Config::<M3508>::at_once(1)).unwrap();
            _ = bus.ingest_raw(0x201, &[0; 8], clock.now());
            bus.arm(clock.now()).unwrap();
            bus.update(Tick::new(clock.now(), 0.001));
            clock.advance(crate::time::Duration::from_millis(1));
            let mut lengths = std::vec![8; 18];
            lengths[17 - place] = 12;
            let mut runner = Runner::new(Nb(Lengths(lengths)), &clock, bus);
            assert_eq!(runner.poll(64), 18);
            let s = runner.statistics();
            assert_eq!((s.received, s.taken, s.unrelated), (18, 17, 1), "{place}");
            runner.tick(Tick::new(clock.now(), 0.001));
            let bus = runner.device();
            assert!(bus.is_motor_armed(wheel), "{place}");
            assert_eq!(bus.link(wheel), Some(crate::motor::Link::Online), "{place}");
        }
    }
}
