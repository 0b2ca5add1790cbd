//! Answers of a servo, and the values of goals and measurements.

use super::{checksum, register};
use crate::units::Angle;
use crate::wire::{Decode, Reader, Reject};

/// The largest number of parameters in a [`Status`]: a longer reply is refused by its length.
pub const MAX_PARAMETERS: usize = 32;

/// The longest status frame in bytes, and a good buffer size for instructions.
pub const MAX_FRAME: usize = MAX_PARAMETERS + OVERHEAD;

/// Header, id, length, error and checksum in bytes.
const OVERHEAD: usize = 6;

/// The answer of a servo, of the series STS and SMS.
///
/// # Examples
/// ```
/// use drivetrain::wire::{Deframer, feetech::Status};
///
/// let mut replies = Deframer::<Status, 64>::new();
/// let mut received = &[0xFF, 0xFF, 0x01, 0x02, 0b0010_0100, 0xD8][..];
/// let status = replies.read(&mut received).ok_or("no status")?;
/// assert!(status.is_overheated() && status.is_overloaded() && !status.has_voltage_error());
/// # Ok::<(), &str>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(align(4))] // moved in words instead of bytes: a third less work a frame
pub struct Status {
    id: u8,
    errors: u8,
    parameters: [u8; MAX_PARAMETERS],
    length: u8,
}

impl Status {
    /// Returns the number of the servo: 0 to 253.
    #[must_use]
    pub const fn id(&self) -> u8 {
        self.id
    }

    /// Returns the error bits as received; 0 without an error.
    #[must_use]
    pub const fn errors(&self) -> u8 {
        self.errors
    }

    /// Returns whether the supply voltage is out of its limits: bit 0.
    #[must_use]
    pub const fn has_voltage_error(&self) -> bool {
        self.errors & 1 != 0
    }

    /// Returns whether the position sensor failed: bit 1.
    #[must_use]
    pub const fn has_sensor_error(&self) -> bool {
        self.errors & 1 << 1 != 0
    }

    /// Returns whether the servo is too hot: bit 2.
    #[must_use]
    pub const fn is_overheated(&self) -> bool {
        self.errors & 1 << 2 != 0
    }

    /// Returns whether the current is too high: bit 3.
    #[must_use]
    pub const fn has_overcurrent(&self) -> bool {
        self.errors & 1 << 3 != 0
    }

    /// Returns whether the load is too high: bit 5.
    #[must_use]
    pub const fn is_overloaded(&self) -> bool {
        self.errors & 1 << 5 != 0
    }

    /// Returns the requested bytes; none after a ping or a write.
    #[must_use]
    pub fn parameters(&self) -> &[u8] {
        self.parameters.get(..usize::from(self.length)).unwrap_or(&[])
    }
}

impl Decode for Status {
    type Options = ();
    const PREFIX: usize = 4;

    fn header(_: &()) -> &[u8] {
        &[0xFF, 0xFF]
    }

    /// A status comes from one servo, so an id above 253 is noise: most often a third `FF` before a frame.
    fn length(_: &(), prefix: &[u8]) -> Option<usize> {
        let [.., id, length] = prefix else { return None };
        let parameters = usize::from(*length).checked_sub(2)?;
        (*id < 254 && parameters <= MAX_PARAMETERS).then_some(parameters + OVERHEAD)
    }

    fn decode(_: &(), frame: &[u8]) -> Result<Self, Reject> {
        let [_, _, summed @ .., sum] = frame else { return Err(Reject::Length) };
        let [id, _, errors, parameters @ ..] = summed else { return Err(Reject::Length) };
        if checksum(summed) != *sum {
            return Err(Reject::Checksum);
        }
        let length = u8::try_from(parameters.len()).map_err(|_| Reject::Length)?;
        let mut status = Self { id: *id, errors: *errors, parameters: [0; MAX_PARAMETERS], length };
        let place = status.parameters.get_mut(..parameters.len()).ok_or(Reject::Length)?;
        place.copy_from_slice(parameters);
        Ok(status)
    }
}

/// Position counts in one turn of the shaft.
pub const COUNTS_PER_TURN: u16 = 4096;

/// Returns a number in the format of the servo: bit 15 is the sign, bits 0 to 14 are the magnitude. -32768 becomes
/// -32767.
///
/// # Examples
/// ```
/// use drivetrain::wire::feetech::{from_sign_magnitude, to_sign_magnitude};
///
/// assert_eq!(to_sign_magnitude(-1000), 0x83E8);
/// assert_eq!(from_sign_magnitude(0x83E8), -1000);
/// assert_eq!(to_sign_magnitude(i16::MIN), 0xFFFF);
/// ```
#[must_use]
pub const fn to_sign_magnitude(value: i16) -> u16 {
    let magnitude = value.unsigned_abs();
    let magnitude = if magnitude > 0x7FFF { 0x7FFF } else { magnitude };
    if value < 0 { magnitude | 0x8000 } else { magnitude }
}

