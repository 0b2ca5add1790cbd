//! What a joint answers.

use super::Register;

const REPLY: u8 = 0x04;

/// The value of a register, as a joint reports it.
///
/// # Examples
/// ```
/// use drivetrain::snake::{Register, Reply};
///
/// let reply = Reply::decode(&[0x04, 0x07, 0xFF, 0xFF, 0xFF, 0xFF])?;
/// assert_eq!((reply.register(), reply.value()), (Register::ActualPosition, -1));
/// # Ok::<(), drivetrain::snake::ReplyError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Reply {
    register: Register,
    value: i32,
}

/// Why a frame is no reply.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ReplyError {
    /// It has not 6 bytes.
    Length(usize),
    /// Its first byte is not 4.
    Kind(u8),
    /// There is no such register.
    Register(u8),
}

impl Reply {
    /// Takes a register and its value.
    #[must_use]
    pub const fn new(register: Register, value: i32) -> Self {
        Self { register, value }
    }

    /// Takes the data of a reply.
    ///
    /// # Errors
    /// Says what is wrong with it.
    pub fn decode(data: &[u8]) -> Result<Self, ReplyError> {
        let [kind, register, a, b, c, d] = *data else {
            return Err(ReplyError::Length(data.len()));
        };
        if kind != REPLY {
            return Err(ReplyError::Kind(kind));
        }
        let known = Register::from_raw(register).ok_or(ReplyError::Register(register))?;
        Ok(Self::new(known, i32::from_be_bytes([a, b, c, d])))
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

    /// Returns its value, as on the wire.
    #[must_use]
    pub const fn value(self) -> i32 {
        self.value
    }
}

impl core::fmt::Display for ReplyError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Length(length) => write!(f, "{length} bytes are no reply of 6"),
            Self::Kind(kind) => write!(f, "a reply begins with 4, not with {kind}"),
            Self::Register(register) => write!(f, "there is no register {register:#04x}"),
        }
    }
}

impl core::error::Error for ReplyError {}
