//! The angle of the output shaft by the tachometer of the drive.

use super::Model;
use super::model::TACHO;
use crate::encoder;
use crate::units::Angle;

/// Turns and phase of the output shaft, in integers: the phase in counts times turns of the gear's fraction, so no count is ever lost.
#[derive(Debug, Clone, Copy)]
pub(super) struct Tachometer {
    last: i32,
    turns: i64,
    /// From 0 to `turn`.
    phase: i32,
    /// One turn of the output shaft, in the unit of the phase; below 2^30, also times the turns of the fraction.
    turn: i32,
    /// Turns of the output shaft in the gear's fraction; negative where the model is reversed.
    output: i32,
}

impl Tachometer {
    /// Begins where the count of the drive is 0. The model has been checked.
    pub(super) fn new(model: &Model) -> Self {
        let rotor = i32::from(model.gear.rotor());
        let output = i32::from(model.gear.output());
        let turn = i32::try_from(TACHO).unwrap_or(6) * i32::from(model.pole_pairs) * rotor;
        let output = if model.is_reversed { -output } else { output };
        Self { last: 0, turns: 0, phase: 0, turn, output }
    }

    /// Takes a count of the drive, which wraps. After a restart of the drive the angle is that of its new zero.
    pub(super) fn take(&mut self, count: i32) {
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
    pub(super) fn position(&self) -> encoder::Position {
        encoder::Position::new(self.turns, Angle::from_turns(self.phase as f32 / self.turn as f32))
    }
}
