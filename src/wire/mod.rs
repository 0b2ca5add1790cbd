//! Byte protocols: host link, IMU, servo, remote control, referee system, plotting, the text of `candump`, and the payload of MIT-mode
//! drives and of super-capacitor controllers.
//!
//! | module | other side | frame | check | decoder | encoder |
//! |---|---|---|---|:-:|:-:|
//! | [`host_link`] | the computer of the snake robot | 79 bytes down, 121 up | CRC-16/MODBUS, high byte first | x | x |
//! | [`hipnuc`] | HiPNUC IMU | 6 + length | CRC-16/XMODEM, low byte first | x | |
//! | [`feetech`] | STS and SMS servos on one half-duplex line | 6 + parameters | sum, inverted | x | x |
//! | [`dbus`] | DR16 receiver of a remote control | 18 bytes between pauses | none: plausibility | x | |
//! | [`vt13`] | remote control of the video link, VT03 and VT13 | 21 bytes | CRC-16/MCRF4XX, low byte first | x | |
//! | [`referee`] | referee system of the RoboMaster | 9 + length | CRC-8 of the header; CRC-16/MCRF4XX, low byte first | x | x |
//! | [`parameters`] | a person, or a plotting tool, that sets gains and targets | a line of text | ranges | x | x |
//! | [`vofa`] | plotting tool on a computer | 4 bytes a channel + tail | none | x | x |
//! | [`candump`] | SocketCAN's log | a line of text | none | x | x |
//! | [`mit`] | motors in MIT mode | the 8 bytes of a CAN frame | that of CAN | x | x |
//! | [`supercap`] | controllers of super-capacitors | the 8 bytes of a CAN frame | that of CAN | x | x |
//!
//! All protocols are sans-I/O: bytes in, values out, and back; any interrupt, DMA, async task or file may move the
//! bytes. The framed protocols share one decoder, [`Deframer`], and with it one law: **the frames found do not depend
//! on how the bytes were split, and no damage to one frame loses the next.** Each frame adds only its facts
//! ([`Decode`]). Encoders write into a slice of the caller and return the filled part, ready for a serial port:
//!
//! ```
//! use drivetrain::wire::{Deframer, feetech};
//!
//! let mut buffer = [0; 16];
//! let ping = feetech::ping(feetech::ServoId::ONE, &mut buffer)?; // -> uart.write_all(ping)
//! assert_eq!(ping, [0xFF, 0xFF, 0x01, 0x02, 0x01, 0xFB]);
//!
//! let mut replies = Deframer::<feetech::Status, 64>::new();
//! let mut received = &[0x00, 0xFF, 0xFF, 0x01, 0x02, 0x00, 0xFC][..]; // <- uart.read(..)
//! while let Some(status) = replies.read(&mut received) {
//!     assert_eq!(status.id(), 1);
//! }
//! assert_eq!((replies.counts().frames, replies.counts().skipped_bytes), (1, 1));
//! # Ok::<(), drivetrain::wire::EncodeError>(())
//! ```
//!
//! With `embedded-io` the two arrows are `port.write_all(ping)?` and
//! `let n = port.read(&mut bytes)?; let mut received = &bytes[..n];`: too little for a function or a dependency.
//!
//! Checksums are computed with one table of 512 bytes a polynomial ([`crc::Table<1>`]). Bit by bit, without the table, four
//! IMUs at 400 Hz would cost an estimated 4 % of a 168 MHz core; the 16-lane table (8 KiB) would be a tenth of a small
//! microcontroller's flash. An unused polynomial is not linked.

pub mod candump;
pub mod dbus;
pub mod feetech;
pub mod hipnuc;
pub mod host_link;
pub mod mit;
pub mod parameters;
pub mod referee;
pub mod supercap;
pub mod vofa;
pub mod vt13;

mod deframer;
mod receiver;

use core::fmt;

pub use deframer::{Counts, Decode, Deframer, Reject};
pub use receiver::Receiver;

