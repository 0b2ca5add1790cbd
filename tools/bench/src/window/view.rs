//! What the window draws: a snapshot of the session, and what of the past is shown beside it.

use crate::snapshot::Snapshot;
use std::collections::VecDeque;

/// Points of a strip chart: ten seconds at 20 Hz.
pub(crate) const POINTS: usize = 200;

/// Lines of the log that are kept.
pub(crate) const LINES: usize = 100;

/// The speeds of a motor in the past, in rpm, with the time in s.
#[derive(Debug, Clone, Default)]
pub(crate) struct Strip {
    pub(crate) measured: VecDeque<(f64, f64)>,
    pub(crate) target: VecDeque<(f64, f64)>,
}

impl Strip {
    pub(crate) fn push(&mut self, seconds: f64, measured: f64, target: Option<f64>) {
        self.measured.push_back((seconds, measured));
        self.target.extend(target.map(|target| (seconds, target)));
        let oldest = seconds - 0.05 * POINTS as f64;
        for points in [&mut self.measured, &mut self.target] {
            while points.front().is_some_and(|(at, _)| *at < oldest) {
                points.pop_front();
            }
        }
    }
}

/// What the window draws.
#[derive(Debug, Clone)]
pub(crate) struct View {
    pub(crate) snapshot: Snapshot,
    pub(crate) strips: Vec<Strip>,
    /// Edges, messages and results, the newest last.
    pub(crate) log: VecDeque<String>,
    pub(crate) is_held: bool,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_strip_keeps_ten_seconds() {
        let mut strip = Strip::default();
        for point in 0..1_000 {
            strip.push(0.05 * f64::from(point), 1.0, (point % 2 == 0).then_some(2.0));
        }
        assert!((200..=201).contains(&strip.measured.len()), "{}", strip.measured.len());
        assert!((100..=101).contains(&strip.target.len()));
        assert!(strip.measured[0].0 >= 39.9);
    }
}
