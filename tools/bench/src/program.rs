//! Programs of an armed motor: a speed, a sine, steps, tuning, identification.

use crate::identifying::Identifying;
use crate::outcome::{Next, Outcome};
use crate::robot::Target;
use crate::tuning::Tuning;
use std::f32::consts::TAU;

/// What a motor does.
#[derive(Debug, Default)]
pub(crate) enum Program {
    /// It holds still.
    #[default]
    Still,
    /// A speed in rad/s.
    Speed(f32),
    /// A speed in rad/s to either side, and the period in s.
    Sine {
        amplitude: f32,
        period_s: f32,
        passed_s: f32,
    },
    /// A speed in rad/s, on and off for so long in s each.
    Steps {
        height: f32,
        half_s: f32,
        passed_s: f32,
    },
    Tune(Box<Tuning>),
    Identify(Box<Identifying>),
}

/// Request of a program in a tick.
#[derive(Debug)]
pub(crate) enum Asks {
    Target(Target),
    Gains((f32, f32, f32)),
    Done(Result<Outcome, String>),
}

impl Program {
    /// How the program is called.
    pub(crate) fn name(&self) -> String {
        match self {
            Self::Still => "still".into(),
            Self::Speed(_) => "speed".into(),
            Self::Sine { .. } => "sine".into(),
            Self::Steps { .. } => "steps".into(),
            Self::Tune(tuning) => format!("tune: {}", tuning.stage()),
            Self::Identify(identifying) => format!("identify: {}", identifying.stage()),
        }
    }

    /// The speed of this program and `by` rad/s more, `top` rad/s at most; from any other program, `by` from a standstill.
    pub(crate) fn jogged(&self, by: f32, top: f32) -> Self {
        let speed = by + if let Self::Speed(speed) = self { *speed } else { 0.0 };
        let speed = speed.min(top).max(-top);
        // The sum of 10 rpm up and down leaves a rest of rounding.
        if speed.abs() < 1e-3 { Self::Still } else { Self::Speed(speed) }
    }

    /// Moves on by `dt_s`; takes the measured speed in rad/s and the effort that the motor reports.
    pub(crate) fn step(&mut self, speed: f32, effort: Option<f32>, dt_s: f32) -> Asks {
        let dt_s = if dt_s.is_finite() { dt_s.max(0.0) } else { 0.0 };
        let velocity = |rad_per_s| Asks::Target(Target::Velocity(rad_per_s));
        match self {
            Self::Still => velocity(0.0),
            Self::Speed(speed) => velocity(*speed),
            Self::Sine { amplitude, period_s, passed_s } => {
                *passed_s = (*passed_s + dt_s) % *period_s;
                velocity(*amplitude * (TAU * *passed_s / *period_s).sin())
            }
            Self::Steps { height, half_s, passed_s } => {
                *passed_s = (*passed_s + dt_s) % (2.0 * *half_s);
                velocity(if *passed_s < *half_s { *height } else { 0.0 })
            }
            Self::Tune(tuning) => {
                let next = tuning.step(speed, effort, dt_s);
                self.go_on(next)
            }
            Self::Identify(identifying) => {
                let next = identifying.step(speed, dt_s);
                self.go_on(next)
            }
        }
    }

    fn go_on(&mut self, next: Next) -> Asks {
        match next {
            Next::Ask(target) => Asks::Target(target),
            Next::Set(gains) => Asks::Gains(gains),
            Next::Done(outcome) => {
                *self = Self::Still;
                Asks::Done(outcome)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn asked(program: &mut Program, dt_s: f32) -> f32 {
        match program.step(0.0, None, dt_s) {
            Asks::Target(Target::Velocity(rad_per_s)) => rad_per_s,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn a_sine_and_steps_go_round_in_their_period() {
        let mut sine = Program::Sine { amplitude: 2.0, period_s: 4.0, passed_s: 0.0 };
        let values: Vec<f32> = (0..8).map(|_| asked(&mut sine, 1.0)).collect();
        let expected = [2.0, 0.0, -2.0, 0.0];
        for (value, expected) in values.iter().zip(expected.iter().cycle()) {
            assert!((value - expected).abs() < 1e-5, "{values:?}");
        }
        let mut steps = Program::Steps { height: 3.0, half_s: 1.0, passed_s: 0.0 };
        let values: Vec<f32> = (0..6).map(|_| asked(&mut steps, 0.5)).collect();
        assert_eq!(values, [3.0, 0.0, 0.0, 3.0, 3.0, 0.0]);
    }

    #[test]
    fn a_time_step_that_is_none_moves_nothing() {
        let mut sine = Program::Sine { amplitude: 2.0, period_s: 4.0, passed_s: 1.0 };
        for dt_s in [f32::NAN, -1.0, f32::INFINITY] {
            assert!((asked(&mut sine, dt_s) - 2.0).abs() < 1e-5);
        }
    }
}
