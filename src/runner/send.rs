//! Frames of one tick, from the device to the driver.

use super::statistics::increment;
use super::{Port, Runner, Sent};
use crate::frame::CanFrame;
use crate::motor::Devices;
use crate::time::Instant;

/// A bound on the frames of one tick, for devices that would offer frames for ever.
const FRAMES_A_TICK: usize = 64;

/// A frame that fails so often in a row takes another turn: not before, because a driver whose errors alternate with
/// successes would fail it there as well.
const PATIENCE: u8 = 3;

impl<P: Port, K, D: Devices> Runner<P, K, D> {
    /// Offers the frames of one tick to the driver; hands frames of others that it evicts to `evicted`.
    ///
    /// A frame for which there is no place goes first in the next tick. One that fails again and again takes another
    /// turn: the last if it was the first, the first otherwise. So a driver that fails one call in each tick, always the
    /// first or always the last, keeps no frame from the bus.
    pub(super) fn send(&mut self, now: Instant, evicted: &mut impl FnMut(&CanFrame)) {
        let yields = self.yields.take();
        let (mut held, mut goes_first, mut refused) = (None, None, None);
        let mut is_first = true;
        for _ in 0..FRAMES_A_TICK {
            let frame = match self.device.next_frame(self.turn) {
                Some(frame) if yields == Some(frame.header()) && held.is_none() => {
                    held = Some(frame);
                    continue;
                }
                Some(frame) => frame,
                None => match held.take() {
                    Some(frame) => frame,
                    None => break,
                },
            };
            increment(&mut self.statistics.offered);
            match self.port.try_send(&frame) {
                Sent::Accepted => {
                    self.count_sent(&frame);
                    self.watch.accepted(frame.header(), now);
                }
                Sent::Evicted(other) => {
                    self.count_sent(&frame);
                    if self.device.requeue(&other) {
                        increment(&mut self.statistics.evicted);
                        self.meter.discount(&other);
                        // Before the frame that took its place: they may be of one id.
                        self.watch.evicted(other.header(), now);
                    } else {
                        increment(&mut self.statistics.evicted_unrelated);
                        evicted(&other);
                    }
                    if other.header() != frame.header() {
                        self.watch.accepted(frame.header(), now);
                    }
                }
                Sent::EvictedForeign => {
                    self.count_sent(&frame);
                    increment(&mut self.statistics.evicted_unrelated);
                    self.watch.accepted(frame.header(), now);
                }
                Sent::Full => {
                    increment(&mut self.statistics.refused);
                    self.watch.refused(frame.header(), now);
                    refused = Some(frame);
                    break;
                }
                Sent::Failed(kind) => {
                    self.statistics.send_errors.count(kind);
                    let tries = self.watch.refused(frame.header(), now);
                    if tries >= PATIENCE && !is_first && goes_first.is_none() {
                        goes_first = Some(frame);
                    } else {
                        self.device.requeue(&frame);
                        if tries >= PATIENCE && is_first {
                            self.yields = Some(frame.header());
                        }
                    }
                }
            }
            is_first = false;
        }
        // What is given back last goes first.
        for frame in [held, goes_first, refused].into_iter().flatten() {
            self.device.requeue(&frame);
        }
    }

    fn count_sent(&mut self, frame: &CanFrame) {
        increment(&mut self.statistics.sent);
        self.meter.count(frame);
    }
}