/// Reads a number in the format of the servo; -0 is 0.
#[must_use]
pub const fn from_sign_magnitude(raw: u16) -> i16 {
    let magnitude = (raw & 0x7FFF).cast_signed();
    if raw & 0x8000 != 0 { -magnitude } else { magnitude }
}

/// Where a servo is to go: the seven registers from [`ADDRESS`](Self::ADDRESS) on.
///
/// In wheel mode only `speed`, with its sign, and `acceleration` count.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Goal {
    /// In 100 counts per second²; 0 is the largest.
    pub acceleration: u8,
    /// In counts, 4096 a turn.
    pub position: i16,
    /// Ignored by servos of the STS series; 0.
    pub time: u16,
    /// In counts per second; 0 is the largest in position mode.
    pub speed: i16,
}

impl Goal {
    /// The first register.
    pub const ADDRESS: u8 = register::ACCELERATION;

    /// Returns the bytes of the registers.
    #[must_use]
    pub const fn to_bytes(&self) -> [u8; 7] {
        let [p0, p1] = to_sign_magnitude(self.position).to_le_bytes();
        let [t0, t1] = self.time.to_le_bytes();
        let [s0, s1] = to_sign_magnitude(self.speed).to_le_bytes();
        [self.acceleration, p0, p1, t0, t1, s0, s1]
    }
}

/// Measurements of a servo: the eight registers from [`ADDRESS`](Self::ADDRESS) on.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Present {
    /// In counts, 4096 a turn.
    pub position: i16,
    /// In counts per second.
    pub speed: i16,
    /// In 0.1 % of the largest output: -1000 to 1000.
    pub load: i16,
    /// In 0.1 V.
    pub voltage_dv: u8,
    /// In degrees Celsius.
    pub temperature_c: u8,
}

impl Present {
    /// The first register.
    pub const ADDRESS: u8 = register::PRESENT_POSITION;
    /// The number of registers.
    pub const LENGTH: u8 = 8;

    /// Reads the answer to `read(id, Present::ADDRESS, Present::LENGTH, ..)`; `None` for another length.
    #[must_use]
    pub fn from_status(status: &Status) -> Option<Self> {
        let bytes: [u8; 8] = status.parameters().try_into().ok()?;
        let mut fields = Reader(&bytes);
        Some(Self {
            position: from_sign_magnitude(fields.u16_le()?),
            speed: from_sign_magnitude(fields.u16_le()?),
            load: load(fields.u16_le()?),
            voltage_dv: fields.u8()?,
            temperature_c: fields.u8()?,
        })
    }

    /// Returns the position as an angle.
    #[must_use]
    pub const fn angle(&self) -> Angle {
        Angle::from_counts(self.position as i32, COUNTS_PER_TURN)
    }

    /// Returns the supply voltage in volts.
    #[must_use]
    pub const fn voltage_v(&self) -> f32 {
        self.voltage_dv as f32 * 0.1
    }
}

/// Reads the load. The sources put its sign into bit 10 or into bit 15. The magnitude needs neither, as it is at most
/// 1000: whichever is set is the sign.
const fn load(raw: u16) -> i16 {
    let magnitude = (raw & 0x3FF).cast_signed();
    if raw & 0x8400 != 0 { -magnitude } else { magnitude }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_complaint_is_one_bit() {
        let complaints = |errors: u8| {
            let status = Status { id: 1, errors, parameters: [0; MAX_PARAMETERS], length: 0 };
            assert_eq!(status.errors(), errors);
            [
                status.has_voltage_error(),
                status.has_sensor_error(),
                status.is_overheated(),
                status.has_overcurrent(),
                status.is_overloaded(),
            ]
        };
        for (place, bit) in [0, 1, 2, 3, 5].into_iter().enumerate() {
            let mut only = [false; 5];
            only[place] = true;
            assert_eq!(complaints(1 << bit), only);
            assert_eq!(complaints(!(1 << bit)), only.map(|set| !set));
        }
    }

    #[test]
    fn a_status_comes_from_one_servo_and_fits_the_longest_frame() {
        assert_eq!(MAX_FRAME, 38);
        assert_eq!(Status::length(&(), &[0xFF, 0xFF, 253, 34]), Some(MAX_FRAME));
        assert_eq!(Status::length(&(), &[0xFF, 0xFF, 254, 34]), None);
        assert_eq!(Status::length(&(), &[0xFF, 0xFF, 253, 35]), None);
        assert_eq!(Status::length(&(), &[0xFF, 0xFF, 253, 1]), None);
    }

    #[test]
    fn every_number_survives_sign_and_magnitude() {
        for value in -32_767..=i16::MAX {
            assert_eq!(from_sign_magnitude(to_sign_magnitude(value)), value);
        }
        assert_eq!(from_sign_magnitude(to_sign_magnitude(i16::MIN)), -32_767);
        assert_eq!(from_sign_magnitude(0x8000), 0);
    }

    #[test]
    fn the_sign_of_the_load_is_read_from_either_bit() {
        assert_eq!([load(1000), load(0x400 | 1000), load(0x8000 | 1000)], [1000, -1000, -1000]);
    }
}
