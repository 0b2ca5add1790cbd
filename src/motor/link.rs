use crate::time::Duration;

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
    /// The last feedback is older than [`Timeouts::late`]: zero output, integrators frozen. Clears itself.
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

    /// Sets the age from which feedback is late: at most 10 s.
    #[must_use]
    pub const fn with_late(self, late: Duration) -> Self {
        Self { late_us: limited(late), ..self }
    }

    /// Sets the age from which a motor is offline: at most 10 s. Taken as `late` when it is shorter.
    #[must_use]
    pub const fn with_offline(self, offline: Duration) -> Self {
        Self { offline_us: limited(offline), ..self }
    }

    /// Sets the age from which a target no longer counts: at most 10 s, and longer than the period of the updates,
    /// because a target has the time of the update before it.
    #[must_use]
    pub const fn with_command(self, command: Duration) -> Self {
        Self { command_us: limited(command), ..self }
    }

    /// Sets the age from which a [measurement of another sensor](super::Measured) is too old to be followed: at most 10 s, in
    /// whole milliseconds, at least one. It never counts for longer than the command deadline.
    #[must_use]
    pub const fn with_measured(self, measured: Duration) -> Self {
        #[expect(clippy::cast_possible_truncation, reason = "at most 10 000")]
        let millis = (limited(measured) / 1_000) as u16;
        Self { measured_ms: if millis == 0 { 1 } else { millis }, ..self }
    }

    /// Sets how many frames in a row bring an offline motor back: at least 1.
    #[must_use]
    pub const fn with_good_frames(self, good_frames: u8) -> Self {
        Self { good_frames: if good_frames == 0 { 1 } else { good_frames }, ..self }
    }

    /// Returns the age from which feedback is late.
    #[must_use]
    pub const fn late(&self) -> Duration {
        Duration::from_micros(self.late_us as u64)
    }

    /// Returns the age from which a motor is offline.
    #[must_use]
    pub const fn offline(&self) -> Duration {
        Duration::from_micros(self.offline_us() as u64)
    }

    /// Returns the age from which a target no longer counts.
    #[must_use]
    pub const fn command(&self) -> Duration {
        Duration::from_micros(self.command_us as u64)
    }

    /// Returns the age from which a measurement of another sensor is too old.
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
        if self.offline_us > self.late_us { self.offline_us } else { self.late_us }
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

/// Ten seconds are far below the 71 minutes after which a 32-bit stamp would repeat.
const fn limited(duration: Duration) -> u32 {
    const LIMIT: u32 = 10_000_000;
    match duration.micros_u32() {
        Some(micros) if micros <= LIMIT => micros,
        _ => LIMIT,
    }
}

/// What an armed motor does when it is heard again after being offline.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Recovery {
    /// It stays relaxed until it is armed again.
    #[default]
    Rearm,
    /// It takes targets again; its output limit rises from zero to full in this time, of 1 ms to 65 s.
    Ramp(Duration),
}
