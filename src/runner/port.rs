use crate::frame::CanFrame;
use embedded_can::{Error, ErrorKind};

mod sealed {
    pub trait Sealed {}
}

/// What the runner needs of a CAN driver: implemented by [`Nb`] and [`BlockingTx`].
///
/// Several drivers implement both traits of `embedded-can`, whose methods have the same names, so the choice is a
/// newtype. A driver with neither trait gets `embedded_can::nb::Can` by a newtype of its own.
pub trait Port: sealed::Sealed {
    /// Offers a frame to the driver.
    fn try_send(&mut self, frame: &CanFrame) -> Sent;

    /// Asks the driver for a received frame.
    fn try_receive(&mut self) -> Received;
}

/// What became of a frame that was offered to the driver.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[must_use]
pub enum Sent {
    /// It waits in the controller.
    Accepted,
    /// It waits in the controller, in the place of this frame of lower priority.
    Evicted(CanFrame),
    /// It waits in the controller, in the place of a frame that is no classic CAN frame of at most 8 bytes.
    EvictedForeign,
    /// There is no place now.
    Full,
    /// The driver reports an error; the frame was not taken.
    Failed(ErrorKind),
}

/// What the driver had received.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[must_use]
pub enum Received {
    /// A frame.
    Frame(CanFrame),
    /// A frame that is no classic CAN frame of at most 8 bytes.
    Foreign,
    /// Nothing now.
    Empty,
    /// The driver reports an error.
    Failed(ErrorKind),
}

/// A driver that implements `embedded_can::nb::Can`: never waits.
#[derive(Debug, Clone, Copy)]
pub struct Nb<C>(pub C);

impl<C> sealed::Sealed for Nb<C> {}

impl<C: embedded_can::nb::Can> Port for Nb<C> {
    fn try_send(&mut self, frame: &CanFrame) -> Sent {
        let Some(frame) = frame.convert() else { return Sent::Failed(ErrorKind::Form) };
        match self.0.transmit(&frame) {
            Ok(None) => Sent::Accepted,
            Ok(Some(evicted)) => {
                CanFrame::copy_of(&evicted).map_or(Sent::EvictedForeign, Sent::Evicted)
            }
            Err(nb::Error::WouldBlock) => Sent::Full,
            Err(nb::Error::Other(error)) => Sent::Failed(error.kind()),
        }
    }

    fn try_receive(&mut self) -> Received {
        match self.0.receive() {
            Ok(frame) => CanFrame::copy_of(&frame).map_or(Received::Foreign, Received::Frame),
            Err(nb::Error::WouldBlock) => Received::Empty,
            Err(nb::Error::Other(error)) => Received::Failed(error.kind()),
        }
    }
}

/// A driver that implements `embedded_can::blocking::Can`: sends only.
///
/// Sending waits until the driver has a place: on a bus that stands still, for ever. A blocking receive waits for a
/// frame by contract, so the runner never calls it: feed received frames to
/// [`Runner::ingest`](super::Runner::ingest), from an interrupt through the queue (feature `queue`) for example.
#[derive(Debug, Clone, Copy)]
pub struct BlockingTx<C>(pub C);

impl<C> sealed::Sealed for BlockingTx<C> {}

impl<C: embedded_can::blocking::Can> Port for BlockingTx<C> {
    fn try_send(&mut self, frame: &CanFrame) -> Sent {
        let Some(frame) = frame.convert() else { return Sent::Failed(ErrorKind::Form) };
        match self.0.transmit(&frame) {
            Ok(()) => Sent::Accepted,
            Err(error) => Sent::Failed(error.kind()),
        }
    }

    fn try_receive(&mut self) -> Received {
        Received::Empty
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

    /// Gives back a frame of another program for each one that it takes.
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
    fn an_evicted_frame_of_others_is_counted_also_where_it_is_too_long_to_be_handed_back() {
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
}
