//! What is wrong with one joint.

use super::{LAST, Slot};
use crate::motor::{Condition, Edge, Health, Link, Reaction};
use crate::snake::PULSES_PER_TURN;
use crate::time::{Duration, Instant};

/// Positions are counted for this long.
const WINDOW: Duration = Duration::from_secs(1);

/// So long after another node led the joint it is forgotten.
const RIVAL_FORGOTTEN: Duration = Duration::from_secs(1);

/// A joint that moves less than this stands.
const STANDS: u32 = PULSES_PER_TURN.unsigned_abs() / 256;

/// A joint that is nearer to its target than this is there.
const THERE: u32 = PULSES_PER_TURN.unsigned_abs() / 64;

/// Where a joint stands, and since when it would have to move.
#[derive(Debug, Clone, Copy)]
pub(super) struct Standing {
    pub(super) at: i32,
    pub(super) since: Instant,
}

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
        self.look_for_stall(now);
        let window = now.since(self.window_from);
        if self.raw.is_some() && window >= WINDOW {
            let units = u16::try_from(window.as_micros() >> 10).unwrap_or(u16::MAX);
            // How often a joint is asked is the application's affair.
            self.traffic.close(units, u32::MAX);
            self.window_from = now;
        }
    }

    /// A joint that has a way to go and does not move is blocked, or its drive does not do what it is told.
    fn look_for_stall(&mut self, now: Instant) {
        let Some(raw) = self.raw else { return };
        let (window, reaction) = (self.stall.window, self.stall.reaction);
        let way = self.target.wrapping_sub(raw).unsigned_abs();
        let moved = raw.wrapping_sub(self.stands.at).unsigned_abs() > STANDS;
        let asked = self.is_up() && way > THERE;
        let looks = reaction != Reaction::Ignore && self.guard.link() == Link::Online;
        if moved || !(asked && looks && self.is_fast_enough()) {
            self.stands = Standing { at: raw, since: now };
        }
        let begins = now.since(self.stands.since) >= window;
        if begins && reaction == Reaction::Relax {
            self.guard.relax_until_armed();
        }
        self.guard.note(Condition::Stalled, begins, now);
    }

    /// Tells whether the joint was enabled. Before that it says of itself that it is not; afterwards it may have news all
    /// the time, from an application that leads it along.
    pub(super) const fn is_up(&self) -> bool {
        self.driven && self.pending & LAST == 0
    }

    /// Tells whether the joint would move visibly within the window, from rest.
    fn is_fast_enough(&self) -> bool {
        let time_s = self.stall.window.as_secs_f32();
        let sped_up = 0.5 * self.settings.acceleration as f32 * time_s * time_s;
        sped_up.min(self.speed as f32 * time_s) > 4.0 * STANDS as f32
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
