//! Gains and targets that a PC sets over a serial port while the program runs: lines of text, into a table of bounded parameters.
//!
//! ```text
//! wheel_kp=2.5        sets a parameter by its name    ends with a line feed; blanks, a carriage return and a comment (#) may follow
//! 0=2.5               the same by its number in the table
//! ?                   asks for the table
//! ```
//!
//! VOFA+ sends such lines from a button or a slider whose command is `wheel_kp=%.3f\n`, and any serial terminal does. The module
//! [`vofa`](super::vofa) sends the curves back.
//!
//! | what arrives | effect |
//! |---|---|
//! | a known parameter, a number within its range | the value holds from now on, a target for 500 ms |
//! | a number out of range, NaN, infinity | nothing changes; [`Counts::content_errors`] |
//! | an unknown name or number | nothing changes; [`Counts::foreign_frames`] |
//! | a line that is none, or has more than 48 bytes | nothing changes; [`Counts::length_errors`] |
//! | half of a line, then 100 ms without a byte | the half is dropped; [`Counts::length_errors`] |
//!
//! Values are only numbers: no line arms a motor, and a disarmed motor refuses every target. A **setting** holds until
//! it is set again. A **target** expires, so a cable that is pulled leaves the program without a target, and the motor stops by its
//! own time-out.
//!
//! ```
//! use drivetrain::time::{Duration, Instant};
//! use drivetrain::wire::parameters::{Parameter, ParameterRequest, Parameters};
//!
//! const KP: usize = 0;
//! const SPEED: usize = 1;
//! let mut parameters = Parameters::new([
//!     Parameter::setting("wheel_kp", "A per rad/s", 0.0, 8.0),
//!     Parameter::target("speed", "rpm", -100.0, 100.0),
//! ])?;
//! let now = Instant::START;
//! let mut received: &[u8] = b"wheel_kp=2.5\nspeed=60\nspeed=600\nspeed=nan\n"; // from the serial port
//! let first = parameters.read(&mut received, now);
//! assert_eq!(first, Some(ParameterRequest::Set { index: KP, value: 2.5 }));
//! while parameters.read(&mut received, now).is_some() {}
//! assert_eq!(parameters.value(SPEED, now), Some(60.0)); // 600 and NaN were refused
//! assert_eq!(parameters.counts().content_errors, 2);
//!
//! let later = now + Duration::from_millis(501);
//! assert_eq!((parameters.value(KP, later), parameters.value(SPEED, later)), (Some(2.5), None));
//! # Ok::<(), drivetrain::error::ConfigError>(())
//! ```
//!
//! Limits: a line has no checksum, because VOFA+ sends none. A disturbed digit that leaves a number within its range is taken, so
//! choose ranges in which every value is safe on a robot that is armed.

use core::fmt::Write;

use super::vofa::Line;
use super::{Counts, EncodeError};
use crate::error::ConfigError;
use crate::time::{Duration, Instant};

/// The longest line, without its line feed.
const LINE: usize = 48;
/// The longest pause between two bytes of a line.
const PAUSE: Duration = Duration::from_millis(100);

/// A number that may be set from outside: its name, its unit and its range.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Parameter {
    name: &'static str,
    unit: &'static str,
    least: f32,
    most: f32,
    is_target: bool,
}

impl Parameter {
    /// Takes name, unit and range of a setting, which holds until it is set again: a gain, a limit.
    ///
    /// The name consists of letters, digits and underscores, and begins with a letter; upper and lower case differ.
    #[must_use]
    pub const fn setting(name: &'static str, unit: &'static str, least: f32, most: f32) -> Self {
        Self { name, unit, least, most, is_target: false }
    }

    /// Takes name, unit and range of a target, which expires: a speed, an angle.
    #[must_use]
    pub const fn target(name: &'static str, unit: &'static str, least: f32, most: f32) -> Self {
        Self { name, unit, least, most, is_target: true }
    }

