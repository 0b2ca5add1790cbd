use super::target::{Action, Goal, needs};
use super::{Slot, age, is_near};
use crate::motor::{TargetError, Timeouts};

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
        let (limit, command_us) = (timeouts.measured_us(), timeouts.command_us());
        let Some(at) = at.filter(|at| is_near(now, *at, limit)) else {
            if self.asked != Action::Rest {
                self.forget_target();
            }
            return Err(TargetError::StaleMeasurement);
        };
        // It counts until the measurement is too old: as if it had been set so long before.
        let commanded = at.wrapping_add(limit).wrapping_sub(command_us);
        let is_ahead = age(now, commanded) == 0;
        let goal = Goal::measured(way, rad_per_s);
        self.start(Action::Measured, goal, if is_ahead { now } else { commanded });
        Ok(())
    }
}
