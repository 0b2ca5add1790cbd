use super::{Slot, Target, is_loop};
use crate::control::{Pid, PidConfig};
use crate::dji::LoopError;
use crate::dji::command::to_raw;
use crate::encoder::Position;
use crate::motor::{Link, TargetError};

impl Slot {
    /// Asks for nothing: zero output, loops reset.
    pub(in crate::dji) fn relax(&mut self) {
        self.target = Target::Relax;
        self.speed.reset();
        self.position.reset();
    }

    /// Takes a value in the unit of the command: amperes or volts.
    pub(in crate::dji) fn set_output(&mut self, value: f32, now: u32) -> Result<(), TargetError> {
        self.admit(value.is_finite())?;
        self.start(Target::Raw(to_raw(value, self.raw_per_unit, self.full_limit)), now);
        Ok(())
    }

    /// Takes a value on the wire's scale, in the direction of the shaft.
    pub(in crate::dji) fn set_raw(&mut self, raw: i16, now: u32) -> Result<(), TargetError> {
        self.admit(true)?;
        self.start(Target::Raw(to_raw(f32::from(raw), self.direction(), self.full_limit)), now);
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
        needs(&self.speed)?;
        if !matches!(self.target, Target::Velocity(_)) {
            self.enter_speed_loop();
        }
        self.start(Target::Velocity(rad_per_s), now);
        Ok(())
    }

    /// Takes an absolute angle of the output shaft: the shortest way.
    pub(in crate::dji) fn set_angle(
        &mut self,
        angle: Position,
        now: u32,
    ) -> Result<(), TargetError> {
        self.admit(angle.is_finite())?;
        needs(&self.position)?;
        if !self.homing.is_known() {
            return Err(TargetError::NotHomed);
        }
        let (_, phase) = self.shaft.locate(angle);
        self.enter_position_loop();
        self.start(Target::Angle(phase), now);
        Ok(())
    }

    /// Takes turns and angle of the output shaft.
    pub(in crate::dji) fn set_position(
        &mut self,
        position: Position,
        now: u32,
    ) -> Result<(), TargetError> {
        self.admit(position.is_finite())?;
        needs(&self.position)?;
        let (turns, phase) = self.shaft.locate(position);
        self.enter_position_loop();
        self.start(Target::Position(turns, phase), now);
        Ok(())
    }

    /// Changes the gains of the speed loop without a jump of its output.
    pub(in crate::dji) fn set_speed_loop(&mut self, config: PidConfig) -> Result<(), LoopError> {
        let limit = f32::from(self.full_limit) / self.raw_per_unit.abs();
        replace(&mut self.speed, config, limit)
    }

    /// Changes the gains of the position loop without a jump of its output.
    pub(in crate::dji) fn set_position_loop(&mut self, config: PidConfig) -> Result<(), LoopError> {
        let facts = self.facts.ok_or(LoopError::Detached)?;
        let limit = super::no_load_velocity(facts, self.rad_per_s_per_rpm);
        replace(&mut self.position, config, limit)
    }

    /// A value that cannot be followed takes the target before it away: zero output, integrators untouched. An older
    /// value must not act in its place when the feedback comes back.
    fn admit(&mut self, finite: bool) -> Result<(), TargetError> {
        if !finite {
            self.target = Target::Relax;
            self.refused_targets = self.refused_targets.saturating_add(1);
            return Err(TargetError::NotFinite);
        }
        if !self.armed {
            return Err(TargetError::Disarmed);
        }
        if self.latched {
            return Err(TargetError::Relaxed);
        }
        if self.link != Link::Online {
            self.target = Target::Relax;
            return Err(TargetError::NoFeedback);
        }
        Ok(())
    }

    fn start(&mut self, target: Target, now: u32) {
        self.target = target;
        self.commanded = now;
    }

    /// The speed loop takes over from a direct command where that was: no jump of the output.
    fn enter_speed_loop(&mut self) {
        if let Target::Raw(raw) = self.target {
            self.speed.reset_to(f32::from(raw) / self.raw_per_unit);
        }
    }

    /// The position loop starts from the present velocity: no jump of its output.
    fn enter_position_loop(&mut self) {
        if matches!(self.target, Target::Angle(_) | Target::Position(..)) {
            return;
        }
        self.enter_speed_loop();
        let moving = matches!(self.target, Target::Velocity(_) | Target::Raw(_));
        let velocity = self.velocity().as_rad_per_s();
        if moving {
            self.position.reset_to(velocity);
        }
    }
}

fn needs(pid: &Pid) -> Result<(), TargetError> {
    if is_loop(pid) { Ok(()) } else { Err(TargetError::NoLoop) }
}

fn replace(pid: &mut Pid, config: PidConfig, limit: f32) -> Result<(), LoopError> {
    if !is_loop(pid) {
        return Err(LoopError::NoLoop);
    }
    pid.set_config(super::within(config, limit))
        .map_err(|error| LoopError::Parameter(error.parameter()))
}
