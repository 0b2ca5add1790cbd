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
    frames: Vec<(Instant, CanFrame)>,
    next: usize,
    /// When it begins, in the session.
    start: Instant,
    time: Time,
}

impl Replay {
    /// # Errors
    /// Says what is wrong with the file.
    pub(crate) fn open(path: &str, time: Time) -> Result<Self, String> {
        let frames = record::read(path)?;
        Ok(Self { name: path.to_owned(), frames, next: 0, start: time.read(), time })
    }

    pub(crate) fn name(&self) -> &str {
        &self.name
    }

    pub(crate) fn is_over(&self) -> bool {
        self.next >= self.frames.len()
    }

    /// Begins from its first frame.
    pub(crate) fn rewind(&mut self) {
        (self.next, self.start) = (0, self.time.read());
    }

    pub(crate) fn receive(&mut self) -> Option<Heard> {
        let ((first, _), (at, frame)) = (self.frames.first()?, self.frames.get(self.next)?);
        let passed = self.time.read().since(self.start) + Duration::from_millis(1);
        if passed <= at.since(*first) {
            return None;
        }
        self.next += 1;
        Some(Heard::Frame(*frame))
    }
}
