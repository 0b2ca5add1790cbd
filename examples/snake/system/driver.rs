//! The CAN driver of the firmware: a queue before the three mailboxes, as a transmit interrupt would feed them.

use drivetrain::frame::CanFrame;
use drivetrain::sim::{Controller, SimError};
use embedded_can::nb::Can;
use std::collections::VecDeque;

/// A stop of all joints and a tick's other frames.
const LONGEST: usize = 24;

pub(crate) struct Queued<'w> {
    can: Controller<'w>,
    waiting: VecDeque<CanFrame>,
}

impl<'w> Queued<'w> {
    pub(crate) fn new(can: Controller<'w>) -> Self {
        Self { can, waiting: VecDeque::with_capacity(LONGEST) }
    }

    /// The transmit interrupt: fills the mailboxes, in order. A frame that had to make way waits again.
    pub(crate) fn pump(&mut self) {
        while let Some(frame) = self.waiting.pop_front() {
            match self.can.transmit(&frame) {
                Ok(None) => {}
                Ok(Some(evicted)) => self.waiting.push_front(evicted),
                Err(_) => {
                    self.waiting.push_front(frame);
                    return;
                }
            }
        }
    }
}

impl Can for Queued<'_> {
    type Frame = CanFrame;
    type Error = SimError;

    fn transmit(&mut self, frame: &CanFrame) -> nb::Result<Option<CanFrame>, SimError> {
        if self.waiting.len() >= LONGEST {
            return Err(nb::Error::WouldBlock);
        }
        self.waiting.push_back(*frame);
        self.pump();
        Ok(None)
    }

    fn receive(&mut self) -> nb::Result<CanFrame, SimError> {
        self.can.receive()
    }
}
