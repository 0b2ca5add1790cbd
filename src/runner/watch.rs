//! Whether the loop runs: heard, sent, on time, with a clock that goes on.

use super::edge::Edges;
use super::{BusCondition, BusEdge};
use crate::time::{Duration, Instant};

/// Without feedback for this long, or with a command frame that waits for this long, something is wrong with the bus.
const BUS_LOST_AFTER: Duration = Duration::from_millis(100);

/// A clock that shows the same time in so many readings stands: between a tenth of a second and some seconds of a
/// loop that does nothing else.
const READINGS_OF_A_STANDSTILL: u32 = 1_000_000;

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
    tries: u8,
}

#[derive(Debug)]
pub(super) struct Watch {
    pub(super) edges: Edges,
    pub(super) heartbeat: u32,
    pub(super) standstills: u32,
    pub(super) reversals: u32,
    received: bool,
    heard: bool,
    heard_at: Option<Instant>,
    reading: Instant,
    repeated: u32,
    ticked: Option<Instant>,
    unsent: [Option<Unsent>; WATCHED_FRAMES],
}

impl Watch {
    pub(super) const fn new() -> Self {
        Self {
            edges: Edges::new(),
            heartbeat: 0,
            standstills: 0,
            reversals: 0,
            received: false,
            heard: false,
            heard_at: None,
            reading: Instant::START,
            repeated: 0,
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
        if now == self.reading {
            self.repeated += 1;
            if self.repeated >= READINGS_OF_A_STANDSTILL {
                self.repeated = 0;
                self.stand(now);
            }
            return;
        }
        self.repeated = 0;
        if now < self.reading {
            self.go_back(now);
        }
        self.reading = now;
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

    /// Notes a frame that the driver took.
    pub(super) fn sent(&mut self, header: u32) {
        let taken = |unsent: &Option<Unsent>| unsent.is_some_and(|it| it.header == header);
        self.unsent.iter_mut().filter(|unsent| taken(unsent)).for_each(|unsent| *unsent = None);
    }

    /// Notes a frame that the driver did not take, or gave back; returns how often in a row.
    pub(super) fn unsent(&mut self, header: u32, now: Instant) -> u8 {
        let known = self.unsent.iter_mut().flatten().find(|unsent| unsent.header == header);
        if let Some(unsent) = known {
            unsent.offered = now;
            unsent.tries = unsent.tries.saturating_add(1);
            return unsent.tries;
        }
        if let Some(place) = self.unsent.iter_mut().find(|unsent| unsent.is_none()) {
            *place = Some(Unsent { header, since: now, offered: now, tries: 1 });
        }
        1
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
            if now.since(unsent.offered) >= FORGOTTEN_AFTER {
                *place = None;
            } else {
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
