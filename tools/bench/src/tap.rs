//! The link as the runner wants a driver; on its way each frame is counted, recorded, and kept in the ledger.

use crate::ledger::Ledger;
use crate::link::{Heard, Link, Taken};
use crate::record::Recorder;
use crate::text;
use crate::time::Time;
use crate::traffic::Traffic;
use drivetrain::frame::CanFrame;
use embedded_can::ErrorKind;

/// Why a link failed.
#[derive(Debug, Clone, Copy)]
pub(crate) struct LinkError(ErrorKind);

impl embedded_can::Error for LinkError {
    fn kind(&self) -> ErrorKind {
        self.0
    }
}

/// The link of a session, and the observers of its frames.
#[derive(Debug)]
pub(crate) struct Tap {
    pub(crate) link: Link,
    pub(crate) ledger: Ledger,
    pub(crate) traffic: Traffic,
    pub(crate) recorders: Vec<Recorder>,
    pub(crate) time: Time,
    /// The motors are armed: sent frames may drive them.
    pub(crate) is_driving: bool,
    /// Frames that the interface said were on the bus.
    pub(crate) confirmed: u64,
}

impl Tap {
    fn record(&mut self, text: &str, is_ours: bool) {
        let at = self.time.read();
        for recorder in &mut self.recorders {
            recorder.frame(at, self.link.name(), text, is_ours);
        }
    }
}

impl embedded_can::nb::Can for Tap {
    type Frame = CanFrame;
    type Error = LinkError;

    fn transmit(&mut self, frame: &CanFrame) -> nb::Result<Option<CanFrame>, LinkError> {
        match self.link.send(frame) {
            Taken::Yes => {
                self.ledger.taken(frame, self.is_driving);
                self.traffic.note(frame, self.time.read(), true);
                self.record(&text::of(frame), true);
                Ok(None)
            }
            Taken::Full => Err(nb::Error::WouldBlock),
            Taken::Failed(kind) => Err(nb::Error::Other(LinkError(kind))),
        }
    }

    fn receive(&mut self) -> nb::Result<CanFrame, LinkError> {
        loop {
            match self.link.receive() {
                None => return Err(nb::Error::WouldBlock),
                Some(Heard::Own(frame)) => {
                    self.ledger.seen(&frame);
                    self.confirmed += 1;
                }
                Some(Heard::Frame(frame)) => {
                    self.traffic.note(&frame, self.time.read(), false);
                    self.record(&text::of(&frame), false);
                    // The commands in a recording are those of a program like this one, and no second master.
                    if self.link.sends() || !self.traffic.is_command(&frame) {
                        return Ok(frame);
                    }
                }
                Some(Heard::Error(class, data, kind)) => {
                    self.record(&text::of_parts(class, 8, &data), false);
                    return Err(nb::Error::Other(LinkError(kind)));
                }
                Some(Heard::Foreign(text)) => self.record(&text, false),
                Some(Heard::Failed(kind)) => return Err(nb::Error::Other(LinkError(kind))),
            }
        }
    }
}
