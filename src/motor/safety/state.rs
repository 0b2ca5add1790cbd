//! States of one motor, apart from its link.

/// Whether a motor takes targets.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Arming {
    Disarmed,
    Armed,
    /// Relaxed since arming, because the feedback was lost.
    Latched,
    /// Relaxed since arming, for another reason.
    Tripped,
}

/// Rest of a motor since the last run of its loops.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Rest {
    /// No rest.
    None,
    /// The feedback was late: older measurements give no rate.
    Pause,
    /// There was no target: the loops start afresh.
    Relaxed,
}
