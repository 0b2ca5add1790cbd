use super::{Slot, Target};
use crate::control::TimeStep;
use crate::dji::command::{saturate, to_raw};
use crate::motor::{Link, Timeouts};

/// What every slot needs to know of this update.
#[derive(Debug, Clone, Copy)]
pub(in crate::dji) struct Cycle {
    pub(in crate::dji) now: u32,
    pub(in crate::dji) step: TimeStep,
    pub(in crate::dji) timeouts: Timeouts,
}

impl Slot {
    /// Runs the loops of this motor and returns its raw command: 0 whenever something is in doubt.
    #[inline]
    pub(in crate::dji) fn update(&mut self, cycle: &Cycle) -> i16 {
        if cycle.now.wrapping_sub(self.heard) > cycle.timeouts.late_us() {
            self.age(cycle);
            return 0;
        }
        if self.target == Target::Relax {
            return 0;
        }
        if cycle.now.wrapping_sub(self.commanded) > cycle.timeouts.command_us() {
            self.forget_target();
            return 0;
        }
        let goal = match self.target {
            Target::Relax => return 0,
            Target::Raw(raw) => return saturate(i32::from(raw), self.limit),
            Target::Velocity(rad_per_s) => rad_per_s,
            Target::Angle(phase) => self.follow(self.shaft.shortest_way_to(phase), &cycle.step),
            Target::Position(turns, phase) => {
                self.follow(self.shaft.way_to(turns, phase), &cycle.step)
            }
        };
        let velocity = self.velocity().as_rad_per_s();
        match &mut self.speed {
            Some(speed) => {
                to_raw(speed.step(goal, velocity, &cycle.step), self.raw_per_unit, self.limit)
            }
            None => 0,
        }
    }

    /// Runs the position loop: radians to go in, the velocity for the speed loop out.
    #[inline]
    fn follow(&mut self, way: f32, step: &TimeStep) -> f32 {
        let velocity = self.velocity().as_rad_per_s();
        match &mut self.position {
            Some(position) => position.step_error(way, velocity, step),
            None => 0.0,
        }
    }

    /// The last feedback is late; its age decides how far that goes.
    #[cold]
    #[inline(never)]
    fn age(&mut self, cycle: &Cycle) {
        let age = cycle.now.wrapping_sub(self.heard);
        match self.link {
            Link::Unheard | Link::Offline => {}
            _ if age > cycle.timeouts.offline_us() => self.set_offline(),
            Link::Online | Link::Late => self.set_late(),
            Link::Recovering => {}
        }
    }

    /// The application has not set a target for too long.
    #[cold]
    #[inline(never)]
    fn forget_target(&mut self) {
        self.relax();
        self.forgotten_targets = self.forgotten_targets.saturating_add(1);
    }
}
