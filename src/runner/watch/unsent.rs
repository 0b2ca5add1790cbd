//! Command frames that the driver refused or gave back: how long each has waited.

use super::{BUS_LOST_AFTER, Watch};
use crate::runner::BusCondition;
use crate::time::{Duration, Instant};

/// A frame that the device does not offer any more is not waited for.
const FORGOTTEN_AFTER: Duration = Duration::from_secs(1);

/// How many frames can wait at a time and be watched each: the five of a DJI bus, and own ones.
pub(super) const WATCHED_FRAMES: usize = 8;

/// A command frame that the driver has not taken.
#[derive(Debug, Clone, Copy)]
pub(super) struct Unsent {
    header: u32,
    since: Instant,
    offered: Instant,
    /// The tick in which the driver took it, as long as it may come back.
    accepted: Option<Instant>,
    /// Whether it was called back after it had waited for a whole tick: then it was not sent, though the driver takes it.
    returns: bool,
    tries: u8,
}

impl Watch {
    pub(super) fn accept_unsent(&mut self, header: u32, now: Instant) {
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
    pub(in crate::runner) fn refused(&mut self, header: u32, now: Instant) -> u8 {
        let Some(unsent) = self.unsent.iter_mut().flatten().find(|it| it.header == header) else {
            self.begin(header, now);
            return 1;
        };
        if unsent.accepted.take().is_some() {
            // The frame of an earlier tick was taken and stayed.
            (unsent.since, unsent.returns) = (now, false);
        }
        unsent.offered = now;
        unsent.tries = unsent.tries.saturating_add(1);
        unsent.tries
    }

    /// Notes a frame that the driver had taken and gave back.
    pub(in crate::runner) fn evicted(&mut self, header: u32, now: Instant) {
        match self.unsent.iter_mut().flatten().find(|it| it.header == header) {
            Some(unsent) => (unsent.accepted, unsent.offered) = (None, now),
            None => self.begin(header, now),
        }
    }

    /// Notes a frame that was called back because it had waited in the controller for a whole tick.
    #[cold]
    pub(in crate::runner) fn called_back(&mut self, header: u32, now: Instant) {
        self.evicted(header, now);
        if let Some(unsent) = self.unsent.iter_mut().flatten().find(|it| it.header == header) {
            unsent.returns = true;
        }
    }

    fn begin(&mut self, header: u32, now: Instant) {
        if let Some(place) = self.unsent.iter_mut().find(|unsent| unsent.is_none()) {
            *place = Some(Unsent {
                header,
                since: now,
                offered: now,
                accepted: None,
                returns: false,
                tries: 1,
            });
            self.has_unsent = true;
        }
    }

    pub(super) fn watch_sending(&mut self, now: Instant) -> bool {
        let mut lost = false;
        for place in &mut self.unsent {
            let Some(unsent) = place else { continue };
            unsent.since = now.min(unsent.since);
            unsent.offered = now.min(unsent.offered);
            let stays_sent = unsent.accepted.is_some_and(|before| before != now);
            if stays_sent || now.since(unsent.offered) >= FORGOTTEN_AFTER {
                *place = None;
            } else if unsent.accepted.is_none() || unsent.returns {
                lost |= now.since(unsent.since) >= BUS_LOST_AFTER;
            }
        }
        self.has_unsent = self.unsent.iter().any(Option::is_some);
        if lost {
            return self.edges.begin(BusCondition::Down, now);
        }
        self.edges.end(BusCondition::Down, now);
        false
    }
}
