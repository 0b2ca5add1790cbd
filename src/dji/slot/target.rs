use super::{Slot, is_loop, steep};
use crate::control::{Pid, PidConfig};
use crate::dji::command::{Outbox, to_raw};
use crate::dji::range::Range;
use crate::dji::{LoopError, SteepGain};
use crate::encoder::Position;
use crate::motor::{Link, Rest, TargetError};

/// What a motor is asked to do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub(super) enum Action {
    Rest,
    Raw,
    Velocity,
    /// The shortest way.
    Angle,
    Position,
    /// The way that another sensor leaves.
    Measured,
}

impl Action {
    /// Tells whether it goes to a place of the shaft.
    pub(super) const fn is_way(self) -> bool {
        matches!(self, Self::Angle | Self::Position)
    }
}

/// What an update does: the action, where that is as simple as it nearly always is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub(super) enum Duty {
    Rest,
    /// Whatever is asked for, for the first time since a rest.
    First,
    Raw,
    /// The speed loop, plain and with the full output: what it gives within its limit needs no other.
    Velocity,
    /// Both loops, as above.
    Position,
    /// Whatever else is asked for, within what is left of the output; also what is asked for in place of another.
    Other,
}

/// Where an action goes to. It stands apart from the action, so that an update has one byte to look at.
#[derive(Debug, Clone, Copy)]
pub(super) struct Goal {
    /// The lower half of the turns, [near](crate::encoder::Shaft::near) to those of the shaft; or bits of the rad/s.
    turns: u32,
    /// Raw command, bits of the rad/s or of the way, or phase of the shaft.
    value: i32,
}

impl Goal {
    pub(super) const NONE: Self = Self::of(0);

    const fn of(value: i32) -> Self {
        Self { turns: 0, value }
    }

    pub(super) const fn raw(&self) -> i32 {
        self.value
    }

    pub(super) const fn rad_per_s(&self) -> f32 {
        f32::from_bits(self.value.cast_unsigned())
    }

    pub(super) const fn phase(&self) -> i32 {
        self.value
    }

    pub(super) const fn turns(&self) -> u32 {
        self.turns
    }

    /// A way in rad, and the rate in rad/s that goes with it.
    pub(super) const fn measured(way: f32, rad_per_s: f32) -> Self {
        Self { turns: rad_per_s.to_bits(), value: way.to_bits().cast_signed() }
    }

    pub(super) const fn way(&self) -> f32 {
        f32::from_bits(self.value.cast_unsigned())
    }

    pub(super) const fn rate(&self) -> f32 {
        f32::from_bits(self.turns)
    }
}

