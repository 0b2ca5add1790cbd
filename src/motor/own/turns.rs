//! The angle of a shaft over more turns than a frame reports.

use crate::encoder;
use crate::units::Angle;

/// The distance of a shaft from the turns that a drive can report, in ranges of the feedback.
#[derive(Debug, Default, Clone, Copy)]
pub(crate) struct Laps(i32);

impl Laps {
    /// Takes an unbounded position, and the range.
    #[expect(clippy::cast_possible_truncation, reason = "saturates")]
    pub(crate) fn of(position: f32, range: f32) -> Self {
        if position.abs() <= range {
            return Self(0);
        }
        let laps = ((position.abs() + range) / (2.0 * range)) as i32;
        Self(if position > 0.0 { laps } else { -laps })
    }

    /// Takes a reported position and the position before: a way of more than the range leads across its end.
    pub(crate) fn advance(&mut self, before: Option<f32>, position: f32, range: f32) {
        let way = before.map_or(0.0, |before| position - before);
        self.0 = self.0.saturating_add(i32::from(way < -range) - i32::from(way > range));
    }

    pub(crate) const fn is_none(self) -> bool {
        self.0 == 0
    }
}

/// Turns and phase of an output shaft, in integers: the phase in counts times turns of the gear's fraction, so no count is ever lost.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Tachometer {
    last: i32,
    turns: i64,
    /// From 0 to `turn`.
    phase: i32,
    turn: i32,
    output: i32,
}

impl Tachometer {
    /// Begins where the count of the drive is 0. Takes the counts for so many turns of the output shaft as the gear's fraction has,
    /// negative for a shaft that turns the other way: their product is below 2^30.
    pub(crate) const fn new(turn: i32, output: i32) -> Self {
        Self { last: 0, turns: 0, phase: 0, turn, output }
    }

    /// Takes a count of the drive; the count wraps. After a restart of the drive the angle begins at its new zero.
    pub(crate) fn take(&mut self, count: i32) {
        let way = count.wrapping_sub(self.last);
        self.last = count;
        // Whole runs of the gear's fraction leave the phase alone.
        let runs = way.checked_div(self.turn).unwrap_or_default();
        let rest = way.checked_rem(self.turn).unwrap_or_default();
        let sum = self.phase + rest * self.output;
        self.turns += i64::from(runs) * i64::from(self.output);
        self.turns += i64::from(sum.checked_div_euclid(self.turn).unwrap_or_default());
        self.phase = sum.checked_rem_euclid(self.turn).unwrap_or_default();
    }

    /// Returns the position since the drive has started.
    pub(crate) fn position(&self) -> encoder::Position {
        encoder::Position::new(self.turns, Angle::from_turns(self.phase as f32 / self.turn as f32))
    }
}
