use super::checksum;
use crate::wire::{Decode, Reject};

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
}