    /// Returns the name.
    #[must_use]
    pub const fn name(&self) -> &'static str {
        self.name
    }

    /// Returns the least and the most that is accepted.
    #[must_use]
    pub const fn range(&self) -> (f32, f32) {
        (self.least, self.most)
    }

    fn is_named(&self) -> bool {
        let mut bytes = self.name.bytes();
        bytes.next().is_some_and(|first| first.is_ascii_alphabetic())
            && bytes.all(|byte| byte.is_ascii_alphanumeric() || byte == b'_')
    }
}

/// Request of a line.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ParameterRequest {
    /// A parameter got a value that lies within its range.
    Set {
        /// Its place in the table.
        index: usize,
        /// The value, in the parameter's unit.
        value: f32,
    },
    /// The table is asked for: answer with [`Parameters::describe`], a line for each parameter.
    List,
}

/// A table of `N` parameters, with the values that were set.
#[derive(Debug, Clone)]
pub struct Parameters<const N: usize> {
    table: [Parameter; N],
    /// When it was set, and to which value.
    values: [Option<(Instant, f32)>; N],
    expiry: Duration,
    line: [u8; LINE],
    /// Above [`LINE`]: the line is too long, and dropped up to its end.
    length: usize,
    heard: Instant,
    counts: Counts,
}

impl<const N: usize> Parameters<N> {
    /// Takes the table. Targets expire after 500 ms.
    ///
    /// # Errors
    /// [`ConfigError::Unusable`] names a parameter whose name is no name; [`ConfigError::Conflict`] one whose name is taken;
    /// [`ConfigError::Reversed`] one whose range is empty, or has an end that is not finite.
    pub fn new(table: [Parameter; N]) -> Result<Self, ConfigError> {
        let mut rest = &table[..];
        while let [parameter, others @ ..] = rest {
            let (least, most) = parameter.range();
            if !parameter.is_named() {
                return Err(ConfigError::Unusable(parameter.name));
            }
            if !(least < most && least.is_finite() && most.is_finite()) {
                return Err(ConfigError::Reversed(parameter.name));
            }
            if others.iter().any(|other| other.name == parameter.name) {
                return Err(ConfigError::Conflict(parameter.name));
            }
            rest = others;
        }
        Ok(Self {
            table,
            values: [None; N],
            expiry: Duration::from_millis(500),
            line: [0; LINE],
            length: 0,
            heard: Instant::START,
            counts: Counts::default(),
        })
    }

    /// Sets the age at which a target expires.
    #[must_use]
    pub fn with_expiry(self, expiry: Duration) -> Self {
        Self { expiry, ..self }
    }

    /// Returns the next request of `input`, and takes the bytes up to its end; `None` when all bytes are taken. `now` is when they
    /// arrived.
    #[must_use]
    pub fn read(&mut self, input: &mut &[u8], now: Instant) -> Option<ParameterRequest> {
        if self.length > 0 && now.since(self.heard) > PAUSE {
            self.length = 0;
            count(&mut self.counts.length_errors);
        }
        self.heard = now;
        while let [byte, rest @ ..] = input {
            let byte = *byte;
            *input = rest;
            if byte == b'\n' {
                if let Some(request) = self.finish(now) {
                    return Some(request);
                }
            } else {
                if let Some(place) = self.line.get_mut(self.length) {
                    *place = byte;
                }
                self.length = self.length.saturating_add(1).min(LINE + 1);
            }
        }
        None
    }

    /// Returns the value of a parameter in its unit; `None` if it was never set, if it is a target that expired, or if there is no
    /// such parameter. A time before that of the line counts as expired.
    #[must_use]
    pub fn value(&self, index: usize, now: Instant) -> Option<f32> {
        let parameter = self.table.get(index)?;
        let (set, value) = (*self.values.get(index)?)?;
        let holds = !parameter.is_target || (now >= set && now.since(set) <= self.expiry);
        holds.then_some(value)
    }

    /// Returns how many lines were taken, and why others were not; each saturates.
    ///
    /// | counter | lines |
    /// |---|---|
    /// | `frames` | set a parameter, or ask for the table |
    /// | `content_errors` | have a number that is out of range, NaN or infinite |
    /// | `foreign_frames` | name no parameter |
    /// | `length_errors` | have another form or more than 48 bytes, or are broken off |
    ///
    /// The other counters stay zero.
    #[must_use]
    pub const fn counts(&self) -> Counts {
        self.counts
    }

