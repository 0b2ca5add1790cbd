//! A driver whose received frames arrive late.

use drivetrain::sim::{Controller, SimError, Simulation};
use drivetrain::time::{Duration, Instant};
use embedded_can::nb::Can;
use std::cell::Cell;
use std::collections::VecDeque;
use std::rc::Rc;

type Frame = <Controller<'static> as Can>::Frame;

/// Holds each received frame for a while, as a slow interrupt, a queue or a gateway does; frames that are sent pass at once.
///
/// Errors of the driver pass at once too.
pub(crate) struct Delayed {
    inner: Controller<'static>,
    world: &'static Simulation,
    delay: Rc<Cell<Duration>>,
    waiting: VecDeque<(Instant, Frame)>,
}

impl Delayed {
    pub(crate) fn new(
        inner: Controller<'static>,
        world: &'static Simulation,
        delay: Rc<Cell<Duration>>,
    ) -> Self {
        Self { inner, world, delay, waiting: VecDeque::new() }
    }
}

impl Can for Delayed {
    type Frame = Frame;
    type Error = SimError;

    fn transmit(&mut self, frame: &Frame) -> nb::Result<Option<Frame>, SimError> {
        self.inner.transmit(frame)
    }

    fn receive(&mut self) -> nb::Result<Frame, SimError> {
        let now = self.world.now();
        loop {
            match self.inner.receive() {
                Ok(frame) => self.waiting.push_back((now, frame)),
                Err(nb::Error::WouldBlock) => break,
                Err(error) => return Err(error),
            }
        }
        match self.waiting.front() {
            Some((arrived, _)) if now.since(*arrived) >= self.delay.get() => {
                self.waiting.pop_front().map(|(_, frame)| frame).ok_or(nb::Error::WouldBlock)
            }
            _ => Err(nb::Error::WouldBlock),
        }
    }
}
