//! The dialogue with a drive about its settings.

use crate::error::ConfigError;
use crate::motor::{MotorName, WrongSetting};
use crate::time::Duration;

/// A question to a drive about a setting, `R` by the protocol's own name.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub(crate) enum Inquiry<R> {
    /// For the value.
    Read(R),
    /// To take a value, until the supply is lost.
    Write(R, f32),
    /// To keep all values over a loss of the supply.
    Store,
}

impl<R> Inquiry<R> {
    /// Returns the setting; `None` for all of them.
    pub(crate) fn setting(self) -> Option<R> {
        match self {
            Self::Read(setting) | Self::Write(setting, _) => Some(setting),
            Self::Store => None,
        }
    }
}

/// The known settings of a drive, and the order of questions about them. `N` settings have to be as configured.
///
/// While the application has a question, each second question is the application's. A read or a write is repeated until the drive
/// answers; a store is sent once.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Settings<R, const N: usize> {
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
    /// How many frames were sent on the way to an enabled drive until the last answer that led on; `None` right after that answer.
    led_on: Option<u8>,
    missed: Option<Missed<R>>,
    /// The next frame about a setting written by the application is a read.
    is_written: bool,
}

/// Frames on the way to an enabled drive, a write and 8 reads, after which a setting that the drive does not confirm is named.
const PATIENCE: u8 = 9;

/// A setting that the drive did not confirm on the way to be enabled.
#[derive(Debug, Clone, Copy)]
struct Missed<R> {
    setting: R,
    /// The value written; `None` for a setting that is only read.
    written: Option<Preparation<R>>,
    /// NaN without an answer.
    found: f32,
}

/// A setting written and read back, or only read, each time before a drive is enabled. The drive confirms the setting by a value from
/// `least` to `value`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Preparation<R> {
    pub(crate) setting: R,
    pub(crate) value: f32,
    pub(crate) least: f32,
    is_written: bool,
}

impl<R> Preparation<R> {
    /// The drive has to have this value.
    pub(crate) const fn exact(setting: R, value: f32) -> Self {
        Self { setting, value, least: value, is_written: true }
    }

    /// The drive may have a lower limit of its own.
    pub(crate) const fn limit(setting: R, value: f32) -> Self {
        Self { setting, value, least: 0.0, is_written: true }
    }

    /// The drive has to have this value already.
    pub(crate) const fn found(setting: R, value: f32) -> Self {
        Self { setting, value, least: value, is_written: false }
    }

    fn is_confirmed_by(&self, value: f32) -> bool {
        (self.least..=self.value).contains(&value)
    }
}

impl<R: Copy + PartialEq, const N: usize> Settings<R, N> {
    /// Takes the settings to be compared with the configuration; all values are unknown.
    #[must_use]
    pub(crate) const fn new(checked: [R; N]) -> Self {
        Self {
            checked,
            found: [None; N],
            turn: 0,
            asked: None,
            request: None,
            answer: None,
            preparing: None,
            prepared: 0,
            led_on: None,
            missed: None,
            is_written: false,
        }
    }

    /// Forgets all values: the drive was away. Requests of the application stay.
    pub(crate) const fn forget(&mut self) {
        self.found = [None; N];
        (self.asked, self.missed) = (None, None);
        self.prepare_anew();
    }

    /// Forgets the confirmations of the drive on the way to be enabled.
    pub(crate) const fn prepare_anew(&mut self) {
        (self.preparing, self.prepared, self.is_written) = (None, 0, false);
        self.led_on = None;
    }

