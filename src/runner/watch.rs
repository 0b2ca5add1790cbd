//! Whether the loop runs: heard, sent, on time, with a clock that goes on.

use super::edge::Edges;
use super::standstill::Standstill;
use super::{BusCondition, BusEdge};
use crate::time::{Duration, Instant};

/// Without feedback for this long, or with a command frame that waits for this long, something is wrong with the bus.
const BUS_LOST_AFTER: Duration = Duration::from_millis(100);

/// A frame that the device does not offer any more is not waited for.
const FORGOTTEN_AFTER: Duration = Duration::from_secs(1);

/// How many frames can wait at a time and be watched each: the five of a DJI bus, and own ones.
const WATCHED_FRAMES: usize = 8;

/// A command frame that the driver has not taken.
#[derive(Debug, Clone, Copy)]
struct Unsent {
    header: u32,
    since: Instant,
    offered: Instant,
    /// The tick in which the driver took it, as long as it may come back.
    accepted: Option<Instant>,
    tries: u8,
}

#[derive(Debug)]
pub(super) struct Watch {
    pub(super) edges: Edges,
    pub(super) standstill: Standstill,
    pub(super) heartbeat: u32,
    pub(super) standstills: u32,
    pub(super) reversals: u32,
    received: bool,
    heard: bool,
    heard_at: Option<Instant>,
    reading: Instant,
    ticked: Option<Instant>,
    unsent: [Option<Unsent>; WATCHED_FRAMES],
}

impl Watch {
    pub(super) const fn new() -> Self {
        Self {
            edges: Edges::new(),
            standstill: Standstill::new(),
            heartbeat: 0,
            standstills: 0,
            reversals: 0,
            received: false,
            heard: false,
            heard_at: None,
            reading: Instant::START,
            ticked: None,
            unsent: [None; WATCHED_FRAMES],
        }
    }

    /// Notes that the program looked for received frames.
    pub(super) const fn receive_ran(&mut self) {
        self.received = true;
    }

    /// Notes feedback of some motor.
    pub(super) const fn hear(&mut self) {
        self.heard = true;
    }

    /// Notes a reading of the clock.
    pub(super) fn read(&mut self, now: Instant) {
        self.standstill.read(now);
        if now < self.reading {
            self.go_back(now);
        }
        self.reading = now;
    }

    /// Returns the time of the last step that was run.
    pub(super) const fn ticked(&self) -> Option<Instant> {
        self.ticked
    }

    fn stand(&mut self, now: Instant) {
        self.standstills = self.standstills.saturating_add(1);
        self.edges.begin(BusCondition::ClockStandstill, now);
    }

    fn go_back(&mut self, now: Instant) {
        self.reversals = self.reversals.saturating_add(1);
        self.edges.begin(BusCondition::ClockReversal, now);
        // Counted once, in the reading or in the tick.
        self.ticked = None;
        self.reading = now;
    }

    /// Notes a frame that the driver took. It counts as sent when it does not come back until the next tick has ended.
    pub(super) fn accepted(&mut self, header: u32, now: Instant) {
        for place in &mut self.unsent {
            let Some(unsent) = place.as_mut().filter(|unsent| unsent.header == header) else {
                continue;
            };
            if unsent.accepted.is_some_and(|before| before != now) {
                *place = None;
            } else {
                (unsent.accepted, unsent.offered, unsent.tries) = (Some(now), now, 0);
            }
        }
    }

    /// Notes a frame that the driver did not take; returns how often in a row.
    pub(super) fn refused(&mut self, header: u32, now: Instant) -> u8 {
        let Some(unsent) = self.unsent.iter_mut().flatten().find(|it| it.header == header) else {
            self.begin(header, now);
            return 1;
        };
        if unsent.accepted.take().is_some() {
            // The frame of an earlier tick was taken and stayed.
            unsent.since = now;
        }
        unsent.offered = now;
        unsent.tries = unsent.tries.saturating_add(1);
        unsent.tries
    }

    /// Notes a frame that the driver had taken and gave back.
    pub(super) fn evicted(&mut self, header: u32, now: Instant) {
        match self.unsent.iter_mut().flatten().find(|it| it.header == header) {
            Some(unsent) => (unsent.accepted, unsent.offered) = (None, now),
            None => self.begin(header, now),
        }
    }

    fn begin(&mut self, header: u32, now: Instant) {
        if let Some(place) = self.unsent.iter_mut().find(|unsent| unsent.is_none()) {
            *place = Some(Unsent { header, since: now, offered: now, accepted: None, tries: 1 });
        }
    }

    /// Ends a tick, after everything was offered to the driver. Returns whether the bus was lost just now.
    pub(super) fn finish(&mut self, now: Instant) -> bool {
        match self.ticked {
            Some(before) if now == before => self.stand(now),
            Some(before) if now < before => self.go_back(now),
            _ if core::mem::take(&mut self.received) => {
                self.heartbeat = self.heartbeat.wrapping_add(1);
            }
            _ => {}
        }
        self.ticked = Some(now);
        self.listen(now);
        self.edges.settle(now);
        self.watch_sending(now)
    }

    fn listen(&mut self, now: Instant) {
        if core::mem::take(&mut self.heard) {
            self.heard_at = Some(now);
            self.edges.end(BusCondition::Silent, now);
        } else if let Some(heard_at) = &mut self.heard_at {
            // The clock may have gone back.
            *heard_at = now.min(*heard_at);
            if now.since(*heard_at) >= BUS_LOST_AFTER {
                self.edges.begin(BusCondition::Silent, now);
            }
        }
    }

    fn watch_sending(&mut self, now: Instant) -> bool {
        let mut lost = false;
        for place in &mut self.unsent {
            let Some(unsent) = place else { continue };
            unsent.since = now.min(unsent.since);
            unsent.offered = now.min(unsent.offered);
            let stays_sent = unsent.accepted.is_some_and(|before| before != now);
            if stays_sent || now.since(unsent.offered) >= FORGOTTEN_AFTER {
                *place = None;
            } else if unsent.accepted.is_none() {
                lost |= now.since(unsent.since) >= BUS_LOST_AFTER;
            }
        }
        if lost {
            return self.edges.begin(BusCondition::Down, now);
        }
        self.edges.end(BusCondition::Down, now);
        false
    }

    pub(super) const fn has(&self, condition: BusCondition) -> bool {
        self.edges.is_active(condition)
    }

    pub(super) fn next_edge(&mut self) -> Option<BusEdge> {
        self.edges.next()
    }
}
