//! The dialogue with a drive before it is driven: its settings, and what it has to confirm.

use super::{Command, Register};
use crate::motor::{Inquiry, Settings};

/// Whose turn it is. A drive answers a write with its feedback, so what it took is read back.
#[derive(Debug, Clone, Copy)]
pub(super) struct Setup {
    pub(super) settings: Settings<Register, 3>,
    /// A command that waits for the drive to rest.
    pub(super) once: Option<Command>,
    /// How many of the preparations the drive has confirmed since it was to be enabled.
    pub(super) prepared: usize,
    /// The next frame about the same parameter reads it.
    is_written: bool,
    turn: u8,
}

impl Setup {
    pub(super) const fn new(checked: [Register; 3]) -> Self {
        let settings = Settings::new(checked);
        Self { settings, once: None, prepared: 0, is_written: false, turn: 0 }
    }

    pub(super) const fn prepare_anew(&mut self) {
        (self.prepared, self.is_written) = (0, false);
    }

    fn ask(&mut self, inquiry: Inquiry<Register>) -> Command {
        match self.settings.ask(inquiry) {
            Inquiry::Write(register, value) if !self.is_written => {
                self.is_written = true;
                Command::Write(register, value)
            }
            Inquiry::Write(register, _) => {
                self.is_written = false;
                Command::Read(register)
            }
            Inquiry::Read(register) => Command::Read(register),
            Inquiry::Store => Command::Store,
        }
    }

    /// Returns what a disabled drive is asked or told. Every fourth time that is its run mode, where it has another one: a drive starts
    /// in the operation mode.
    pub(super) fn inquire(&mut self, run_mode: Option<f32>) -> Option<Command> {
        self.prepared = 0;
        if let Some(command) = self.once.take() {
            self.settings.forget();
            return Some(command);
        }
        self.turn = self.turn.wrapping_add(1);
        if let (Some(number), true) = (run_mode, self.turn.is_multiple_of(4)) {
            return Some(Command::Write(Register::RunMode, number));
        }
        self.settings.inquire().map(|inquiry| self.ask(inquiry))
    }

    /// Returns the next frame on the way to an enabled drive: a question for what is not known, then a preparation, written and read
    /// back, at last the one that enables. After that all of it is due anew.
    pub(super) fn next(&mut self, preparation: Option<(Register, f32)>) -> Command {
        if let Some(unknown) = self.settings.complete() {
            return self.ask(unknown);
        }
        let Some((register, value)) = preparation else {
            self.prepare_anew();
            self.settings.forget();
            return Command::Enable;
        };
        if self.is_written {
            return self.ask(Inquiry::Read(register));
        }
        self.is_written = true;
        Command::Write(register, value)
    }

    /// Takes a value from the drive. It confirms a preparation if it is what was written; a limit may be lower, for a drive may know one
    /// of its own, but not a time-out, whose 0 is none.
    pub(super) fn take(
        &mut self,
        register: Register,
        value: f32,
        preparation: Option<(Register, f32)>,
    ) {
        let asked = match self.settings.asked() {
            Some(asked @ (Inquiry::Read(wanted) | Inquiry::Write(wanted, _)))
                if wanted == register =>
            {
                asked
            }
            _ => return,
        };
        self.settings.take(asked, value);
        let preparation = preparation.filter(|(wanted, _)| *wanted == register && self.is_written);
        if let (Some((_, wanted)), Inquiry::Read(_)) = (preparation, asked) {
            self.is_written = false;
            let is_lower = register != Register::Timeout && value >= 0.0 && value < wanted;
            self.prepared += usize::from(is_lower || value.to_bits() == wanted.to_bits());
        }
    }
}
