use super::target::Action;
use super::{Slot, age, is_near};
use crate::dji::bus::LONGEST_PAUSE_US;
use crate::dji::{Facts, Feedback};
use crate::encoder::{COUNTS_PER_TURN, Gap, Homing, shortest};
use crate::motor::{Condition, Link, Timeouts};

impl Slot {
    /// Takes a feedback frame that arrived at `now`, shortly after the one before; otherwise does nothing and
    /// returns `false`. A motor that is not online, and a free slot, trust no gap.
    #[inline]
    pub(in crate::dji) fn receive(&mut self, feedback: Feedback, now: u32) -> bool {
        let in_time = now.wrapping_sub(self.heard) < self.trusted_gap_us;
        if in_time {
            self.traffic.count();
            self.shaft.advance(shortest(self.feedback.angle(), feedback.angle()));
            self.feedback = feedback;
            self.heard = now;
        }
        in_time
    }

    /// Takes a feedback frame that arrived at `now`, whenever the one before came.
    pub(in crate::dji) fn receive_after_gap(
        &mut self,
        facts: &Facts,
        feedback: Feedback,
        now: u32,
        timeouts: &Timeouts,
        running: bool,
    ) {
        if self.link != Link::Unheard {
            self.traffic.gap(age(now, self.heard));
        }
        self.traffic.count();
        match self.link {
            Link::Unheard => {
                self.shaft.seed(feedback.angle());
                self.set_online(facts);
            }
            Link::Online | Link::Late => {
                let in_time = now.wrapping_sub(self.heard) < trusted_gap_us(facts);
                if in_time && !running {
                    self.move_shortest(feedback);
                } else {
                    self.follow(facts, feedback, age(now, self.heard));
                }
                self.set_online(facts);
            }
            Link::Offline => {
                self.move_shortest(feedback);
                self.doubt_position();
                self.good_frames = 1;
                self.link = Link::Recovering;
                self.finish_recovery(facts, timeouts, now);
            }
            Link::Recovering => {
                self.move_shortest(feedback);
                let in_a_row = is_near(now, self.heard, timeouts.late_us());
                self.good_frames = if in_a_row { self.good_frames.saturating_add(1) } else { 1 };
                self.finish_recovery(facts, timeouts, now);
            }
        }
        self.feedback = feedback;
        self.heard = now;
        if !running {
            // Nobody looks at ages yet, so every frame has to: it comes this way.
            self.trusted_gap_us = 0;
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
        let gap = Gap::resolve(before, after, gap_us, no_load_rpm);
        self.shaft.advance_far(gap.counts);
        if gap.ambiguous {
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
            let before = self.conditions.active();
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

    fn finish_recovery(&mut self, facts: &Facts, timeouts: &Timeouts, now: u32) {
        if self.good_frames >= timeouts.good_frames() {
            self.set_online(facts);
            self.resume(now);
        }
    }

    fn set_online(&mut self, facts: &Facts) {
        self.link = Link::Online;
        self.trusted_gap_us = if self.traffic.is_crowded() { 0 } else { trusted_gap_us(facts) };
        self.conditions.set(Condition::Late, false);
        self.conditions.set(Condition::Offline, false);
        self.relent(facts);
        self.settle();
    }

    /// The feedback is too old for its angle to be followed blindly: the next frame is looked at.
    pub(super) fn set_late(&mut self) {
        self.link = Link::Late;
        self.begin(Condition::Late);
        self.trusted_gap_us = 0;
        self.loops.interrupt();
        self.settle();
    }

    /// Gives up what nobody knows any more how old it is: after a pause everything, otherwise what is so old that nobody
    /// will know.
    pub(in crate::dji) fn forget_bygones(&mut self, now: u32, is_pause: bool) {
        let is_bygone = |stamp| is_pause || age(now, stamp) > LONGEST_PAUSE_US;
        if self.link != Link::Unheard && is_bygone(self.heard) {
            self.set_offline();
        } else if self.asked != Action::Rest && is_bygone(self.commanded) {
            self.forget_target();
        }
    }

    /// The motor is lost: relaxed, and latched until it is armed again or ramps back.
    pub(super) fn set_offline(&mut self) {
        self.link = Link::Offline;
        self.begin(Condition::Late);
        self.begin(Condition::Offline);
        self.trusted_gap_us = 0;
        self.latch();
        self.relax();
    }
}

/// Half a rotor turn at no-load speed, 30 s / rpm, less what frames may be delayed by others on the bus.
fn trusted_gap_us(facts: &Facts) -> u32 {
    let half_turn_us = 30_000_000 / u32::from(facts.rotor_no_load_rpm()).max(1);
    half_turn_us.saturating_sub(500)
}
