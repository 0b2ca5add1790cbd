//! What the application asks of the joints.

use super::offset::Offset;
use super::slot::{Slot, to_pulses};
use super::{AttachError, Config, Joint, Joints, PULSES_PER_TURN, Register, Reply};
use crate::encoder::Position;
use crate::motor::TargetError;
use crate::units::AngularVelocity;

/// Targets. Each replaces the one before, works in RAM only, and counts until the command deadline
/// ([`Timeouts::command`](crate::motor::Timeouts::command)): an application that stops setting targets has its joints
/// disabled.
///
/// # Errors
/// A target fails, and is not kept for later, when the joint is detached, not armed, relaxed by a fault or not heard, and
/// for NaN or infinity, which takes the present target away.
impl Joints {
    /// Sets the position that a joint goes to, from its zero. Saturates at the ±32768 turns of its counter.
    ///
    /// # Errors
    /// See above.
    pub fn set_position(&mut self, joint: Joint, position: Position) -> Result<(), TargetError> {
        let turns = position.turns().clamp(-32_768, 32_767);
        let turns = i32::try_from(turns).unwrap_or(0) * PULSES_PER_TURN;
        let pulses = turns.saturating_add(to_pulses(position.angle().as_radians()));
        self.aim(joint, position.is_finite(), |slot| slot.set_target(pulses))
    }

    /// Sets the position that a joint goes to, in pulses from its zero: the wire's own scale, 65536 a turn.
    ///
    /// # Errors
    /// See above.
    pub fn set_pulses(&mut self, joint: Joint, pulses: i32) -> Result<(), TargetError> {
        self.aim(joint, true, |slot| slot.set_target(pulses))
    }

    /// Sets the speed with which a joint goes to its targets, whatever its sign; saturates at 255 rpm. It is no target
    /// itself: it can be set before arming, and keeps nothing alive.
    ///
    /// # Errors
    /// When the joint is detached, and for NaN or infinity, which takes the present target away.
    pub fn set_speed(&mut self, joint: Joint, speed: AngularVelocity) -> Result<(), TargetError> {
        let slot = self.slot_mut(joint).ok_or(TargetError::Detached)?;
        if !speed.is_finite() {
            self.relax(joint);
            return Err(TargetError::NotFinite);
        }
        slot.set_speed(speed.as_rad_per_s());
        Ok(())
    }

    /// Changes the registers that a joint is set up with to those of `config`: current, acceleration, deceleration and mode.
    ///
    /// Nothing else of `config` is looked at. The joint may move meanwhile. If it is being brought up, a change may be written
    /// after the enable, within seven of its turns.
    ///
    /// # Errors
    /// When a parameter is not usable. A detached joint changes nothing.
    pub fn set_settings(&mut self, joint: Joint, config: &Config) -> Result<(), AttachError> {
        let settings = config.settings;
        let Some(slot) = self.slot_mut(joint) else { return Ok(()) };
        if let (Some(parameter), Some(joint)) = (settings.refused(), slot.name()) {
            return Err(AttachError::Parameter { joint, parameter });
        }
        slot.set_settings(settings);
        Ok(())
    }

    /// Asks a joint for nothing: it is disabled, and stays armed.
    pub fn relax(&mut self, joint: Joint) {
        if self.slot(joint).is_some() {
            self.relax_at(joint.index());
        }
    }

    /// Makes the present position of a joint zero. A joint that has a target is relaxed: it was given in the old terms.
    ///
    /// The position is that of the last reply: a joint that moves is where it was then.
    ///
    /// # Errors
    /// When the joint is detached, or not heard: where it is now is not known then.
    pub fn zero(&mut self, joint: Joint) -> Result<(), TargetError> {
        let now = self.now;
        let slot = self.slot_mut(joint).ok_or(TargetError::Detached)?;
        if !slot.zero(now) {
            return Err(TargetError::NoFeedback);
        }
        self.relax(joint);
        Ok(())
    }

    /// Sets where the zero of a joint lies in the counts of its drive, in pulses: one that was stored, say. A joint that has a
    /// target is relaxed.
    ///
    /// ```text
    /// position shown = raw - offset        target sent = wanted + offset
    /// ```
    ///
    /// # Errors
    /// When the joint is detached.
    pub fn set_offset(&mut self, joint: Joint, raw_pulses: i32) -> Result<(), TargetError> {
        let now = self.now;
        self.slot_mut(joint).ok_or(TargetError::Detached)?.set_offset(Offset::new(raw_pulses), now);
        self.relax(joint);
        Ok(())
    }

    /// Returns where the zero of a joint lies in the counts of its drive, in pulses: to be stored. `None` for a detached joint.
    #[must_use]
    pub fn offset(&self, joint: Joint) -> Option<i32> {
        Some(self.slot(joint)?.offset.raw())
    }

    /// Asks a joint for a register once, in its turn; [`answer`](Self::answer) has it then.
    ///
    /// # Errors
    /// When the joint is detached.
    pub fn read(&mut self, joint: Joint, register: Register) -> Result<(), TargetError> {
        let slot = self.slot_mut(joint).ok_or(TargetError::Detached)?;
        slot.question = Some(register);
        slot.answer = None;
        Ok(())
    }

    /// Returns the answer to the last [`read`](Self::read), and forgets it.
    pub fn answer(&mut self, joint: Joint) -> Option<Reply> {
        self.slot_mut(joint)?.answer.take()
    }

    fn aim(
        &mut self,
        joint: Joint,
        is_finite: bool,
        set: impl FnOnce(&mut Slot),
    ) -> Result<(), TargetError> {
        let slot = self.slot_mut(joint).ok_or(TargetError::Detached)?;
        let outcome = slot.guard.admit(is_finite);
        if outcome.is_ok() {
            set(slot);
        }
        // A target that is refused takes the present one away.
        self.let_go(joint.index());
        outcome
    }
}
