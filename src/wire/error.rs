use core::fmt;

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
