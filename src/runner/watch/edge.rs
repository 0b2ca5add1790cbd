//! Conditions of the bus as a whole, the latch that keeps each edge until read, and the record of a command frame refused or given
//! back by the driver.

use crate::frame::{CanFrame, Pattern};
use crate::motor::{CanDevice, Claim, Devices, Visitor, take_age};
use crate::time::{Duration, Edge, Instant};
use core::num::NonZeroU32;

/// A fault of the bus as a whole, for a moment or for hours.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum BusCondition {
    /// Some command frame was not sent for 100 ms, refused or given back by the driver: everything was disarmed. Ends when all are
    /// sent.
    Down,
    /// After the first feedback, no motor sent feedback for 100 ms. Ends with the next feedback.
    Silent,
    /// Received frames were lost because a buffer was full: the driver's, or a queue. Ends after 1 s without.
    ReceiveOverrun,
    /// A tick came so late that periods were left out. Ends after 1 s without a late tick.
    TickOverrun,
    /// The clock shows the same time again and again. Ends after 1 s in which the clock runs.
    ClockStandstill,
    /// The clock went back. Ends after 1 s without going back.
    ClockReversal,
}

impl BusCondition {
    /// All of them.
    pub const ALL: [Self; 6] = [
        Self::Down,
        Self::Silent,
        Self::ReceiveOverrun,
        Self::TickOverrun,
        Self::ClockStandstill,
        Self::ClockReversal,
    ];

    /// Returns whether the condition consists of repeated incidents, and so ends after a while without an incident.
    const fn is_repeated(self) -> bool {
        !matches!(self, Self::Down | Self::Silent)
    }
}

impl core::fmt::Display for BusCondition {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Self::Down => "bus down",
            Self::Silent => "bus silent",
            Self::ReceiveOverrun => "receive overrun",
            Self::TickOverrun => "tick overrun",
            Self::ClockStandstill => "clock standstill",
            Self::ClockReversal => "clock reversal",
        })
    }
}

/// Beginning or end of a [`BusCondition`], for [`Runner::next_edge`](crate::runner::Runner::next_edge).
pub(super) type BusEdge = Edge<BusCondition>;

/// Time without an incident after which a repeated condition ends.
const CALM: Duration = Duration::from_secs(1);

/// The present conditions, and the edges not read yet.
#[derive(Debug)]
pub(in crate::runner) struct Edges {
    latches: [Latch; BusCondition::ALL.len()],
    /// No condition is there.
    pub(super) is_calm: bool,
}

#[derive(Debug, Clone, Copy)]
struct Latch {
    began: Instant,
    ended: Instant,
    /// A stamp: it is looked at in each tick.
    seen: u32,
    begin_waits: bool,
    end_waits: bool,
    active: bool,
}

impl Edges {
    pub(super) const fn new() -> Self {
        let calm = Latch {
            began: Instant::START,
            ended: Instant::START,
            seen: 0,
            begin_waits: false,
            end_waits: false,
            active: false,
        };
        Self { latches: [calm; BusCondition::ALL.len()], is_calm: true }
    }

    pub(super) const fn is_active(&self, condition: BusCondition) -> bool {
        let [down, silent, receive, tick, standstill, reversal] = &self.latches;
        match condition {
            BusCondition::Down => down.active,
            BusCondition::Silent => silent.active,
            BusCondition::ReceiveOverrun => receive.active,
            BusCondition::TickOverrun => tick.active,
            BusCondition::ClockStandstill => standstill.active,
            BusCondition::ClockReversal => reversal.active,
        }
    }

    /// Begins a condition; returns whether the condition was absent before.
    pub(in crate::runner) fn begin(&mut self, condition: BusCondition, at: Instant) -> bool {
        self.is_calm = false;
        self.latches.get_mut(condition as usize).is_some_and(|latch| latch.begin(at))
    }

    pub(super) fn end(&mut self, condition: BusCondition, at: Instant) {
        if let Some(latch) = self.latches.get_mut(condition as usize) {
            latch.end(at);
        }
    }

