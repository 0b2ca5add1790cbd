//! Plots of variables over a serial port: the formats of VOFA+ and of similar tools.
//!
//! ```text
//! JustFloat  4 bytes a channel, f32 low byte first | 00 00 80 7F             binary, for control loops
//! text line  name:1.000,-2.500,\n                                            for people and for FireWater
//! ```
//!
//! `JustFloat` has no header, no length and no checksum: its tail is the bytes of +infinity. [`justfloat`] prevents these
//! four bytes elsewhere, so its output is never cut in the wrong place: +infinity is sent as the largest finite number,
//! and the last bit of a value is changed where the value and its neighbour would make up the tail. At 115200 baud a frame
//! of 4 channels takes 1.7 ms.
//!
//! ```
//! use drivetrain::wire::Deframer;
//! use drivetrain::wire::vofa::{justfloat, text_line};
//!
//! let mut buffer = [0; 32];
//! let mut bytes = justfloat(&[1.0, -2.5], &mut buffer)?;
//! assert_eq!(bytes, [0, 0, 0x80, 0x3F, 0, 0, 0x20, 0xC0, 0, 0, 0x80, 0x7F]);
//! let mut reader = Deframer::<[f32; 2], 12>::new();
//! assert_eq!(reader.read(&mut bytes), Some([1.0, -2.5]));
//!
//! assert_eq!(text_line("rpm", &[482.0, -0.25], &mut buffer)?, b"rpm:482.000,-0.250\n");
//! # Ok::<(), drivetrain::wire::EncodeError>(())
//! ```
//!
//! Limits: a reader that starts in the middle of a frame, behind noise, may take the noise for the first channels of this
//! one frame; the format does not distinguish them. [`text_line`] brings the formatting of floats into the image, about
//! 10 KB of flash.
//!
//! Source: VOFA+ manual, protocols `JustFloat` and `FireWater`.

use core::fmt::Write;

use super::{Decode, EncodeError, Reader, Reject, Writer};

/// The end of a frame: +infinity.
const TAIL: [u8; 4] = [0x00, 0x00, 0x80, 0x7F];

/// Writes one `JustFloat` frame: `values`, then the tail. Returns the filled part of `out`.
///
/// Costs 105 instructions on a Cortex-M4F, of 4 values (`docs/figures.md`).
///
/// # Errors
/// [`EncodeError::BufferTooSmall`] when `out` has less than 4 bytes a value and 4 more.
pub fn justfloat<'a>(values: &[f32], out: &'a mut [u8]) -> Result<&'a [u8], EncodeError> {
    let needed = values.len().saturating_add(1).saturating_mul(4);
    let mut frame = Writer::new(out, needed)?;
    let mut previous = [0xFF; 4];
    for value in values {
        let value = if *value == f32::INFINITY { f32::MAX } else { *value };
        let mut bytes = value.to_le_bytes();
        if makes_tail(previous, bytes) {
            bytes = f32::from_bits(value.to_bits() ^ 1).to_le_bytes();
        }
        frame.put(&bytes);
        previous = bytes;
    }
    frame.put(&TAIL);
    Ok(frame.finish())
}

/// Returns whether the tail appears across the border of two values. The tail always includes the first byte of the
/// second value, so another last bit there removes the tail.
fn makes_tail([_, a, b, c]: [u8; 4], [d, e, f, _]: [u8; 4]) -> bool {
    [[a, b, c, d], [b, c, d, e], [c, d, e, f]].contains(&TAIL)
}

/// Writes `name:1.000,-2.500` and a line end, with three decimals. Returns the filled part of `out`.
///
/// # Errors
/// [`EncodeError::BufferTooSmall`] when the line does not fit, with the length of the line.
pub fn text_line<'a>(
    name: &str,
    values: &[f32],
    out: &'a mut [u8],
) -> Result<&'a [u8], EncodeError> {
    let mut line = Line::new(out);
    // `Line` takes everything, so writing to it cannot fail.
    let _ = line.write_str(name);
    for (index, value) in values.iter().enumerate() {
        let _ = write!(line, "{}{value:.3}", if index == 0 { ':' } else { ',' });
    }
    let _ = line.write_char('\n');
    line.finish()
}

