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

mod deadline;
mod deframer;
mod error;
mod field;
mod receiver;

pub use deadline::Silence;
pub use deframer::{Counts, Decode, Deframer, Reject};
pub use error::EncodeError;
pub use receiver::Receiver;
