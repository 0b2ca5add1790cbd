use super::frozen::Frozen;
use super::runaway::Runaway;
use super::{Condition, HealthConfig, Latch, stall, thermal};

/// Returns a time between two looks as the checks take it.
pub(crate) fn elapsed(micros: Option<u32>) -> u8 {
    const LONGEST: u8 = 128;
    let units = micros.and_then(|micros| u8::try_from(micros >> 10).ok());
    units.map_or(LONGEST, |units| units.min(LONGEST))
}

/// For how long something holds, in units of 1.024 ms; saturates.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Timer(u16);

impl Timer {
    pub(super) const ZERO: Self = Self(0);

    /// Goes on while it holds, and starts anew when it does not.
    pub(super) const fn run(&mut self, holds: bool, elapsed: u8) -> u16 {
        self.0 = if holds { self.0.saturating_add(elapsed as u16) } else { 0 };
        self.0
    }
}

/// What a look at a motor finds, in the direction of its rotor.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Sample {
    /// Time since the look before, in units of 1.024 ms: at most 128, because what lay between was not seen.
    pub(crate) elapsed: u8,
    /// Whether a frame came since.
    pub(crate) fresh: bool,
    /// The command that was sent, as a share of the motor's limit.
    pub(crate) effort: f32,
    /// The reported speed, as a share of that without load.
    pub(crate) speed: f32,
    /// The reported current, as a share of its full scale; 0 when it is not known.
    pub(crate) current: f32,
    /// The command that was sent in a coarse unit of its own, and the change of it that a current has to follow.
    pub(crate) word: i8,
    pub(crate) word_change: u8,
    /// Rotor angle, as it was reported.
    pub(crate) angle: u16,
    /// Anything that changes with the current; its upper three bits count.
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
        word: 0,
        word_change: 20,
        angle: 0,
        rest: 0,
        temperature: None,
    };
}

/// The slow checks of one motor: everything that need not be looked at in every tick.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Monitor {
    stall: Timer,
    runaway: Runaway,
    frozen: Frozen,
    error_heard: bool,
}

impl Monitor {
    pub(crate) const NEW: Self = Self {
        stall: Timer::ZERO,
        runaway: Runaway::NONE,
        frozen: Frozen::NONE,
        error_heard: false,
    };

    /// As [`look`](Self::look), for a motor that is moderately driven and cool; `false` when its angle did not move, and
    /// has to be looked at.
    #[inline]
    pub(crate) const fn glance(&mut self, angle: u16, word: i8) -> bool {
        let moved = self.frozen.has_moved(angle);
        if moved {
            self.stall = Timer::ZERO;
            self.runaway = Runaway::NONE;
            self.frozen.follow(angle, word);
        }
        moved
    }

    /// What ends where a motor is armed, so that it begins again, and relaxes again, if it still holds.
    pub(crate) const NOTICED_ANEW: [Condition; 3] =
        [Condition::Runaway, Condition::Stalled, Condition::Overspeed];

    /// An error code came.
    pub(crate) const fn hear_error(&mut self) {
        self.error_heard = true;
    }

    /// Tells whether an error code came since this was asked last.
    pub(crate) const fn take_error(&mut self) -> bool {
        core::mem::replace(&mut self.error_heard, false)
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
            let warning = (!config.ignores(Condition::Warm)).then_some(warning);
            let limit = (!config.ignores(Condition::Hot)).then_some(limit);
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
