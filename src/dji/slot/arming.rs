use super::{Slot, is_near};
use crate::dji::command::to_raw;
use crate::dji::range::Range;
use crate::motor::{Link, Monitor, Timeouts};
use core::num::NonZeroU16;

/// Whether the motor takes targets.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Arming {
    Disarmed,
    Armed,
    /// Relaxed since it was armed, because it was lost.
    Latched,
    /// Relaxed since it was armed, for something else.
    Tripped,
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
        let refuses = self.is_armed() || self.is_missing(now, timeouts) || self.is_faulty();
        if self.facts.is_none() || refuses {
            return;
        }
        self.relax();
        for condition in Monitor::NOTICED_ANEW {
            self.conditions.set(condition, false);
        }
        self.monitor = Monitor::NEW;
        self.arming = Arming::Armed;
        self.ramp_started = None;
        self.keep_inside(0);
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

    /// Relaxes the motor, and refuses targets until it is armed again.
    pub(super) fn trip(&mut self) {
        if self.arming != Arming::Disarmed {
            self.arming = Arming::Tripped;
        }
        self.relax();
    }

    /// Starts again from zero output after a recovery, where that is configured.
    pub(super) fn start_ramp(&mut self) {
        if self.arming == Arming::Latched && self.ramp_ms.is_some() {
            self.arming = Arming::Armed;
            self.range = Range::ZERO;
            self.settle();
            self.attend();
            // The last unit does not count: it tells that there is a ramp.
            self.ramp_started = NonZeroU16::new(coarse(self.heard) | 1);
        }
    }

    /// Returns the share of the output that a ramp leaves.
    pub(super) fn ramp(&mut self, now: u32) -> f32 {
        let Some(started) = self.ramp_started else { return 1.0 };
        // An interrupt may have stamped the frame just after the tick read its clock.
        const AHEAD: u16 = 64_500;
        let elapsed = coarse(now).wrapping_sub(started.get());
        let elapsed_ms = if elapsed < AHEAD { f32::from(elapsed) * 1.024 } else { 0.0 };
        match self.ramp_ms.map(|time| f32::from(time.get())) {
            Some(time_ms) if elapsed_ms < time_ms => elapsed_ms / time_ms,
            _ => {
                self.ramp_started = None;
                1.0
            }
        }
    }

    /// Keeps the speed loop within what is left of the output: it knows only the full limit, and would wind up.
    pub(super) fn hold_back(&mut self) {
        let output = self.loops.output();
        let raw = to_raw(output, self.raw_per_unit, i16::MAX);
        let nearest = self.range.nearest(raw.into());
        if nearest != raw {
            self.loops.speed_mut().reset_to(f32::from(nearest) / self.raw_per_unit);
        }
    }
}

/// In units of 1.024 ms, up to 67 s; a ramp takes no longer than 65.
#[expect(clippy::cast_possible_truncation, reason = "compared by wrapping difference")]
const fn coarse(stamp: u32) -> u16 {
    (stamp >> 10) as u16
}
