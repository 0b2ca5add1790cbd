use super::{Slot, is_near};
use crate::dji::range::Range;
use crate::motor::{Condition, Link, Monitor, Timeouts};
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
        self.open(now);
        self.keep_inside(0);
        self.commanded = now;
    }

    /// Has the output range open from zero.
    fn open(&mut self, now: u32) {
        // The last unit does not count: it tells that the range opens.
        self.opened = self.opening_ms.and(NonZeroU16::new(coarse(now) | 1));
        if self.opened.is_some() {
            self.range = Range::ZERO;
            self.attend();
        }
    }

    pub(in crate::dji) fn disarm(&mut self) {
        self.relax();
        self.arming = Arming::Disarmed;
    }

    /// Tells whether the motor was relaxed since it was armed, and waits to be armed again.
    pub(in crate::dji) const fn is_tripped(&self) -> bool {
        matches!(self.arming, Arming::Latched | Arming::Tripped)
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

    /// Time did not move on: trips the motor, and takes its feedback for late until the next one.
    pub(in crate::dji) fn lose_time(&mut self) {
        if self.facts.is_none() {
            return;
        }
        self.begin(Condition::ClockFault);
        if self.link == Link::Online {
            self.set_late();
        }
        self.trip();
    }

    /// Takes targets again after a recovery, where that is configured; the output range opens from zero.
    pub(super) fn resume(&mut self, now: u32) {
        if self.arming == Arming::Latched && self.resumes {
            self.arming = Arming::Armed;
            self.open(now);
            self.settle();
        }
    }

    /// Returns the share of the output range that is open.
    pub(super) fn open_share(&mut self, now: u32) -> f32 {
        let Some(opened) = self.opened else { return 1.0 };
        // An interrupt may have stamped the frame just after the tick read its clock.
        const AHEAD: u16 = 64_500;
        let elapsed = coarse(now).wrapping_sub(opened.get());
        let elapsed_ms = if elapsed < AHEAD { f32::from(elapsed) * 1.024 } else { 0.0 };
        match self.opening_ms.map(|time| f32::from(time.get())) {
            Some(time_ms) if elapsed_ms < time_ms => elapsed_ms / time_ms,
            _ => {
                self.opened = None;
                1.0
            }
        }
    }

    /// Keeps the integral of the speed loop within what is left of the output: the loop knows only the full limit, and would
    /// wind up.
    pub(super) fn hold_back(&mut self) {
        let end = |raw: i16| f32::from(self.range.nearest(raw.into())) / self.raw_per_unit;
        let (one, other) = (end(i16::MIN), end(i16::MAX));
        self.loops.speed_mut().keep_integral_between(one.min(other), one.max(other));
    }
}

/// In units of 1.024 ms, up to 67 s; a ramp takes no longer than 65.
#[expect(clippy::cast_possible_truncation, reason = "compared by wrapping difference")]
const fn coarse(stamp: u32) -> u16 {
    (stamp >> 10) as u16
}
