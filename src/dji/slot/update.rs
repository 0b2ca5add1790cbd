use super::target::{Action, Duty};
use super::{Slot, age, is_near};
use crate::control::{Input, TimeStep};
use crate::dji::command::{Outbox, free_to_raw, loop_to_raw, saturate};
use crate::motor::{Condition, Link, Timeouts};

/// The greatest ages among some motors, each counted from as far ahead of now as it may reach back: from 0 to twice its
/// limit a stamp is near.
#[derive(Debug, Clone, Copy)]
pub(in crate::dji) struct Ages {
    now: u32,
    timeouts: Timeouts,
    heard: u32,
    commanded: u32,
}

impl Ages {
    /// The ages of no motor; but a target may come at any time from now on.
    pub(in crate::dji) const fn none(now: u32, timeouts: Timeouts) -> Self {
        Self { now, timeouts, heard: 0, commanded: timeouts.command_us() }
    }

    /// Returns after how many µs one of them is above its limit; `None` when one is already.
    pub(in crate::dji) fn within_limits_us(&self) -> Option<u32> {
        let heard = (2 * self.timeouts.late_us()).checked_sub(self.heard)?;
        let commanded = (2 * self.timeouts.command_us()).checked_sub(self.commanded)?;
        Some(heard.min(commanded) + 1)
    }
}

impl Slot {
    /// Runs the loops of this motor and returns its raw command. Both steps are the same one: `plain` is a copy that
    /// stays in registers, because nobody else gets to see it.
    #[inline]
    pub(in crate::dji) fn update(
        &mut self,
        plain: &TimeStep,
        step: &TimeStep,
        sent: &Outbox,
    ) -> i16 {
        let velocity = self.velocity().as_rad_per_s();
        let goal = match self.duty {
            Duty::Velocity => self.goal.rad_per_s(),
            Duty::Position => {
                let way = self.shaft.way_to(self.goal.turns(), self.goal.phase());
                let input = Input::Given { error: way, rate: velocity };
                match self.loops.position_mut().step_plain(input, plain) {
                    Ok(goal) => goal,
                    Err(_) => return self.update_carefully(step, sent),
                }
            }
            Duty::Raw => return saturate(self.goal.raw(), self.range),
            // Out of line too: a zero for these would be loaded in every update of every motor.
            Duty::Rest | Duty::First | Duty::Other => return self.update_carefully(step, sent),
        };
        let input = Input::Measured { setpoint: goal, measurement: velocity };
        match self.loops.speed_mut().step_plain(input, plain) {
            Ok(output) => free_to_raw(output, self.raw_per_unit),
            Err(_) => self.follow_velocity(goal, velocity, step),
        }
    }

    // Cold, so that the usual way runs straight on; loops with options come here too, and lose nothing but that.
    #[cold]
    #[inline(never)]
    fn follow_velocity(&mut self, goal: f32, velocity: f32, step: &TimeStep) -> i16 {
        let output = self.loops.speed_mut().step(goal, velocity, step);
        loop_to_raw(output, self.raw_per_unit, self.range)
    }

    /// Runs the loops whatever they are and however far the output is limited; or rests, or begins after a rest.
    #[cold]
    #[inline(never)]
    fn update_carefully(&mut self, step: &TimeStep, sent: &Outbox) -> i16 {
        match self.duty {
            Duty::Rest => return 0,
            Duty::First => self.end_rest(),
            _ => {}
        }
        if self.acted != self.asked {
            self.take_over(sent);
        }
        let mut velocity = self.velocity().as_rad_per_s();
        let way = match self.asked {
            Action::Velocity => {
                return self.follow_velocity(self.goal.rad_per_s(), velocity, step);
            }
            Action::Position => self.shaft.way_to(self.goal.turns(), self.goal.phase()),
            Action::Angle => self.shaft.shortest_way_to(self.goal.phase()),
            Action::Measured => {
                velocity = self.goal.rate();
                self.goal.way()
            }
            Action::Raw => return saturate(self.goal.raw(), self.range),
            Action::Rest => return 0,
        };
        let goal = self.loops.position_mut().step_error(way, velocity, step);
        self.follow_velocity(goal * self.opened_part(), velocity, step)
    }

    /// Returns which part of its velocity a position loop may ask for: while the output range opens, that of the range.
    fn opened_part(&self) -> f32 {
        if self.opened.is_none() {
            return 1.0;
        }
        f32::from(
            self.range.nearest(i32::from(i16::MAX)).max(-self.range.nearest(i32::from(i16::MIN))),
        ) / f32::from(self.full_limit)
    }

    /// Adds the ages of this motor's feedback and target, when it is heard.
    #[inline]
    pub(in crate::dji) fn add_to(&self, ages: &mut Ages) {
        if self.link != Link::Online {
            return;
        }
        let since = |stamp, limit| ages.now.wrapping_add(limit).wrapping_sub(stamp);
        let heard = since(self.heard, ages.timeouts.late_us());
        let commanded = since(self.commanded, ages.timeouts.command_us());
        ages.heard = ages.heard.max(heard);
        if self.asked != Action::Rest {
            ages.commanded = ages.commanded.max(commanded);
        }
    }

    /// Sees to what grew old; `false` when there may be more to see to at the next update, whatever
    /// comes or does not come until then.
    pub(in crate::dji) fn see_to(&mut self, now: u32, timeouts: &Timeouts) -> bool {
        match self.link {
            Link::Unheard | Link::Offline => return true,
            Link::Online if is_near(now, self.heard, timeouts.late_us()) => {}
            _ => {
                self.grow_old(now, timeouts);
                return false;
            }
        }
        if self.asked != Action::Rest && !is_near(now, self.commanded, timeouts.command_us()) {
            self.forget_target();
        }
        true
    }

    /// The last feedback is not fresh; its age decides how far that goes.
    fn grow_old(&mut self, now: u32, timeouts: &Timeouts) {
        if age(now, self.heard) > timeouts.offline_us() {
            self.set_offline();
        } else if self.link == Link::Online {
            self.set_late();
        }
    }

    /// The application has not set a target for too long.
    pub(super) fn forget_target(&mut self) {
        self.relax();
        self.begin(Condition::CommandLost);
        self.forgotten_targets = self.forgotten_targets.saturating_add(1);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Below a limit, next to it on both sides, and far above.
    fn about(limit: u32) -> impl Strategy<Value = u32> {
        prop_oneof![0..=limit, limit - 2..=limit + 2, limit..=100 * limit]
    }

    proptest! {
        /// Law: nothing is above its limit for as long as it is told, and something is a microsecond later.
        #[test]
        fn it_is_quiet_until_the_oldest_age_is_above_its_limit(heard in about(20_000), commanded in about(200_000)) {
            let ages = Ages { heard, commanded, ..Ages::none(0, Timeouts::new()) };
            // 10 ms and 100 ms, and as far ahead.
            let is_within = |passed| heard + passed <= 20_000 && commanded + passed <= 200_000;
            match ages.within_limits_us() {
                Some(quiet) => prop_assert!(is_within(quiet - 1) && !is_within(quiet)),
                None => prop_assert!(!is_within(0)),
            }
        }
    }
}
