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
            Ok(Some(evicted)) => CanFrame::copy_of(&evicted).map_or(Sent::Accepted, Sent::Evicted),
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
