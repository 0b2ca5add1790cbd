//! What is wrong with one joint.

use super::Slot;
use crate::motor::{Condition, Edge, Health};
use crate::time::{Duration, Instant};

/// Positions are counted for this long.
const WINDOW: Duration = Duration::from_secs(1);

/// So long after another node led the joint it is forgotten.
const RIVAL_FORGOTTEN: Duration = Duration::from_secs(1);

impl Slot {
    /// Counts a position that arrived at `now`, before its time replaces that of the one before.
    pub(super) fn count_position(&mut self, now: Instant) {
        if self.raw.is_some() {
            let gap = now.since(self.heard).micros_u32();
            self.traffic.gap(gap.unwrap_or(u32::MAX));
        } else {
            self.window_from = now;
        }
        self.traffic.count();
    }

    /// Another node wrote to the joint, or asked it.
    pub(in crate::snake) fn hear_rival(&mut self, now: Instant) {
        self.rival_heard = Some(now);
        self.guard.note(Condition::SecondMaster, true, now);
    }

    pub(in crate::snake) const fn has_rival(&self) -> bool {
        self.rival_heard.is_some()
    }

    /// Ends what is over, and the window in which positions are counted.
    pub(super) fn look(&mut self, now: Instant) {
        if self.rival_heard.is_some_and(|heard| now.since(heard) > RIVAL_FORGOTTEN) {
            self.rival_heard = None;
            self.guard.note(Condition::SecondMaster, false, now);
        }
        let window = now.since(self.window_from);
        if self.raw.is_some() && window >= WINDOW {
            let units = u16::try_from(window.as_micros() >> 10).unwrap_or(u16::MAX);
            // How often a joint is asked is the application's affair.
            self.traffic.close(units, u32::MAX);
            self.window_from = now;
        }
    }

    /// Returns when the change was noted that is next to be read.
    pub(in crate::snake) fn next_edge_at(&self) -> Option<Instant> {
        self.id.and_then(|_| self.guard.next_edge_at())
    }

    pub(in crate::snake) fn next_edge(&mut self) -> Option<Edge> {
        let motor = self.name()?;
        self.guard.next_edge(motor)
    }

    /// Returns how the joint is.
    pub(in crate::snake) fn health(&self) -> Option<Health> {
        Some(Health {
            feedback_hz: self.traffic.rate_hz(),
            longest_gap: Duration::from_micros(self.traffic.longest_gap_us().into()),
            ambiguous_gaps: self.position_jumps,
            ..self.guard.health(self.name()?)
        })
    }
}
