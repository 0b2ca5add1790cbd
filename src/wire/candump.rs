//! The text output of SocketCAN's `candump`: one CAN frame a line.
//!
//! ```text
//!   can0  201   [8]  0E 16 00 00 FF FD 21 00                          candump can0
//!  (1788189998.242396)  can0  201   [8]  0E 16 00 00 FF FD 21 00      candump -ta can0
//! (1788189998.242396) can0 201#0E160000FFFD2100                       candump -L can0, candump -l can0
//! ```
//!
//! Understood besides: remote frames (`[2]  remote request`, `#R2`), 29-bit ids (8 digits), the columns of `-x` and
//! `-a`, a carriage return. Not understood, and refused by name: CAN FD frames, error frames, dates (`-tA`).
//!
//! ```
//! use drivetrain::wire::candump::Record;
//! use embedded_can::Frame;
//!
//! let record = Record::parse(b"(1788189998.242396) can0 201#0E160000FFFD2100")?;
//! assert_eq!(record.interface, "can0");
//! assert_eq!(record.frame.data()[6], 33); // motor temperature in degrees Celsius
//! assert_eq!(record.time.map(|time| time.as_micros()), Some(1_788_189_998_242_396));
//! # Ok::<(), drivetrain::wire::candump::ParseError>(())
//! ```
//!
//! Source: linux-can/can-utils, `candump.c` and `lib.c` (`snprintf_canframe`, `snprintf_long_canframe`).

mod cursor;

use embedded_can::{Frame, Id};

use self::cursor::Cursor;
pub use self::cursor::ParseError;
use crate::frame::CanFrame;
use crate::time::Instant;

/// One line of candump: a frame, its interface, and its time.
///
/// `{}` writes the form of `candump -L`, `{:#}` the columns. [`parse`](Self::parse) reads both again to an equal
/// record, if `interface` is a valid name for candump: 1 to 15 printable ASCII characters without a space, the first of
/// them not `(`.
///
/// # Examples
/// ```
/// use drivetrain::wire::candump::Record;
///
/// let record = Record::parse(b"  can0  201   [2]  0E 16")?;
/// assert_eq!(record.to_string(), "can0 201#0E16");
/// assert_eq!(format!("{record:#}"), "  can0  201   [2]  0E 16");
/// # Ok::<(), drivetrain::wire::candump::ParseError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Record<'a> {
    /// The time stamp as printed by candump: since 1970 (`-ta`, `-L`) or since its start (`-tz`); `None` without a
    /// stamp.
    pub time: Option<Instant>,
    /// The name of the CAN interface: `can0`.
    pub interface: &'a str,
    /// The frame.
    pub frame: CanFrame,
}

impl<'a> Record<'a> {
    /// Reads one line, with or without its line end.
    ///
    /// # Errors
    /// [`ParseError`] names the fault and its column. No line causes a panic.
    pub fn parse(line: &'a [u8]) -> Result<Self, ParseError> {
        let mut cursor = Cursor::new(line.trim_ascii_end());
        cursor.skip_spaces();
        if cursor.peek().is_none() {
            return Err(cursor.error(ParseError::Blank));
        }
        let time = cursor.time()?;
        let interface = cursor.interface()?;
        cursor.skip_direction();
        let id = cursor.id()?;
        let frame = if cursor.accept(b'#') { cursor.packed(id)? } else { cursor.columns(id)? };
        Ok(Self { time, interface, frame })
    }
}