    /// Ends the repeated conditions without a recent incident. Has to be called in each tick, unless all is calm.
    pub(super) fn end_calm(&mut self, now: Instant) {
        for (condition, latch) in BusCondition::ALL.into_iter().zip(&mut self.latches) {
            // The clock may have gone back.
            let calm = take_age(now, &mut latch.seen);
            if condition.is_repeated() && calm >= CALM {
                latch.end(now);
            }
        }
        self.is_calm = self.latches.iter().all(|latch| !latch.active);
    }

    /// Takes the oldest edge.
    pub(super) fn next(&mut self) -> Option<BusEdge> {
        let waiting = BusCondition::ALL
            .into_iter()
            .zip(&mut self.latches)
            .filter_map(|(condition, latch)| Some((latch.waiting(condition)?, latch)));
        let (edge, latch) = waiting.min_by_key(|(edge, _)| edge.at)?;
        latch.take(edge);
        Some(edge)
    }
}

impl Latch {
    fn begin(&mut self, at: Instant) -> bool {
        self.seen = at.stamp();
        if self.active {
            return false;
        }
        self.active = true;
        if self.begin_waits {
            // The condition ended and began again, and neither edge was read.
            self.end_waits = false;
        } else {
            self.began = at;
            self.begin_waits = true;
        }
        true
    }

    const fn end(&mut self, at: Instant) {
        if self.active {
            self.active = false;
            self.end_waits = true;
            self.ended = at;
        }
    }

    /// Returns the edge to be read next.
    const fn waiting(&self, condition: BusCondition) -> Option<BusEdge> {
        // While the condition is present, a pending end belongs to the time before.
        if self.end_waits && (self.active || !self.begin_waits) {
            Some(Edge { source: (), condition, began: false, at: self.ended })
        } else if self.begin_waits {
            Some(Edge { source: (), condition, began: true, at: self.began })
        } else {
            None
        }
    }

    const fn take(&mut self, edge: BusEdge) {
        if edge.began {
            self.begin_waits = false;
        } else {
            self.end_waits = false;
        }
    }
}

/// How many frames can wait at a time and be watched each: the five of a DJI bus, and own ones.
pub(super) const WATCHED_FRAMES: usize = 8;

/// Bits of an id of 29 that may carry a value: in them, a RobStride has its torque.
const VALUES: u32 = 0x00FF_FF00;

/// The frames of one command: their headers agree in the bits of the mask.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::runner) struct FrameKey {
    header: u32,
    mask: NonZeroU32,
}

impl FrameKey {
    /// Takes a frame of a device. The bits of values are those that the claim of the command leaves out.
    #[cold]
    #[inline(never)]
    pub(in crate::runner) fn of(device: &mut impl Devices, frame: &CanFrame) -> Self {
        let mut key = Self { header: frame.header(), mask: NonZeroU32::MAX };
        if frame.has_extended_id() {
            device.visit(&mut key);
        }
        key
    }

    pub(in crate::runner) const fn fits(self, header: u32) -> bool {
        header & self.mask.get() == self.header
    }
}

impl Visitor for FrameKey {
    fn visit(&mut self, device: &mut impl CanDevice) {
        let fits = |claim: &Claim| {
            let Pattern { header, mask } = claim.pattern();
            !claim.is_feedback() && (self.header ^ header) & mask == 0
        };
        if let Some(claim) = device.claims().find(fits) {
            let mask = claim.pattern().mask | !VALUES;
            self.header &= mask;
            self.mask = NonZeroU32::new(mask).unwrap_or(NonZeroU32::MAX);
        }
    }
}

/// A command frame not taken by the driver. Times are stamps, compared in each tick.
#[derive(Debug, Clone, Copy)]
pub(super) struct Unsent {
    pub(super) key: FrameKey,
    pub(super) since: u32,
    /// The last tick in which the frame was offered, or taken by the driver.
    pub(super) offered: u32,
    /// The driver took the frame, and the frame may come back.
    pub(super) is_accepted: bool,
    /// Whether the frame was called back after a whole tick: then the frame was not sent, although the driver takes it.
    pub(super) returns: bool,
    pub(super) tries: u8,
    /// Ticks since the frame was offered.
    pub(super) idle: u8,
}

