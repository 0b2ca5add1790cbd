//! Reads a line of candump from left to right.

use embedded_can::{ExtendedId, Frame, Id, StandardId};

use crate::frame::CanFrame;
use crate::time::Instant;

/// The bit set by candump in the id of an error frame (`CAN_ERR_FLAG`).
const ERROR_FRAME: u32 = 0x2000_0000;

/// Fault of a line of candump, and its place: the byte at which reading stopped, counted from 1.
///
/// # Examples
/// ```
/// use drivetrain::wire::candump::{ParseError, Record};
///
/// let error = Record::parse(b"can0 201#0E1").unwrap_err();
/// assert_eq!(error, ParseError::DataByte(13));
/// assert_eq!(error.to_string(), "column 13: expected two hexadecimal digits");
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum ParseError {
    /// The line is blank.
    Blank(usize),
    /// There is no time stamp `(seconds.fraction)` within 64 bits of microseconds; dates (`-tA`) are not read.
    Time(usize),
    /// There is no name of 1 to 15 printable ASCII characters.
    Interface(usize),
    /// There is no id of 3 or 8 hexadecimal digits, up to `7FF` or `1FFFFFFF`.
    Id(usize),
    /// There is an error frame of the driver, not a data or remote frame.
    ErrorFrame(usize),
    /// There is a CAN FD frame, not a classic frame of up to 8 bytes.
    CanFd(usize),
    /// There is no length `[0]` to `[8]`, nor `#` and the data.
    Length(usize),
    /// There are no two hexadecimal digits.
    DataByte(usize),
    /// There is more than the line should have.
    End(usize),
}

impl ParseError {
    /// Returns the byte of the line at which reading stopped, counted from 1.
    #[must_use]
    pub const fn column(&self) -> usize {
        match self {
            Self::Blank(column)
            | Self::Time(column)
            | Self::Interface(column)
            | Self::Id(column)
            | Self::ErrorFrame(column)
            | Self::CanFd(column)
            | Self::Length(column)
            | Self::DataByte(column)
            | Self::End(column) => *column,
        }
    }
}

impl core::fmt::Display for ParseError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let what = match self {
            Self::Blank(_) => "expected a frame, the line is blank",
            Self::Time(_) => "expected a time stamp (seconds.fraction)",
            Self::Interface(_) => "expected the name of an interface, as can0",
            Self::Id(_) => "expected an id of 3 digits up to 7FF or 8 digits up to 1FFFFFFF",
            Self::ErrorFrame(_) => "expected a data or remote frame, not an error frame",
            Self::CanFd(_) => "expected a classic CAN frame, not CAN FD",
            Self::Length(_) => "expected a length [0] to [8], or # and data",
            Self::DataByte(_) => "expected two hexadecimal digits",
            Self::End(_) => "expected the end of the line",
        };
        write!(f, "column {}: {what}", self.column())
    }
}

impl core::error::Error for ParseError {}

/// A place in a line. Every step moves forward or fails, so the time to read a line grows with its length only.
pub(super) struct Cursor<'a> {
    line: &'a [u8],
    at: usize,
}

impl<'a> Cursor<'a> {
    pub(super) const fn new(line: &'a [u8]) -> Self {
        Self { line, at: 0 }
    }

    /// Makes the error for this place.
    pub(super) fn error(&self, what: impl FnOnce(usize) -> ParseError) -> ParseError {
        what(self.at + 1)
    }

    pub(super) fn peek(&self) -> Option<u8> {
        self.line.get(self.at).copied()
    }

    pub(super) fn accept(&mut self, byte: u8) -> bool {
        let found = self.peek() == Some(byte);
        self.at += usize::from(found);
        found
    }

    fn require(
        &mut self,
        byte: u8,
        what: impl FnOnce(usize) -> ParseError,
    ) -> Result<(), ParseError> {
        if self.accept(byte) { Ok(()) } else { Err(self.error(what)) }
    }

    pub(super) fn skip_spaces(&mut self) {
        while self.accept(b' ') || self.accept(b'\t') {}
    }

