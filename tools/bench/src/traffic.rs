//! What goes over the bus: the load, and the frames of each id.

use crate::guess;
use crate::record::key;
use drivetrain::frame::CanFrame;
use drivetrain::motor::Claim;
use drivetrain::sim::frame_bits;
use drivetrain::time::{Duration, Instant};
use embedded_can::Frame;
use std::collections::BTreeMap;

/// Rates are those of the last half second.
const WINDOW: Duration = Duration::from_millis(500);

/// The bit rate that the load refers to.
pub(crate) const BITS_PER_S: f32 = 1e6;

/// The frames of one id, and of one side: this program, or all others.
#[derive(Debug, Clone)]
pub(crate) struct Row {
    pub(crate) frames: u64,
    pub(crate) rate_hz: f32,
    pub(crate) last: CanFrame,
    /// The motor with this id, or a guess in parentheses.
    pub(crate) owner: String,
    pub(crate) is_known: bool,
    /// This program sends these frames.
    pub(crate) is_ours: bool,
    in_window: u32,
}

/// What goes over the bus.
#[derive(Debug)]
pub(crate) struct Traffic {
    claims: Vec<Claim>,
    rows: BTreeMap<(bool, u32, bool), Row>,
    window: Option<Instant>,
    bits: u64,
    load: f32,
}

impl Traffic {
    pub(crate) fn new(claims: impl Iterator<Item = Claim>) -> Self {
        Self { claims: claims.collect(), rows: BTreeMap::new(), window: None, bits: 0, load: 0.0 }
    }

    pub(crate) fn note(&mut self, frame: &CanFrame, at: Instant, is_ours: bool) {
        self.turn(at);
        self.bits += u64::from(frame_bits(frame));
        let claims = &self.claims;
        let (is_extended, id) = key(frame);
        let row = self.rows.entry((is_extended, id, is_ours)).or_insert_with(|| {
            // LK and RMD answer with the id of their commands.
            let covers = |claim: &&Claim| claim.covers(frame.id());
            let mut both = claims.iter().filter(covers);
            let claim = both.clone().find(|claim| claim.is_feedback() != is_ours).or(both.next());
            let owner = match (claim, guess::of(frame)) {
                (Some(claim), _) if !claim.is_feedback() => {
                    format!("commands, {}", claim.motor())
                }
                (Some(claim), _) => claim.motor().to_string(),
                (None, Some(guess)) => format!("({guess}?)"),
                (None, None) => "(unknown)".into(),
            };
            let is_known = claim.is_some();
            Row { frames: 0, rate_hz: 0.0, last: *frame, owner, is_known, is_ours, in_window: 0 }
        });
        row.frames += 1;
        row.in_window += 1;
        row.last = *frame;
    }

    /// Tells whether a frame is a command to one of the motors, and no answer of any.
    pub(crate) fn is_command(&self, frame: &CanFrame) -> bool {
        let mut covering = self.claims.iter().filter(|claim| claim.covers(frame.id())).peekable();
        covering.peek().is_some() && covering.all(|claim| !claim.is_feedback())
    }

    /// Ends the window of the rates, if it is over.
    pub(crate) fn turn(&mut self, now: Instant) {
        let begun = *self.window.get_or_insert(now);
        let passed = now.since(begun);
        if passed < WINDOW {
            return;
        }
        let seconds = passed.as_secs_f32();
        for row in self.rows.values_mut() {
            row.rate_hz = std::mem::take(&mut row.in_window) as f32 / seconds;
        }
        self.load = std::mem::take(&mut self.bits) as f32 / seconds / BITS_PER_S;
        self.window = Some(now);
    }

    /// The share of the time in which the bus carries a frame.
    pub(crate) fn load(&self) -> f32 {
        self.load
    }

    pub(crate) fn rows(&self) -> impl Iterator<Item = &Row> {
        self.rows.values()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motors;
    use crate::robot::Robot;
    use drivetrain::motor::Devices;

    #[test]
    fn rates_and_load_are_those_of_the_last_half_second() {
        let mut robot = Robot::new(&motors::parse("m3508:1").unwrap(), false).unwrap();
        let mut traffic = Traffic::new(robot.claims());
        let frame = |id| CanFrame::standard(id, [0x55; 8]).unwrap();
        for ms in 0..=1_000 {
            let at = Instant::from_micros(1_000 * ms);
            traffic.note(&frame(0x201), at, false);
            if ms % 2 == 0 {
                traffic.note(&frame(0x7F0), at, ms % 4 == 0);
            }
        }
        let rows: Vec<_> = traffic.rows().collect();
        let owners: Vec<_> = rows.iter().map(|row| row.owner.as_str()).collect();
        assert_eq!(owners, ["M3508 #1", "(unknown)", "(unknown)"]);
        let sides: Vec<_> = rows.iter().map(|row| row.is_ours).collect();
        assert_eq!(sides, [false, false, true]);
        for (row, rate_hz) in rows.iter().zip([1_000.0, 250.0, 250.0]) {
            assert!((row.rate_hz - rate_hz).abs() < 3.0, "{row:?}");
        }
        // 1500 frames in a second of 111 bits, without stuff bits, and 3 of the pause.
        assert!((traffic.load() - 0.17).abs() < 0.02, "{}", traffic.load());
    }
}
