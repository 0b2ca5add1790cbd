//! Who owes an answer: by id, as an answer may come after its joint was detached.

use super::bus::{SLOTS, count};
use super::{Joint, Joints, Register};
use crate::time::{Duration, Instant};

/// What each joint was asked for and has not answered, and when.
#[derive(Debug, Clone, Copy)]
pub(super) struct Answers([Option<(Register, Instant)>; SLOTS]);

impl Answers {
    pub(super) const NONE: Self = Self([None; SLOTS]);

    pub(super) fn of(&self, index: usize) -> Option<Register> {
        let (register, _) = (*self.0.get(index)?)?;
        Some(register)
    }

    pub(super) fn expect(&mut self, index: usize, register: Register, now: Instant) {
        if let Some(owed) = self.0.get_mut(index) {
            *owed = Some((register, now));
        }
    }

    /// Waits no longer for this answer; `false` when it was another that is due, or none.
    pub(super) fn settle(&mut self, index: usize, register: Register) -> bool {
        let owed = self.0.get_mut(index);
        let owed = owed.filter(|owed| owed.is_some_and(|(asked, _)| asked == register));
        owed.and_then(Option::take).is_some()
    }

    /// Returns the joints that owe one, a bit each.
    pub(super) fn owing(&self) -> u16 {
        (0..).zip(&self.0).map(|(index, owed)| u16::from(owed.is_some()) << index).sum()
    }
}

impl Joints {
    /// Returns the register that a joint was asked for and has not answered yet.
    #[must_use]
    pub fn awaited(&self, joint: Joint) -> Option<Register> {
        self.slot(joint).and_then(|_| self.answers.of(joint.index()))
    }

    /// Waits no longer for what is overdue. Without a time-out all is.
    pub(super) fn give_up(&mut self, reply_timeout: Option<Duration>) {
        let now = self.now;
        for (owed, slot) in self.answers.0.iter_mut().zip(&mut self.slots) {
            let Some((_, since)) = *owed else { continue };
            // A clock that was set back would have it wait for long.
            if reply_timeout.is_none_or(|timeout| now.since(since) > timeout || now < since) {
                *owed = None;
                count(&mut slot.unanswered);
                count(&mut self.counters.unanswered);
            }
        }
    }
}
