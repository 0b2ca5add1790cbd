//! The supply and the power of the drive of an actuator: whether the drive is enabled, and a jump of its angle.

use crate::encoder::furthest;
use crate::time::{Duration, Instant};
use crate::units::{Angle, AngularVelocity};

/// The time between frames to a drive that reports the opposite state.
const INSIST: Duration = Duration::from_millis(10);

/// The time between frames to a disabled drive, which may have missed a frame.
const REMIND: Duration = Duration::from_millis(100);

/// For this long after a change, reports of the state before may still arrive.
const SETTLING: Duration = Duration::from_millis(20);

/// Decides when a frame to enable or disable the drive is due.
///
/// | wanted | the drive reports | the frame is sent |
/// |---|---|---|
/// | disabled | enabled | at once, and again each 10 ms |
/// | disabled | disabled, or nothing | at once, and again each 100 ms |
/// | enabled | disabled | at once, and again each 10 ms; if it was enabled before, never again: it has reset |
/// | enabled | enabled, or nothing | at once |
#[derive(Debug, Clone, Copy)]
pub(super) struct Power {
    /// The wanted state.
    pub(super) on: bool,
    /// The state reported by the drive since then; the opposite until the first report.
    pub(super) seen: Option<bool>,
    /// The drive followed.
    is_confirmed: bool,
    /// The time of the first call with this wanted state.
    since: Instant,
    /// The time of the last frame.
    told: Instant,
    is_due: bool,
    /// The drive was never told.
    is_new: bool,
}

impl Power {
    /// Begins with an unknown drive, to be disabled.
    pub(super) const NEW: Self = Self {
        on: false,
        seen: None,
        is_confirmed: false,
        since: Instant::START,
        told: Instant::START,
        is_due: false,
        is_new: true,
    };

    /// Takes the state reported by the drive with a feedback frame; `None` without a report. Returns whether the drive has
    /// reset: enabled before, and disabled now.
    pub(super) fn hear(&mut self, report: Option<bool>, now: Instant) -> bool {
        self.seen = report;
        let has_reset = self.on
            && self.is_confirmed
            && report == Some(false)
            && now.since(self.since) > SETTLING;
        self.is_confirmed |= report == Some(self.on);
        has_reset
    }

    /// Takes the first update; returns whether this update is the first, as the drive is to be disabled then.
    pub(super) const fn begin(&mut self, now: Instant) -> bool {
        let is_new = self.is_new;
        if is_new {
            self.tell(now);
        }
        is_new
    }

    /// Takes the wanted state in an update. Returns the state to be sent to the drive, if a frame is due.
    pub(super) fn step(&mut self, on: bool, now: Instant) -> Option<bool> {
        if on != self.on {
            self.turn(on, now);
        }
        // The clock may have gone back.
        let is_over = |pause| now < self.told || now.since(self.told) >= pause;
        if !self.is_due && !self.pause().is_some_and(is_over) {
            return None;
        }
        self.tell(now);
        Some(on)
    }

    /// Wants the drive to be disabled; returns whether a frame is due now.
    pub(super) fn stop(&mut self, now: Instant) -> bool {
        let stops = self.on || self.is_new;
        if stops {
            self.turn(false, now);
            self.tell(now);
        }
        stops
    }

    /// The frame was not sent, and is due with the next update.
    pub(super) const fn give_back(&mut self) {
        self.is_due = true;
    }

    /// Tells whether the drive is to be enabled.
    pub(super) const fn is_on(&self) -> bool {
        self.on
    }

    /// Tells whether the drive is enabled, by its reports.
    pub(super) fn is_ready(&self) -> bool {
        self.on && self.seen != Some(false)
    }

    /// Tells whether the drive is enabled, by its reports, and nothing is due.
    pub(super) fn is_steady(&self) -> bool {
        self.is_ready() && !self.is_due
    }

    /// Tells whether the drive is wanted and reported as enabled.
    pub(super) fn is_confirmed(&self) -> bool {
        self.on && self.seen == Some(true)
    }

    fn turn(&mut self, on: bool, now: Instant) {
        *self = Self {
            on,
            seen: self.seen.map(|_| !on),
            is_confirmed: false,
            since: now,
            is_due: true,
            ..*self
        };
    }

    const fn tell(&mut self, now: Instant) {
        self.is_due = false;
        self.is_new = false;
        self.told = now;
    }

    fn pause(&self) -> Option<Duration> {
        match (self.on, self.seen) {
            (false, Some(true)) => Some(INSIST),
            (true, Some(false)) if !self.is_confirmed => Some(INSIST),
            (false, _) => Some(REMIND),
            (true, _) => None,
        }
    }
}

/// A reading of the angle, with the stamp of its feedback.
#[derive(Debug, Clone, Copy)]
pub(super) struct Reading {
    pub(super) angle: Angle,
    pub(super) velocity: AngularVelocity,
    pub(super) at: u32,
}

impl Reading {
    /// Returns the largest way in rad of the shaft to a later reading, at the larger of both velocities.
    pub(super) fn furthest(&self, later: &Self, gap_s: f32) -> f32 {
        let (one, other) = (self.velocity.as_rad_per_s(), later.velocity.as_rad_per_s());
        // A velocity that is no number counts as none.
        let fastest = one.abs().max(other.abs()).max(0.0);
        0.25 + furthest(gap_s, fastest, (0.0, 0.0))
    }

    pub(super) fn gap_s(&self, later: &Self) -> f32 {
        later.at.wrapping_sub(self.at) as f32 * 1e-6
    }
}
