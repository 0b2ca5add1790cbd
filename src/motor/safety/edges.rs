//! The conditions of a guarded motor, and the edges that wait to be read.

use super::Guard;
use crate::motor::{Condition, Conditions, Edge, Health, Latch, MotorName};
use crate::time::{Duration, Instant};

impl Guard {
    /// Says whether a condition of the motor holds. A change is an edge, and waits to be read.
    ///
    /// Late and lost feedback and old targets are noted by the guard itself.
    pub fn note(&mut self, condition: Condition, holds: bool, now: Instant) {
        self.look(now, |latch| latch.set(condition, holds));
    }

    /// Lets conditions change.
    pub(in crate::motor) fn look<T>(
        &mut self,
        now: Instant,
        look: impl FnOnce(&mut Latch) -> T,
    ) -> T {
        self.change(now, |motor| look(motor.latch_mut()))
    }

    /// Returns what is wrong with the motor.
    #[must_use]
    pub const fn conditions(&self) -> Conditions {
        self.motor.latch().active()
    }

    /// Returns the oldest change of a condition that was not read yet; the guard does not know its motor's name.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::motor::{Condition, Guard, MotorName};
    /// use drivetrain::time::Instant;
    ///
    /// let at_ms = |ms: u64| Instant::from_micros(ms * 1_000);
    /// let mut guard = Guard::new();
    /// guard.hear(at_ms(1));
    /// assert!(!guard.drives(at_ms(12)));
    /// let edge = guard.next_edge(MotorName::new("mine", 1)).ok_or("none")?;
    /// assert_eq!((edge.condition, edge.began), (Condition::Late, true));
    /// assert_eq!(guard.next_edge(MotorName::new("mine", 1)), None);
    /// # Ok::<(), &str>(())
    /// ```
    pub fn next_edge(&mut self, motor: MotorName) -> Option<Edge> {
        let now = self.device.updated();
        while let Some(entry) = self.device.journal_mut().pop() {
            if self.motor.latch_mut().take(entry.condition, entry.began) {
                let at = self.device.journal().time_of(&entry, now);
                let (condition, began) = (entry.condition, entry.began);
                return Some(Edge { motor, condition, began, at });
            }
        }
        let (condition, began) = self.motor.latch().next()?;
        self.motor.latch_mut().take(condition, began);
        Some(Edge { motor, condition, began, at: self.device.journal().last_time(now) })
    }

    /// Returns what the guard knows of a motor's health.
    pub(crate) const fn health(&self, motor: MotorName) -> Health {
        Health {
            motor,
            link: self.link(),
            armed: self.is_armed(),
            conditions: self.conditions(),
            feedback_hz: 0,
            longest_gap: Duration::ZERO,
            temperature_c: None,
            error_code: 0,
            saturated: 0,
            refused_targets: self.refused_targets(),
            forgotten_targets: self.forgotten_targets(),
            ambiguous_gaps: 0,
        }
    }

    /// Returns when the change that [`next_edge`](Self::next_edge) returns next was noted: to read several motors in order.
    pub(crate) fn next_edge_at(&self) -> Option<Instant> {
        self.motor.latch().next()?;
        let (journal, now) = (self.device.journal(), self.device.updated());
        Some(journal.first_time(now).unwrap_or_else(|| journal.last_time(now)))
    }
}