    /// Returns the next question on the way to an enabled drive: for unknown values, then for each preparation, written and read back.
    /// `None` when the drive is ready to be enabled; then [`forget`](Self::forget), for the drive may lose its supply until the next time.
    ///
    /// `sent` is how many frames were sent to enable the drive. If several frames do not lead on, the setting counts as not confirmed.
    pub(crate) fn prepare(
        &mut self,
        sent: u8,
        preparations: impl IntoIterator<Item = Preparation<R>>,
    ) -> Option<Inquiry<R>> {
        self.led_on.take_if(|_| sent == 0);
        let waits = sent.saturating_sub(*self.led_on.get_or_insert(sent)) >= PATIENCE;
        if let Some(setting) = self.unknown() {
            return Some(self.wait_for(setting, None, waits));
        }
        if let Some(written) = self.preparing {
            return Some(self.wait_for(written.setting, Some(written), waits));
        }
        self.preparing = preparations.into_iter().nth(self.prepared.into());
        let Preparation { setting, value, is_written, .. } = self.preparing?;
        Some(self.ask(if is_written {
            Inquiry::Write(setting, value)
        } else {
            Inquiry::Read(setting)
        }))
    }

    /// Asks for a setting, and notes a setting that was waited for long enough.
    fn wait_for(
        &mut self,
        setting: R,
        written: Option<Preparation<R>>,
        is_missed: bool,
    ) -> Inquiry<R> {
        if is_missed {
            let found = self.missed.filter(|missed| missed.setting == setting);
            let found = found.map_or(f32::NAN, |missed| missed.found);
            self.missed = Some(Missed { setting, written, found });
        }
        self.ask(Inquiry::Read(setting))
    }

    /// Turns each second write of a setting into a question for the setting: for drives without an answer to a write.
    pub(crate) fn reading_back(&mut self, inquiry: Inquiry<R>) -> Inquiry<R> {
        let Inquiry::Write(setting, _) = inquiry else { return inquiry };
        self.is_written = !self.is_written;
        if self.is_written { inquiry } else { Inquiry::Read(setting) }
    }

    /// Takes the value of a setting, if an answer about the setting is awaited.
    pub(crate) fn take_value(&mut self, setting: R, value: f32) {
        if let Some(asked) = self.asked.filter(|asked| asked.setting() == Some(setting)) {
            self.take(asked, value);
        }
    }

    /// Takes a question of the application, in the place of a waiting question.
    pub(crate) const fn request(&mut self, inquiry: Inquiry<R>) {
        self.request = Some(inquiry);
    }

    /// Returns the last answer to a question of the application.
    #[must_use]
    pub(crate) const fn answer(&self) -> Option<(R, f32)> {
        self.answer
    }

    /// Returns a question for an unknown value, and awaits the answer; `None` if all values are known.
    pub(crate) fn complete(&mut self) -> Option<Inquiry<R>> {
        let setting = self.unknown()?;
        Some(self.ask(Inquiry::Read(setting)))
    }

    fn unknown(&self) -> Option<R> {
        let index = self.found.iter().position(Option::is_none)?;
        self.checked.get(index).copied()
    }

    /// Returns the next question: for unknown values, then for each value in turn. Each second question is about a setting that the
    /// drive did not confirm, written and read by turns.
    pub(crate) fn inquire(&mut self) -> Option<Inquiry<R>> {
        (self.preparing, self.prepared) = (None, 0);
        let turn = usize::from(self.turn);
        self.turn = self.turn.wrapping_add(1);
        if let (Some(request), false) = (self.request, turn.is_multiple_of(2)) {
            if request == Inquiry::Store {
                self.request = None;
            }
            return Some(self.ask(request));
        }
        if let Some(Missed { setting, written: Some(written), .. }) = self.missed {
            if turn.is_multiple_of(2) {
                let is_written = turn.is_multiple_of(4);
                let write = Inquiry::Write(setting, written.value);
                return Some(self.ask(if is_written { write } else { Inquiry::Read(setting) }));
            }
        }
        if let Some(unknown) = self.complete() {
            return Some(unknown);
        }
        let index = (turn / 2).checked_rem(N)?;
        let setting = *self.checked.get(index)?;
        Some(self.ask(Inquiry::Read(setting)))
    }

    /// Notes and returns a question with an awaited answer.
    pub(crate) const fn ask(&mut self, inquiry: Inquiry<R>) -> Inquiry<R> {
        self.asked = Some(inquiry);
        inquiry
    }

    /// Returns the value of a compared setting; `None` if unknown.
    pub(crate) fn found(&self, setting: R) -> Option<f32> {
        let place = self.checked.iter().position(|checked| *checked == setting)?;
        *self.found.get(place)?
    }

