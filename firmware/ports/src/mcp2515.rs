use drivetrain::runner::AbortPending;
use embedded_can::{ErrorKind, nb::Can};
use embedded_hal::spi::SpiDevice;
use mcp2515::buffer::TxBuf;
use mcp2515::error::Error;
use mcp2515::frame::CanFrame;
use mcp2515::regs::TxbCtrl;

/// The driver of the crate `mcp2515`, with the frame that each transmit buffer was given.
///
/// The driver implements the blocking trait of embedded-can, but returns an error instead of waiting: as a polled driver, that
/// error is "not now".
pub struct Mcp2515<SPI: SpiDevice> {
    can: mcp2515::MCP2515<SPI>,
    given: [Option<CanFrame>; 3],
}

impl<SPI: SpiDevice> Mcp2515<SPI> {
    /// Takes a driver that is set up.
    pub const fn new(can: mcp2515::MCP2515<SPI>) -> Self {
        Self { can, given: [None; 3] }
    }
}

fn polled<E: core::fmt::Debug>(error: Error<E>) -> nb::Error<ErrorKind> {
    match error {
        Error::TxBusy | Error::NoMessage => nb::Error::WouldBlock,
        _ => nb::Error::Other(ErrorKind::Other),
    }
}

impl<SPI: SpiDevice> Can for Mcp2515<SPI> {
    type Frame = CanFrame;
    type Error = ErrorKind;

    fn transmit(&mut self, frame: &CanFrame) -> nb::Result<Option<CanFrame>, ErrorKind> {
        let buffer = self.can.find_free_tx_buf().map_err(polled)?;
        // The flags in the buffer's register are those of the frame before it as well: what counts is that it waits.
        match self.can.send_message_via_buffer(buffer, *frame) {
            Ok(()) | Err(Error::TxFailed) => {}
            Err(error) => return Err(polled(error)),
        }
        let place = TxBuf::ALL.iter().position(|known| known.ctrl() as u8 == buffer.ctrl() as u8);
        if let Some(place) = place.and_then(|place| self.given.get_mut(place)) {
            *place = Some(*frame);
        }
        Ok(None)
    }

    fn receive(&mut self) -> nb::Result<CanFrame, ErrorKind> {
        self.can.read_message().map_err(polled)
    }
}

impl<SPI: SpiDevice> AbortPending for Mcp2515<SPI> {
    fn abort_pending(&mut self, mut back: impl FnMut(CanFrame)) {
        // Not known: then the frames stay where they are, and the next update offers newer ones.
        let Ok(status) = self.can.read_status() else { return };
        let waits = [status.tx0req(), status.tx1req(), status.tx2req()];
        for ((buffer, given), waits) in TxBuf::ALL.into_iter().zip(&mut self.given).zip(waits) {
            let Some(frame) = given.take().filter(|_| waits) else { continue };
            let request = TxbCtrl::MASK_TXREQ.into_bytes();
            // One that is on the wire is sent nevertheless.
            if self.can.modify_register_addr(&[buffer.ctrl()], &[0], &request).is_ok() {
                back(frame);
            }
        }
    }
}