/// Why a frame cannot be written. Nothing useful stands in the buffer.
///
/// # Examples
/// ```
/// use drivetrain::wire::{EncodeError, feetech};
///
/// let error = feetech::ping(feetech::ServoId::ONE, &mut [0; 5]).unwrap_err();
/// assert_eq!(error, EncodeError::BufferTooSmall { needed: 6, given: 5 });
/// assert_eq!(error.to_string(), "the frame needs 6 bytes, the buffer has 5");
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum EncodeError {
    /// The caller's buffer is shorter than the frame.
    BufferTooSmall {
        /// The length of the frame in bytes.
        needed: usize,
        /// The length of the buffer in bytes.
        given: usize,
    },
    /// The parameters of a servo's instruction are more than its length byte can tell.
    TooManyParameters {
        /// The number of parameter bytes asked for; at most 253 fit.
        parameters: usize,
    },
    /// The data is more than the length field of its frame can tell.
    DataTooLong {
        /// The length of the data in bytes.
        given: usize,
        /// The largest number of bytes in one frame.
        most: usize,
    },
}

impl fmt::Display for EncodeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::BufferTooSmall { needed, given } => {
                write!(f, "the frame needs {needed} bytes, the buffer has {given}")
            }
            Self::TooManyParameters { parameters } => {
                write!(f, "{parameters} parameter bytes, one frame takes 253: split it")
            }
            Self::DataTooLong { given, most } => {
                write!(f, "{given} data bytes, one frame takes {most}: split them")
            }
        }
    }
}

impl core::error::Error for EncodeError {}

/// Reads from the front. Every method gives `None` when the bytes are used up.
#[derive(Debug, Clone, Copy)]
struct Reader<'a>(&'a [u8]);

impl Reader<'_> {
    fn take<const K: usize>(&mut self) -> Option<[u8; K]> {
        let (field, rest) = self.0.split_first_chunk()?;
        self.0 = rest;
        Some(*field)
    }

    fn u8(&mut self) -> Option<u8> {
        self.take().map(|[byte]| byte)
    }

    fn u16_le(&mut self) -> Option<u16> {
        self.take().map(u16::from_le_bytes)
    }

    fn i16_le(&mut self) -> Option<i16> {
        self.take().map(i16::from_le_bytes)
    }

    fn i16_be(&mut self) -> Option<i16> {
        self.take().map(i16::from_be_bytes)
    }

    fn i32_le(&mut self) -> Option<i32> {
        self.take().map(i32::from_le_bytes)
    }

    fn i32_be(&mut self) -> Option<i32> {
        self.take().map(i32::from_be_bytes)
    }

    fn f32_le(&mut self) -> Option<f32> {
        self.take().map(f32::from_le_bytes)
    }

    /// Reads `K` fields of one kind.
    fn array<T: Copy + Default, const K: usize>(
        &mut self,
        mut field: impl FnMut(&mut Self) -> Option<T>,
    ) -> Option<[T; K]> {
        let mut values = [T::default(); K];
        for value in &mut values {
            *value = field(self)?;
        }
        Some(values)
    }
}

/// Writes from the front, into a slice of sufficient length.
#[derive(Debug)]
struct Writer<'a> {
    out: &'a mut [u8],
    at: usize,
}

impl<'a> Writer<'a> {
    /// Takes exactly `needed` bytes of `out`.
    fn new(out: &'a mut [u8], needed: usize) -> Result<Self, EncodeError> {
        let given = out.len();
        let out = out.get_mut(..needed).ok_or(EncodeError::BufferTooSmall { needed, given })?;
        Ok(Self { out, at: 0 })
    }

    fn put(&mut self, bytes: &[u8]) {
        let place = self.at.checked_add(bytes.len()).and_then(|end| self.out.get_mut(self.at..end));
        if let Some(place) = place {
            place.copy_from_slice(bytes);
            self.at += bytes.len();
        }
    }

    /// Returns the bytes written so far.
    fn written(&self) -> &[u8] {
        self.out.get(..self.at).unwrap_or(&[])
    }

    /// Gives the frame back.
    fn finish(self) -> &'a [u8] {
        self.out
    }
}
