use crate::time::{Duration, Instant};

/// A source of data went silent or was heard again.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum SignalEdge {
    /// Data came, for the first time or again.
    Heard {
        /// When it came.
        at: Instant,
    },
    /// Nothing came until the deadline, or what came could not be trusted.
    Lost {
        /// When the deadline passed, or the bad data came.
        at: Instant,
    },
}

/// Watches that something happens again within a time limit, and latches each change.
///
/// It begins as not live. An [`SignalEdge`] is kept until it is fetched. When the source came and went more than once
/// between two calls of [`edge`](Self::edge), the changes that cancel each other are left out; [`losses`](Self::losses)
/// still counts them all.
///
/// # Examples
/// ```
/// use drivetrain::time::{Duration, Instant};
/// use drivetrain::wire::{Deadline, SignalEdge};
///
/// let ms = |ms| Instant::START + Duration::from_millis(ms);
/// let mut host = Deadline::new(Duration::from_millis(100));
/// assert!(!host.is_live(ms(0)));
/// host.meet(ms(5));
/// assert!(host.is_live(ms(105)));
/// assert!(!host.is_live(ms(106)));
/// assert_eq!(host.edge(ms(300)), Some(SignalEdge::Heard { at: ms(5) }));
/// assert_eq!(host.edge(ms(300)), Some(SignalEdge::Lost { at: ms(105) }));
/// assert_eq!(host.edge(ms(300)), None);
/// ```
#[derive(Debug, Clone)]
pub struct Deadline {
    limit: Duration,
    met: Instant,
    live: bool,
    losses: u32,
    pending: [Option<SignalEdge>; 2],
}

impl Deadline {
    /// Takes the longest silence that is no loss.
    #[must_use]
    pub const fn new(limit: Duration) -> Self {
        Self { limit, met: Instant::START, live: false, losses: 0, pending: [None; 2] }
    }

    /// Notes that data came.
    pub fn meet(&mut self, now: Instant) {
        self.expire(now);
        self.met = now;
        if !self.live {
            self.live = true;
            self.latch(SignalEdge::Heard { at: now });
        }
    }

    /// Notes that what came cannot be trusted: lost at once.
    pub fn revoke(&mut self, now: Instant) {
        self.expire(now);
        if self.live {
            self.lose(now);
        }
    }

    /// Returns whether data came within the limit.
    #[must_use]
    pub fn is_live(&self, now: Instant) -> bool {
        self.live && now.since(self.met) <= self.limit
    }

    /// Returns the oldest change that was not fetched yet.
    #[must_use]
    pub fn edge(&mut self, now: Instant) -> Option<SignalEdge> {
        self.expire(now);
        let [first, second] = self.pending;
        self.pending = [second, None];
        first
    }

    /// Returns how often the source was lost. Saturates.
    #[must_use]
    pub const fn losses(&self) -> u32 {
        self.losses
    }

    fn expire(&mut self, now: Instant) {
        if self.live && !self.is_live(now) {
            self.lose(self.met + self.limit);
        }
    }

    fn lose(&mut self, at: Instant) {
        self.live = false;
        self.losses = self.losses.saturating_add(1);
        self.latch(SignalEdge::Lost { at });
    }

    fn latch(&mut self, edge: SignalEdge) {
        self.pending = match self.pending {
            [None, _] => [Some(edge), None],
            [first, None] => [first, Some(edge)],
            [first, Some(_)] => [first, None],
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ms(ms: u64) -> Instant {
        Instant::START + Duration::from_millis(ms)
    }

    #[test]
    fn a_loss_between_two_frames_is_seen_though_nobody_asked_meanwhile() {
        let mut deadline = Deadline::new(Duration::from_millis(10));
        deadline.meet(ms(0));
        assert_eq!(deadline.edge(ms(0)), Some(SignalEdge::Heard { at: ms(0) }));
        deadline.meet(ms(50));
        assert_eq!(deadline.edge(ms(50)), Some(SignalEdge::Lost { at: ms(10) }));
        assert_eq!(deadline.edge(ms(50)), Some(SignalEdge::Heard { at: ms(50) }));
        assert_eq!(deadline.edge(ms(50)), None);
    }

    #[test]
    fn the_last_edge_always_tells_the_present_state() {
        let mut deadline = Deadline::new(Duration::from_millis(10));
        for round in 1..100 {
            deadline.meet(ms(100 * round));
            if round % 3 == 0 {
                deadline.revoke(ms(100 * round + 5));
            }
            let now = ms(100 * round + 6);
            if round % 7 == 0 {
                let mut last = None;
                while let Some(edge) = deadline.edge(now) {
                    assert_ne!(
                        last.map(is_heard),
                        Some(is_heard(edge)),
                        "two equal edges in a row"
                    );
                    last = Some(edge);
                }
                assert_eq!(last.map(is_heard), Some(deadline.is_live(now)));
            }
        }
        assert_eq!(deadline.losses(), 98 + 1);
    }

    fn is_heard(edge: SignalEdge) -> bool {
        matches!(edge, SignalEdge::Heard { .. })
    }
}
