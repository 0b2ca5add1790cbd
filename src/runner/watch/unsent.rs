//! Command frames refused or given back by the driver: the time that each has waited.

use super::{BUS_LOST_AFTER, Watch};
use crate::motor::take_age;
use crate::runner::BusCondition;
use crate::time::{Duration, Instant};

/// A frame that the device no longer offers is forgotten: after this time, or after this number of ticks, in which each of many
/// devices has its turn. A frame sent seldom, such as the limits of a drive, may be refused once.
const FORGOTTEN_AFTER: (Duration, u8) = (Duration::from_secs(1), 32);

/// How many frames can wait at a time and be watched each: the five of a DJI bus, and own ones.
pub(super) const WATCHED_FRAMES: usize = 8;

/// A command frame not taken by the driver. Times are stamps, compared in each tick.
#[derive(Debug, Clone, Copy)]
pub(super) struct Unsent {
    header: u32,
    since: u32,
    offered: u32,
    /// The tick in which the driver took the frame.
    accepted: u32,
    /// The driver took the frame, and the frame may come back.
    is_accepted: bool,
    /// Whether the frame was called back after a whole tick: then the frame was not sent, although the driver takes it.
    returns: bool,
    tries: u8,
    /// Ticks since the frame was offered.
    idle: u8,
}

impl Unsent {
    /// Tells whether the driver took it in an earlier tick, and it did not come back.
    const fn stays_sent(&self, now: Instant) -> bool {
        self.is_accepted && self.accepted != now.stamp()
    }
}

impl Watch {
    pub(super) fn accept_unsent(&mut self, header: u32, now: Instant) {
        for place in &mut self.unsent {
            let Some(unsent) = place.as_mut().filter(|unsent| unsent.header == header) else {
                continue;
            };
            if unsent.stays_sent(now) {
                *place = None;
            } else {
                (unsent.accepted, unsent.is_accepted) = (now.stamp(), true);
                (unsent.offered, unsent.tries, unsent.idle) = (now.stamp(), 0, 0);
            }
        }
    }

    /// Notes a frame not taken by the driver; returns the number of refusals in a row.
    pub(in crate::runner) fn refused(&mut self, header: u32, now: Instant) -> u8 {
        let Some(unsent) = self.unsent.iter_mut().flatten().find(|it| it.header == header) else {
            self.begin(header, now);
            return 1;
        };
        if core::mem::take(&mut unsent.is_accepted) {
            // The frame of an earlier tick was taken and stayed.
            (unsent.since, unsent.returns) = (now.stamp(), false);
        }
        (unsent.offered, unsent.idle) = (now.stamp(), 0);
        unsent.tries = unsent.tries.saturating_add(1);
        unsent.tries
    }

    /// Notes a frame that the driver had taken and gave back.
    pub(in crate::runner) fn evicted(&mut self, header: u32, now: Instant) {
        match self.unsent.iter_mut().flatten().find(|it| it.header == header) {
            Some(unsent) => {
                (unsent.is_accepted, unsent.offered, unsent.idle) = (false, now.stamp(), 0);
            }
            None => self.begin(header, now),
        }
    }

    /// Notes a frame called back after a whole tick in the controller.
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
                since: now.stamp(),
                offered: now.stamp(),
                accepted: 0,
                is_accepted: false,
                returns: false,
                tries: 1,
                idle: 0,
            });
            self.has_unsent = true;
        }
    }

    pub(super) fn watch_sending(&mut self, now: Instant) -> bool {
        let mut lost = false;
        for place in &mut self.unsent {
            let Some(unsent) = place else { continue };
            let waits = take_age(now, &mut unsent.since);
            let is_forgotten = take_age(now, &mut unsent.offered) >= FORGOTTEN_AFTER.0
                || unsent.idle >= FORGOTTEN_AFTER.1;
            unsent.idle = unsent.idle.saturating_add(1);
            if unsent.stays_sent(now) || is_forgotten {
                *place = None;
            } else if !unsent.is_accepted || unsent.returns {
                lost |= waits >= BUS_LOST_AFTER;
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

#[cfg(test)]
mod tests {
    use super::*;

    /// A drive's limits, each 101 ms, refused each time: the frames of the other devices pass.
    #[test]
    fn a_frame_that_is_sent_seldom_and_refused_each_time_is_no_lost_bus() {
        let mut watch = Watch::new();
        for ms in 1..1_000 {
            let now = Instant::from_micros(1_000 * ms);
            if ms % 101 == 1 {
                watch.refused(0x0C5, now);
            }
            assert!(!watch.finish(now), "{ms} ms");
        }
    }

    /// Thirty devices take turns, and the driver takes no frame: each frame is offered in each thirtieth tick.
    #[test]
    fn turns_of_many_devices_do_not_hide_a_lost_bus() {
        let mut watch = Watch::new();
        let lost = (1..300_u32).find(|ms| {
            let now = Instant::from_micros(1_000 * u64::from(*ms));
            watch.refused(0x100 + ms % 30, now);
            watch.finish(now)
        });
        assert!(lost.is_some_and(|ms| (100..150).contains(&ms)), "{lost:?}");
    }
}
