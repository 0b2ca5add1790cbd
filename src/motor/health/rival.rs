use crate::time::{Duration, Instant};

/// Another node that sends commands: the time of its last frame.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Rival(Option<Instant>);

impl Rival {
    /// Time after the last frame from which the node counts as gone.
    pub(crate) const FORGOTTEN: Duration = Duration::from_secs(1);

    pub(crate) const NONE: Self = Self(None);

    pub(crate) const fn hear(&mut self, now: Instant) {
        self.0 = Some(now);
    }

    /// Forgets a node that has fallen silent.
    pub(crate) fn check(&mut self, now: Instant) {
        self.0 = self.0.filter(|heard| now.since(*heard) <= Self::FORGOTTEN);
    }

    pub(crate) const fn is_present(self) -> bool {
        self.0.is_some()
    }
}
