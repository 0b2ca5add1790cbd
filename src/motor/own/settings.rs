//! The dialogue with a drive about its settings.

/// A question to a drive about a setting, `R` by the protocol's own name.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Inquiry<R> {
    /// For the value.
    Read(R),
    /// To take a value, until the supply is lost.
    Write(R, f32),
    /// To keep all values over a loss of the supply.
    Store,
}

/// The known settings of a drive, and the order of questions about them. `N` settings have to be as configured.
///
/// While the application has a question, each second question is that one. A read or a write is repeated until the drive answers; a
/// store is sent once.
///
/// # Examples
/// ```
/// use drivetrain::motor::{Inquiry, Settings};
///
/// let mut settings = Settings::new(["mode", "range"]);
/// assert_eq!(settings.inquire(), Some(Inquiry::Read("mode")));
/// assert!(settings.take(Inquiry::Read("mode"), 2.0) && !settings.take(Inquiry::Read("range"), 1.0));
/// assert_eq!(settings.inquire(), Some(Inquiry::Read("range")));
/// let is_right = |name: &str, value: f32| name == "mode" && value == 1.0;
/// assert_eq!(settings.wrong(is_right), Some(("mode", Some(2.0))));
/// ```
#[derive(Debug, Clone, Copy)]
pub struct Settings<R, const N: usize> {
    checked: [R; N],
    found: [Option<f32>; N],
    turn: u8,
    asked: Option<Inquiry<R>>,
    request: Option<Inquiry<R>>,
    answer: Option<(R, f32)>,
}

impl<R: Copy + PartialEq, const N: usize> Settings<R, N> {
    /// Takes the settings that have to be as configured; none is known.
    #[must_use]
    pub const fn new(checked: [R; N]) -> Self {
        Self { checked, found: [None; N], turn: 0, asked: None, request: None, answer: None }
    }

    /// Forgets all values: the drive was away. What the application asks for stays.
    pub const fn forget(&mut self) {
        self.found = [None; N];
        self.asked = None;
    }

    /// Takes a question of the application, in the place of one that waits.
    pub const fn request(&mut self, inquiry: Inquiry<R>) {
        self.request = Some(inquiry);
    }

    /// Returns the last answer to a question of the application.
    #[must_use]
    pub const fn answer(&self) -> Option<(R, f32)> {
        self.answer
    }

    /// Returns a question for a value that is not known, and awaits the answer; `None` when all are.
    pub fn complete(&mut self) -> Option<Inquiry<R>> {
        let index = self.found.iter().position(Option::is_none)?;
        let setting = *self.checked.get(index)?;
        Some(self.ask(Inquiry::Read(setting)))
    }

    /// Returns the next question: for what is not known, then for each value in turn.
    pub fn inquire(&mut self) -> Option<Inquiry<R>> {
        let turn = usize::from(self.turn);
        self.turn = self.turn.wrapping_add(1);
        if let (Some(request), false) = (self.request, turn.is_multiple_of(2)) {
            if request == Inquiry::Store {
                self.request = None;
            }
            return Some(self.ask(request));
        }
        if let Some(unknown) = self.complete() {
            return Some(unknown);
        }
        let index = (turn / 2).checked_rem(N)?;
        let setting = *self.checked.get(index)?;
        Some(self.ask(Inquiry::Read(setting)))
    }

    /// Notes a question whose answer is awaited, and returns it.
    pub const fn ask(&mut self, inquiry: Inquiry<R>) -> Inquiry<R> {
        self.asked = Some(inquiry);
        inquiry
    }

    /// Returns the question whose answer is awaited.
    #[must_use]
    pub const fn asked(&self) -> Option<Inquiry<R>> {
        self.asked
    }

    /// Takes the value that a drive answers to a question; `false` if that one is not awaited.
    pub fn take(&mut self, inquiry: Inquiry<R>, value: f32) -> bool {
        let (Inquiry::Read(setting) | Inquiry::Write(setting, _)) = inquiry else { return false };
        if self.asked != Some(inquiry) {
            return false;
        }
        self.asked = None;
        for (checked, found) in self.checked.iter().zip(&mut self.found) {
            if *checked == setting {
                *found = Some(value);
            }
        }
        if self.request == Some(inquiry) {
            (self.request, self.answer) = (None, Some((setting, value)));
        }
        true
    }

    /// Returns the first setting that is not right or not known, with its value in the drive.
    pub fn wrong(&self, is_right: impl Fn(R, f32) -> bool) -> Option<(R, Option<f32>)> {
        let settings = self.checked.iter().copied().zip(self.found);
        settings
            .into_iter()
            .find(|(setting, found)| found.is_none_or(|found| !is_right(*setting, found)))
    }
}