    /// Tells whether the drive did not confirm a setting.
    pub(crate) const fn has_missed(&self) -> bool {
        self.missed.is_some()
    }

    /// Returns a question for the setting that the drive did not confirm, each second time. Nothing is written.
    pub(crate) fn inquire_missed(&mut self) -> Option<Inquiry<R>> {
        self.turn = self.turn.wrapping_add(1);
        let setting = self.missed.filter(|_| self.turn.is_multiple_of(2))?.setting;
        Some(self.ask(Inquiry::Read(setting)))
    }

    /// Takes the value that `read` finds in a frame, if the frame answers the question.
    #[cold]
    #[inline(never)]
    pub(crate) fn hear(&mut self, read: impl FnOnce(Inquiry<R>) -> Option<f32>) {
        if let Some(asked) = self.asked {
            if let Some(value) = read(asked) {
                self.take(asked, value);
            }
        }
    }

    /// Takes the value in the answer to a question; `false` if the answer is not awaited.
    pub(crate) fn take(&mut self, inquiry: Inquiry<R>, value: f32) -> bool {
        let Some(setting) = inquiry.setting() else { return false };
        if self.asked != Some(inquiry) {
            return false;
        }
        self.asked = None;
        for (checked, found) in self.checked.iter().zip(&mut self.found) {
            if *checked == setting {
                self.led_on.take_if(|_| found.is_none());
                *found = Some(value);
            }
        }
        let is_read = inquiry == Inquiry::Read(setting);
        if let Some(written) = self.preparing.filter(|it| is_read && it.setting == setting) {
            let is_confirmed = written.is_confirmed_by(value);
            self.preparing = None;
            self.prepared += u8::from(is_confirmed);
            self.led_on.take_if(|_| is_confirmed);
            if !is_confirmed && !written.is_written {
                self.missed = Some(Missed { setting, written: Some(written), found: value });
            }
        }
        if let Some(missed) = self.missed.as_mut().filter(|it| is_read && it.setting == setting) {
            missed.found = value;
            let is_wrong = missed.written.is_some_and(|it| !it.is_confirmed_by(value));
            self.missed.take_if(|_| !is_wrong);
        }
        if self.request == Some(inquiry) {
            (self.request, self.answer) = (None, Some((setting, value)));
        }
        true
    }

    /// Returns the first setting of a motor that is not confirmed, wrong or unknown. `name` and `expected` have the facts of each.
    pub(crate) fn wrong_setting(
        &self,
        motor: MotorName,
        is_right: impl Fn(R, f32) -> bool,
        name: impl Fn(R) -> &'static str,
        expected: impl Fn(R) -> f32,
    ) -> Option<WrongSetting> {
        let missed = self.missed.map(|it| (it.setting, it.written, Some(it.found)));
        let wrong = || self.wrong(is_right).map(|(setting, found)| (setting, None, found));
        let (wrong, written, found) = missed.or_else(wrong)?;
        let expected = written.map_or_else(|| expected(wrong), |written| written.value);
        Some(WrongSetting { motor, setting: name(wrong), expected, found })
    }

    /// Returns the first wrong or unknown setting, with its value in the drive.
    pub(crate) fn wrong(&self, is_right: impl Fn(R, f32) -> bool) -> Option<(R, Option<f32>)> {
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

#[cfg(test)]
mod tests {
    use super::{Inquiry, Settings};

    #[test]
    fn settings_are_asked_for_in_turn_and_the_wrong_one_is_named() {
        let mut settings = Settings::new(["mode", "range"]);
        assert_eq!(settings.inquire(), Some(Inquiry::Read("mode")));
        assert!(settings.take(Inquiry::Read("mode"), 2.0));
        assert!(!settings.take(Inquiry::Read("range"), 1.0));
        assert_eq!(settings.inquire(), Some(Inquiry::Read("range")));
        let is_right = |name: &str, value: f32| name == "mode" && (value - 1.0).abs() < 0.5;
        assert_eq!(settings.wrong(is_right), Some(("mode", Some(2.0))));
    }
}
