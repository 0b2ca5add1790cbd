use core::fmt;

/// The reason for a run without a plant.
///
/// # Examples
/// ```
/// use drivetrain::control::{Identification, IdentificationError};
///
/// let still = Identification::new(10.0, 0.1)?;
/// let error = still.result().unwrap_err();
/// assert_eq!(error, IdentificationError::NotExcited);
/// assert_eq!(error.to_string(), "not excited: both directions, several speeds and reversals of the effort are necessary");
/// # Ok::<(), drivetrain::error::ConfigError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum IdentificationError {
    /// Too few samples in motion, or a motion that does not separate friction, resistance and inertia: one direction, one speed,
    /// no reversal of the effort; a shaft that the effort does not move.
    NotExcited,
    /// The standard deviation of `kA` is above 5 %: more time, more effort, or less noise of the speed is necessary.
    TooNoisy,
    /// More samples had an effort beyond the limit of the drive than within.
    Saturated,
    /// The response is later than the largest delay that is searched, [`Identification::LAGS`](super::Identification::LAGS) ticks.
    DelayTooLong,
    /// The speed exceeded the limit of the excitation.
    TooFast,
    /// The way exceeded the limit of the excitation.
    TooFar,
    /// The feedback was NaN or infinite, or missing for more than 0.1 s, while the excitation drove the motor.
    NoFeedback,
}

impl fmt::Display for IdentificationError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NotExcited => {
                "not excited: both directions, several speeds and reversals of the effort are necessary"
            }
            Self::TooNoisy => "too noisy: the inertia is uncertain by more than 5 %",
            Self::Saturated => "saturated: most efforts are beyond the limit of the drive",
            Self::DelayTooLong => "the delay is longer than 12 ticks",
            Self::TooFast => "stopped: the speed is beyond its limit",
            Self::TooFar => "stopped: the way is beyond its limit",
            Self::NoFeedback => "stopped: no valid feedback",
        })
    }
}

impl core::error::Error for IdentificationError {}
