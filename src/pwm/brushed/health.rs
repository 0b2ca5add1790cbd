use super::Brushed;
use crate::motor::{Condition, Conditions, Edge, Health, HealthConfig, Reaction, Vitals};
use crate::pwm::Direction;
use crate::time::Instant;
use core::f32::consts::TAU;
use embedded_hal::pwm::SetDutyCycle;

/// The monitored conditions by default.
pub(super) static USUAL: HealthConfig =
    HealthConfig::new().with_reaction(Condition::Stalled, Reaction::Relax);

/// Speed of a turning shaft when the no-load speed is not known, as a share of it: no stall, and never a runaway.
const TURNS: f32 = 0.1;

/// A shaft turns if it moves a count in this time.
const COUNT_S: f32 = 0.05;

/// Health: conditions of the motor, and every change of a condition.
impl<P: SetDutyCycle, D: Direction> Brushed<P, D> {
    /// Returns the present conditions of the motor.
    #[must_use]
    pub const fn conditions(&self) -> Conditions {
        self.guard.conditions()
    }

    /// Returns the health of the motor; without an encoder there is neither rate nor gap.
    #[must_use]
    pub fn health(&self) -> Health {
        self.watch.health(self.config.name, &self.guard, &self.vitals())
    }

    /// Returns the oldest unread edge. No edge is lost, however late the reading; while an edge waits, the same change
    /// is not noted again.
    pub fn next_edge(&mut self) -> Option<Edge> {
        self.guard.next_edge(self.config.name)
    }

    /// Monitors the motor, and relaxes it if configured; returns the remaining share of its limit.
    pub(super) fn check(&mut self, now: Instant) -> f32 {
        let vitals = self.vitals();
        self.watch.check(&mut self.guard, || vitals, now)
    }

    /// A motor without an encoder is not known to turn or to stand.
    fn vitals(&self) -> Vitals {
        let Some(counts_per_turn) = self.config.counts_per_turn else { return Vitals::default() };
        let speed = match self.config.no_load {
            Some(no_load) => self.rad_per_s / no_load.as_rad_per_s(),
            None if self.rad_per_s.abs() > TAU / (counts_per_turn * COUNT_S) => {
                TURNS.copysign(self.rad_per_s)
            }
            None => 0.0,
        };
        Vitals { effort: self.output / self.config.limit, speed, ..Vitals::default() }
    }
}
