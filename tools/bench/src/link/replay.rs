//! A recording as a link: its frames come at their times, and nothing is sent.

use super::Heard;
use crate::record;
use crate::time::Time;
use drivetrain::frame::CanFrame;
use drivetrain::time::{Duration, Instant};

/// A recording that is played.
#[derive(Debug)]
pub(crate) struct Replay {
    name: String,
    frames: std::vec::IntoIter<(Instant, CanFrame)>,
    next: Option<(Instant, CanFrame)>,
    /// The time of the first frame, in the recording and in the session.
    starts: Option<(Instant, Instant)>,
    time: Time,
}

impl Replay {
    /// # Errors
    /// Says what is wrong with the file.
    pub(crate) fn open(path: &str, time: Time) -> Result<Self, String> {
        let mut frames = record::read(path)?.into_iter();
        let next = frames.next();
        let starts = next.map(|(first, _)| (first, time.read()));
        Ok(Self { name: path.to_owned(), frames, next, starts, time })
    }

    pub(crate) fn name(&self) -> &str {
        &self.name
    }

    pub(crate) fn is_over(&self) -> bool {
        self.next.is_none()
    }

    pub(crate) fn receive(&mut self) -> Option<Heard> {
        let ((at, frame), (first, start)) = self.next.zip(self.starts)?;
        let is_due = self.time.read().since(start) + Duration::from_millis(1) > at.since(first);
        if !is_due {
            return None;
        }
        self.next = self.frames.next();
        Some(Heard::Frame(frame))
    }
}
