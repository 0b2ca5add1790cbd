use super::Slot;
use super::target::{Action, Duty};
use crate::control::{Input, TimeStep};
use crate::dji::command::{Outbox, free_to_raw, loop_to_raw, saturate};

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
        if !self.guard.is_opening() {
            return 1.0;
        }
        f32::from(
            self.range.nearest(i32::from(i16::MAX)).max(-self.range.nearest(i32::from(i16::MIN))),
        ) / f32::from(self.full_limit)
    }
}
