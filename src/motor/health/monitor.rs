use super::frozen::Frozen;
use super::runaway::Runaway;
use super::{Condition, HealthConfig, Latch, stall, thermal};

/// A longer pause between two looks counts as this long, in units of 1.024 ms: what lay between was not seen.
const LONGEST_LOOK: u16 = 128;

/// For how long something holds, in units of 1.024 ms; saturates.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Timer(u16);

impl Timer {
    pub(super) const ZERO: Self = Self(0);

    /// Goes on while it holds, and starts anew when it does not.
    pub(super) const fn run(&mut self, holds: bool, elapsed: u16) -> u16 {
        self.0 = if holds { self.0.saturating_add(elapsed) } else { 0 };
        self.0
    }
}

/// What a look at a motor finds, in the direction of its rotor.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Sample {
    /// Time since the look before, in units of 1.024 ms; see [`Monitor::elapsed`].
    pub(crate) elapsed: u16,
    /// Whether a frame came since.
    pub(crate) fresh: bool,
    /// The command that was sent, as a share of the motor's limit.
    pub(crate) effort: f32,
    /// The reported speed, as a share of that without load.
    pub(crate) speed: f32,
    /// The reported current, as a share of its full scale; 0 when it is not known.
    pub(crate) current: f32,
    /// Rotor angle, as it was reported.
    pub(crate) angle: u16,
    /// Anything that changes with the rest of the feedback.
    pub(crate) rest: u16,
    /// What the motor reports, and at which temperatures it gets warm and hot.
    pub(crate) temperature: Option<(i16, (i16, i16))>,
}

impl Sample {
    #[cfg(test)]
    pub(super) const AT_REST: Self = Self {
        elapsed: 0,
        fresh: true,
        effort: 0.0,
        speed: 0.0,
        current: 0.0,
        angle: 0,
        rest: 0,
        temperature: None,
    };
}

/// The slow checks of one motor: everything that need not be looked at in every tick.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Monitor {
    looked: u16,
    stall: Timer,
    runaway: Runaway,
    frozen: Frozen,
}

impl Monitor {
    pub(crate) const NEW: Self =
        Self { looked: 0, stall: Timer::ZERO, runaway: Runaway::NONE, frozen: Frozen::NONE };

    /// Returns the time since the look before in units of 1.024 ms, and notes this one.
    #[expect(clippy::cast_possible_truncation, reason = "a wrapping difference of up to 67 s")]
    pub(crate) const fn elapsed(&mut self, now_stamp: u32) -> u16 {
        let now = (now_stamp >> 10) as u16;
        let elapsed = now.wrapping_sub(self.looked);
        self.looked = now;
        if elapsed < LONGEST_LOOK { elapsed } else { LONGEST_LOOK }
    }

    /// Forgets what was seen: the motor was not heard, or is about to start.
    pub(crate) const fn start(&mut self) {
        *self = Self { looked: self.looked, ..Self::NEW };
    }

    /// Looks at the motor and returns the share of the output that it is left with.
    pub(crate) fn look(
        &mut self,
        latch: &mut Latch,
        sample: &Sample,
        config: &HealthConfig,
    ) -> f32 {
        let mut share = 1.0;
        if let Some((celsius, (warning, limit))) = sample.temperature {
            let warning = if config.ignores(Condition::Warm) { limit } else { warning };
            let limit = if config.ignores(Condition::Hot) { i16::MAX } else { limit };
            share = thermal::check(latch, celsius, warning, limit);
        }
        if !config.ignores(Condition::Stalled) {
            share = share.min(stall::check(&mut self.stall, latch, sample, config));
        }
        if !config.ignores(Condition::Runaway) {
            self.runaway.check(latch, sample);
        }
        if !config.ignores(Condition::Frozen) {
            self.frozen.check(latch, sample);
        }
        if !config.ignores(Condition::Overspeed) {
            latch.set(Condition::Overspeed, sample.speed.abs() > 2.0);
        }
        share
    }
}
