use drivetrain::frame::CanFrame;
use drivetrain::runner::AbortPending;
use embedded_can::{ErrorKind, Frame, Id, nb::Can};
use fdcan::frame::{FrameFormat, TxFrameHeader};
use fdcan::{FdCan, Instance, Mailbox, NormalOperationMode};

/// The mailboxes of the controller.
const MAILBOXES: usize = 3;

/// The driver of the crate `fdcan`, with the frames that it was given since it was last idle.
///
/// The driver does not tell which mailbox a frame went to, so a call back hands over all of these. Frames without data are refused:
/// fdcan 0.2 sends them as remote frames.
pub struct Fdcan<I: Instance> {
    can: FdCan<I, NormalOperationMode>,
    given: [Option<CanFrame>; MAILBOXES],
}

impl<I: Instance> Fdcan<I> {
    /// Takes a driver in normal operation.
    pub const fn new(can: FdCan<I, NormalOperationMode>) -> Self {
        Self { can, given: [None; MAILBOXES] }
    }
}

impl<I: Instance> Can for Fdcan<I> {
    type Frame = CanFrame;
    type Error = ErrorKind;

    fn transmit(&mut self, frame: &CanFrame) -> nb::Result<Option<CanFrame>, ErrorKind> {
        let id = match frame.id() {
            Id::Standard(id) => fdcan::id::StandardId::new(id.as_raw()).map(Into::into),
            Id::Extended(id) => fdcan::id::ExtendedId::new(id.as_raw()).map(Into::into),
        };
        let id = id.filter(|_| !frame.data().is_empty()).ok_or(ErrorKind::Form)?;
        let header = TxFrameHeader {
            len: frame.length(),
            frame_format: FrameFormat::Standard,
            id,
            bit_rate_switching: false,
            marker: None,
        };
        if self.can.is_transmitter_idle() {
            self.given = [None; MAILBOXES];
        }
        // A full driver would replace the frame that is least urgent, and give it back as words: it is not asked to.
        let place = self.given.iter_mut().find(|place| place.is_none());
        let place = place.ok_or(nb::Error::WouldBlock)?;
        match self.can.transmit(header, frame.data()) {
            Ok(_) => *place = Some(*frame),
            Err(_) => return Err(nb::Error::WouldBlock),
        }
        Ok(None)
    }

    fn receive(&mut self) -> nb::Result<CanFrame, ErrorKind> {
        let mut data = [0; 64];
        let Ok(received) = self.can.receive0(&mut data) else { return Err(nb::Error::WouldBlock) };
        let header = received.unwrap();
        let id = match header.id {
            fdcan::id::Id::Standard(id) => embedded_can::StandardId::new(id.as_raw()).map(Id::from),
            fdcan::id::Id::Extended(id) => embedded_can::ExtendedId::new(id.as_raw()).map(Id::from),
        };
        let data = data.get(..usize::from(header.len)).unwrap_or_default();
        let frame = id.filter(|_| !header.rtr).and_then(|id| CanFrame::new(id, data));
        Ok(frame.ok_or(ErrorKind::Form)?)
    }
}

impl<I: Instance> AbortPending for Fdcan<I> {
    fn abort_pending(&mut self, mut back: impl FnMut(CanFrame)) {
        if self.can.is_transmitter_idle() {
            self.given = [None; MAILBOXES];
            return;
        }
        for mailbox in [Mailbox::_0, Mailbox::_1, Mailbox::_2] {
            self.can.abort(mailbox);
        }
        self.given.iter_mut().filter_map(Option::take).for_each(&mut back);
    }
}
