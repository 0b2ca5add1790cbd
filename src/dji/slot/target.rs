//! Targets of a new kind, and loops outside the usual path.

use super::{Action, Duty, Goal, Slot};
use crate::control::Pid;
use crate::dji::codec::{Range, saturate, to_raw};
use crate::dji::outbox::Outbox;
use crate::encoder::{Homing, Position};
use crate::math::limited;
use crate::motor::{Rest, TargetError, velocity_inside};
use crate::time::TimeStep;
use crate::units::Angle;

/// A target is so far inside of a soft limit, in rad.
const MARGIN: f32 = 0.015;

impl Slot {
    /// Discards the target: zero output, loops reset.
    pub(in crate::dji) fn relax(&mut self) {
        self.guard.relax();
        self.apply_rules();
    }

    /// Takes rad/s of the output shaft.
    #[cold]
    #[inline(never)]
    pub(in crate::dji) fn set_velocity(
        &mut self,
        rad_per_s: f32,
        now: u32,
    ) -> Result<(), TargetError> {
        needs(self.has_speed_loop())?;
        self.admit(rad_per_s.is_finite())?;
        self.start(Action::Velocity, Goal::of(rad_per_s.to_bits().cast_signed()), now);
        Ok(())
    }

    /// Takes turns and angle of the output shaft.
    #[cold]
    #[inline(never)]
    pub(in crate::dji) fn set_position(
        &mut self,
        position: Position,
        now: u32,
    ) -> Result<(), TargetError> {
        needs(self.has_position_loop())?;
        self.admit(position.is_finite())?;
        let position = self.require_zero(position, self.homing != Homing::Uncertain)?;
        let (turns, phase) = self.shaft.locate(self.inside(position));
        let goal = Goal { turns: self.shaft.near(turns), value: phase };
        self.start(Action::Position, goal, now);
        Ok(())
    }

    /// Returns the limits of targets, inside of the soft limits: where the output is barred outward, no load is held. `None` without limits,
    /// and while the position is not known.
    fn limits(&self) -> Option<(f32, f32)> {
        let (lower, upper) = self.health.soft_limits.filter(|_| self.homing != Homing::Relative)?;
        let margin = MARGIN.min(0.25 * (upper - lower));
        Some((lower + margin, upper - margin))
    }

    /// Returns the nearest position within the soft limits.
    fn inside(&self, position: Position) -> Position {
        let Some((lower, upper)) = self.limits() else { return position };
        let radians = position.as_angle().as_radians();
        if (lower..=upper).contains(&radians) {
            return position;
        }
        Position::from_angle(Angle::from_radians(limited(radians, lower, upper)))
    }

    /// Tells whether a target may be taken; if not, the previous target may be cancelled.
    #[inline]
    fn admit(&mut self, is_finite: bool) -> Result<(), TargetError> {
        match self.guard.admit(is_finite) {
            Ok(()) => Ok(()),
            Err(error) => Err(self.refuse(error)),
        }
    }

    /// Refuses a target from a zero that is not known.
    fn require_zero(&mut self, target: Position, is_known: bool) -> Result<Position, TargetError> {
        let target = is_known.then_some(target);
        self.guard.require_zero(target).map_err(|error| self.refuse(error))
    }

    #[inline]
    fn start(&mut self, action: Action, goal: Goal, now: u32) {
        self.goal = goal;
        if self.asked == action {
            self.guard.renew_target(now);
        } else {
            self.start_anew(action, now);
        }
    }

    /// Takes a value in the unit of the command: amperes or volts.
    pub(in crate::dji) fn set_output(&mut self, value: f32, now: u32) -> Result<(), TargetError> {
        self.admit(value.is_finite())?;
        let raw = to_raw(value, self.raw_per_unit, self.full_limit);
        self.start(Action::Raw, Goal::of(raw.into()), now);
        Ok(())
    }

    /// Takes a value on the wire's scale, in the direction of the shaft.
    pub(in crate::dji) fn set_raw(&mut self, raw: i16, now: u32) -> Result<(), TargetError> {
        self.admit(true)?;
        let raw = to_raw(f32::from(raw), self.direction(), self.full_limit);
        self.start(Action::Raw, Goal::of(raw.into()), now);
        Ok(())
    }

