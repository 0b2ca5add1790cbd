//! The conditions of one motor, and a list of their changes that nobody has read.

use super::Reference;
use drivetrain::motor::{Condition, Conditions, MotorName};
use drivetrain::time::Edge;

const KNOWN: [Condition; 5] = [
    Condition::Late,
    Condition::Offline,
    Condition::CommandLost,
    Condition::ClockFault,
    Condition::SecondMaster,
];

/// The time of an edge is not known to a program that reads it later than this.
const TOLD_US: u64 = 24 * 86_400_000_000;

#[derive(Debug, Clone, Copy)]
struct Change {
    condition: Condition,
    began: bool,
    at: u64,
    /// The number of the call that found it: changes of one call have no order.
    call: u64,
}

impl Change {
    fn is(&self, edge: &Edge<Condition, MotorName>) -> bool {
        (self.condition, self.began) == (edge.condition, edge.began)
    }

    /// Times are told in units of 1024 µs, rounded down.
    fn has_time_of(&self, edge: &Edge<Condition, MotorName>) -> bool {
        self.at / 1024 == edge.at.as_micros() / 1024
    }
}

#[derive(Debug, Clone)]
pub(super) struct Edges {
    /// So many edges have an order and a time of their own.
    room: usize,
    holds: Vec<Condition>,
    /// The oldest first.
    unread: Vec<Change>,
    /// Changes that may have found no room, in any order.
    crowded: Vec<Change>,
    /// The changes since all were last read: one without room has the time of another.
    since: Vec<Change>,
    calls: u64,
}

impl Edges {
    pub(super) fn new(room: usize) -> Self {
        let (holds, unread, crowded, since) = (vec![], vec![], vec![], vec![]);
        Self { room, holds, unread, crowded, since, calls: 0 }
    }

    pub(super) fn begin_call(&mut self) {
        self.calls += 1;
    }

    pub(super) fn has(&self, condition: Condition) -> bool {
        self.holds.contains(&condition)
    }

    pub(super) fn set(&mut self, condition: Condition, holds: bool, at: u64) {
        if self.has(condition) == holds {
            return;
        }
        if holds {
            self.holds.push(condition);
        } else {
            self.holds.retain(|other| *other != condition);
        }
        let mut waiting = self.unread.iter().chain(&self.crowded);
        if waiting.any(|change| (change.condition, change.began) == (condition, holds)) {
            return;
        }
        let change = Change { condition, began: holds, at, call: self.calls };
        self.since.push(change);
        if self.crowded.is_empty() && self.unread.len() < self.room {
            return self.unread.push(change);
        }
        // The order of the changes of one call, and so the place of each, is not specified.
        let is_before = |other: &Change| other.call < change.call;
        let certain = self.unread.iter().take_while(|other| is_before(other)).count();
        self.crowded.extend(self.unread.drain(certain..));
        self.crowded.push(change);
    }

    /// As [`set`](Self::set), where the last call was not sure of a condition.
    pub(super) fn correct(&mut self, condition: Condition, holds: bool, at: u64) {
        let is_doubtful = |other: &Change| other.call == self.calls && other.condition == condition;
        if self.has(condition) && !holds {
            self.unread.retain(|other| !is_doubtful(other));
            self.crowded.retain(|other| !is_doubtful(other));
            self.holds.retain(|other| *other != condition);
        } else {
            self.set(condition, holds, at);
        }
    }

    pub(super) fn is_read(&self) -> bool {
        self.unread.is_empty() && self.crowded.is_empty()
    }

    /// Takes an edge that the device has returned; its last update was at `updated`.
    pub(super) fn read(&mut self, edge: &Edge<Condition, MotorName>, updated: u64) {
        let is_told = |change: &Change| change.at.abs_diff(updated) < TOLD_US;
        if let Some(oldest) = self.unread.first().map(|change| change.call) {
            let mut first = self.unread.iter().take_while(|change| change.call == oldest);
            let at = first.position(|change| change.is(edge));
            let Some(at) = at else { panic!("not the oldest edge, {edge}: {self:?}") };
            let change = self.unread.remove(at);
            assert!(
                !is_told(&change) || change.has_time_of(edge),
                "the time of an edge, {edge}: {change:?}"
            );
        } else {
            let at = self.crowded.iter().position(|change| change.is(edge));
            let Some(at) = at else { panic!("an edge that was not, {edge}: {self:?}") };
            let known = |change: &Change| !is_told(change) || change.has_time_of(edge);
            assert!(self.since.iter().any(known), "the time of an edge, {edge}: {self:?}");
            self.crowded.remove(at);
        }
        if self.is_read() {
            self.since.clear();
        }
    }
}

/// Conditions and their edges.
impl Reference {
    /// Tells whether the reference predicts a condition.
    pub(crate) fn knows(&self, condition: Condition) -> bool {
        let is_zero = condition == Condition::PositionUncertain;
        is_zero && self.rules.loses_zero || KNOWN.contains(&condition)
    }

    /// Tells whether an edge of another condition may be: a motor of a bus that lost frames is not sure of its turns, once.
    pub(crate) fn is_news(&mut self, edge: &Edge<Condition, MotorName>) -> bool {
        let is_doubt = edge.condition == Condition::PositionUncertain && edge.began;
        is_doubt && self.rules.takes_turns && !core::mem::replace(&mut self.is_in_doubt, true)
    }

    pub(crate) fn has_unread(&self) -> bool {
        !self.edges.is_read()
    }

    pub(crate) fn read(&mut self, edge: &Edge<Condition, MotorName>) {
        self.edges.read(edge, self.updated);
    }

    pub(crate) fn agrees_with(&self, conditions: Conditions) -> bool {
        KNOWN.iter().all(|known| conditions.contains(*known) == self.edges.has(*known))
    }
}
