//! What the data path meets seldom, out of its line: the usual case then needs few registers and no copies.

use super::Feedback;
use super::bus::{Bus, FIRST_FEEDBACK_ID};
use super::slot::Slot;
use crate::frame::CanFrame;
use crate::motor::{Ingest, Malformed};
use crate::time::Instant;

impl<B> Bus<B> {
    /// Takes any frame: also the first one of a motor, one after a gap, and what is no feedback at all.
    #[cold]
    #[inline(never)]
    pub(super) fn ingest_unusual(&mut self, frame: &CanFrame, now: Instant) -> Ingest {
        let index = frame.header().wrapping_sub(FIRST_FEEDBACK_ID) as usize;
        let Some(slot) = self.slots.get_mut(index) else { return Ingest::Unrelated };
        let Some(facts) = slot.facts() else {
            self.rejects.unattached = self.rejects.unattached.saturating_add(1);
            return Ingest::Unrelated;
        };
        if frame.length() != 8 {
            self.rejects.bad_length = self.rejects.bad_length.saturating_add(1);
            return Ingest::Malformed(Malformed::Length(frame.length()));
        }
        let Ok(feedback) = Feedback::decode(frame.bytes()) else {
            self.rejects.bad_field = self.rejects.bad_field.saturating_add(1);
            return Ingest::Malformed(Malformed::Field);
        };
        slot.receive_after_gap(facts, feedback, now.stamp(), &self.timeouts);
        Ingest::Taken
    }

    /// Ends an update whose time is not usable: the last commands stay once, then zeros.
    #[cold]
    #[inline(never)]
    pub(super) fn hold(&mut self, lost_after_before: Instant) {
        self.rejects.bad_steps = self.rejects.bad_steps.saturating_add(1);
        self.held_steps = self.held_steps.saturating_add(1);
        let late = self.lost_after.since(lost_after_before) > self.timeouts.late();
        if self.held_steps >= 2 || late {
            self.outbox.clear();
        }
        self.outbox.finish_update(self.now);
    }

    /// Takes every motor for lost, after a pause too long for stamps of 32 bits. The first update ends no pause.
    #[cold]
    #[inline(never)]
    pub(super) fn lose_all(&mut self, lost_after_before: Instant) {
        if lost_after_before != Instant::START {
            self.slots.iter_mut().for_each(Slot::lose);
        }
    }
}
