//! Frames of a motor between its commands.

/// A value sent to a drive between commands: on a change with every second command at most, and again after so many, for a frame
/// may be lost.
#[derive(Debug, Default, Clone, Copy)]
pub(crate) struct Told {
    value: f32,
    /// Commands since then.
    since: u8,
}

impl Told {
    /// The drive was told this before the first command.
    pub(crate) const fn new(value: f32) -> Self {
        Self { value, since: 1 }
    }

    /// Counts a command, and tells whether the value takes its place.
    pub(crate) fn is_due(&mut self, value: f32, period: u8) -> bool {
        self.since = self.since.saturating_add(1);
        let has_changed = value.to_bits() != self.value.to_bits();
        let is_due = self.since > if has_changed { 1 } else { period };
        if is_due {
            *self = Self { value, since: 0 };
        }
        is_due
    }

    pub(crate) const fn value(self) -> f32 {
        self.value
    }

    /// Returns how many commands were counted since the drive was told.
    pub(crate) const fn since(self) -> u8 {
        self.since
    }

    /// The frame was not sent, and is due.
    pub(crate) const fn repeat(&mut self) {
        self.since = u8::MAX;
    }
}
