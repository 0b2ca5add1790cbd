//! Outstanding replies, by id: a reply may arrive after its joint was detached.

use super::Register;
use super::model::SLOTS;
use crate::time::{Duration, Instant};

/// Requests without a reply, one place per joint.
#[derive(Debug, Clone, Copy)]
pub(super) struct Answers([Owed; SLOTS]);

#[derive(Debug, Clone, Copy)]
struct Owed {
    due: Option<(Register, Instant)>,
    /// Requests that expired and were not answered since, one bit each: a driver may still hold them.
    given_up: u32,
}

const fn bit(register: Register) -> u32 {
    1 << register.as_raw()
}

impl Answers {
    pub(super) const NONE: Self = Self([Owed { due: None, given_up: 0 }; SLOTS]);

    pub(super) fn of(&self, index: usize) -> Option<Register> {
        let (register, _) = self.0.get(index)?.due?;
        Some(register)
    }

    pub(super) fn expect(&mut self, index: usize, register: Register, now: Instant) {
        if let Some(owed) = self.0.get_mut(index) {
            owed.due = Some((register, now));
        }
    }

    /// Takes a reply: the outstanding one, or a reply for another register.
    pub(super) fn take(&mut self, index: usize, register: Register) {
        if let Some(owed) = self.0.get_mut(index) {
            owed.given_up &= !bit(register);
            owed.due = owed.due.filter(|(asked, _)| *asked != register);
        }
    }

    /// Takes back a request that was not sent. Returns `false` if the request expired before, or may have: the reply to another request is
    /// then still outstanding.
    pub(super) fn take_back(&mut self, index: usize, register: Register) -> bool {
        let Some(owed) = self.0.get_mut(index) else { return false };
        let is_given_up = owed.given_up & bit(register) != 0;
        owed.due.take_if(|(asked, _)| *asked == register && !is_given_up).is_some()
    }

    /// Returns the joints with an outstanding reply, one bit each.
    pub(super) fn owing(&self) -> u16 {
        (0..).zip(&self.0).map(|(index, owed)| u16::from(owed.due.is_some()) << index).sum()
    }

    /// Drops overdue replies, and returns their joints; without a time-out, drops all.
    pub(super) fn give_up(
        &mut self,
        now: Instant,
        reply_timeout: Option<Duration>,
    ) -> impl Iterator<Item = usize> {
        self.0.iter_mut().enumerate().filter_map(move |(index, owed)| {
            let (register, since) = owed.due?;
            // After a set-back of the clock, the time since the request alone would delay the expiry for long.
            let passed = now.since(since).max(since.since(now));
            reply_timeout.is_none_or(|timeout| passed > timeout).then(|| {
                *owed = Owed { due: None, given_up: owed.given_up | bit(register) };
                index
            })
        })
    }
}
