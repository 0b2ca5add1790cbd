use super::Slot;
use super::target::{Action, Goal, needs};
use crate::motor::{MotorGuard, TargetError, Timeouts};

impl Slot {
    /// Takes the way that another sensor leaves, in rad, and the rate that it measures, in rad/s; `at` is `None` when that
    /// was too long ago for a stamp.
    pub(in crate::dji) fn set_measured(
        &mut self,
        way: f32,
        rad_per_s: f32,
        at: Option<u32>,
        now: u32,
        timeouts: &Timeouts,
    ) -> Result<(), TargetError> {
        self.admit(way.is_finite() && rad_per_s.is_finite())?;
        needs(self.loops.position())?;
        let Some(stamp) = at.and_then(|at| MotorGuard::stamp_of_measurement(at, now, timeouts))
        else {
            if self.guard.has_target() {
                self.guard.forget_target();
                self.settle();
            }
            return Err(TargetError::StaleMeasurement);
        };
        self.start(Action::Measured, Goal::measured(way, rad_per_s), stamp);
        Ok(())
    }
}