/// Keeps the part that fits, and counts the whole.
#[derive(Debug)]
pub(super) struct Line<'a> {
    out: &'a mut [u8],
    length: usize,
}

impl<'a> Line<'a> {
    pub(super) const fn new(out: &'a mut [u8]) -> Self {
        Self { out, length: 0 }
    }

    /// Returns the line, or how long it is when it does not fit.
    pub(super) fn finish(self) -> Result<&'a [u8], EncodeError> {
        let Self { out, length } = self;
        let given = out.len();
        out.get(..length).ok_or(EncodeError::BufferTooSmall { needed: length, given })
    }
}

impl Write for Line<'_> {
    fn write_str(&mut self, text: &str) -> core::fmt::Result {
        let end = self.length.saturating_add(text.len());
        if let Some(place) = self.out.get_mut(self.length..end) {
            place.copy_from_slice(text.as_bytes());
        }
        self.length = end;
        Ok(())
    }
}

/// The channels of a `JustFloat` frame, for a [`Deframer`](super::Deframer) of `4 * C + 4` bytes.
impl<const C: usize> Decode for [f32; C] {
    type Options = ();
    const PREFIX: usize = TAIL.len();

    fn header(_: &()) -> &[u8] {
        &[]
    }

    fn length(_: &(), _prefix: &[u8]) -> Option<usize> {
        Some(4 * C + TAIL.len())
    }

    fn decode(_: &(), frame: &[u8]) -> Result<Self, Reject> {
        let values = frame.strip_suffix(&TAIL).ok_or(Reject::Unframed)?;
        Reader(values).array(Reader::f32_le).ok_or(Reject::Length)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wire::Deframer;
    use proptest::prelude::*;
    use std::vec::Vec;

    fn tails(bytes: &[u8]) -> usize {
        bytes.windows(4).filter(|window| *window == TAIL).count()
    }

    #[test]
    fn plus_infinity_is_not_taken_for_the_end() {
        let mut buffer = [0; 16];
        let mut bytes = justfloat(&[f32::INFINITY, f32::NEG_INFINITY, 1.0], &mut buffer).unwrap();
        assert_eq!(tails(bytes), 1);
        let mut reader = Deframer::<[f32; 3], 16>::new();
        assert_eq!(reader.read(&mut bytes), Some([f32::MAX, f32::NEG_INFINITY, 1.0]));
    }

    #[test]
    fn two_neighbours_never_make_up_the_tail() {
        for shift in 1..4 {
            let mut bytes = [0x11; 8];
            bytes[shift..shift + 4].copy_from_slice(&TAIL);
            let values = [0, 4].map(|at| f32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()));
            let mut buffer = [0; 12];
            let written = justfloat(&values, &mut buffer).unwrap();
            assert_eq!(tails(written), 1, "{shift}");
            assert_eq!(written[..4], bytes[..4]);
            assert_eq!(written[5..8], bytes[5..]);
        }
    }

    #[test]
    fn the_error_of_a_long_line_has_its_length() {
        let error = text_line("speed", &[1.0, f32::NAN], &mut [0; 10]).unwrap_err();
        assert_eq!(
            error,
            EncodeError::BufferTooSmall { needed: "speed:1.000,NaN\n".len(), given: 10 }
        );
        assert_eq!(text_line("x", &[], &mut [0; 2]), Ok(&b"x\n"[..]));
    }

    proptest! {
        #[test]
        fn the_tail_stands_only_at_the_end(
            bits in prop::collection::vec(prop_oneof![
                any::<u32>(),
                prop::sample::select(&[0, 0x0000_7F80, 0x0080_7F00, 0x8000_0000, 0x7F, 0x7F80_0000][..]),
            ], 0..8),
        ) {
            let values: Vec<f32> = bits.into_iter().map(f32::from_bits).collect();
            let mut buffer = [0; 36];
            let bytes = justfloat(&values, &mut buffer).unwrap();
            prop_assert!(bytes.ends_with(&TAIL));
            prop_assert_eq!(tails(bytes), 1);
        }
    }
}
