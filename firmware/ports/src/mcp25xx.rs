use drivetrain::runner::AbortPending;
use embedded_can::{ErrorKind, nb::Can};
use embedded_hal::spi::SpiDevice;
use mcp25xx::{CanFrame, MCP25xx, TxBuffer};

/// TXREQ in the control register of a transmit buffer, and these registers.
const REQUEST: u8 = 1 << 3;
const CONTROL: [u8; 3] = [0x30, 0x40, 0x50];
const BUFFERS: [TxBuffer; 3] = [TxBuffer::TXB0, TxBuffer::TXB1, TxBuffer::TXB2];
const BIT_MODIFY: u8 = 0x05;

/// The driver of the crate `mcp25xx`, with the frame that each transmit buffer was given. Without the abort, the driver itself
/// fits: `Nb(driver)`.
pub struct Mcp25xx<SPI: SpiDevice> {
    can: MCP25xx<SPI>,
    given: [Option<CanFrame>; 3],
}

impl<SPI: SpiDevice> Mcp25xx<SPI> {
    /// Takes a driver that is set up.
    pub const fn new(can: MCP25xx<SPI>) -> Self {
        Self { can, given: [None, None, None] }
    }

    fn waits(&mut self) -> Result<[bool; 3], ErrorKind> {
        let status = self.can.read_status().map_err(|_| ErrorKind::Other)?;
        Ok([status.txreq0(), status.txreq1(), status.txreq2()])
    }
}

impl<SPI: SpiDevice> Can for Mcp25xx<SPI> {
    type Frame = CanFrame;
    type Error = ErrorKind;

    fn transmit(&mut self, frame: &CanFrame) -> nb::Result<Option<CanFrame>, ErrorKind> {
        let waits = self.waits()?;
        let mut places = BUFFERS.into_iter().zip(&mut self.given).zip(waits);
        let free = places.find(|(_, waits)| !waits);
        let ((buffer, given), _) = free.ok_or(nb::Error::WouldBlock)?;
        let loaded = self.can.load_tx_buffer(buffer, frame);
        loaded.and_then(|()| self.can.request_to_send(buffer)).map_err(|_| ErrorKind::Other)?;
        *given = Some(frame.clone());
        Ok(None)
    }

    fn receive(&mut self) -> nb::Result<CanFrame, ErrorKind> {
        self.can.receive().map_err(|error| error.map(|_| ErrorKind::Other))
    }
}

impl<SPI: SpiDevice> AbortPending for Mcp25xx<SPI> {
    fn abort_pending(&mut self, mut back: impl FnMut(CanFrame)) {
        let Ok(waits) = self.waits() else { return };
        for ((control, given), waits) in CONTROL.into_iter().zip(&mut self.given).zip(waits) {
            let frame = given.take().filter(|_| waits);
            let Some(frame) = frame else { continue };
            // One that is on the wire is sent nevertheless.
            if self.can.spi.write(&[BIT_MODIFY, control, REQUEST, 0]).is_ok() {
                back(frame);
            }
        }
    }
}
