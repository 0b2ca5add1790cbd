//! Replies of a joint.

use super::Register;

const REPLY: u8 = 0x04;

/// Value of a register, as reported by a joint.
///
/// # Examples
/// ```
/// use drivetrain::snake::{Register, Reply};
///
/// let reply = Reply::decode(&[0x04, 0x07, 0xFF, 0xFF, 0xFF, 0xFF]).ok_or("no reply")?;
/// assert_eq!((reply.register(), reply.value()), (Register::ActualPosition, -1));
/// # Ok::<(), &str>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Reply {
    register: Register,
    value: i32,
}

impl Reply {
    /// Takes a register and its value.
    #[must_use]
    pub const fn new(register: Register, value: i32) -> Self {
        Self { register, value }
    }

    /// Takes the data of a reply; `None` unless the data has 6 bytes, begins with 4 and names a register.
    #[must_use]
    pub fn decode(data: &[u8]) -> Option<Self> {
        match *data {
            [REPLY, register, a, b, c, d] => {
                Some(Self::new(Register::from_raw(register)?, i32::from_be_bytes([a, b, c, d])))
            }
            _ => None,
        }
    }

    /// Returns the data of the reply.
    #[must_use]
    pub const fn encode(self) -> [u8; 6] {
        let [a, b, c, d] = self.value.to_be_bytes();
        [REPLY, self.register.as_raw(), a, b, c, d]
    }

    /// Returns the register.
    #[must_use]
    pub const fn register(self) -> Register {
        self.register
    }

    /// Returns the value of the register, as on the wire.
    #[must_use]
    pub const fn value(self) -> i32 {
        self.value
    }
}
