use super::{Slot, age, is_near};
use crate::dji::command::to_raw;
use crate::motor::{Link, Timeouts};

/// Whether the motor takes targets.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Arming {
    Disarmed,
    Armed,
    /// Relaxed by a fault since it was armed.
    Latched,
}

impl Slot {
    /// Tells whether the motor is online with feedback that is fresh at `now`. A free slot is not missing.
    pub(in crate::dji) fn is_missing(&self, now: u32, timeouts: &Timeouts) -> bool {
        let fresh = self.link == Link::Online && is_near(now, self.heard, timeouts.late_us());
        self.facts.is_some() && !fresh
    }

    /// Takes targets from now on, starting from rest, if the motor is heard. One that takes them already goes on
    /// undisturbed.
    pub(in crate::dji) fn engage(&mut self, now: u32, timeouts: &Timeouts) {
        if self.facts.is_none() || self.is_armed() || self.is_missing(now, timeouts) {
            return;
        }
        self.relax();
        self.arming = Arming::Armed;
        self.limit = self.full_limit;
        self.commanded = now;
    }

    pub(in crate::dji) fn disarm(&mut self) {
        self.relax();
        self.arming = Arming::Disarmed;
    }

    pub(in crate::dji) const fn is_armed(&self) -> bool {
        matches!(self.arming, Arming::Armed)
    }

    /// Refuses targets until it is armed again, or ramps back.
    pub(super) fn latch(&mut self) {
        if self.arming == Arming::Armed {
            self.arming = Arming::Latched;
        }
    }

    /// Starts again from zero output after a recovery, where that is configured.
    pub(super) fn start_ramp(&mut self) {
        if self.arming == Arming::Latched && self.ramp_ms.is_some() {
            self.arming = Arming::Armed;
            self.limit = 0;
            self.ramp_started = self.heard;
        }
    }

    /// Lets the output limit rise; to be called every few milliseconds.
    pub(in crate::dji) fn ramp(&mut self, now: u32) {
        if self.limit == self.full_limit {
            return;
        }
        let elapsed_ms = age(now, self.ramp_started) / 1_000;
        self.limit = match self.ramp_ms.map(|time| u32::from(time.get())) {
            Some(time_ms) if elapsed_ms < time_ms => to_raw(
                elapsed_ms as f32 / time_ms as f32,
                f32::from(self.full_limit),
                self.full_limit,
            ),
            _ => self.full_limit,
        };
        self.hold_back();
    }

    /// Keeps the speed loop within the limit that rises: it knows only the full one, and would wind up.
    fn hold_back(&mut self) {
        let limit = f32::from(self.limit) / self.raw_per_unit.abs();
        let output = self.speed.output();
        if output.abs() > limit {
            self.speed.reset_to(limit.copysign(output));
        }
    }
}
