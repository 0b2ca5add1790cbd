//! The states of one motor beside its link.

/// Whether a motor takes targets.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Arming {
    Disarmed,
    Armed,
    /// Relaxed since it was armed, because it was lost.
    Latched,
    /// Relaxed since it was armed, for something else.
    Tripped,
}

/// How a motor rested since its loops ran last.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Rest {
    /// Not at all.
    None,
    /// Its feedback was late: what was measured before says nothing of a rate.
    Pause,
    /// Nothing was asked of it: the loops start afresh.
    Relaxed,
}
