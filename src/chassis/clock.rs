/// Counts the ticks without usable time: ages in seconds stand still in them.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
pub(super) struct DeadClock(u8);

impl DeadClock {
    /// Ticks without usable time after which the clock counts as dead.
    const PATIENCE: u8 = 100;

    pub(super) const fn new() -> Self {
        Self(0)
    }

    /// Takes the step of a tick, and returns a usable step, above zero and finite, unchanged; otherwise zero.
    pub(super) const fn see(&mut self, dt_s: f32) -> f32 {
        if dt_s > 0.0 && dt_s.is_finite() {
            self.0 = 0;
            dt_s
        } else {
            self.0 = self.0.saturating_add(1);
            0.0
        }
    }

    pub(super) const fn is_dead(self) -> bool {
        self.0 >= Self::PATIENCE
    }
}
