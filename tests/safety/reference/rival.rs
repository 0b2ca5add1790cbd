//! Another controller that sends the command of a motor: the last of its frames, and how long it counts.

use super::{Arming, REPEATS_US, Reference};
use drivetrain::motor::{Condition, Reaction};

/// After so long without a frame, the other controller is gone.
const WINDOW_US: u64 = 1_000_000;

/// What a frame of another controller does.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Rivals {
    /// As the configuration of the motor says.
    Configured,
    /// It is reported: a joint has no choice.
    Reported,
    /// No frame commands the motor.
    Never,
}

#[derive(Debug, Clone, Copy)]
pub(super) struct Rival {
    reaction: Reaction,
    /// All of its frames.
    frames: u32,
    last: Option<u64>,
}

impl Rival {
    pub(super) fn new(rule: Rivals, configured: Reaction) -> Self {
        let reaction = if rule == Rivals::Reported { Reaction::Report } else { configured };
        Self { reaction, frames: 0, last: None }
    }

    /// A frame may be stamped a little ahead of the update. A time further ahead belongs to the clock before it was set back; one that is
    /// wrong by the range of a 32-bit stamp goes unnoticed.
    fn is_gone(&self, now: u64) -> bool {
        let is_near = |last: u64| {
            now.wrapping_sub(last).wrapping_add(WINDOW_US) % REPEATS_US <= 2 * WINDOW_US
        };
        !self.last.is_some_and(is_near)
    }
}

/// A second master.
impl Reference {
    pub(crate) fn has_rival(&self) -> bool {
        self.edges.has(Condition::SecondMaster)
    }

    pub(crate) fn rival_frames(&self) -> u32 {
        self.rival.frames
    }

    /// Takes a command of this motor that another controller has sent.
    pub(crate) fn hear_rival(&mut self, now: u64) {
        self.edges.begin_call();
        self.rival.frames += 1;
        if self.rival.reaction == Reaction::Ignore {
            return;
        }
        self.rival.last = Some(now);
        let begins = !self.has_rival();
        self.edges.set(Condition::SecondMaster, true, now);
        if begins && self.rival.reaction == Reaction::Relax {
            self.fall_to(Arming::Tripped);
        }
    }

    pub(super) fn look_for_rival(&mut self, now: u64) {
        if self.rival.is_gone(now) {
            self.rival.last = None;
            self.edges.set(Condition::SecondMaster, false, now);
        }
    }
}
