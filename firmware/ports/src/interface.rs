use embedded_can::{ErrorKind, Frame, nb::Can};
use embedded_can_interface::{RxFrameIo, TxFrameIo};

/// Any driver with the traits of `embedded-can-interface`, and how its error says that it would have to wait: the traits leave
/// that to the driver.
#[derive(Debug)]
pub struct Interface<T, E> {
    /// The driver.
    pub io: T,
    /// Tells whether an error means "not now".
    pub is_not_now: fn(&E) -> bool,
}

impl<T, E> Interface<T, E> {
    fn error(&self, error: &E) -> nb::Error<ErrorKind> {
        match (self.is_not_now)(error) {
            true => nb::Error::WouldBlock,
            false => nb::Error::Other(ErrorKind::Other),
        }
    }
}

impl<F: Frame, E, T> Can for Interface<T, E>
where
    T: TxFrameIo<Frame = F, Error = E> + RxFrameIo<Frame = F, Error = E>,
{
    type Frame = F;
    type Error = ErrorKind;

    fn transmit(&mut self, frame: &F) -> nb::Result<Option<F>, ErrorKind> {
        let sent = self.io.try_send(frame);
        sent.map(|()| None).map_err(|error| self.error(&error))
    }

    fn receive(&mut self) -> nb::Result<F, ErrorKind> {
        let received = self.io.try_recv();
        received.map_err(|error| self.error(&error))
    }
}
