use super::{ServoId, checksum};
use crate::wire::EncodeError;
use crate::wire::field::Writer;

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
