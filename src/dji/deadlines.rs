//! What time brings with it: ages that exceed their limits, keep-alives, updates without a usable step.

use super::Bus;
use super::slot::Slot;
use crate::motor::{Ages, Hold};
use crate::time::Instant;

impl<B> Bus<B> {
    /// Sees to all that grows old or is due now and then, and finds out until when there is nothing of it; `false` when
    /// the time did not move on.
    #[cold]
    #[inline(never)]
    pub(super) fn look_around(&mut self, before: Instant) -> bool {
        if !self.guard.moves_on(before) {
            return false;
        }
        if self.guard.is_pause(before) {
            self.forget_bygones(before);
        }
        self.guard.run();
        let keep_alive_us = self.outbox.keep_alive(self.guard.now());
        let ages = self.guard.ages().map(|ages| self.add_ages(ages));
        if let Some(micros) = ages.and_then(|ages| ages.within_limits_us()) {
            self.guard.rest_for(micros.min(keep_alive_us));
        } else {
            self.see_to_motors();
        }
        true
    }

    fn add_ages(&self, mut ages: Ages) -> Ages {
        let mut rest = self.slots.get(..usize::from(self.used)).unwrap_or_default();
        while let [slot, others @ ..] = rest {
            ages.add(&slot.guard);
            rest = others;
        }
        ages
    }

    #[cold]
    #[inline(never)]
    fn see_to_motors(&mut self) {
        let (now, updated, timeouts) =
            (self.guard.now(), self.guard.updated(), *self.guard.timeouts());
        for motor in 0..self.used {
            if self.change(motor, updated, |slot| slot.guard.age(now, &timeouts)) == Some(false) {
                self.guard.disturb();
            }
        }
    }

    /// Gives up what is too old for a stamp of 32 bits to tell how old it is, and everything after a pause, of which no
    /// stamp tells how long it was. Whatever makes time pass without looking at ages has to ask for this.
    #[cold]
    #[inline(never)]
    pub(super) fn forget_bygones(&mut self, before: Instant) {
        let (now, is_pause) = (self.guard.updated(), self.guard.is_pause(before));
        for motor in 0..self.used {
            self.change(motor, now, |slot| slot.guard.forget_bygones(now.stamp(), is_pause));
        }
    }

    /// Ends an update whose time or time step is not usable.
    #[cold]
    #[inline(never)]
    pub(super) fn update_without_step(&mut self, before: Instant, moves_on: bool) {
        self.forget_bygones(before);
        match self.guard.hold(before, moves_on) {
            Hold::Keep => {}
            Hold::Rest => self.outbox.clear(),
            Hold::LoseTime => {
                for motor in 0..self.used {
                    self.change(motor, self.guard.updated(), Slot::lose_time);
                }
                self.outbox.clear();
                return self.outbox.finish_update();
            }
        }
        // What asks for nothing gets zero at once.
        for slot in self.slots.iter().filter(|slot| slot.has_rested()) {
            self.outbox.put(slot.place, 0);
        }
        self.outbox.keep_alive(self.guard.now());
        self.outbox.finish_update();
    }
}
