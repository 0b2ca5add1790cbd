//! Answers of a drive needed before the motor may be driven.

/// How far a drive is on its way to be driven.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Enabling {
    /// The drive is to be driven.
    pub(super) is_wanted: bool,
    /// The state was read since then.
    pub(super) is_sound: bool,
    /// The brake was released, or the angle read, since then.
    pub(super) is_prepared: bool,
    /// All of this has been so, and nothing told otherwise since.
    pub(super) is_on: bool,
    /// The drive is not to be driven, and has confirmed to be off.
    pub(super) is_off: bool,
    /// Feedback came since then: the drive follows frames. A drive whose time-out has expired sends the first frame back, and
    /// the second one has to be rest.
    pub(super) is_heard: bool,
}

impl Enabling {
    /// Takes whether the mode has to be prepared, and whether the drive has confirmed its time-out.
    pub(super) const fn settle(&mut self, prepares: bool, has_timeout: bool) {
        let is_prepared = self.is_prepared || !prepares;
        self.is_on |= self.is_wanted && self.is_sound && is_prepared && has_timeout;
    }
}