    /// Writes the line of one parameter for a person, `0 wheel_kp=2.500 from 0.000 to 8.000 A per rad/s`, with a minus sign for a value
    /// that is unset or expired, and a line feed. Returns the part of `out` that it fills; `None` behind the last parameter.
    ///
    /// # Errors
    /// [`EncodeError::BufferTooSmall`] when the line does not fit; it says how long the line is.
    pub fn describe<'a>(
        &self,
        index: usize,
        now: Instant,
        out: &'a mut [u8],
    ) -> Option<Result<&'a [u8], EncodeError>> {
        let parameter = self.table.get(index)?;
        let mut line = Line::new(out);
        // `Line` takes everything, so that writing to it cannot fail.
        let _ = write!(line, "{index} {}=", parameter.name);
        let _ = match self.value(index, now) {
            Some(value) => write!(line, "{value:.3}"),
            None => line.write_char('-'),
        };
        let (least, most) = parameter.range();
        let _ = writeln!(line, " from {least:.3} to {most:.3} {}", parameter.unit);
        Some(line.finish())
    }

    /// Takes the line that is complete.
    fn finish(&mut self, now: Instant) -> Option<ParameterRequest> {
        let length = core::mem::take(&mut self.length);
        let Some(line) = self.line.get(..length) else {
            count(&mut self.counts.length_errors);
            return None;
        };
        let line = line.split(|byte| *byte == b'#').next().unwrap_or(&[]).trim_ascii();
        if line.is_empty() {
            return None;
        }
        if line == b"?" {
            count(&mut self.counts.frames);
            return Some(ParameterRequest::List);
        }
        let mut halves = line.splitn(2, |byte| *byte == b'=');
        let (Some(key), Some(text)) = (halves.next(), halves.next()) else {
            count(&mut self.counts.length_errors);
            return None;
        };
        let Some(value) = parse_number(text.trim_ascii()) else {
            count(&mut self.counts.length_errors);
            return None;
        };
        let Some((index, parameter)) = self.find(key.trim_ascii()) else {
            count(&mut self.counts.foreign_frames);
            return None;
        };
        if !(parameter.least <= value && value <= parameter.most) {
            count(&mut self.counts.content_errors);
            return None;
        }
        if let Some(place) = self.values.get_mut(index) {
            *place = Some((now, value));
        }
        count(&mut self.counts.frames);
        Some(ParameterRequest::Set { index, value })
    }

    /// Finds a parameter by its name or its number.
    fn find(&self, key: &[u8]) -> Option<(usize, Parameter)> {
        let number = parse_index(key);
        let named = |(index, parameter): &(usize, &Parameter)| {
            number == Some(*index) || parameter.name.as_bytes() == key
        };
        let (index, parameter) = self.table.iter().enumerate().find(named)?;
        Some((index, *parameter))
    }
}

const fn count(counter: &mut u32) {
    *counter = counter.saturating_add(1);
}

/// More digits than an `f32` tells apart are no mistake, but more than these are no number of a person.
const MOST_DIGITS: u32 = 24;
/// Of the exponent: beyond, every number is zero or infinite.
const FAR: i32 = 99;

/// Returns the number that the whole text is: digits with sign, point and exponent, `nan`, `inf`. Within two units in the last place.
/// `core`'s own parser would bring tables of 10 KB and a path that panics into the image.
fn parse_number(text: &[u8]) -> Option<f32> {
    let (is_negative, text) = sign(text);
    let magnitude = match text {
        text if text.eq_ignore_ascii_case(b"nan") => f32::NAN,
        text if text.eq_ignore_ascii_case(b"inf") => f32::INFINITY,
        text => decimal(text)?,
    };
    Some(if is_negative { -magnitude } else { magnitude })
}

/// Returns the number of a parameter: up to three digits.
fn parse_index(text: &[u8]) -> Option<usize> {
    if text.is_empty() || text.len() > 3 {
        return None;
    }
    let mut number = 0_usize;
    for byte in text {
        let digit = byte.checked_sub(b'0').filter(|digit| *digit < 10)?;
        number = number * 10 + usize::from(digit);
    }
    Some(number)
}

