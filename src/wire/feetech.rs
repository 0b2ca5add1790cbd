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

mod status;

use super::{EncodeError, Writer};

pub use status::{
    COUNTS_PER_TURN, Goal, MAX_FRAME, MAX_PARAMETERS, Present, Status, from_sign_magnitude,
    to_sign_magnitude,
};

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

pub mod register {
    //! Addresses of registers, for [`read`](super::read) and [`write`](super::write).

    /// The number on the line, in the EEPROM.
    pub const ID: u8 = 5;
    /// 0: 1 Mbaud, 1: 500k, 2: 250k, 3: 128k, 4: 115200, 5: 76800, 6: 57600, 7: 38400.
    pub const BAUD_RATE: u8 = 6;
    /// The lowest position, two bytes.
    pub const MIN_ANGLE: u8 = 9;
    /// The highest position, two bytes.
    pub const MAX_ANGLE: u8 = 11;
    /// Added to the position, two bytes with sign.
    pub const OFFSET: u8 = 31;
    /// 0: position, 1: wheel (speed).
    pub const MODE: u8 = 33;
    /// 1: torque on, 0: off, 128: take the present position as 2048.
    pub const TORQUE: u8 = 40;
    /// In 100 steps per second².
    pub const ACCELERATION: u8 = 41;
    /// Two bytes with sign, in counts.
    pub const GOAL_POSITION: u8 = 42;
    /// Two bytes.
    pub const GOAL_TIME: u8 = 44;
    /// Two bytes with sign, in counts per second.
    pub const GOAL_SPEED: u8 = 46;
    /// Two bytes, in 0.1 % of the stall torque.
    pub const TORQUE_LIMIT: u8 = 48;
    /// 0: the EEPROM can be written, 1: the EEPROM is locked.
    pub const LOCK: u8 = 55;
    /// Two bytes with sign, in counts.
    pub const PRESENT_POSITION: u8 = 56;
    /// Two bytes with sign, in counts per second.
    pub const PRESENT_SPEED: u8 = 58;
    /// Two bytes with sign, in 0.1 % of the largest output.
    pub const PRESENT_LOAD: u8 = 60;
    /// In 0.1 V.
    pub const PRESENT_VOLTAGE: u8 = 62;
    /// In degrees Celsius.
    pub const PRESENT_TEMPERATURE: u8 = 63;
    /// 1 while the servo moves.
    pub const MOVING: u8 = 66;
    /// Two bytes with sign, in 6.5 mA.
    pub const PRESENT_CURRENT: u8 = 69;
}

const PING: u8 = 0x01;
const READ: u8 = 0x02;
const WRITE: u8 = 0x03;
const REG_WRITE: u8 = 0x04;
const ACTION: u8 = 0x05;
const RESET: u8 = 0x06;
const SYNC_READ: u8 = 0x82;
const SYNC_WRITE: u8 = 0x83;

/// Asks a servo for a status without parameters.
///
/// # Errors
/// [`EncodeError::BufferTooSmall`] when `out` has less than 6 bytes.
pub fn ping(id: ServoId, out: &mut [u8]) -> Result<&[u8], EncodeError> {
    simple(id, PING, out)
}

/// Asks for `count` bytes from register `address` on.
///
/// # Errors
/// [`EncodeError::BufferTooSmall`] when `out` has less than 8 bytes.
pub fn read(id: ServoId, address: u8, count: u8, out: &mut [u8]) -> Result<&[u8], EncodeError> {
    let mut frame = Writer::new(out, 8)?;
    frame.put(&[0xFF, 0xFF, id.as_raw(), 4, READ, address, count]);
    Ok(seal(frame))
}

/// Writes bytes from register `address` on.
///
/// # Errors
/// [`EncodeError`] when the buffer is too small or there are more than 252 bytes.
pub fn write<'a>(
    id: ServoId,
    address: u8,
    data: &[u8],
    out: &'a mut [u8],
) -> Result<&'a [u8], EncodeError> {
    addressed(id, WRITE, address, data, out)
}

/// Writes bytes from register `address` on, to take effect at the next [`action`].
///
/// # Errors
/// [`EncodeError`] when the buffer is too small or there are more than 252 bytes.
pub fn reg_write<'a>(
    id: ServoId,
    address: u8,
    data: &[u8],
    out: &'a mut [u8],
) -> Result<&'a [u8], EncodeError> {
    addressed(id, REG_WRITE, address, data, out)
}

