//! The link to a motor, the ages at which feedback and commands count as lost, and the stamps by which ages are known.

use crate::error::ConfigError;
use crate::time::{Duration, Instant};

/// After a silence of so long a drive may have started again, in µs.
pub(crate) const SILENCE_US: u32 = 100_000;

/// Whether a motor is heard.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Link {
    /// No frame yet.
    #[default]
    Unheard,
    /// Fresh feedback.
    Online,
    /// The last feedback is older than [`Timeouts::late`]: zero output; the integrators of a motor with a target are frozen. Clears itself.
    Late,
    /// The last feedback is older than [`Timeouts::offline`]: relaxed, latched.
    Offline,
    /// Heard again after being offline; not trusted before [`Timeouts::good_frames`] frames in a row.
    Recovering,
}

/// When feedback and commands count as lost.
///
/// # Examples
/// ```
/// use drivetrain::motor::Timeouts;
/// use drivetrain::time::Duration;
///
/// let defaults = Timeouts::new();
/// assert_eq!(defaults.late(), Duration::from_millis(10));
/// assert_eq!(defaults.offline(), Duration::from_millis(100));
/// assert_eq!(defaults.command(), Duration::from_millis(100));
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Timeouts {
    late_us: u32,
    offline_us: u32,
    command_us: u32,
    /// In ms, where it takes no more room.
    measured_ms: u16,
    good_frames: u8,
}

impl Timeouts {
    /// Feedback that is polled, one motor after the other: late after 40 ms, all else as [`new`](Self::new).
    pub(crate) const POLLED: Self = Self { late_us: 40_000, ..Self::new() };

    /// Feedback late after 10 ms and offline after 100 ms, command deadline 100 ms, measurements of another sensor too old
    /// after 20 ms, back after 10 good frames.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            late_us: 10_000,
            offline_us: 100_000,
            command_us: 100_000,
            measured_ms: 20,
            good_frames: 10,
        }
    }

    /// Sets the ages from which feedback is late and a motor offline: `late` at most 1 s, `offline` from `late` to 10 s.
    ///
    /// # Errors
    /// Names the age outside of its range: longer than a robot may be driven blindly.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::motor::Timeouts;
    /// use drivetrain::time::Duration;
    ///
    /// let slow = Timeouts::new().with_feedback(Duration::from_millis(40), Duration::from_millis(400))?;
    /// assert_eq!(slow.late(), Duration::from_millis(40));
    /// let blind = Timeouts::new().with_feedback(Duration::from_secs(10), Duration::from_millis(1));
    /// assert_eq!(
    ///     blind.map_err(|error| error.to_string()),
    ///     Err("late in us 10000000: 1 to 1000000 are allowed".into()),
    /// );
    /// # Ok::<(), drivetrain::error::ConfigError>(())
    /// ```
    pub const fn with_feedback(
        self,
        late: Duration,
        offline: Duration,
    ) -> Result<Self, ConfigError> {
        let late_us = match ConfigError::check_micros("late in us", late.micros_u32(), 1, BLIND_US)
        {
            Ok(micros) => micros,
            Err(error) => return Err(error),
        };
        match ConfigError::check_micros("offline in us", offline.micros_u32(), late_us, LONGEST_US)
        {
            Ok(offline_us) => Ok(Self { late_us, offline_us, ..self }),
            Err(error) => Err(error),
        }
    }

    /// Sets the age at which a target expires: at most 1 s, and longer than the period of the updates, because a target
    /// has the time of the last update.
    ///
    /// # Errors
    /// The age is zero or longer than 1 s.
    pub const fn with_command(self, command: Duration) -> Result<Self, ConfigError> {
        match ConfigError::check_micros("command in us", command.micros_u32(), 1, BLIND_US) {
            Ok(command_us) => Ok(Self { command_us, ..self }),
            Err(error) => Err(error),
        }
    }

    /// Sets the age at which a [measurement of another sensor](super::Measured) expires: 1 ms to 1 s, in whole milliseconds.
    /// A measurement never counts for longer than the command deadline.
    ///
    /// # Errors
    /// The age is out of this range.
    pub const fn with_measured(self, measured: Duration) -> Result<Self, ConfigError> {
        match ConfigError::check_micros("measurement in us", measured.micros_u32(), 1_000, BLIND_US)
        {
            #[expect(clippy::cast_possible_truncation, reason = "at most 1000")]
            Ok(micros) => Ok(Self { measured_ms: (micros / 1_000) as u16, ..self }),
            Err(error) => Err(error),
        }
    }

    /// Sets how many frames in a row bring an offline motor back: at least 1.
    #[must_use]
    pub const fn with_good_frames(self, good_frames: u8) -> Self {
        Self { good_frames: if good_frames == 0 { 1 } else { good_frames }, ..self }
    }

    /// Returns the age above which feedback is late.
    #[must_use]
    pub const fn late(&self) -> Duration {
        Duration::from_micros(self.late_us as u64)
    }

    /// Returns the age above which a motor is offline.
    #[must_use]
    pub const fn offline(&self) -> Duration {
        Duration::from_micros(self.offline_us as u64)
    }

    /// Returns the age at which a target expires.
    #[must_use]
    pub const fn command(&self) -> Duration {
        Duration::from_micros(self.command_us as u64)
    }

    /// Returns the age at which a measurement of another sensor expires.
    #[must_use]
    pub const fn measured(&self) -> Duration {
        Duration::from_millis(self.measured_ms as u64)
    }

    /// Returns how many frames in a row bring an offline motor back.
    #[must_use]
    pub const fn good_frames(&self) -> u8 {
        self.good_frames
    }

    pub(crate) const fn late_us(&self) -> u32 {
        self.late_us
    }

    pub(crate) const fn offline_us(&self) -> u32 {
        self.offline_us
    }

    pub(crate) const fn measured_us(&self) -> u32 {
        self.measured_ms as u32 * 1_000
    }

    pub(crate) const fn command_us(&self) -> u32 {
        self.command_us
    }
}

impl Default for Timeouts {
    fn default() -> Self {
        Self::new()
    }
}

/// The longest time for which a motor may be driven without feedback, or without a new target.
const BLIND_US: u32 = 1_000_000;

/// Far below the 71 minutes after which a 32-bit stamp repeats.
const LONGEST_US: u32 = 10_000_000;

/// Tells whether a stamp, of 32 bits in µs, lies within `limit` of `now`, before or after. A stamp repeats after 71 min 35 s.
///
/// A stamp may lie after `now`, because an interrupt may stamp a frame just after a tick has read the clock. The limit holds there too:
/// after a set-back of the clock, an old stamp must not look fresh.
#[inline]
pub(crate) const fn is_near(now: u32, stamp: u32, limit: u32) -> bool {
    now.wrapping_sub(stamp).wrapping_add(limit) <= limit.wrapping_mul(2)
}

/// Returns the age of a stamp; zero for a stamp ahead.
pub(crate) const fn age(now: u32, stamp: u32) -> u32 {
    let age = now.wrapping_sub(stamp);
    if age.cast_signed() < 0 { 0 } else { age }
}

/// Returns the age of a stamp, which is brought to `now` if the clock went back behind it.
pub(crate) fn take_age(now: Instant, stamp: &mut u32) -> Duration {
    let micros = age(now.stamp(), *stamp);
    *stamp = now.stamp().wrapping_sub(micros);
    Duration::from_micros(micros.into())
}