impl core::fmt::Display for Record<'_> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let columns = f.alternate();
        if let Some(time) = self.time {
            let (seconds, micros) = (time.as_micros() / 1_000_000, time.as_micros() % 1_000_000);
            write!(f, "{}({seconds:010}.{micros:06}) ", if columns { " " } else { "" })?;
        } else if columns {
            f.write_str(" ")?;
        }
        write!(f, "{}{} ", if columns { " " } else { "" }, self.interface)?;
        let (frame, length) = (&self.frame, self.frame.length());
        if columns {
            f.write_str(" ")?;
        }
        match frame.id() {
            Id::Standard(id) => write!(f, "{:03X}", id.as_raw())?,
            Id::Extended(id) => write!(f, "{:08X}", id.as_raw())?,
        }
        match (columns, frame.is_remote_frame()) {
            (true, true) => write!(f, "   [{length}]  remote request"),
            (false, true) => write!(f, "#R{length}"),
            (true, false) => {
                write!(f, "   [{length}] ")?;
                frame.data().iter().try_for_each(|byte| write!(f, " {byte:02X}"))
            }
            (false, false) => {
                f.write_str("#")?;
                frame.data().iter().try_for_each(|byte| write!(f, "{byte:02X}"))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use embedded_can::{ExtendedId, StandardId};
    use proptest::prelude::*;
    use std::format;
    use std::string::ToString;

    fn rest() -> CanFrame {
        CanFrame::standard(0x201, [0x0E, 0x16, 0, 0, 0xFF, 0xFD, 0x21, 0]).unwrap()
    }

    fn parsed(line: &str) -> CanFrame {
        Record::parse(line.as_bytes()).unwrap().frame
    }

    fn refused(line: &str) -> ParseError {
        Record::parse(line.as_bytes()).unwrap_err()
    }

    #[test]
    fn every_form_of_one_frame_is_the_same_frame() {
        let stamped = Some(Instant::from_micros(1_788_189_998_242_396));
        for (line, time) in [
            ("can0  201   [8]  0E 16 00 00 FF FD 21 00", None),
            ("  can0  201   [8]  0E 16 00 00 FF FD 21 00", None),
            ("  can0       201   [8]  0E 16 00 00 FF FD 21 00\r\n", None),
            ("\tcan0 201 [8] 0e 16 00 00 ff fd 21 00", None),
            ("  can0  201   [8]  0E 16 00 00 FF FD 21 00   '......!.'", None),
            ("  can0  RX - -  201   [8]  0E 16 00 00 FF FD 21 00", None),
            ("can0 201#0E160000FFFD2100", None),
            (" (1788189998.242396)  can0  201   [8]  0E 16 00 00 FF FD 21 00", stamped),
            ("(1788189998.242396) can0 201#0E160000FFFD2100", stamped),
            ("(1788189998.242396) can0 201#0E160000FFFD2100 R\r\n", stamped),
            ("(1788189998.242396999) can0 201#0E160000FFFD2100_F T", stamped),
        ] {
            let record = Record { time, interface: "can0", frame: rest() };
            assert_eq!(Record::parse(line.as_bytes()), Ok(record), "{line}");
        }
    }

    #[test]
    fn time_stamps_of_any_length_keep_their_size() {
        for (text, micros) in [
            ("(0.5)", 500_000),
            ("(000.001021)", 1_021),
            ("( 2.000000)", 2_000_000),
            ("(0.1234567)", 123_456),
            ("(0.12345678)", 123_456),
        ] {
            let line = format!("{text} can0 201#");
            let time = Record::parse(line.as_bytes()).unwrap().time;
            assert_eq!(time, Some(Instant::from_micros(micros)));
        }
    }

    #[test]
    fn remote_frames_keep_the_length_they_ask_for() {
        let remote = |raw, dlc| CanFrame::new_remote(StandardId::new(raw).unwrap(), dlc).unwrap();
        assert_eq!(parsed("  can0  201   [2]  remote request"), remote(0x201, 2));
        assert_eq!(parsed("can0 201#R"), remote(0x201, 0));
        assert_eq!(parsed("can0 201#R8"), remote(0x201, 8));
        assert_eq!(parsed("can0 201#R8_C"), remote(0x201, 8));
    }

    #[test]
    fn eight_digits_are_a_29_bit_id_even_when_small() {
        let extended = CanFrame::new(ExtendedId::new(0x201).unwrap(), &[1]).unwrap();
        assert_eq!(parsed("can0  00000201   [1]  01"), extended);
        assert_eq!(parsed("can0 00000201#01"), extended);
        assert_eq!(refused("can0 201201#01"), ParseError::Id(6));
        assert_eq!(refused("can0 800#01"), ParseError::Id(6));
        assert_eq!(refused("can0 40000000#01"), ParseError::Id(6));
        assert_eq!(refused("can0 000000201#01"), ParseError::Id(6));
    }

    #[test]
    fn error_frames_and_can_fd_are_refused_by_name() {
        let error_frame = "can0  20000088   [8]  00 00 00 00 00 00 00 00   ERRORFRAME";
        assert_eq!(refused(error_frame), ParseError::ErrorFrame(7));
        assert_eq!(refused("can0 20000004#0000000000000000"), ParseError::ErrorFrame(6));
        assert_eq!(refused("can0 201##1112233"), ParseError::CanFd(10));
        assert_eq!(refused("can0  201  [12]  00 00"), ParseError::CanFd(14));
        assert_eq!(refused("can0  201  [08]  00 00"), ParseError::CanFd(14));
    }

    #[test]
    fn a_broken_line_names_the_column() {
        assert_eq!(refused(""), ParseError::Blank(1));
        assert_eq!(refused("  \r\n"), ParseError::Blank(1));
        assert_eq!(refused("(2026-01-01 00:00:00.1) can0 201#"), ParseError::Time(6));
        assert_eq!(refused("(18446744073710.0) can0 201#"), ParseError::Time(18));
        assert_eq!(refused("(1.0000000000) can0 201#"), ParseError::Time(14));
        assert_eq!(refused("(1.0"), ParseError::Time(5));
        assert_eq!(refused("(1.0)"), ParseError::Interface(6));
        assert_eq!(refused("a-name-of-16-ch. 201#"), ParseError::Interface(1));
        assert_eq!(refused("can\u{e9} 201#"), ParseError::Interface(1));
        assert_eq!(refused("can0"), ParseError::Id(5));
        assert_eq!(refused("can0 201"), ParseError::Length(9));
        assert_eq!(refused("can0 201=01"), ParseError::Id(9));
        assert_eq!(refused("can0 201 [9] 01"), ParseError::Length(11));
        assert_eq!(refused("can0 201 [2] 01"), ParseError::DataByte(16));
        assert_eq!(refused("can0 201 [2] 01 0G"), ParseError::DataByte(18));
        assert_eq!(refused("can0 201 [2] 01 023"), ParseError::DataByte(19));
        assert_eq!(refused("can0 201 [2] 01 02 03"), ParseError::End(20));
        assert_eq!(refused("can0 201#0102030405060708 x"), ParseError::End(27));
        assert_eq!(refused("can0 201#010203040506070809"), ParseError::End(26));
        assert_eq!(refused("can0 201 [2] remote request 1"), ParseError::End(29));
        assert_eq!(refused("can0 201#R9"), ParseError::Length(11));
        assert_eq!(refused("can0 201#R88"), ParseError::End(12));
        assert_eq!(refused("can0 201#0102030405060708_8"), ParseError::End(27));
    }

    fn any_frame() -> impl Strategy<Value = CanFrame> {
        let id = prop_oneof![
            (0_u16..=0x7FF).prop_map(|raw| Id::Standard(StandardId::new(raw).unwrap())),
            (0_u32..=0x1FFF_FFFF).prop_map(|raw| Id::Extended(ExtendedId::new(raw).unwrap())),
        ];
        (id, any::<[u8; 8]>(), 0_usize..=8, any::<bool>()).prop_map(|(id, data, dlc, remote)| {
            let frame = if remote {
                CanFrame::new_remote(id, dlc)
            } else {
                CanFrame::new(id, &data[..dlc])
            };
            frame.unwrap()
        })
    }

    proptest! {
        #[test]
        fn a_written_record_is_read_again(
            micros in prop::option::of(any::<u64>()),
            interface in "[!-'*-~][!-~]{0,14}",
            frame in any_frame(),
        ) {
            let time = micros.map(Instant::from_micros);
            let record = Record { time, interface: &interface, frame };
            for text in [record.to_string(), format!("{record:#}"), format!("{record:#}\r\n")] {
                prop_assert_eq!(Record::parse(text.as_bytes()), Ok(record));
            }
        }

        #[test]
        fn any_bytes_give_a_frame_or_a_column_of_the_line(line in prop::collection::vec(any::<u8>(), 0..80)) {
            if let Err(error) = Record::parse(&line) {
                prop_assert!((1..=line.len() + 1).contains(&error.column()));
            }
        }

        #[test]
        fn a_line_with_one_byte_changed_never_panics(
            frame in any_frame(), at in 0_usize..60, byte in any::<u8>(), columns in any::<bool>(),
        ) {
            let record = Record { time: Some(Instant::START), interface: "can0", frame };
            let text = if columns { format!("{record:#}") } else { record.to_string() };
            let mut line = text.into_bytes();
            if let Some(place) = line.get_mut(at) {
                *place = byte;
            }
            let _ = Record::parse(&line);
        }
    }

    #[test]
    fn an_error_names_the_column_and_the_expectation() {
        let error = Record::parse(b"can0 201#0E1").unwrap_err();
        assert_eq!(std::format!("{error}"), "column 13: expected two hexadecimal digits");
    }
}