    /// Takes an absolute angle of the output shaft, by the shortest way.
    pub(in crate::dji) fn set_angle(
        &mut self,
        angle: Position,
        now: u32,
    ) -> Result<(), TargetError> {
        needs(self.has_position_loop())?;
        self.admit(angle.is_finite())?;
        let angle = self.require_zero(angle, self.homing.is_known())?;
        let (_, phase) = self.shaft.locate(angle);
        self.start(Action::Angle, Goal::of(phase), now);
        Ok(())
    }

    /// Takes the remaining way in rad, and the rate in rad/s, both measured by another sensor. `at` is `None` for a measurement too old for
    /// a stamp.
    pub(in crate::dji) fn set_measured(
        &mut self,
        way: f32,
        rad_per_s: f32,
        stamp: Option<u32>,
    ) -> Result<(), TargetError> {
        needs(self.has_position_loop())?;
        self.admit(way.is_finite() && rad_per_s.is_finite())?;
        let stamp = self.guard.require_fresh(stamp).map_err(|error| self.refuse(error))?;
        self.start(Action::Measured, Goal::measured(way, rad_per_s), stamp);
        Ok(())
    }

    #[cold]
    #[inline(never)]
    pub(super) fn refuse(&mut self, error: TargetError) -> TargetError {
        self.apply_rules();
        error
    }

    #[cold]
    #[inline(never)]
    fn start_anew(&mut self, action: Action, now: u32) {
        self.asked = action;
        self.guard.take_target(now);
        self.apply_rules();
    }

    /// Determines the task of an update. Call this wherever the guard, the range, a loop or the action changes.
    pub(in crate::dji) fn apply_rules(&mut self) {
        if !self.guard.has_target() {
            self.asked = Action::Rest;
        }
        if !self.guard.latch.active().is_empty() || self.guard.is_opening {
            self.require_check();
        }
        let is_free = self.range == Range::within(self.full_limit)
            && self.speed.core.is_plain()
            && self.health.soft_limits.is_none();
        self.duty = match self.asked {
            _ if !self.guard.drives() => Duty::Rest,
            _ if self.guard.has_rested() => Duty::First,
            _ if self.acted != self.asked => Duty::Other,
            Action::Raw => Duty::Raw,
            Action::Velocity if is_free => Duty::Velocity,
            Action::Position if is_free && self.position.is_plain() => Duty::Position,
            _ => Duty::Other,
        };
    }

    // Cold, so that the usual path of an update runs straight on.

    /// Runs loops of any kind at any limit of the output; or rests, or begins after a rest.
    #[cold]
    #[inline(never)]
    pub(in crate::dji) fn update_carefully(&mut self, dt_s: f32, sent: &Outbox) -> i16 {
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
                let goal = self.slowed(self.goal.rad_per_s());
                return self.follow_velocity(goal, velocity, dt_s);
            }
            Action::Position => self.shaft.way_to(self.goal.turns, self.goal.value),
            Action::Angle => self.shaft.shortest_way_to(self.goal.value),
            Action::Measured => {
                velocity = self.goal.rate();
                self.goal.way()
            }
            Action::Raw => return saturate(self.goal.value, self.range),
            Action::Rest => return 0,
        };
        let step = TimeStep::of_motor(dt_s);
        let goal = self.position.as_pid(|pid| pid.step_error(way, velocity, &step));
        let goal = self.slowed(goal * self.opened_part());
        self.follow_velocity(goal, velocity, dt_s)
    }

    /// Returns the velocity within the soft limits.
    fn slowed(&self, rad_per_s: f32) -> f32 {
        let Some(limits) = self.limits() else { return rad_per_s };
        velocity_inside(limits, self.shaft.position().as_angle().as_radians(), rad_per_s)
    }

    /// Returns the share of its velocity available to a position loop: the open share of the output range.
    fn opened_part(&self) -> f32 {
        if !self.guard.is_opening {
            return 1.0;
        }
        f32::from(
            self.range.nearest(i32::from(i16::MAX)).max(-self.range.nearest(i32::from(i16::MIN))),
        ) / f32::from(self.full_limit)
    }

    /// Begins the action after a rest.
    fn end_rest(&mut self) {
        self.rest_loops();
        self.guard.end_rest();
        self.acted = Action::Rest;
        self.duty = Duty::Other;
        self.apply_rules();
    }

    /// Resets or interrupts the loops, by the kind of the rest.
    pub(super) fn rest_loops(&mut self) {
        match self.guard.rest {
            Rest::Relaxed => self.reset_loops(),
            Rest::Pause => self.interrupt_loops(),
            Rest::None => {}
        }
    }

    /// Runs an action for the first time. The loops in use continue from the last action and the last command sent, so their output does
    /// not jump. An action set in between, but never run, is ignored.
    #[cold]
    #[inline(never)]
    fn take_over(&mut self, sent: &Outbox) {
        let before = core::mem::replace(&mut self.acted, self.asked);
        match before {
            _ if self.asked == Action::Raw => self.reset_loops(),
            Action::Raw => {
                let last = self.in_units(sent.get(self.place));
                self.speed.reset_to(last);
            }
            // Another sensor: its last reading gives no rate with the next one.
            Action::Measured => self.interrupt_loops(),
            _ => {}
        }
        let is_placed = before == Action::Rest || before.is_way();
        match self.asked {
            Action::Measured => {
                if !is_placed {
                    let rate = self.goal.rate();
                    self.position.as_pid(|pid| pid.reset_to(rate));
                }
                // Avoids a kick at the step from one velocity to the other.
                self.interrupt_loops();
            }
            _ if self.asked.is_way() && !is_placed => {
                let velocity = self.velocity().as_rad_per_s();
                self.position.as_pid(|pid| pid.reset_to(velocity));
            }
            _ => {}
        }
        self.apply_rules();
    }

    fn reset_loops(&mut self) {
        self.position.as_pid(Pid::reset);
        self.speed.reset();
    }

    fn interrupt_loops(&mut self) {
        self.position.as_pid(Pid::interrupt);
        self.speed.interrupt();
    }

    /// Returns a raw command in A or V, in the direction of the shaft.
    pub(in crate::dji) fn in_units(&self, raw: i16) -> f32 {
        f32::from(raw) / self.raw_per_unit
    }

    pub(in crate::dji) const fn speed_loop_mut(&mut self) -> &mut Pid {
        &mut self.speed
    }
}

