//! Receivers of a byte stream, and the deadline of its content.

use super::{Counts, Decode, Deframer};
use crate::time::{Duration, Edge, Instant};

/// A [`Deframer`] that keeps its latest frame, and discards the frame when no new frame came in time.
///
/// # Examples
/// ```
/// use drivetrain::time::{Duration, Instant};
/// use drivetrain::wire::host_link::{HostCommand, COMMAND_LENGTH};
/// use drivetrain::wire::Receiver;
///
/// let ms = |ms| Instant::START + Duration::from_millis(ms);
/// let mut host = Receiver::<HostCommand, COMMAND_LENGTH>::new(Duration::from_millis(100));
/// let mut buffer = [0; COMMAND_LENGTH];
/// let mut received = HostCommand::default().encode(&mut buffer)?;
/// assert_eq!(host.read(&mut received, ms(1)), Some(HostCommand::default()));
///
/// assert!(host.latest(ms(101)).is_some());
/// assert!(host.latest(ms(102)).is_none()); // relax the robot
/// assert!(host.edge(ms(102)).is_some_and(|heard| !heard.began && heard.at == ms(1)));
/// assert!(host.edge(ms(102)).is_some_and(|silent| silent.began && silent.at == ms(101)));
/// # Ok::<(), drivetrain::wire::EncodeError>(())
/// ```
#[derive(Debug, Clone)]
pub struct Receiver<F: Decode, const N: usize> {
    decoder: Deframer<F, N>,
    deadline: Deadline,
    latest: Option<F>,
    frozen_frames: u32,
}

impl<F: Decode<Options = ()> + Copy, const N: usize> Receiver<F, N> {
    /// Takes the age limit of the last frame, for frames without options.
    #[must_use]
    pub const fn new(deadline: Duration) -> Self {
        Self::with_options((), deadline)
    }
}

impl<F: Decode + Copy, const N: usize> Receiver<F, N> {
    /// Takes the options of the frames, and the age limit of the last frame.
    #[must_use]
    pub const fn with_options(options: F::Options, deadline: Duration) -> Self {
        Self {
            decoder: Deframer::with_options(options),
            deadline: Deadline::new(deadline),
            latest: None,
            frozen_frames: 0,
        }
    }

    /// Returns the next frame of `input`, as [`Deframer::read`] does; `now` is when the bytes arrived.
    ///
    /// Frames that only repeat the last frame (see [`Decode::is_new`]) are returned too, but do not keep the link
    /// alive.
    #[must_use]
    pub fn read(&mut self, input: &mut &[u8], now: Instant) -> Option<F> {
        let frame = self.decoder.read(input)?;
        if self.latest.is_none_or(|previous| frame.is_new(&previous)) {
            self.deadline.meet(now);
        } else {
            self.frozen_frames = self.frozen_frames.saturating_add(1);
        }
        self.latest = Some(frame);
        Some(frame)
    }

    /// Discards an unfinished frame; see [`Deframer::abandon`].
    pub fn abandon(&mut self) {
        self.decoder.abandon();
    }

    /// Returns the latest frame; `None` before the first frame, and when the last new frame is older than the deadline.
    #[must_use]
    pub fn latest(&self, now: Instant) -> Option<F> {
        self.latest.filter(|_| self.deadline.is_live(now))
    }

    /// Returns the oldest unread beginning or end of silence, the only condition of a receiver: no new data until the deadline, or data not
    /// to be trusted. A source is silent before its first data. The text is "silence began at 101000 us".
    #[must_use]
    pub fn edge(&mut self, now: Instant) -> Option<Edge<&'static str>> {
        self.deadline.edge(now)
    }

    /// Returns how often the other side was lost. Saturates.
    #[must_use]
    pub const fn losses(&self) -> u32 {
        self.deadline.losses()
    }

    /// Returns the number of frames that only repeated the last frame. Saturates.
    #[must_use]
    pub const fn frozen_frames(&self) -> u32 {
        self.frozen_frames
    }

    /// Returns the counts of frames and of discarded bytes.
    #[must_use]
    pub const fn counts(&self) -> Counts {
        self.decoder.counts()
    }
}

/// Watches an event that repeats within a time limit, and latches each change.
///
/// At first, the source is silent. An edge is kept until read. When the source came and went more than once between two
/// calls of [`edge`](Self::edge), changes that cancel each other are left out; [`losses`](Self::losses) still counts
/// them all.
#[derive(Debug, Clone)]
pub(super) struct Deadline {
    limit: Duration,
    met: Instant,
    live: bool,
    losses: u32,
    pending: [Option<Edge<&'static str>>; 2],
}

impl Deadline {
    /// Takes the longest silence without a loss.
    pub(super) const fn new(limit: Duration) -> Self {
        Self { limit, met: Instant::START, live: false, losses: 0, pending: [None; 2] }
    }

    /// Notes that data came.
    pub(super) fn meet(&mut self, now: Instant) {
        self.expire(now);
        self.met = now;
        if !self.live {
            self.live = true;
            self.latch(edge(false, now));
        }
    }

    /// Notes data that cannot be trusted: lost at once.
    pub(super) fn revoke(&mut self, now: Instant) {
        self.expire(now);
        if self.live {
            self.lose(now);
        }
    }

    /// Returns whether data came within the limit.
    pub(super) fn is_live(&self, now: Instant) -> bool {
        self.live && now.since(self.met) <= self.limit
    }

    /// Returns the oldest unread edge.
    pub(super) fn edge(&mut self, now: Instant) -> Option<Edge<&'static str>> {
        self.expire(now);
        let [first, second] = self.pending;
        self.pending = [second, None];
        first
    }

    /// Returns how often the source was lost. Saturates.
    pub(super) const fn losses(&self) -> u32 {
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
        self.latch(edge(true, at));
    }

    fn latch(&mut self, edge: Edge<&'static str>) {
        self.pending = match self.pending {
            [None, _] => [Some(edge), None],
            [first, None] => [first, Some(edge)],
            [first, Some(_)] => [first, None],
        };
    }
}

/// Beginning or end of silence.
const fn edge(began: bool, at: Instant) -> Edge<&'static str> {
    Edge { source: (), condition: "silence", began, at }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ms(ms: u64) -> Instant {
        Instant::START + Duration::from_millis(ms)
    }

    #[test]
    fn data_counts_until_the_limit_and_both_edges_wait() {
        let mut host = Deadline::new(Duration::from_millis(100));
        assert!(!host.is_live(ms(0)));
        host.meet(ms(5));
        assert!(host.is_live(ms(105)) && !host.is_live(ms(106)));
        assert_eq!(host.edge(ms(300)), Some(edge(false, ms(5))));
        assert_eq!(host.edge(ms(300)), Some(edge(true, ms(105))));
        assert_eq!(host.edge(ms(300)), None);
    }

    #[test]
    fn a_loss_between_two_frames_is_latched_without_a_reading_meanwhile() {
        let mut deadline = Deadline::new(Duration::from_millis(10));
        deadline.meet(ms(0));
        assert_eq!(deadline.edge(ms(0)), Some(edge(false, ms(0))));
        deadline.meet(ms(50));
        assert_eq!(deadline.edge(ms(50)), Some(edge(true, ms(10))));
        assert_eq!(deadline.edge(ms(50)), Some(edge(false, ms(50))));
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

    fn is_heard(edge: Edge<&'static str>) -> bool {
        !edge.began
    }
}
