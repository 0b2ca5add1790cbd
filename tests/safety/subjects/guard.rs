//! A guard by itself: its output is the share that it returns.

use super::*;
use drivetrain::motor::{Guard, MotorName};

/// A guard with feedback, or without.
pub(crate) struct Bare<const LISTENS: bool>(Guard);

impl<const LISTENS: bool> Bare<LISTENS> {
    pub(crate) fn new(setup: Setup) -> Self {
        let guard = if LISTENS { Guard::new() } else { Guard::without_feedback() };
        Self(guard.with_opening(setup.opening))
    }
}

impl<const LISTENS: bool> Subject<1> for Bare<LISTENS> {
    const RULES: [Rules; 1] = [Rules {
        late_us: if LISTENS { Some(10_000) } else { None },
        has_steps: false,
        opens: Opens::Fills,
        resolution: 1e-6,
        rivals: Rivals::Never,
        ..OWN
    }];

    fn hear(&mut self, now: Instant) {
        if LISTENS {
            self.0.hear(now);
        }
    }
    fn link(&self) -> [Link; 1] {
        [self.0.link()]
    }
    /// In the order of all devices.
    fn arm(&mut self, now: Instant) -> Result<(), Refusal> {
        let is_granted = self.0.ask();
        if self.0.is_stopped() {
            Err(Refusal::Stopped)
        } else if self.0.is_missing(now) {
            Err(Refusal::Missing)
        } else if is_granted {
            self.0.engage(now);
            Ok(())
        } else {
            Err(Refusal::NotReleased)
        }
    }
    fn is_armed(&self) -> [bool; 1] {
        [self.0.is_armed()]
    }
    fn set(&mut self, value: f32) -> [Result<(), TargetError>; 1] {
        [self.0.admit(value.is_finite())]
    }
    fn relax(&mut self) -> [bool; 1] {
        self.0.relax();
        [true]
    }
    fn disarm(&mut self) {
        self.0.disarm();
    }
    fn stop(&mut self) {
        self.0.emergency_stop();
    }
    fn clear_stop(&mut self) {
        self.0.clear_emergency_stop();
    }
    fn outputs(&mut self, tick: Tick) -> [f64; 1] {
        [if self.0.drives(tick.now()) { self.0.share().into() } else { 0.0 }]
    }
    fn conditions(&self) -> [Conditions; 1] {
        [self.0.conditions()]
    }
    fn next_edge(&mut self) -> Option<(usize, Edge<Condition, MotorName>)> {
        self.0.next_edge(MotorName::new("bare", 1)).map(|edge| (0, edge))
    }
}
