use super::{Slot, Target, age, is_near};
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
        if !is_near(cycle.now, self.heard, cycle.timeouts.late_us())
            || !is_near(cycle.now, self.commanded, cycle.timeouts.command_us())
        {
            self.rest(cycle);
            return 0;
        }
        let velocity = self.velocity().as_rad_per_s();
        let goal = if let Target::Velocity(rad_per_s) = self.target {
            rad_per_s
        } else {
            let way = match self.target {
                Target::Position(turns, phase) => self.shaft.way_to(turns, phase),
                Target::Angle(phase) => self.shaft.shortest_way_to(phase),
                Target::Raw(raw) => return saturate(i32::from(raw), self.limit),
                Target::Relax | Target::Velocity(_) => return 0,
            };
            self.position.step_error(way, velocity, &cycle.step)
        };
        to_raw(self.speed.step(goal, velocity, &cycle.step), self.raw_per_unit, self.limit)
    }

    /// The last feedback is late, or the last target.
    #[cold]
    #[inline(never)]
    fn rest(&mut self, cycle: &Cycle) {
        if !is_near(cycle.now, self.heard, cycle.timeouts.late_us()) {
            self.grow_old(cycle);
        } else if self.target != Target::Relax {
            self.forget_target();
        }
    }

    /// The last feedback is late; its age decides how far that goes.
    fn grow_old(&mut self, cycle: &Cycle) {
        match self.link {
            Link::Unheard | Link::Offline => {}
            _ if age(cycle.now, self.heard) > cycle.timeouts.offline_us() => self.set_offline(),
            Link::Online | Link::Late => self.set_late(),
            Link::Recovering => {}
        }
    }

    /// The application has not set a target for too long.
    fn forget_target(&mut self) {
        self.relax();
        self.forgotten_targets = self.forgotten_targets.saturating_add(1);
    }
}
