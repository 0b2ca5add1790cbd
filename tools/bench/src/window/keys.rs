//! Keys and their actions.

use super::remote::Action;
use super::view::View;
use drivetrain::units::AngularVelocity;
use ratatui::crossterm::event::{KeyCode, KeyEvent, KeyModifiers};

/// A press of an arrow, in rpm, and ten times that with Shift.
const JOG_RPM: f32 = 10.0;

/// The sine and the steps, in rpm.
const SWING_RPM: f32 = 60.0;

/// The middle of the window.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) enum Page {
    #[default]
    Motors,
    Bus,
    Help,
}

/// State of the window that is not of the session.
#[derive(Debug, Clone, Default)]
pub(crate) struct Ui {
    pub(crate) page: Page,
    pub(crate) selected: usize,
    /// Gains that are being typed.
    pub(crate) input: Option<String>,
    pub(crate) hint: Option<String>,
    pub(crate) has_changed: bool,
}

impl Ui {
    /// Tells whether the window must be drawn anew, once.
    pub(crate) fn has_changed(&mut self) -> bool {
        std::mem::take(&mut self.has_changed)
    }

    pub(crate) fn change(&mut self) {
        self.has_changed = true;
    }

    /// Takes a key; returns what it asks for. `is_alone` tells that no other key came shortly before or waits behind.
    pub(crate) fn press(
        &mut self,
        key: KeyEvent,
        is_alone: bool,
        view: Option<&View>,
    ) -> Option<Action> {
        self.has_changed = true;
        self.hint = None;
        let is_control = key.modifiers.contains(KeyModifiers::CONTROL);
        // From anywhere, also while gains are typed. A terminal sends Esc and a key soon after it as Alt and this key.
        let is_alt = key.modifiers.contains(KeyModifiers::ALT);
        // An input method sends a space of its own.
        let is_space = matches!(key.code, KeyCode::Char(sign) if sign.is_whitespace());
        if is_alt || is_space || key.code == KeyCode::Esc {
            self.input = None;
            return Some(Action::Stop);
        }
        if is_control && matches!(key.code, KeyCode::Char('c' | 'z' | 'd')) {
            return Some(Action::Quit);
        }
        if is_control {
            return None;
        }
        if self.input.is_some() {
            return self.type_gains(key.code);
        }
        let motors = view.map_or(0, |view| view.snapshot.motors.len());
        let motor = self.selected;
        let swing = AngularVelocity::from_rpm(SWING_RPM).as_rad_per_s();
        let factor = if key.modifiers.contains(KeyModifiers::SHIFT) { 10.0 } else { 1.0 };
        let jog = AngularVelocity::from_rpm(factor * JOG_RPM).as_rad_per_s();
        match key.code {
            KeyCode::Char('q') => return Some(Action::Quit),
            // Up is Esc, [ and A: torn by a slow line, or behind an Esc, it arrives as three keys. So does a pasted text.
            KeyCode::Char('A') if !is_alone => {
                self.hint = Some("Shift-A arms if no other key comes with it".into());
            }
            KeyCode::Char('A') => return Some(Action::Arm),
            KeyCode::Char('a') => self.hint = Some("Shift-A arms: lift the wheels first".into()),
            KeyCode::Down | KeyCode::Tab | KeyCode::Char('j') => {
                self.selected = (motor + 1).checked_rem(motors).unwrap_or(0);
            }
            KeyCode::Up | KeyCode::Char('k') => {
                self.selected = (motor + motors.saturating_sub(1)).checked_rem(motors).unwrap_or(0);
            }
            KeyCode::Right => return Some(Action::Jog(motor, jog)),
            KeyCode::Left => return Some(Action::Jog(motor, -jog)),
            KeyCode::Char('0') => return Some(Action::Still(motor)),
            KeyCode::Char('s') => return Some(Action::Sine(motor, swing)),
            KeyCode::Char('e') => return Some(Action::Steps(motor, swing)),
            KeyCode::Char('t') => return Some(Action::Tune(motor)),
            KeyCode::Char('i') => return Some(Action::Identify(motor)),
            KeyCode::Char('r') => return Some(Action::Record),
            KeyCode::Char('p') => return Some(Action::Rewind),
            KeyCode::Char('x') => return Some(Action::Silence(motor)),
            KeyCode::Char('.') => return Some(Action::Advance(100)),
            KeyCode::Char(':') => return Some(Action::Advance(1_000)),
            KeyCode::Char('b') if self.page == Page::Bus => self.page = Page::Motors,
            KeyCode::Char('b') => self.page = Page::Bus,
            KeyCode::Char('?') if self.page == Page::Help => self.page = Page::Motors,
            KeyCode::Char('?') => self.page = Page::Help,
            KeyCode::Char('g') => {
                let gains = view.and_then(|view| Some(view.snapshot.motors.get(motor)?.gains));
                self.input = gains.map(|(kp, ki, kd)| format!("{kp},{ki},{kd}"));
            }
            _ => {}
        }
        None
    }

