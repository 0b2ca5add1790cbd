//! Arming, the gesture, the emergency stop, and the pause after a trip.

use super::{Arming, PAUSE_US, Reference, Refusal};

impl Reference {
    /// Takes a request to arm, whatever comes of it.
    pub(crate) fn ask(&mut self) {
        self.is_granted = !self.tripped || self.quiet_us >= PAUSE_US;
        self.quiet_us = 0;
    }

    pub(crate) fn refusal(&self, now: u64) -> Option<Refusal> {
        if self.is_stopped {
            Some(Refusal::Stopped)
        } else if self.is_missing(now) {
            Some(Refusal::Missing)
        } else if self.has_rival() {
            Some(Refusal::SecondMaster)
        } else {
            (!self.is_granted).then_some(Refusal::NotReleased)
        }
    }

    pub(crate) fn is_arming(&self) -> bool {
        self.arms_with_update
    }

    /// The request is granted, of all motors.
    pub(crate) fn arm(&mut self, now: u64) {
        if self.rules.arms_later {
            self.arms_with_update = !self.is_armed();
        } else {
            self.engage(now);
        }
    }

    pub(crate) fn engage(&mut self, now: u64) {
        self.tripped = false;
        if !self.is_armed() {
            self.relax();
            self.arming = Arming::Armed;
            (self.is_resting, self.was_driven) = (true, false);
            self.open(now);
        }
        self.armed_at = self.armed_at.max(now);
        self.target_time = now;
    }

    pub(crate) fn disarm(&mut self) {
        self.relax();
        self.arming = Arming::Disarmed;
        self.arms_with_update = false;
    }

    pub(crate) fn stop(&mut self) {
        if !self.is_stopped {
            self.disarm();
            self.begin_pause();
        }
        self.is_stopped = true;
        self.arms_with_update = false;
    }

    pub(crate) fn clear_stop(&mut self) {
        if self.is_stopped {
            self.begin_pause();
        }
        self.is_stopped = false;
    }

    pub(crate) fn begin_pause(&mut self) {
        (self.tripped, self.quiet_us, self.is_granted) = (true, 0, false);
    }

    /// The motor is relaxed until it is armed again.
    pub(super) fn fall_to(&mut self, arming: Arming) {
        if self.is_armed() {
            self.begin_pause();
        }
        if self.is_armed() || self.arming == Arming::Latched && arming == Arming::Tripped {
            self.arming = arming;
        }
        self.relax();
    }
}
