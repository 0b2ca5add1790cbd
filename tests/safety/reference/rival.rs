//! Another controller that sends the command of a motor: the last of its frames, and how long it counts.

use super::{Arming, REPEATS_US, Reference};
use drivetrain::motor::{Condition, Reaction};

/// After so long without a frame, the other controller is gone.
const WINDOW_US: u64 = 1_000_000;

/// When the condition begins and ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Rivals {
    /// It begins with the frame, and ends at the motor's turn: each twelfth update of a bus.
    AtTurn,
    /// It begins and ends with an update.
    AtUpdate,
    /// It begins with the frame, and ends with an update.
    AtFrame,
    /// No frame commands the motor.
    Never,
}

#[derive(Debug, Clone, Copy)]
pub(super) struct Rival {
    pub(super) rule: Rivals,
    pub(super) reaction: Reaction,
    /// All of its frames.
    pub(super) frames: u32,
    last: Option<u64>,
}

impl Rival {
    pub(super) fn new(rule: Rivals, reaction: Reaction) -> Self {
        // A joint has no choice.
        let reaction = if rule == Rivals::AtFrame { Reaction::Report } else { reaction };
        Self { rule, reaction, frames: 0, last: None }
    }

    /// Tells whether the frame is looked at.
    pub(super) fn hear(&mut self, now: u64) -> bool {
        self.frames += 1;
        let counts = self.reaction != Reaction::Ignore;
        if counts {
            self.last = Some(now);
        }
        counts
    }

    /// A frame may be stamped a little ahead of the update. A time further ahead belongs to the clock before it was set back.
    pub(super) fn forget(&mut self, now: u64) {
        let is_near = |last: &u64| match self.rule {
            // A clock that is wrong by the range of a 32-bit stamp goes unnoticed on a bus.
            Rivals::AtTurn => {
                now.wrapping_sub(*last).wrapping_add(WINDOW_US) % REPEATS_US <= 2 * WINDOW_US
            }
            _ => now.abs_diff(*last) <= WINDOW_US,
        };
        self.last = self.last.filter(is_near);
    }

    pub(super) fn is_present(&self) -> bool {
        self.last.is_some()
    }
}

/// A second master.
impl Reference {
    pub(crate) fn has_rival(&self) -> bool {
        match self.rival.rule {
            Rivals::AtTurn => self.edges.has(Condition::SecondMaster),
            Rivals::AtUpdate | Rivals::AtFrame | Rivals::Never => self.rival.is_present(),
        }
    }

    pub(crate) fn rival_frames(&self) -> u32 {
        self.rival.frames
    }

    /// Takes a command of this motor that another controller has sent.
    pub(crate) fn hear_rival(&mut self, now: u64) {
        self.edges.begin_call();
        if self.rival.hear(now) && self.rival.rule != Rivals::AtUpdate {
            self.note_rival(true, now);
        }
    }

    pub(crate) fn look_for_rival(&mut self, now: u64) {
        self.rival.forget(now);
        self.note_rival(self.rival.is_present(), now);
    }

    pub(crate) fn note_rival(&mut self, is_present: bool, now: u64) {
        let begins = is_present && !self.edges.has(Condition::SecondMaster);
        self.edges.set(Condition::SecondMaster, is_present, now);
        if begins && self.rival.reaction == Reaction::Relax {
            self.fall_to(Arming::Tripped);
        }
    }
}