const fn sign(text: &[u8]) -> (bool, &[u8]) {
    match text {
        [b'-', rest @ ..] => (true, rest),
        [b'+', rest @ ..] => (false, rest),
        _ => (false, text),
    }
}

fn decimal(text: &[u8]) -> Option<f32> {
    let mut halves = text.splitn(2, |byte| byte.eq_ignore_ascii_case(&b'e'));
    let mantissa = halves.next()?;
    let mut exponent = match halves.next() {
        Some(text) => exponent(text)?,
        None => 0,
    };
    let (mut value, mut digits, mut is_fraction) = (0_u32, 0_u32, false);
    for byte in mantissa {
        if *byte == b'.' && !is_fraction {
            is_fraction = true;
            continue;
        }
        let digit = byte.checked_sub(b'0').filter(|digit| *digit < 10)?;
        digits += 1;
        // What nine digits cannot hold only shifts the point.
        let next = value.checked_mul(10).and_then(|value| value.checked_add(u32::from(digit)));
        match next {
            Some(next) => {
                value = next;
                exponent -= i32::from(is_fraction);
            }
            None => exponent += i32::from(!is_fraction),
        }
        if digits > MOST_DIGITS {
            return None;
        }
    }
    (digits > 0).then(|| scaled(value as f32, exponent))
}

fn exponent(text: &[u8]) -> Option<i32> {
    let (is_negative, digits) = sign(text);
    let number = i32::try_from(parse_index(digits)?).ok()?.min(FAR);
    Some(if is_negative { -number } else { number })
}

