//! The CAN drivers that a runner takes, and the frames of a tick on their way to the driver and back.

use super::Statistics;
use super::statistics::{Meter, increment};
use super::watch::{FrameKey, Watch};
use crate::frame::CanFrame;
use crate::motor::Devices;
use crate::time::Instant;
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

/// Upper bound on the frames of one tick, for devices with an endless supply of frames.
const FRAMES_A_TICK: usize = 64;

/// Frames evicted in a tick, or refused in a poll, that wait for the next poll.
const MOST_RETURNS: usize = 4;

/// Number of failures in a row after which a frame takes another turn. A driver whose errors alternate with successes
/// would fail an earlier change as well.
const PATIENCE: u8 = 3;

/// The sending of one tick: frames of a device go to the driver, and frames that the driver gives back go to the device.
pub(super) struct Sending<'r, P, D> {
    pub(super) port: &'r mut P,
    pub(super) device: &'r mut D,
    pub(super) statistics: &'r mut Statistics,
    pub(super) meter: &'r mut Meter,
    pub(super) watch: &'r mut Watch,
    pub(super) pending: &'r mut Pending,
    pub(super) turn: u32,
    pub(super) now: Instant,
}

impl<P: Driver, D: Devices> Sending<'_, P, D> {
    /// Calls back the frames offered in the tick before that did not leave; hands frames of others to `others`.
    #[inline]
    pub(super) fn call_back(self, others: &mut impl FnMut(&CanFrame)) {
        let Self { port, device, statistics, meter, watch, now, .. } = self;
        port.call_back(|frame| match frame {
            Some(frame) if device.requeue(&frame) => {
                increment(&mut statistics.evicted);
                meter.discount(&frame);
                watch.called_back(FrameKey::of(device, &frame), now);
            }
            frame => {
                increment(&mut statistics.evicted_unrelated);
                if let Some(frame) = frame {
                    others(&frame);
                }
            }
        });
    }

    /// The parts, for a call out of line: the parts of the usual case then stay in registers.
    #[inline(always)]
    const fn reborrow(&mut self) -> Sending<'_, P, D> {
        let Self { port, device, statistics, meter, watch, pending, turn, now } = self;
        Sending { port, device, statistics, meter, watch, pending, turn: *turn, now: *now }
    }

    /// Offers the frames of one tick to the driver; hands evicted frames of others to `evicted`.
    #[inline(always)]
    pub(super) fn send(mut self, evicted: &mut impl FnMut(&CanFrame)) {
        if self.pending.yields.is_some() {
            return self.reborrow().send_rest(0, None, false, evicted);
        }
        let mut other = CanFrame::EMPTY;
        for sent in 0..FRAMES_A_TICK {
            let Some(frame) = self.device.next_frame(self.turn) else { break };
            let outcome = self.port.try_send(&frame, &mut other);
            if outcome != Sent::Accepted {
                return self.reborrow().send_rest(
                    sent,
                    Some((frame, outcome, other)),
                    false,
                    evicted,
                );
            }
            self.note_accepted(&frame);
        }
    }

    pub(super) fn send_later(mut self) {
        let mut other = None;
        self.pending.waits = false;
        self.reborrow().send_rest(0, None, true, &mut |frame: &CanFrame| other = Some(*frame));
        self.pending.evicted = other;
    }

    /// Offers the frames after a frame not simply taken by the driver, and all frames of a tick in which a frame takes
    /// another turn.
    ///
    /// A frame without a place ends a tick, and no poll. This frame and the evicted ones are offered again by the next poll.
    /// A frame that fails again and again takes another turn: the last after the first, otherwise the first. So a driver with one
    /// failing call in each tick, always the first or always the last, keeps no frame from the bus.
    #[cold]
    #[inline(never)]
    fn send_rest(
        mut self,
        sent: usize,
        mut offered: Option<(CanFrame, Sent, CanFrame)>,
        is_later: bool,
        evicted: &mut dyn FnMut(&CanFrame),
    ) {
        let yields = if is_later { None } else { self.pending.yields.take() };
        let goes_last = |frame: &CanFrame| yields.is_some_and(|key| key.fits(frame.header()));
        let (mut held, mut goes_first, mut refused) = (None, None, None);
        let mut is_first = sent == 0 && !is_later;
        // Evicted by this call, and not offered again by it.
        let (mut ids, mut evictions) = ([u32::MAX; MOST_RETURNS], 0);
        let (mut back, mut returns) = ([CanFrame::EMPTY; MOST_RETURNS], 0);
        for _ in sent..FRAMES_A_TICK {
            let mut comes_again = false;
            let (frame, outcome, other) = match offered.take() {
                Some(offered) => offered,
                None => {
                    let frame = match self.device.next_frame(self.turn) {
                        Some(frame) if goes_last(&frame) && held.is_none() => {
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
                    comes_again = ids.contains(&frame.header());
                    let outcome = match comes_again {
                        true => Sent::Full,
                        false => self.port.try_send(&frame, &mut other),
                    };
                    (frame, outcome, other)
                }
            };
            match outcome {
                Sent::Accepted => self.note_accepted(&frame),
                Sent::Evicted => {
                    self.count_sent(&frame);
                    let key = FrameKey::of(self.device, &other);
                    let place = ids.get_mut(evictions);
                    let place = place.filter(|_| other.header() != frame.header());
                    let waits = place.is_some() && self.device.put_back(&other);
                    if waits || self.device.requeue(&other) {
                        increment(&mut self.statistics.evicted);
                        self.meter.discount(&other);
                        // Before the frame that took its place: both may have one id.
                        self.watch.evicted(key, self.now);
                    } else {
                        increment(&mut self.statistics.evicted_unrelated);
                        evicted(&other);
                    }
                    if !key.fits(frame.header()) {
                        self.watch.accepted(frame.header(), self.now);
                    }
                    if let Some(place) = place.filter(|_| waits) {
                        *place = other.header();
                        evictions += 1;
                        self.pending.waits = true;
                    }
                    if is_later {
                        break;
                    }
                }
                Sent::EvictedForeign => {
                    self.count_sent(&frame);
                    increment(&mut self.statistics.evicted_unrelated);
                    self.watch.accepted(frame.header(), self.now);
                }
                Sent::Full => {
                    self.pending.waits = true;
                    if is_later || comes_again {
                        if let Some(place) = back.get_mut(returns) {
                            *place = frame;
                            returns += 1;
                            continue;
                        }
                    } else {
                        increment(&mut self.statistics.refused);
                        self.watch.refused(FrameKey::of(self.device, &frame), self.now);
                    }
                    refused = Some(frame).filter(|frame| !self.device.put_back(frame));
                    break;
                }
                Sent::Failed(kind) => {
                    self.statistics.send_errors.count(kind);
                    let key = FrameKey::of(self.device, &frame);
                    let tries = self.watch.refused(key, self.now);
                    if tries >= PATIENCE && !is_first && goes_first.is_none() {
                        goes_first = Some(frame);
                    } else {
                        self.device.requeue(&frame);
                        if tries >= PATIENCE && is_first {
                            self.pending.yields = Some(key);
                        }
                    }
                }
            }
            is_first = false;
        }
        for frame in back.iter().take(returns) {
            if !self.device.put_back(frame) {
                self.device.requeue(frame);
            }
        }
        self.pending.was_armed = self.device.is_armed();
        // The frame given back last goes first.
        for frame in [held, goes_first, refused].into_iter().flatten() {
            self.device.requeue(&frame);
        }
    }

    #[inline(always)]
    fn note_accepted(&mut self, frame: &CanFrame) {
        self.count_sent(frame);
        self.watch.accepted(frame.header(), self.now);
    }

    fn count_sent(&mut self, frame: &CanFrame) {
        increment(&mut self.statistics.sent);
        self.meter.count(frame);
    }
}

/// Frames of the last tick that the driver did not take.
#[derive(Debug)]
pub(super) struct Pending {
    /// A frame that failed as the first, and therefore goes last in the next tick.
    pub(super) yields: Option<FrameKey>,
    /// Frames that found no place wait in the device.
    pub(super) waits: bool,
    /// The device was armed in the tick.
    pub(super) was_armed: bool,
    /// The emergency stop was set in the tick.
    pub(super) was_stopped: bool,
    /// A frame of others, evicted by a frame that waited. Polls offer no more frames then, until the next tick.
    pub(super) evicted: Option<CanFrame>,
}

impl Pending {
    pub(super) const NONE: Self =
        Self { yields: None, waits: false, was_armed: false, was_stopped: false, evicted: None };

    /// Begins a tick, whose update replaces the frames that wait.
    #[inline]
    pub(super) fn hand_over(&mut self, evicted: &mut impl FnMut(&CanFrame)) {
        self.waits = false;
        if let Some(frame) = self.evicted.take() {
            evicted(&frame);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dji::{Bus, Config, M3508};
    use crate::runner::Runner;
    use crate::time::{Instant, Tick};
    use core::cell::Cell;
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
            let clock = Cell::new(Instant::from_micros(1_000));
            let mut bus = Bus::new();
            bus.attach(Config::<M3508>::new(1)).unwrap();
            let mut runner = Runner::new(Nb(Full { length }), &clock, bus);
            let mut evicted = 0;
            runner.tick_with(Tick::new(clock.get(), 0.001), |_| evicted += 1);
            let s = runner.statistics();
            assert_eq!((s.sent, s.evicted_unrelated, s.evicted), (1, 1, 0), "{length}");
            assert_eq!(evicted, handed_back, "{length}");
            assert_eq!(s.offered, s.sent + s.refused + s.send_errors());
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
            let clock = Cell::new(Instant::from_micros(10_000_000));
            let mut bus = Bus::new();
            let wheel = bus.attach(Config::<M3508>::at_once(1)).unwrap();
            _ = bus.ingest_raw(0x201, &[0; 8], clock.get());
            bus.arm(clock.get()).unwrap();
            bus.update(Tick::new(clock.get(), 0.001));
            clock.set(clock.get() + crate::time::Duration::from_millis(1));
            let mut lengths = std::vec![8; 18];
            lengths[17 - place] = 12;
            let mut runner = Runner::new(Nb(Lengths(lengths)), &clock, bus);
            assert_eq!(runner.poll(64), 18);
            let s = runner.statistics();
            assert_eq!((s.received, s.taken, s.unrelated), (18, 17, 1), "{place}");
            runner.tick(Tick::new(clock.get(), 0.001));
            let bus = runner.device();
            assert!(bus.is_motor_armed(wheel), "{place}");
            assert_eq!(bus.link(wheel), Some(crate::motor::Link::Online), "{place}");
        }
    }
}