impl Slot {
    /// Asks for nothing: zero output, loops reset.
    pub(in crate::dji) fn relax(&mut self) {
        self.guard.relax();
        self.settle();
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

    /// Takes rad/s of the output shaft.
    #[inline]
    pub(in crate::dji) fn set_velocity(
        &mut self,
        rad_per_s: f32,
        now: u32,
    ) -> Result<(), TargetError> {
        self.admit(rad_per_s.is_finite())?;
        needs(self.loops.speed())?;
        self.start(Action::Velocity, Goal::of(rad_per_s.to_bits().cast_signed()), now);
        Ok(())
    }

    /// Takes an absolute angle of the output shaft: the shortest way.
    pub(in crate::dji) fn set_angle(
        &mut self,
        angle: Position,
        now: u32,
    ) -> Result<(), TargetError> {
        self.admit(angle.is_finite())?;
        needs(self.loops.position())?;
        if !self.homing.is_known() {
            return Err(TargetError::NotHomed);
        }
        let (_, phase) = self.shaft.locate(angle);
        self.start(Action::Angle, Goal::of(phase), now);
        Ok(())
    }

    /// Takes turns and angle of the output shaft.
    pub(in crate::dji) fn set_position(
        &mut self,
        position: Position,
        now: u32,
    ) -> Result<(), TargetError> {
        self.admit(position.is_finite())?;
        needs(self.loops.position())?;
        let (turns, phase) = self.shaft.locate(self.inside(position));
        let goal = Goal { turns: self.shaft.near(turns), value: phase };
        self.start(Action::Position, goal, now);
        Ok(())
    }

    /// Changes the gains of the speed loop without a jump of its output.
    pub(in crate::dji) fn set_speed_loop(&mut self, config: PidConfig) -> Result<(), LoopError> {
        let facts = self.facts.ok_or(LoopError::Detached)?;
        let limit = f32::from(self.full_limit) / self.raw_per_unit.abs();
        let steep = steep::speed(&config, facts, self.rad_per_s_per_rpm);
        self.rest_loops();
        let replaced = replace(self.loops.speed_mut(), config, limit, steep);
        self.settle();
        replaced
    }

    /// Changes the gains of the position loop without a jump of its output.
    pub(in crate::dji) fn set_position_loop(&mut self, config: PidConfig) -> Result<(), LoopError> {
        let facts = self.facts.ok_or(LoopError::Detached)?;
        let limit = super::no_load_velocity(facts, self.rad_per_s_per_rpm);
        let steep = steep::position(&config, facts);
        self.rest_loops();
        let replaced = replace(self.loops.position_mut(), config, limit, steep);
        self.settle();
        replaced
    }

    /// Tells whether a target may be taken; where not, the one before may be over.
    #[inline]
    pub(super) fn admit(&mut self, is_finite: bool) -> Result<(), TargetError> {
        match self.guard.admit(is_finite) {
            Ok(()) => Ok(()),
            Err(error) => Err(self.refuse(error)),
        }
    }

    #[cold]
    #[inline(never)]
    fn refuse(&mut self, error: TargetError) -> TargetError {
        self.settle();
        error
    }

    #[inline]
    pub(super) fn start(&mut self, action: Action, goal: Goal, now: u32) {
        self.goal = goal;
        if self.asked == action {
            self.guard.renew_target(now);
        } else {
            self.start_anew(action, now);
        }
    }

    #[cold]
    #[inline(never)]
    fn start_anew(&mut self, action: Action, now: u32) {
        self.asked = action;
        self.guard.take_target(now);
        self.settle();
    }

    /// Tells whether the motor was at rest, not asked or not heard, at any time since the last usable update: its command
    /// of then is not to be sent again.
    pub(in crate::dji) fn has_rested(&self) -> bool {
        matches!(self.duty, Duty::Rest | Duty::First)
    }

    /// Finds out what an update has to do. To be called wherever the guard, the range, a loop or what is asked for changes.
    pub(in crate::dji) fn settle(&mut self) {
        if !self.guard.has_target() {
            self.asked = Action::Rest;
        }
        let is_online = self.guard.link() == Link::Online;
        if !self.guard.latch().active().is_empty() || self.guard.is_opening() {
            self.attend();
        }
        let is_free = self.range == Range::within(self.full_limit) && self.loops.speed().is_plain();
        self.duty = match self.asked {
            _ if !is_online => Duty::Rest,
            Action::Rest => Duty::Rest,
            _ if self.has_rested() => Duty::First,
            _ if self.acted != self.asked => Duty::Other,
            Action::Raw => Duty::Raw,
            Action::Velocity if is_free => Duty::Velocity,
            Action::Position if is_free && self.loops.position().is_plain() => Duty::Position,
            _ => Duty::Other,
        };
    }

    /// What is asked for has an output from now on.
    pub(super) fn end_rest(&mut self) {
        self.rest_loops();
        self.acted = Action::Rest;
        self.duty = Duty::Other;
        self.settle();
    }

    /// Has the loops rest as the motor did.
    fn rest_loops(&mut self) {
        match self.guard.end_rest() {
            Rest::Relaxed => self.loops.reset(),
            Rest::Pause => self.loops.interrupt(),
            Rest::None => {}
        }
    }

    /// What is asked for is done for the first time. The loops that have a part in it go on from what was done until now and
    /// sent last, so that their output does not jump. What was asked for in between, and never done, is nothing to go on from.
    #[cold]
    #[inline(never)]
    pub(super) fn take_over(&mut self, sent: &Outbox) {
        let before = core::mem::replace(&mut self.acted, self.asked);
        match before {
            _ if self.asked == Action::Raw => self.loops.reset(),
            Action::Raw => {
                let last = self.in_units(sent.get(self.place));
                self.loops.speed_mut().reset_to(last);
            }
            // Another sensor: its last reading says nothing of the next one.
            Action::Measured => self.loops.interrupt(),
            _ => {}
        }
        let is_placed = before == Action::Rest || before.is_way();
        match self.asked {
            Action::Measured => {
                if !is_placed {
                    self.loops.position_mut().reset_to(self.goal.rate());
                }
                // No kick for the step from one velocity to the other.
                self.loops.interrupt();
            }
            _ if self.asked.is_way() && !is_placed => {
                let velocity = self.velocity().as_rad_per_s();
                self.loops.position_mut().reset_to(velocity);
            }
            _ => {}
        }
        self.settle();
    }
}

pub(super) fn needs(pid: &Pid) -> Result<(), TargetError> {
    if is_loop(pid) { Ok(()) } else { Err(TargetError::NoLoop) }
}

fn replace(
    pid: &mut Pid,
    config: PidConfig,
    limit: f32,
    steep: Option<SteepGain>,
) -> Result<(), LoopError> {
    if !is_loop(pid) {
        return Err(LoopError::NoLoop);
    }
    if let Some(gain) = steep {
        return Err(LoopError::Gain(gain));
    }
    pid.set_config(super::within(Some(config), limit))
        .map_err(|error| LoopError::Parameter(error.parameter()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dji::{Bus, Config, M3508};
    use crate::frame::CanFrame;
    use crate::motor::Timeouts;
    use crate::time::{Instant, Tick};
    use crate::units::AngularVelocity;

    /// The short ways are for plain loops with the full output; all others take the one that knows everything.
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
            let duty = |bus: &Bus| bus.slot(motor.erase()).unwrap().duty;
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
            let slot = bus.slot_mut(motor.erase()).unwrap();
            slot.range = Range::within(1_000);
            slot.settle();
            assert_eq!(slot.duty, Duty::Other, "less than the full output");
            slot.guard.age(500_000, &Timeouts::new());
            slot.settle();
            assert_eq!(slot.duty, Duty::Rest, "not heard");
        }
    }
}