/// Returns `value` times a power of ten, in steps that `f32` holds exactly: one rounding for up to ten digits.
fn scaled(mut value: f32, mut exponent: i32) -> f32 {
    const POWERS: [f32; 11] = [1.0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10];
    while exponent != 0 && value > 0.0 && value.is_finite() {
        let step = exponent.unsigned_abs().min(10);
        let power = POWERS.get(step as usize).copied().unwrap_or(1e10);
        if exponent < 0 {
            value /= power;
            exponent += step.cast_signed();
        } else {
            value *= power;
            exponent -= step.cast_signed();
        }
    }
    value
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::format;
    use std::string::String;
    use std::vec::Vec;

    const TABLE: [Parameter; 3] = [
        Parameter::setting("kp", "A per rad/s", 0.0, 8.0),
        Parameter::setting("ki", "A per rad", 0.0, 50.0),
        Parameter::target("speed", "rpm", -100.0, 100.0),
    ];

    fn ms(ms: u64) -> Instant {
        Instant::from_micros(1_000 * ms)
    }

    fn parameters() -> Parameters<3> {
        Parameters::new(TABLE).unwrap()
    }

    fn hear(parameters: &mut Parameters<3>, text: &str, now: Instant) -> Vec<ParameterRequest> {
        let mut bytes = text.as_bytes();
        core::iter::from_fn(|| parameters.read(&mut bytes, now)).collect()
    }

    #[test]
    fn names_numbers_blanks_and_comments() {
        let mut parameters = parameters();
        let set = |index, value| ParameterRequest::Set { index, value };
        let text = "kp=1.5\n 1 = 2e1 # faster\r\n\n# nothing\nspeed=-40.25\n?\n";
        let expected = [set(0, 1.5), set(1, 20.0), set(2, -40.25), ParameterRequest::List];
        assert_eq!(hear(&mut parameters, text, ms(0)), expected);
        assert_eq!(parameters.counts(), Counts { frames: 4, ..Default::default() });
    }

    #[test]
    fn what_is_wrong_is_counted_by_its_kind_and_changes_nothing() {
        let mut parameters = parameters();
        assert_eq!(hear(&mut parameters, "kp=1\nspeed=50\n", ms(0)).len(), 2);
        let out = "kp=8.001\nkp=-0.001\nkp=nan\nkp=NaN\nkp=inf\nkp=-inf\nkp=1e99\nspeed=-101\n";
        let unknown = "kq=1\n3=1\nKP=1\n99999999999999999999999=1\n=1\n";
        let malformed = "kp\nkp=\nkp=1=2\nkp=1.2.3\nkp=0x1\nkp 1\nkp=1kp=2\nkp=--1\nkp=1e\n";
        let long = "kp=1                                               2\n";
        for text in [out, unknown, malformed, long] {
            assert_eq!(hear(&mut parameters, text, ms(0)), []);
        }
        let expected = Counts {
            frames: 2,
            content_errors: 8,
            foreign_frames: 5,
            length_errors: 10,
            ..Counts::default()
        };
        assert_eq!(parameters.counts(), expected);
        assert_eq!(
            [0, 1, 2, 3].map(|index| parameters.value(index, ms(0))),
            [Some(1.0), None, Some(50.0), None]
        );
    }

    #[test]
    fn a_target_expires_a_setting_does_not_and_a_clock_that_goes_back_keeps_no_target() {
        let mut parameters = parameters().with_expiry(Duration::from_millis(200));
        hear(&mut parameters, "kp=1\nspeed=50\n", ms(1_000));
        for (at, speed) in [(1_000, Some(50.0)), (1_200, Some(50.0)), (1_201, None), (999, None)] {
            assert_eq!(parameters.value(2, ms(at)), speed, "{at}");
            assert_eq!(parameters.value(0, ms(at)), Some(1.0));
        }
    }

    #[test]
    fn half_a_line_before_a_pause_does_not_join_the_next() {
        let mut parameters = parameters();
        assert_eq!(hear(&mut parameters, "kp=", ms(0)), []);
        assert_eq!(hear(&mut parameters, "1", ms(100)), []);
        assert_eq!(hear(&mut parameters, "\n", ms(200)).len(), 1);
        assert_eq!(hear(&mut parameters, "kp=1", ms(300)), []);
        assert_eq!(hear(&mut parameters, "5\n", ms(401)), [], "5 is not the rest of 15");
        assert_eq!(
            (parameters.value(0, ms(401)), parameters.counts().length_errors),
            (Some(1.0), 2)
        );
    }

    #[test]
    fn a_parameter_has_the_name_and_the_range_that_it_was_given() {
        assert_eq!(TABLE.map(|parameter| parameter.name()), ["kp", "ki", "speed"]);
        assert_eq!(
            TABLE.map(|parameter| parameter.range()),
            [(0.0, 8.0), (0.0, 50.0), (-100.0, 100.0)]
        );
    }

    #[test]
    fn a_pause_between_two_lines_breaks_none() {
        let mut parameters = parameters();
        for at in [1_000, 2_000, 3_000] {
            assert_eq!(hear(&mut parameters, "kp=1\n", ms(at)).len(), 1);
        }
        assert_eq!(parameters.counts(), Counts { frames: 3, ..Counts::default() });
    }

    #[test]
    fn a_line_for_each_parameter_says_value_range_and_unit() {
        let mut parameters = parameters();
        hear(&mut parameters, "speed=12.5\n", ms(0));
        let mut text = String::new();
        let mut index = 0;
        let mut buffer = [0; 64];
        while let Some(line) = parameters.describe(index, ms(0), &mut buffer) {
            text += core::str::from_utf8(line.unwrap()).unwrap();
            index += 1;
        }
        let expected = "0 kp=- from 0.000 to 8.000 A per rad/s\n\
                        1 ki=- from 0.000 to 50.000 A per rad\n\
                        2 speed=12.500 from -100.000 to 100.000 rpm\n";
        assert_eq!(text, expected);
        let error = parameters.describe(0, ms(0), &mut [0; 5]).unwrap().unwrap_err();
        assert_eq!(error, EncodeError::BufferTooSmall { needed: 39, given: 5 });
    }

    #[test]
    fn a_table_that_cannot_work_is_refused_by_name() {
        let of = |name, least, most| {
            Parameters::new([TABLE[0], Parameter::setting(name, "", least, most)]).unwrap_err()
        };
        for name in ["", "1a", "a b", "a=b", "ä", "_a"] {
            assert_eq!(of(name, 0.0, 1.0), ConfigError::Unusable(name));
        }
        assert_eq!(of("kp", 0.0, 1.0), ConfigError::Conflict("kp"));
        for (least, most) in
            [(1.0, 1.0), (2.0, 1.0), (f32::NAN, 1.0), (0.0, f32::NAN), (0.0, f32::INFINITY)]
        {
            assert_eq!(of("a", least, most), ConfigError::Reversed("a"));
        }
    }

    proptest! {
        #[test]
        fn no_bytes_set_a_value_out_of_its_range_and_each_line_counts_once(
            bytes in prop::collection::vec(
                prop_oneof![any::<u8>(), prop::sample::select(&b"0123456789.-+eknapisped=?#\n\n"[..])], 0..200),
            split in 0..200_usize,
        ) {
            let mut parameters = parameters();
            let (mut first, mut second) = bytes.split_at(split.min(bytes.len()));
            let mut requests = 0;
            while parameters.read(&mut first, ms(0)).is_some() { requests += 1; }
            while parameters.read(&mut second, ms(1)).is_some() { requests += 1; }
            for (index, parameter) in TABLE.iter().enumerate() {
                if let Some(value) = parameters.value(index, ms(1)) {
                    prop_assert!((parameter.least..=parameter.most).contains(&value));
                }
            }
            let counts = parameters.counts();
            prop_assert_eq!(counts.frames, requests);
            let lines = bytes.iter().filter(|byte| **byte == b'\n').count();
            prop_assert!([counts.frames, counts.content_errors, counts.foreign_frames, counts.length_errors].iter().sum::<u32>() as usize <= lines);
        }
    }

    #[test]
    fn numbers_of_people_are_those_that_the_compiler_reads() {
        for (text, value) in [
            ("0", 0.0_f32),
            ("-0", -0.0),
            ("1", 1.0),
            ("+1.5", 1.5),
            (".25", 0.25),
            ("7.", 7.0),
            ("0.1", 0.1),
            ("-3.25159", -3.25159),
            ("2e3", 2e3),
            ("1E-3", 1e-3),
            ("0000012", 12.0),
            ("16777217", 16_777_216.0),
            ("10000000000000", 1e13),
        ] {
            let parsed = parse_number(text.as_bytes()).unwrap();
            assert_eq!(parsed.to_bits(), value.to_bits(), "{text}: {parsed}");
        }
        assert_eq!(parse_number(b"1e50"), Some(f32::INFINITY));
        assert_eq!(parse_number(b"1e-99"), Some(0.0));
        assert_eq!(parse_number(b"-INF"), Some(f32::NEG_INFINITY));
        assert!(parse_number(b"nan").is_some_and(f32::is_nan));
    }

    #[test]
    fn text_that_is_no_number_is_none() {
        for text in [
            "", "-", ".", "1.2.3", "e5", "1e", "1e+", "1e1.5", "1,5", "0x10", "1_000", "--1",
            "1 2", "1:", "1/", "infinity", "1e9999",
        ] {
            assert_eq!(parse_number(text.as_bytes()), None, "{text}");
        }
        assert_eq!(parse_number(&[b'1'; 25]), None);
        assert_eq!(parse_number(&[b'0'; 24]), Some(0.0));
        assert_eq!(
            (parse_index(b"12"), parse_index(b""), parse_index(b"1234"), parse_index(b"-1")),
            (Some(12), None, None, None)
        );
        assert_eq!(
            (parse_index(b"907"), parse_index(b":"), parse_index(b"/")),
            (Some(907), None, None)
        );
    }

    proptest! {
        #[test]
        fn any_number_comes_back_within_two_units_in_the_last_place(value in -1e7_f32..1e7, decimals in 0..9_usize) {
            let text = format!("{value:.decimals$}");
            let exact: f32 = text.parse().unwrap();
            let parsed = parse_number(text.as_bytes()).unwrap();
            prop_assert!(parsed.to_bits().abs_diff(exact.to_bits()) <= 2, "{} {} {}", text, parsed, exact);
        }
    }
}
