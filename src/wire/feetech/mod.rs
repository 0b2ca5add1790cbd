//! Feetech STS and SMS servos (STS3032, ..): many on one half-duplex line, 1 Mbaud by default.
//!
//! ```text
//! instruction  FF FF | id | length | instruction | parameters | checksum
//! status       FF FF | id | length | error bits  | parameters | checksum
//! length = parameters + 2        checksum = complement of the sum from id to the last parameter
//! ```
//! Numbers have their low byte first (older SCS servos have the high byte first; these are not read here). Signed
//! numbers are sign and magnitude, not two's complement.
//!
//! A servo answers every instruction except to [`ServoId::BROADCAST`]. Status and instruction look the same, so on an
//! adapter with an echo, discard as many received bytes as were sent before giving the rest to the decoder.
//!
//! ```
//! use drivetrain::wire::{Deframer, feetech::{self, Goal, Present, ServoId, Status, MAX_FRAME}};
//!
//! let mut buffer = [0; MAX_FRAME];
//! let goal = Goal { position: 4095, speed: 2250, acceleration: 50, time: 0 };
//! feetech::write(ServoId::ONE, Goal::ADDRESS, &goal.to_bytes(), &mut buffer)?;
//! feetech::read(ServoId::ONE, Present::ADDRESS, Present::LENGTH, &mut buffer)?;
//!
//! let mut replies = Deframer::<Status, MAX_FRAME>::new();
//! let mut received: &[u8] = &[0xFF, 0xFF, 1, 10, 0, 0, 8, 0, 0, 0, 0, 0x79, 0x1E, 0x55];
//! let status = replies.read(&mut received).ok_or("no status")?;
//! let present = Present::from_status(&status).ok_or("another length was asked for")?;
//! assert_eq!((present.position, present.temperature_c), (2048, 30));
//! assert_eq!(present.angle().as_degrees(), 180.0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Source: Feetech protocol manual 191218-0923; registers and signs by the vendor's SDK (`SMS_STS`).

mod instruction;
mod status;
mod values;

pub mod register;

pub use instruction::{action, ping, read, reg_write, reset, sync_read, sync_write, write};

pub use status::{MAX_FRAME, MAX_PARAMETERS, Status};
pub use values::{COUNTS_PER_TURN, Goal, Present, from_sign_magnitude, to_sign_magnitude};

/// The number of a servo on its line: 0 to 253, or all of them.
///
/// # Examples
/// ```
/// use drivetrain::wire::feetech::ServoId;
///
/// assert_eq!(ServoId::new(7).map(ServoId::as_raw), Some(7));
/// assert_eq!(ServoId::new(254), None);
/// assert_eq!(ServoId::BROADCAST.as_raw(), 254);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ServoId(u8);

impl ServoId {
    /// The number of a servo at delivery.
    pub const ONE: Self = Self(1);
    /// All servos; none of them answers.
    pub const BROADCAST: Self = Self(254);

    /// Takes a number of 0 to 253.
    #[must_use]
    pub const fn new(raw: u8) -> Option<Self> {
        if raw < Self::BROADCAST.0 { Some(Self(raw)) } else { None }
    }

    /// Returns the number: 0 to 254.
    #[must_use]
    pub const fn as_raw(self) -> u8 {
        self.0
    }
}

/// Returns the checksum of the bytes from the id to the last parameter.
fn checksum(bytes: &[u8]) -> u8 {
    !bytes.iter().fold(0_u8, |sum, byte| sum.wrapping_add(*byte))
}
