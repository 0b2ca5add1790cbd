//! The share of the output that is open, in 64-bit times and 64-bit numbers.

use super::{Bounds, Reference};
use drivetrain::time::Duration;

/// Effect of the open share on a target, which is itself a share of the full output.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Opens {
    /// The target is cut off at it.
    Clamps,
    /// The target is multiplied by it: a velocity, or the way to an angle.
    Scales,
    /// The target is far above any limit, so the output is the share.
    Fills,
    /// The loops are in the drive, which has no such limit.
    Never,
}

#[derive(Debug, Clone, Copy)]
pub(super) struct Opening {
    whole_us: u64,
    /// Since when it opens; it is open before the first time, and once it was.
    began: Option<u64>,
}

impl Opening {
    /// In whole milliseconds.
    pub(super) fn new(time: Duration) -> Self {
        Self { whole_us: time.as_micros() / 1_000 * 1_000, began: None }
    }

    pub(super) fn begin(&mut self, now: u64) {
        self.began = (self.whole_us > 0).then_some(now);
    }

    /// Takes the later beginning.
    pub(super) fn since(self, now: u64) -> Self {
        let began = self.began.map_or(now, |began| began.max(now));
        Self { began: (self.whole_us > 0).then_some(began), ..self }
    }

    pub(super) fn share(&mut self, now: u64) -> f64 {
        let Some(began) = self.began else { return 1.0 };
        let share = now.saturating_sub(began) as f64 / self.whole_us as f64;
        if share >= 1.0 {
            self.began = None;
        }
        share.min(1.0)
    }
}

impl Opens {
    /// The output for a target under a share.
    pub(super) fn output(self, target: f64, share: f64) -> f64 {
        match self {
            Self::Clamps => target.min(share),
            Self::Scales => target * share,
            Self::Fills => share,
            Self::Never => 1.0,
        }
    }
}

/// The share of the output.
impl Reference {
    /// The output opens from now on.
    pub(crate) fn open(&mut self, now: u64) {
        self.opening.begin(now);
        self.share = self.opening.share(now);
    }

    /// Tells whether less than the whole output is open.
    pub(crate) fn is_opening(&self) -> bool {
        self.rules.opens != Opens::Never && self.share < 1.0
    }

    pub(crate) fn predict(&mut self, now: u64) -> Bounds {
        let opens = self.rules.opens;
        if core::mem::take(&mut self.has_rested) && self.rules.opens_again {
            self.opening.begin(now);
        }
        if !self.rules.takes_turns {
            self.share = self.opening.share(now);
        }
        let share = self.share;
        let most = opens.output(self.value, share);
        let before = core::mem::replace(&mut self.commanded, now);
        if !self.rules.is_prepared {
            return Bounds { least: most, most };
        }
        // A question may take the place of the command, and its drive may be enabled later than the reference can tell.
        let least = self.opening.since(self.rested).share(before);
        let least = opens.output(self.value, least).min(most);
        Bounds { least: if self.is_resting { 0.0 } else { least }, most }
    }

    /// Takes the output of an update; returns whether the motor is driven again after a rest, without another arming. A drive at rest
    /// that might be driven was not enabled yet: its output opens anew.
    pub(crate) fn note(
        &mut self,
        now: u64,
        output: f64,
        predicted: Option<Bounds>,
        has_step: bool,
    ) -> bool {
        let was_resting = core::mem::replace(&mut self.is_resting, output == 0.0);
        let is_again = self.was_driven && was_resting && !self.is_resting;
        self.was_driven |= !self.is_resting;
        if !self.rules.is_prepared || !self.is_resting {
            return is_again;
        }
        self.rested = now;
        let was_asked = predicted.is_some_and(|bounds| bounds.most > 2.0 * self.rules.resolution);
        if was_asked && has_step {
            self.opening.begin(now);
        }
        is_again
    }

    /// Takes an update without a command: a question took its place. The drive goes on as before.
    pub(crate) fn miss(&mut self, now: u64) {
        if self.is_resting {
            self.rested = now;
        }
    }

    /// Tells whether the output may be this one, after [`update`](Self::update).
    pub(crate) fn allows(&self, output: f64, Bounds { least, most }: Bounds) -> bool {
        let slack = self.rules.resolution;
        let may_rest = self.rules.is_prepared && self.is_resting && output == 0.0;
        may_rest || least - slack <= output && output <= most + slack
    }
}
