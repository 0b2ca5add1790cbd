//! The dialogue with a drive about its settings.

use crate::error::ConfigError;
use crate::motor::{MotorName, WrongSetting};
use crate::time::Duration;

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
/// While the application has a question, each second question is the application's. A read or a write is repeated until the drive
/// answers; a store is sent once.
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
    /// The setting written on the way to an enabled drive, still to be read back.
    preparing: Option<Preparation<R>>,
    /// How many preparations the drive has confirmed.
    prepared: u8,
    /// The next frame about a setting written by the application is a read.
    is_written: bool,
}

/// A setting written and read back each time before a drive is enabled. The drive confirms the setting by a value from `least` to `value`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Preparation<R> {
    pub(crate) setting: R,
    pub(crate) value: f32,
    pub(crate) least: f32,
}

impl<R> Preparation<R> {
    /// The drive has to have this value.
    pub(crate) const fn exact(setting: R, value: f32) -> Self {
        Self { setting, value, least: value }
    }

    /// The drive may have a lower limit of its own.
    pub(crate) const fn limit(setting: R, value: f32) -> Self {
        Self { setting, value, least: 0.0 }
    }
}

impl<R: Copy + PartialEq, const N: usize> Settings<R, N> {
    /// Takes the settings to be compared with the configuration; all values are unknown.
    #[must_use]
    pub const fn new(checked: [R; N]) -> Self {
        Self {
            checked,
            found: [None; N],
            turn: 0,
            asked: None,
            request: None,
            answer: None,
            preparing: None,
            prepared: 0,
            is_written: false,
        }
    }

    /// Forgets all values: the drive was away. Requests of the application stay.
    pub const fn forget(&mut self) {
        self.found = [None; N];
        self.asked = None;
        self.prepare_anew();
    }

    /// Forgets the confirmations of the drive on the way to be enabled.
    pub(crate) const fn prepare_anew(&mut self) {
        (self.preparing, self.prepared, self.is_written) = (None, 0, false);
    }

    /// Returns the next question on the way to an enabled drive: for unknown values, then for each preparation, written and read back.
    /// `None` when the drive is ready to be enabled; then [`forget`](Self::forget), for the drive may lose its supply until the next time.
    pub(crate) fn prepare(
        &mut self,
        preparations: impl IntoIterator<Item = Preparation<R>>,
    ) -> Option<Inquiry<R>> {
        if let Some(unknown) = self.complete() {
            return Some(unknown);
        }
        if let Some(written) = self.preparing {
            return Some(self.ask(Inquiry::Read(written.setting)));
        }
        self.preparing = preparations.into_iter().nth(self.prepared.into());
        let Preparation { setting, value, .. } = self.preparing?;
        Some(self.ask(Inquiry::Write(setting, value)))
    }

    /// Turns each second write of a setting into a question for the setting: for drives without an answer to a write.
    pub(crate) fn reading_back(&mut self, inquiry: Inquiry<R>) -> Inquiry<R> {
        let Inquiry::Write(setting, _) = inquiry else { return inquiry };
        self.is_written = !self.is_written;
        if self.is_written { inquiry } else { Inquiry::Read(setting) }
    }

    /// Returns the question whose answer is awaited, if about this setting.
    pub(crate) fn awaited(&self, setting: R) -> Option<Inquiry<R>> {
        self.asked.filter(|asked| match asked {
            Inquiry::Read(awaited) | Inquiry::Write(awaited, _) => *awaited == setting,
            Inquiry::Store => false,
        })
    }

    /// Takes a question of the application, in the place of a waiting question.
    pub const fn request(&mut self, inquiry: Inquiry<R>) {
        self.request = Some(inquiry);
    }

    /// Returns the last answer to a question of the application.
    #[must_use]
    pub const fn answer(&self) -> Option<(R, f32)> {
        self.answer
    }

    /// Returns a question for an unknown value, and awaits the answer; `None` if all values are known.
    pub fn complete(&mut self) -> Option<Inquiry<R>> {
        let index = self.found.iter().position(Option::is_none)?;
        let setting = *self.checked.get(index)?;
        Some(self.ask(Inquiry::Read(setting)))
    }

    /// Returns the next question: for unknown values, then for each value in turn.
    pub fn inquire(&mut self) -> Option<Inquiry<R>> {
        (self.preparing, self.prepared) = (None, 0);
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

    /// Notes and returns a question with an awaited answer.
    pub const fn ask(&mut self, inquiry: Inquiry<R>) -> Inquiry<R> {
        self.asked = Some(inquiry);
        inquiry
    }

    /// Returns the value of a compared setting; `None` if unknown.
    pub(crate) fn found(&self, setting: R) -> Option<f32> {
        let place = self.checked.iter().position(|checked| *checked == setting)?;
        *self.found.get(place)?
    }

    /// Returns the question whose answer is awaited.
    #[must_use]
    pub const fn asked(&self) -> Option<Inquiry<R>> {
        self.asked
    }

    /// Takes the value in the answer to a question; `false` if the answer is not awaited.
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
        if let (Some(written), Inquiry::Read(_)) = (self.preparing, inquiry)
            && written.setting == setting
        {
            self.preparing = None;
            self.prepared += u8::from((written.least..=written.value).contains(&value));
        }
        if self.request == Some(inquiry) {
            (self.request, self.answer) = (None, Some((setting, value)));
        }
        true
    }

    /// Returns the first wrong or unknown setting of a motor. `expected` has the name and the value of each.
    pub(crate) fn wrong_setting(
        &self,
        motor: MotorName,
        is_right: impl Fn(R, f32) -> bool,
        expected: impl Fn(R) -> (&'static str, f32),
    ) -> Option<WrongSetting> {
        let (wrong, found) = self.wrong(is_right)?;
        let (setting, expected) = expected(wrong);
        Some(WrongSetting { motor, setting, expected, found })
    }

    /// Returns the first wrong or unknown setting, with its value in the drive.
    pub fn wrong(&self, is_right: impl Fn(R, f32) -> bool) -> Option<(R, Option<f32>)> {
        let settings = self.checked.iter().copied().zip(self.found);
        settings
            .into_iter()
            .find(|(setting, found)| found.is_none_or(|found| !is_right(*setting, found)))
    }
}

/// The time without a command after which a drive stops by itself, in units of 50 µs: 100 ms at first.
#[derive(Debug, Clone, Copy)]
pub(crate) struct TimeoutUnits(u32);

impl TimeoutUnits {
    const UNIT_US: u32 = 50;

    pub(crate) const USUAL: Self = Self(100_000 / Self::UNIT_US);

    /// # Errors
    /// [`ConfigError::Range`] for less than 1 ms, and for more than so many µs.
    pub(crate) fn new(timeout: Duration, most_us: u32) -> Result<Self, ConfigError> {
        let micros = timeout.micros_u32();
        let micros = ConfigError::check_micros("time-out in us", micros, 1_000, most_us)?;
        Ok(Self(micros / Self::UNIT_US))
    }

    pub(crate) const fn value(self) -> f32 {
        self.0 as f32
    }
}
