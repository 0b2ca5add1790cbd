//! What an application asks of joints and reads of them.

use super::offset::Offset;
use super::slot::{Slot, health, to_pulses};
use super::{AttachError, Config, Joint, Joints, PULSES_PER_TURN, Register, Reply};
use crate::encoder::Position;
use crate::motor::{Capabilities, Capability, Conditions, Edge, Health, TargetError};
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

    /// Returns the register that a joint was asked for and has not answered yet.
    #[must_use]
    pub fn awaited(&self, joint: Joint) -> Option<Register> {
        self.slot(joint).and_then(|_| self.answers.of(joint.index()))
    }

    /// Says that the driver hands back the frames that it sent, so that a frame of a controller that is received is no
    /// sign of a second one. None is looked for then.
    #[must_use]
    pub const fn with_loopback(mut self) -> Self {
        self.echoes = true;
        self
    }

    /// Returns what a joint offers: positions over many turns, in radians or in its own pulses, and what it reports of
    /// them. Nothing once it is detached. There is no function for any other target.
    #[must_use]
    pub fn capabilities(&self, joint: Joint) -> Capabilities {
        const OFFERED: Capabilities =
            Capabilities::of(&[Capability::Raw, Capability::Position, Capability::Feedback]);
        self.slot(joint).map_or(Capabilities::NONE, |_| OFFERED)
    }

    /// Returns how a joint is; `None` once it is detached. Its feedback rate is that of positions, and its ambiguous gaps
    /// are the positions further off than it can go.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::snake::{Config, Joints};
    ///
    /// let mut joints = Joints::new();
    /// let neck = joints.attach(Config::new(3))?;
    /// assert_eq!(
    ///     joints.health(neck).map(|health| health.to_string()).as_deref(),
    ///     Some("snake joint #3: unheard, disarmed, healthy; 0 Hz, gap 0 us, no temperature, error 0; saturated 0, refused 0, forgotten 0, ambiguous 0"),
    /// );
    /// # Ok::<(), drivetrain::snake::AttachError>(())
    /// ```
    #[must_use]
    pub fn health(&self, joint: Joint) -> Option<Health> {
        health::report(self.slot(joint)?)
    }

    /// Returns what is wrong with a joint; nothing once it is detached.
    #[must_use]
    pub fn conditions(&self, joint: Joint) -> Conditions {
        self.slot(joint).map_or(Conditions::NONE, |slot| slot.guard.conditions())
    }

    /// Returns the oldest change of a joint's condition that was not read yet.
    ///
    /// None is lost, however late it is read; while it waits, the same change is not noted again. Of each joint, beyond 6
    /// that wait, the later ones have the time of the last of these.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::frame::CanFrame;
    /// use drivetrain::motor::Condition;
    /// use drivetrain::snake::{Config, Joints};
    /// use drivetrain::time::{Instant, Tick};
    ///
    /// let mut joints = Joints::new();
    /// joints.attach(Config::new(3))?;
    /// let at_ms = |ms: u64| Instant::from_micros(ms * 1_000);
    /// let id = embedded_can::StandardId::new(3).ok_or("id")?;
    /// let reply = <CanFrame as embedded_can::Frame>::new(id, &[4, 7, 0, 0, 0, 9]).ok_or("length")?;
    /// _ = joints.ingest(&reply, at_ms(1));
    /// (2..50).for_each(|ms| joints.update(Tick::new(at_ms(ms), 0.001)));
    /// let edge = joints.next_edge().ok_or("nothing happened")?;
    /// assert_eq!((edge.motor.id(), edge.condition, edge.began), (3, Condition::Late, true));
    /// assert_eq!(edge.at.as_micros() / 1_024, 42_000 / 1_024); // the first update after 40 ms
    /// assert_eq!(joints.next_edge(), None);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn next_edge(&mut self) -> Option<Edge> {
        let waiting = self.slots.iter_mut().filter(|slot| health::next_edge_at(slot).is_some());
        health::next_edge(waiting.min_by_key(|slot| health::next_edge_at(slot))?)
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
