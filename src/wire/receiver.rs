use super::deadline::Deadline;
use super::{Counts, Decode, Deframer, Silence};
use crate::time::{ConditionEdge, Duration, Instant};

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

    /// Returns the oldest unread beginning or end of silence.
    #[must_use]
    pub fn edge(&mut self, now: Instant) -> Option<ConditionEdge<Silence>> {
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