    /// Takes the text before the next blank.
    fn word(&mut self) -> &'a [u8] {
        let rest = self.line.get(self.at..).unwrap_or(&[]);
        let length = rest.iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len());
        self.at += length;
        rest.get(..length).unwrap_or(&[])
    }

    pub(super) fn time(&mut self) -> Result<Option<Instant>, ParseError> {
        if !self.accept(b'(') {
            return Ok(None);
        }
        self.skip_spaces();
        let (seconds, _) = self.decimal()?;
        self.require(b'.', ParseError::Time)?;
        let (fraction, digits) = self.decimal()?;
        // Up to nine digits fit 32 bits, whose division small cores have.
        let short = u32::try_from(fraction).unwrap_or(u32::MAX);
        let micros = match digits {
            0..=6 => fraction * 10_u64.pow(6 - digits),
            7 => u64::from(short / 10),
            8 => u64::from(short / 100),
            9 => u64::from(short / 1_000),
            _ => return Err(self.error(ParseError::Time)),
        };
        let total = seconds.checked_mul(1_000_000).and_then(|total| total.checked_add(micros));
        let total = total.ok_or(self.error(ParseError::Time))?;
        self.require(b')', ParseError::Time)?;
        self.skip_spaces();
        Ok(Some(Instant::from_micros(total)))
    }

    /// Takes a decimal number, and counts its digits.
    fn decimal(&mut self) -> Result<(u64, u32), ParseError> {
        let (mut value, mut digits) = (0_u64, 0_u32);
        while let Some(digit) = self.peek().filter(u8::is_ascii_digit) {
            let next = value.checked_mul(10);
            let next = next.and_then(|value| value.checked_add(u64::from(digit - b'0')));
            value = next.ok_or(self.error(ParseError::Time))?;
            digits = digits.saturating_add(1);
            self.at += 1;
        }
        if digits == 0 { Err(self.error(ParseError::Time)) } else { Ok((value, digits)) }
    }

    pub(super) fn interface(&mut self) -> Result<&'a str, ParseError> {
        let error = self.error(ParseError::Interface);
        let name = self.word();
        let printable = matches!(name.len(), 1..=15) && name.iter().all(u8::is_ascii_graphic);
        let name = core::str::from_utf8(name).ok().filter(|_| printable).ok_or(error);
        self.skip_spaces();
        name
    }

    /// Steps over the columns of `candump -x`: `RX - -`.
    pub(super) fn skip_direction(&mut self) {
        let start = self.at;
        if !matches!(self.word(), b"RX" | b"TX") {
            self.at = start;
            return;
        }
        for _ in 0..2 {
            self.skip_spaces();
            self.word();
        }
        self.skip_spaces();
    }

    pub(super) fn id(&mut self) -> Result<Id, ParseError> {
        let error = self.error(ParseError::Id);
        let not_an_error_frame = self.error(ParseError::ErrorFrame);
        let start = self.at;
        let mut raw = 0_u32;
        while let Some(digit) = self.peek().and_then(nibble) {
            raw = raw << 4 | u32::from(digit);
            self.at += 1;
        }
        let id = match self.at - start {
            3 => u16::try_from(raw).ok().and_then(StandardId::new).map(Id::Standard),
            8 if raw & !ExtendedId::MAX.as_raw() == ERROR_FRAME => {
                return Err(not_an_error_frame);
            }
            8 => ExtendedId::new(raw).map(Id::Extended),
            _ => None,
        };
        id.ok_or(error)
    }

    /// Reads the text after `#`.
    pub(super) fn packed(&mut self, id: Id) -> Result<CanFrame, ParseError> {
        if self.peek() == Some(b'#') {
            return Err(self.error(ParseError::CanFd));
        }
        if self.accept(b'R') {
            let length = self.peek().filter(u8::is_ascii_digit).map_or(0, |digit| digit - b'0');
            let frame = CanFrame::new_remote(id, usize::from(length));
            let frame = frame.ok_or(self.error(ParseError::Length))?;
            self.at += usize::from(self.peek().is_some_and(|digit| digit.is_ascii_digit()));
            return self.packed_end(frame);
        }
        let mut data = Data::default();
        while self.peek().is_some_and(|byte| !byte.is_ascii_whitespace() && byte != b'_') {
            data.push(self)?;
        }
        let frame = CanFrame::new(id, data.bytes()).ok_or(self.error(ParseError::End))?;
        self.packed_end(frame)
    }

    /// Reads the optional end of a packed frame: the raw length code of an 8-byte frame (`_9` to `_F`), the direction.
    fn packed_end(&mut self, frame: CanFrame) -> Result<CanFrame, ParseError> {
        if frame.length() == 8 && self.accept(b'_') {
            let code = self.peek().and_then(nibble).filter(|code| *code > 8);
            code.ok_or(self.error(ParseError::End))?;
            self.at += 1;
        }
        if self.peek().is_some_and(|byte| !byte.is_ascii_whitespace()) {
            return Err(self.error(ParseError::End));
        }
        self.skip_spaces();
        let error = self.error(ParseError::End);
        if matches!(self.word(), b"" | b"R" | b"T") && self.peek().is_none() {
            Ok(frame)
        } else {
            Err(error)
        }
    }

    /// Reads `[8]  0E 16 ..` or `[8]  remote request`.
    pub(super) fn columns(&mut self, id: Id) -> Result<CanFrame, ParseError> {
        if self.peek().is_some_and(|byte| !byte.is_ascii_whitespace()) {
            return Err(self.error(ParseError::Id));
        }
        self.skip_spaces();
        self.require(b'[', ParseError::Length)?;
        let declared = self.peek().filter(|byte| matches!(byte, b'0'..=b'8'));
        let length = declared.map(|digit| digit - b'0').ok_or(self.error(ParseError::Length))?;
        self.at += 1;
        if self.peek().is_some_and(|byte| byte.is_ascii_digit()) {
            return Err(self.error(ParseError::CanFd)); // two digits: candump's mark of CAN FD
        }
        self.require(b']', ParseError::Length)?;
        self.skip_spaces();
        let rest = self.line.get(self.at..).unwrap_or(&[]);
        let frame = if rest.starts_with(b"remote request") {
            self.at += b"remote request".len();
            CanFrame::new_remote(id, usize::from(length))
        } else {
            let mut data = Data::default();
            for _ in 0..length {
                data.push(self)?;
                if self.peek().is_some_and(|byte| !byte.is_ascii_whitespace()) {
                    return Err(self.error(ParseError::DataByte));
                }
                self.skip_spaces();
            }
            CanFrame::new(id, data.bytes())
        };
        self.skip_spaces();
        match (self.peek(), frame) {
            (None | Some(b'\''), Some(frame)) => Ok(frame), // a quote begins the text column of -a
            _ => Err(self.error(ParseError::End)),
        }
    }
}

/// Up to 8 data bytes.
#[derive(Default)]
struct Data {
    bytes: [u8; 8],
    length: usize,
}

impl Data {
    fn push(&mut self, cursor: &mut Cursor<'_>) -> Result<(), ParseError> {
        let place = self.bytes.get_mut(self.length).ok_or(cursor.error(ParseError::End))?;
        *place = 0;
        for _ in 0..2 {
            let digit = cursor.peek().and_then(nibble);
            *place = *place << 4 | digit.ok_or(cursor.error(ParseError::DataByte))?;
            cursor.at += 1;
        }
        self.length += 1;
        Ok(())
    }

    fn bytes(&self) -> &[u8] {
        self.bytes.get(..self.length).unwrap_or(&[])
    }
}

const fn nibble(digit: u8) -> Option<u8> {
    match digit {
        b'0'..=b'9' => Some(digit - b'0'),
        b'A'..=b'F' => Some(digit - b'A' + 10),
        b'a'..=b'f' => Some(digit - b'a' + 10),
        _ => None,
    }
}
