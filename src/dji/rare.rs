//! What the data path meets seldom, out of its line: the usual case then needs few registers and no copies.

use super::Feedback;
use super::bus::{Bus, FIRST_FEEDBACK_ID, LONGEST_PAUSE};
use super::slot::{Ages, Slot};
use crate::frame::CanFrame;
use crate::motor::{Ingest, Malformed, Progress};
use crate::time::{Duration, Instant};

impl<B> Bus<B> {
    /// Takes any frame: also the first one of a motor, one after a gap, one with an error, and what is no feedback at all.
    #[cold]
    #[inline(never)]
    pub(super) fn ingest_unusual(&mut self, frame: &CanFrame, now: Instant) -> Ingest {
        let index = frame.header().wrapping_sub(FIRST_FEEDBACK_ID) as usize;
        let Some(slot) = self.slots.get_mut(index) else {
            self.ingest_command(frame, now);
            return Ingest::Unrelated;
        };
        #[expect(clippy::cast_possible_truncation, reason = "below 11")]
        let motor = index as u8;
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
        if !self.running {
            let before = core::mem::replace(&mut self.updated, now);
            self.forget_bygones(before);
        }
        let (timeouts, running) = (self.timeouts, self.running);
        let in_time = self.change(motor, now, |slot| {
            let in_time = slot.receive(feedback, now.stamp());
            if !in_time {
                slot.receive_after_gap(facts, feedback, now.stamp(), &timeouts, running);
            }
            slot.hear_error(facts, feedback.error());
            in_time
        });
        if in_time == Some(false) {
            self.disturb();
        }
        Ingest::Taken
    }

    /// Sees to all that grows old or is due now and then, and finds out until when there is nothing of it; `false` when
    /// the time did not move on.
    #[cold]
    #[inline(never)]
    pub(super) fn look_around(&mut self, before: Instant) -> bool {
        if !self.moves_on(before) {
            return false;
        }
        if self.updated > before + LONGEST_PAUSE {
            self.forget_bygones(before);
        }
        self.running = true;
        self.held_steps = 0;
        let keep_alive_us = self.outbox.keep_alive(self.now);
        let ages = if self.is_disturbed { None } else { self.ages().within_limits_us() };
        if let Some(micros) = ages {
            let quiet = Duration::from_micros(micros.min(keep_alive_us).into());
            // After a trip each update is part of the pause before a request to arm.
            let quiet = if self.gesture.is_tripped() { Duration::ZERO } else { quiet };
            self.quiet_until = self.updated + quiet;
        } else {
            self.see_to_motors();
        }
        true
    }

    fn ages(&self) -> Ages {
        let mut ages = Ages::none(self.now, self.timeouts);
        let mut rest = self.slots.get(..usize::from(self.used)).unwrap_or_default();
        while let [slot, others @ ..] = rest {
            slot.add_to(&mut ages);
            rest = others;
        }
        ages
    }

    #[cold]
    #[inline(never)]
    fn see_to_motors(&mut self) {
        let (now, timeouts) = (self.now, self.timeouts);
        self.is_disturbed = false;
        for motor in 0..self.used {
            let is_settled = self.change(motor, self.updated, |slot| slot.see_to(now, &timeouts));
            self.is_disturbed |= is_settled == Some(false);
        }
    }

    /// Gives up what is too old for a stamp of 32 bits to tell how old it is, and everything after a pause, of which no
    /// stamp tells how long it was. Whatever makes time pass without looking at ages has to ask for this.
    #[cold]
    #[inline(never)]
    fn forget_bygones(&mut self, before: Instant) {
        let now = self.updated;
        let is_pause = now > before + LONGEST_PAUSE;
        for motor in 0..self.used {
            self.change(motor, now, |slot| slot.forget_bygones(now.stamp(), is_pause));
        }
    }

    /// Tells whether the present update lies after the one before, and not before the arming.
    fn moves_on(&mut self, before: Instant) -> bool {
        let step = Progress::step(self.running.then_some(before), self.armed_at, self.updated);
        self.gesture.pass(step);
        step.is_some()
    }

    /// Ends an update whose time or time step is not usable.
    #[cold]
    #[inline(never)]
    pub(super) fn update_without_step(&mut self, before: Instant) {
        let moves_on = self.moves_on(before);
        self.forget_bygones(before);
        self.running = true;
        self.disturb();
        self.rejects.bad_steps = self.rejects.bad_steps.saturating_add(1);
        if moves_on {
            self.hold(before);
        } else {
            self.lose_time();
        }
        self.outbox.finish_update();
    }

    /// Leaves the last commands once, then sends zeros. What asks for nothing gets zero at once.
    fn hold(&mut self, before: Instant) {
        self.held_steps = self.held_steps.saturating_add(1);
        let late = self.updated.since(before) > self.timeouts.late();
        if self.held_steps >= 2 || late {
            self.outbox.clear();
        }
        for slot in self.slots.iter().filter(|slot| slot.has_rested()) {
            self.outbox.put(slot.place, 0);
        }
        self.outbox.keep_alive(self.now);
    }

    /// Sends zeros, and relaxes every motor until it is armed again: where time did not move on, no age is known.
    fn lose_time(&mut self) {
        for motor in 0..self.used {
            self.change(motor, self.updated, Slot::lose_time);
        }
        // No target is left that an update before the arming could make younger.
        self.armed_at = self.updated;
        self.outbox.clear();
    }
}