fn needs(is_there: bool) -> Result<(), TargetError> {
    if is_there { Ok(()) } else { Err(TargetError::NoLoop) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::PidConfig;
    use crate::dji::{Bus, Config, M3508};
    use crate::frame::CanFrame;
    use crate::motor::Timeouts;
    use crate::time::{Instant, Tick};
    use crate::units::AngularVelocity;

    /// The short paths are for plain loops with the full output; all other loops take the general path.
    #[test]
    fn a_plain_loop_with_the_full_output_takes_the_short_way_and_no_other_does() {
        let plain = PidConfig::new(1.0, 0.0, 0.0);
        let slow = plain.with_slew_limit(1.0);
        for (position, speed, expected) in [
            (plain, plain, [Duty::Velocity, Duty::Position]),
            (slow, plain, [Duty::Velocity, Duty::Other]),
            (plain, slow, [Duty::Other, Duty::Other]),
        ] {
            let mut bus: Bus = Bus::new();
            let motor =
                bus.attach(Config::<M3508>::at_once(1).position_loop(position, speed)).unwrap();
            let now = Instant::from_micros(1_000);
            _ = bus.ingest(&CanFrame::standard(0x201, [0; 8]).unwrap(), now);
            bus.arm(now).unwrap();
            let duty = |bus: &Bus| bus.motors.get(motor.erase().key()).unwrap().duty;
            bus.set_velocity(motor, AngularVelocity::ZERO).unwrap();
            assert_eq!(duty(&bus), Duty::First);
            bus.update(Tick::new(now, 0.001));
            let velocity = duty(&bus);
            bus.set_position(motor, Position::ZERO).unwrap();
            assert_eq!(duty(&bus), Duty::Other, "in place of another");
            bus.update(Tick::new(Instant::from_micros(2_000), 0.001));
            assert_eq!([velocity, duty(&bus)], expected);
            bus.set_raw(motor, 5).unwrap();
            bus.update(Tick::new(Instant::from_micros(3_000), 0.001));
            assert_eq!(duty(&bus), Duty::Raw, "it has no loop");
            bus.set_position(motor, Position::ZERO).unwrap();
            bus.update(Tick::new(Instant::from_micros(4_000), 0.001));
            let slot = bus.motors.get_mut(motor.erase().key()).unwrap();
            slot.range = Range::within(1_000);
            slot.apply_rules();
            assert_eq!(slot.duty, Duty::Other, "less than the full output");
            slot.guard.age(500_000, &Timeouts::new());
            slot.apply_rules();
            assert_eq!(slot.duty, Duty::Rest, "not heard");
        }
    }
}