    fn type_gains(&mut self, code: KeyCode) -> Option<Action> {
        let input = self.input.as_mut()?;
        match code {
            KeyCode::Char(sign) if input.len() < 60 => input.push(sign),
            KeyCode::Backspace => _ = input.pop(),
            KeyCode::Enter => {
                let numbers: Result<Vec<f32>, _> =
                    input.split(',').map(|part| part.trim().parse()).collect();
                let gains = numbers.ok().and_then(|numbers| <[f32; 3]>::try_from(numbers).ok());
                if let Some([kp, ki, kd]) = gains {
                    self.input = None;
                    return Some(Action::Gains(self.selected, (kp, ki, kd)));
                }
                self.hint = Some("three numbers with commas between them".into());
            }
            _ => {}
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn press(ui: &mut Ui, code: KeyCode) -> Option<Action> {
        ui.press(KeyEvent::new(code, KeyModifiers::NONE), true, None)
    }

    #[test]
    fn space_and_esc_stop_from_anywhere_and_a_small_a_does_not_arm() {
        for (page, input) in [
            (Page::Motors, None),
            (Page::Bus, None),
            (Page::Help, None),
            (Page::Motors, Some("1,2,3".to_owned())),
        ] {
            let spaces = [' ', '\u{3000}', '\u{a0}'].map(KeyCode::Char);
            for key in spaces.into_iter().chain([KeyCode::Esc]) {
                let mut ui = Ui { page, input: input.clone(), ..Ui::default() };
                assert_eq!(press(&mut ui, key), Some(Action::Stop), "{page:?} {key}");
                assert_eq!((ui.page, ui.input), (page, None), "{key}");
            }
        }
        let mut ui = Ui::default();
        assert_eq!(press(&mut ui, KeyCode::Char('a')), None);
        assert_eq!(press(&mut ui, KeyCode::Char('A')), Some(Action::Arm));
    }

    #[test]
    fn a_key_soon_after_esc_stops_and_does_nothing_else() {
        for (code, input) in [
            (KeyCode::Char('s'), None),
            (KeyCode::Char('A'), None),
            (KeyCode::Right, None),
            (KeyCode::Char('2'), Some("0".to_owned())),
        ] {
            let mut ui = Ui { input, ..Ui::default() };
            let action = ui.press(KeyEvent::new(code, KeyModifiers::ALT), true, None);
            assert_eq!((action, ui.input), (Some(Action::Stop), None), "{code:?}");
        }
    }

    #[test]
    fn a_key_among_others_does_not_arm_and_with_control_does_nothing() {
        let mut ui = Ui::default();
        let arm = KeyEvent::new(KeyCode::Char('A'), KeyModifiers::SHIFT);
        assert_eq!(ui.press(arm, false, None), None);
        assert!(ui.hint.is_some());
        for sign in ['s', 'e', 't', 'A'] {
            let key = KeyEvent::new(KeyCode::Char(sign), KeyModifiers::CONTROL);
            assert_eq!(ui.press(key, true, None), None, "{sign}");
        }
    }

    #[test]
    fn gains_are_typed_and_nonsense_is_not_taken() {
        let mut ui = Ui { input: Some(String::new()), selected: 2, ..Ui::default() };
        for sign in "1.5,2".chars() {
            assert_eq!(press(&mut ui, KeyCode::Char(sign)), None);
        }
        assert_eq!(press(&mut ui, KeyCode::Enter), None);
        assert!(ui.hint.is_some() && ui.input.is_some());
        ",0".chars().for_each(|sign| _ = press(&mut ui, KeyCode::Char(sign)));
        assert_eq!(press(&mut ui, KeyCode::Enter), Some(Action::Gains(2, (1.5, 2.0, 0.0))));
        assert_eq!(ui.input, None);
    }

    #[test]
    fn a_page_is_left_by_the_key_that_opened_it() {
        for (key, page) in [('?', Page::Help), ('b', Page::Bus)] {
            let mut ui = Ui::default();
            for expected in [page, Page::Motors] {
                assert_eq!(press(&mut ui, KeyCode::Char(key)), None);
                assert_eq!(ui.page, expected);
            }
        }
    }

    // The sum is the session's: a picture is up to 50 ms old, and a press is not.
    #[test]
    fn an_arrow_asks_for_a_change_and_not_for_a_speed() {
        let rpm = |rpm| AngularVelocity::from_rpm(rpm).as_rad_per_s();
        let mut ui = Ui { selected: 1, ..Ui::default() };
        assert_eq!(press(&mut ui, KeyCode::Right), Some(Action::Jog(1, rpm(10.0))));
        assert_eq!(press(&mut ui, KeyCode::Left), Some(Action::Jog(1, rpm(-10.0))));
        let shifted = KeyEvent::new(KeyCode::Right, KeyModifiers::SHIFT);
        assert_eq!(ui.press(shifted, true, None), Some(Action::Jog(1, rpm(100.0))));
        assert_eq!(press(&mut ui, KeyCode::Char('0')), Some(Action::Still(1)));
    }

    #[test]
    fn control_c_and_control_z_quit() {
        for sign in ['c', 'z'] {
            let key = KeyEvent::new(KeyCode::Char(sign), KeyModifiers::CONTROL);
            assert_eq!(Ui::default().press(key, true, None), Some(Action::Quit));
        }
    }
}
