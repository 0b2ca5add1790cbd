//! Questions in the place of commands, for drives with an answer to each frame.

/// Each so many commands the questions begin anew: 32 ms at 1 kHz.
const ROUND: u8 = 32;

/// The order of commands and questions. The drive goes on with the command before while answering a question, so a new command
/// goes first, once.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Questions<C> {
    /// The place within the round.
    place: u8,
    /// The last command that was no question.
    last: C,
    /// A question has waited for a new command.
    has_waited: bool,
}

impl<C: Copy + PartialEq> Questions<C> {
    /// Takes the command of a drive at rest.
    pub(crate) const fn new(rest: C) -> Self {
        Self { place: 1, last: rest, has_waited: false }
    }

    /// Returns a command, or the question due in its place.
    pub(crate) fn next(&mut self, command: C, due: impl FnOnce(u8) -> Option<C>) -> C {
        let due = due(self.place);
        let question = due.filter(|_| self.has_waited || command == self.last);
        self.has_waited = question.is_none() && due.is_some();
        if !self.has_waited {
            self.place = (self.place + 1) % ROUND;
        }
        self.last = question.map_or(command, |_| self.last);
        question.unwrap_or(command)
    }
}