/// Executes the writes left in the servos by [`reg_write`].
///
/// # Errors
/// [`EncodeError::BufferTooSmall`] when `out` has less than 6 bytes.
pub fn action(id: ServoId, out: &mut [u8]) -> Result<&[u8], EncodeError> {
    simple(id, ACTION, out)
}

/// Sets the registers of a servo back to the state of delivery.
///
/// # Errors
/// [`EncodeError::BufferTooSmall`] when `out` has less than 6 bytes.
pub fn reset(id: ServoId, out: &mut [u8]) -> Result<&[u8], EncodeError> {
    simple(id, RESET, out)
}

/// Asks several servos for `count` bytes each, from register `address` on. The servos answer one after the other.
///
/// # Errors
/// [`EncodeError`] when the buffer is too small or there are more than 251 servos.
pub fn sync_read<'a>(
    servos: &[ServoId],
    address: u8,
    count: u8,
    out: &'a mut [u8],
) -> Result<&'a [u8], EncodeError> {
    let mut frame = begin(ServoId::BROADCAST, SYNC_READ, 2 + servos.len(), out)?;
    frame.put(&[address, count]);
    servos.iter().for_each(|id| frame.put(&[id.as_raw()]));
    Ok(seal(frame))
}

/// Writes `K` bytes into each of several servos, from register `address` on. None of the servos answers.
///
/// # Examples
/// ```
/// use drivetrain::wire::feetech::{self, Goal, ServoId};
///
/// let goal = Goal { position: 2048, speed: 1000, ..Goal::default() }.to_bytes();
/// let mut buffer = [0; 32];
/// let frame = feetech::sync_write(Goal::ADDRESS, &[(ServoId::ONE, goal)], &mut buffer)?;
/// assert_eq!(frame.len(), 6 + 2 + 1 + goal.len());
/// # Ok::<(), drivetrain::wire::EncodeError>(())
/// ```
///
/// # Errors
/// [`EncodeError`] when the buffer is too small or there are more than 251 bytes, the servos' ids included.
pub fn sync_write<'a, const K: usize>(
    address: u8,
    servos: &[(ServoId, [u8; K])],
    out: &'a mut [u8],
) -> Result<&'a [u8], EncodeError> {
    let parameters = servos.len().saturating_mul(K.saturating_add(1)).saturating_add(2);
    let mut frame = begin(ServoId::BROADCAST, SYNC_WRITE, parameters, out)?;
    frame.put(&[address, u8::try_from(K).unwrap_or(u8::MAX)]);
    for (id, data) in servos {
        frame.put(&[id.as_raw()]);
        frame.put(data);
    }
    Ok(seal(frame))
}

fn simple(id: ServoId, instruction: u8, out: &mut [u8]) -> Result<&[u8], EncodeError> {
    let mut frame = Writer::new(out, 6)?;
    frame.put(&[0xFF, 0xFF, id.as_raw(), 2, instruction]);
    Ok(seal(frame))
}

fn addressed<'a>(
    id: ServoId,
    instruction: u8,
    address: u8,
    data: &[u8],
    out: &'a mut [u8],
) -> Result<&'a [u8], EncodeError> {
    let mut frame = begin(id, instruction, data.len().saturating_add(1), out)?;
    frame.put(&[address]);
    frame.put(data);
    Ok(seal(frame))
}

fn begin(
    id: ServoId,
    instruction: u8,
    parameters: usize,
    out: &mut [u8],
) -> Result<Writer<'_>, EncodeError> {
    let length = parameters.checked_add(2).and_then(|length| u8::try_from(length).ok());
    let length = length.ok_or(EncodeError::TooManyParameters { parameters })?;
    let mut frame = Writer::new(out, usize::from(length) + 4)?;
    frame.put(&[0xFF, 0xFF, id.as_raw(), length, instruction]);
    Ok(frame)
}

fn seal(mut frame: Writer<'_>) -> &[u8] {
    let sum = checksum(frame.written().get(2..).unwrap_or(&[]));
    frame.put(&[sum]);
    frame.finish()
}
