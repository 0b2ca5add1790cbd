//! Frames in the place of commands: questions to a drive with an answer to each frame, and limits that a drive is told.

/// Each so many commands the questions begin anew: 32 ms at 1 kHz.
const ROUND: u8 = 32;

/// The order of commands and questions. The drive goes on with the command before while answering a question, so a new command
/// goes first, once.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Questions<C> {
    /// The place within the round.
    place: u8,
    /// The last command that was no question; `None` if not sent, so that the drive goes on with one before.
    last: Option<C>,
    /// A question has waited for a new command.
    has_waited: bool,
}

impl<C: Copy + PartialEq> Questions<C> {
    /// Takes the command of a drive at rest.
    pub(crate) const fn new(rest: C) -> Self {
        Self { place: 1, last: Some(rest), has_waited: false }
    }

    /// Returns a command, or the question due in its place.
    pub(crate) fn next(&mut self, command: C, due: impl FnOnce(u8) -> Option<C>) -> C {
        let due = due(self.place);
        let question = due.filter(|_| self.has_waited || self.last == Some(command));
        self.has_waited = question.is_none() && due.is_some();
        if !self.has_waited {
            self.place = (self.place + 1) % ROUND;
        }
        if question.is_none() {
            self.last = Some(command);
        }
        question.unwrap_or(command)
    }

    /// A frame was not sent: the next command goes first, also before a question that has waited.
    pub(crate) const fn unsent(&mut self) {
        (self.last, self.has_waited) = (None, false);
    }
}

/// The share of a limit, sent to a drive between commands: on a change with every second command at most, and again after so many, for
/// a frame may be lost.
#[derive(Debug, Default, Clone, Copy)]
pub(crate) struct Told {
    share: f32,
    /// Commands since then.
    since: u8,
}

impl Told {
    /// Steps of the share, one at least unless the share is zero: coarse for a drive whose commands shall rarely give way to limits.
    pub(crate) const COARSE: f32 = 16.0;
    pub(crate) const FINE: f32 = 4_096.0;

    /// The drive was told zero, or one step, before the first command.
    pub(crate) const ZERO: Self = Self { share: 0.0, since: 1 };

    /// Counts a command, and returns the share that takes its place, in whole steps.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
    pub(crate) fn due(&mut self, share: f32, steps: f32, period: u8) -> Option<f32> {
        self.since = self.since.saturating_add(1);
        let whole = ((share.min(1.0) * steps) as u16).max(u16::from(share > 0.0));
        let share = f32::from(whole) / steps;
        let has_changed = share.to_bits() != self.share.to_bits();
        let is_due = self.since > if has_changed { 1 } else { period };
        if is_due {
            *self = Self { share, since: 0 };
        }
        is_due.then_some(share)
    }

    pub(crate) const fn share(self) -> f32 {
        self.share
    }

    /// Returns how many commands were counted since the drive was told.
    pub(crate) const fn since(self) -> u8 {
        self.since
    }

    /// The frame was not sent, and is due.
    pub(crate) const fn repeat(&mut self) {
        self.since = u8::MAX;
    }
}
