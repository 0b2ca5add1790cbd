//! Feedback that does not come shortly after the one before, and where the shaft then is.

use super::Slot;
use crate::dji::{Facts, Feedback};
use crate::encoder::{COUNTS_PER_TURN, Homing, Position, resolve_gap, shortest};
use crate::motor::{Condition, Link, TargetError, Timeouts, age};

impl Slot {
    /// Takes a feedback frame that arrived at `now`, whenever the one before came.
    pub(in crate::dji) fn receive_after_gap(
        &mut self,
        facts: &Facts,
        feedback: Feedback,
        now: u32,
        timeouts: &Timeouts,
        running: bool,
    ) {
        let (link, gap_us) = (self.guard.link(), age(now, self.guard.heard()));
        let in_time = now.wrapping_sub(self.guard.heard()) < trusted_gap_us(facts);
        if link != Link::Unheard {
            self.traffic.gap(gap_us);
        }
        self.traffic.count();
        match link {
            Link::Unheard => self.shaft.seed(feedback.angle()),
            Link::Online | Link::Late if in_time && !running => self.move_shortest(feedback),
            Link::Online | Link::Late => self.follow(facts, feedback, gap_us),
            Link::Offline => {
                self.move_shortest(feedback);
                self.doubt_position();
            }
            Link::Recovering => self.move_shortest(feedback),
        }
        self.feedback = feedback;
        self.guard.hear(now, timeouts);
        if self.guard.link() == Link::Online {
            // Before the first update nobody looks at ages, so that every frame has to: it comes this way.
            let is_trusted = running && !self.traffic.is_crowded();
            self.guard.trust(if is_trusted { trusted_gap_us(facts) } else { 0 });
            if link == Link::Recovering || link == Link::Offline {
                self.begin_opening();
            }
            self.relent(facts);
        }
    }

    /// Follows the angle of a motor that was heard `gap_us` ago.
    fn follow(&mut self, facts: &Facts, feedback: Feedback, gap_us: u32) {
        let (before, after) = (self.feedback, feedback);
        if self.traffic.is_crowded() && gap_us < trusted_gap_us(facts) {
            self.compare(feedback, gap_us);
            return self.move_shortest(feedback);
        }
        let no_load_rpm = facts.rotor_no_load_rpm();
        let absurd = |rpm: i16| u32::from(rpm.unsigned_abs()) > 2 * u32::from(no_load_rpm);
        if absurd(before.rpm()) || absurd(after.rpm()) {
            self.move_shortest(feedback);
            return self.doubt_position();
        }
        let (before, after) = ((before.angle(), before.rpm()), (after.angle(), after.rpm()));
        let gap = resolve_gap(before, after, gap_us, no_load_rpm);
        let (Ok(counts) | Err(counts)) = gap;
        self.shaft.advance_far(counts);
        if gap.is_err() {
            self.doubt_position();
        }
    }

    /// Looks whether two motors take turns, when more frames come than one motor sends.
    fn compare(&mut self, feedback: Feedback, gap_us: u32) {
        const COUNTS_PER_RPM_MS: f32 = COUNTS_PER_TURN as f32 / 60_000.0;
        let (one, other) = (f32::from(self.feedback.rpm()), f32::from(feedback.rpm()));
        let predicted = (one + other) * 0.5 * COUNTS_PER_RPM_MS * (gap_us as f32 * 1e-3);
        // A sample is up to a period old, and so is the one before.
        let tolerance = 200.0 + 2.0 * COUNTS_PER_RPM_MS * one.abs().max(other.abs());
        let counts = shortest(self.feedback.angle(), feedback.angle());
        #[expect(clippy::cast_possible_truncation, reason = "saturates")]
        self.traffic.compare(counts, predicted as i32, tolerance as i32);
        if self.traffic.is_double() && !self.health.ignores(Condition::DuplicateId) {
            let before = self.guard.latch().active();
            self.begin(Condition::DuplicateId);
            self.react(before);
        }
    }

    /// Follows the angle without counting turns that nobody saw.
    fn move_shortest(&mut self, feedback: Feedback) {
        self.shaft.advance(shortest(self.feedback.angle(), feedback.angle()));
    }

    fn doubt_position(&mut self) {
        self.ambiguous_gaps = self.ambiguous_gaps.saturating_add(1);
        self.begin(Condition::PositionUncertain);
        if self.homing == Homing::Homed && !self.shaft.is_direct() {
            self.homing = Homing::Uncertain;
        }
    }

    /// Calls the present position `position`. A motor that holds an angle or position is relaxed: its target
    /// was given in the old terms.
    pub(in crate::dji) fn set_present_position(
        &mut self,
        position: Position,
    ) -> Result<(), TargetError> {
        if self.guard.link() != Link::Online {
            return Err(TargetError::NoFeedback);
        }
        if !position.is_finite() {
            return Err(TargetError::NotFinite);
        }
        if self.asked.is_way() {
            self.relax();
        }
        self.shaft.set_position(position);
        self.homing = Homing::Homed;
        self.guard.latch_mut().set(Condition::PositionUncertain, false);
        self.keep_inside(0);
        Ok(())
    }
}

/// Half a rotor turn at no-load speed, 30 s / rpm, less what frames may be delayed by others on the bus.
fn trusted_gap_us(facts: &Facts) -> u32 {
    let half_turn_us = 30_000_000 / u32::from(facts.rotor_no_load_rpm()).max(1);
    half_turn_us.saturating_sub(500)
}
