use super::target::Action;
use super::{Slot, age, is_near};
use crate::dji::{Facts, Feedback};
use crate::encoder::{Gap, Homing, shortest};
use crate::motor::{Link, Timeouts};

impl Slot {
    /// Takes a feedback frame that arrived at `now`, shortly after the one before; otherwise does nothing and
    /// returns `false`. A motor that is not online, and a free slot, trust no gap.
    #[inline]
    pub(in crate::dji) fn receive(&mut self, feedback: Feedback, now: u32) -> bool {
        let in_time = now.wrapping_sub(self.heard) < self.trusted_gap_us;
        if in_time {
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
    ) {
        match self.link {
            Link::Unheard => {
                self.shaft.seed(feedback.angle());
                self.set_online(facts);
            }
            Link::Online | Link::Late => {
                let (before, after) = (self.feedback, feedback);
                let gap = Gap::resolve(
                    (before.angle(), before.rpm()),
                    (after.angle(), after.rpm()),
                    age(now, self.heard),
                    facts.rotor_no_load_rpm(),
                );
                self.shaft.advance_far(gap.counts);
                if gap.ambiguous {
                    self.doubt_position();
                }
                self.set_online(facts);
            }
            Link::Offline => {
                self.move_shortest(feedback);
                self.doubt_position();
                self.good_frames = 1;
                self.link = Link::Recovering;
                self.finish_recovery(facts, timeouts);
            }
            Link::Recovering => {
                self.move_shortest(feedback);
                let in_a_row = is_near(now, self.heard, timeouts.late_us());
                self.good_frames = if in_a_row { self.good_frames.saturating_add(1) } else { 1 };
                self.finish_recovery(facts, timeouts);
            }
        }
        self.feedback = feedback;
        self.heard = now;
    }

    /// Follows the angle without counting turns that nobody saw.
    fn move_shortest(&mut self, feedback: Feedback) {
        self.shaft.advance(shortest(self.feedback.angle(), feedback.angle()));
    }

    fn doubt_position(&mut self) {
        self.ambiguous_gaps = self.ambiguous_gaps.saturating_add(1);
        if self.homing == Homing::Homed && !self.shaft.is_direct() {
            self.homing = Homing::Uncertain;
        }
    }

    fn finish_recovery(&mut self, facts: &Facts, timeouts: &Timeouts) {
        if self.good_frames >= timeouts.good_frames() {
            self.set_online(facts);
            self.start_ramp();
        }
    }

    fn set_online(&mut self, facts: &Facts) {
        self.link = Link::Online;
        self.action = self.asked;
        // Half a rotor turn at no-load speed, 30 s / rpm, less what frames may be delayed by others on the bus.
        let half_turn_us = 30_000_000 / u32::from(facts.rotor_no_load_rpm()).max(1);
        self.trusted_gap_us = half_turn_us.saturating_sub(500);
    }

    /// The feedback is too old for its angle to be followed blindly: the next frame is looked at.
    pub(super) fn set_late(&mut self) {
        self.link = Link::Late;
        self.action = Action::Rest;
        self.trusted_gap_us = 0;
        self.speed.interrupt();
        self.position.interrupt();
    }

    /// Nobody knows any more when the motor was heard.
    #[inline(never)]
    pub(in crate::dji) fn lose(&mut self) {
        if self.link != Link::Unheard {
            self.set_offline();
        }
    }

    /// The motor is lost: relaxed, and latched until it is armed again or ramps back.
    pub(super) fn set_offline(&mut self) {
        self.link = Link::Offline;
        self.trusted_gap_us = 0;
        self.latch();
        self.relax();
    }
}