impl Unsent {
    /// Tells whether the driver took the frame in an earlier tick, and the frame did not come back.
    pub(super) const fn stays_sent(&self, now: Instant) -> bool {
        self.is_accepted && self.offered != now.stamp()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::vec::Vec;

    const DOWN: BusCondition = BusCondition::Down;
    const OVERRUN: BusCondition = BusCondition::TickOverrun;

    fn at_ms(ms: u64) -> Instant {
        Instant::from_micros(1_000 * ms)
    }

    fn drained(edges: &mut Edges) -> Vec<(BusCondition, u64, bool)> {
        core::iter::from_fn(|| edges.next())
            .map(|edge| (edge.condition, edge.at.as_micros() / 1_000, edge.began))
            .collect()
    }

    #[test]
    fn a_condition_that_lasts_is_one_edge_and_its_end_another() {
        let mut edges = Edges::new();
        assert!((10..500).filter(|ms| edges.begin(DOWN, at_ms(*ms))).eq([10]));
        assert_eq!(drained(&mut edges), [(DOWN, 10, true)]);
        edges.begin(DOWN, at_ms(600));
        assert!(edges.is_active(DOWN) && edges.next().is_none());
        edges.end(DOWN, at_ms(700));
        edges.end(DOWN, at_ms(701));
        assert_eq!(drained(&mut edges), [(DOWN, 700, false)]);
    }

    #[test]
    fn an_unread_condition_that_came_and_went_keeps_its_first_beginning_and_its_last_end() {
        let mut edges = Edges::new();
        for round in 0..3 {
            edges.begin(DOWN, at_ms(100 * round));
            edges.end(DOWN, at_ms(100 * round + 50));
        }
        assert_eq!(drained(&mut edges), [(DOWN, 0, true), (DOWN, 250, false)]);
        edges.begin(DOWN, at_ms(300));
        assert_eq!(drained(&mut edges), [(DOWN, 300, true)]);
        edges.end(DOWN, at_ms(350));
        edges.begin(DOWN, at_ms(400));
        assert_eq!(drained(&mut edges), [(DOWN, 350, false), (DOWN, 400, true)]);
    }

    #[test]
    fn a_repeated_condition_ends_after_a_second_without_an_incident() {
        let mut edges = Edges::new();
        for ms in (0..5_000).step_by(900) {
            edges.begin(OVERRUN, at_ms(ms));
            edges.end_calm(at_ms(ms + 899));
        }
        assert_eq!(drained(&mut edges), [(OVERRUN, 0, true)]);
        edges.end_calm(at_ms(5_499));
        assert!(edges.is_active(OVERRUN));
        edges.end_calm(at_ms(5_500));
        assert_eq!(drained(&mut edges), [(OVERRUN, 5_500, false)]);
    }

    #[test]
    fn a_clock_that_went_back_keeps_nothing_alive() {
        let mut edges = Edges::new();
        edges.begin(OVERRUN, at_ms(1_000_000));
        edges.end_calm(at_ms(10));
        edges.end_calm(at_ms(1_010));
        assert!(!edges.is_active(OVERRUN));
    }

    proptest! {
        /// Law: the edge read last tells the present state, and an end follows a beginning.
        #[test]
        fn the_last_edge_tells_the_state(steps in prop::collection::vec(0..4_u8, 0..200)) {
            let mut edges = Edges::new();
            let mut known = false;
            for (step, ms) in steps.into_iter().zip(0..) {
                match step {
                    0 => _ = edges.begin(DOWN, at_ms(ms)),
                    1 => edges.end(DOWN, at_ms(ms)),
                    _ => {
                        while let Some(edge) = edges.next() {
                            prop_assert!(edge.began || known, "an end after an end");
                            known = edge.began;
                        }
                        prop_assert_eq!(known, edges.is_active(DOWN));
                    }
                }
            }
        }
    }
}
