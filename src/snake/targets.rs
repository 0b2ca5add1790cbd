//! Targets for joints, and their settings, registers and health.

use super::slot::{Offset, Slot, health, to_pulses};
use super::{AttachError, Config, Joint, Joints, PULSES_PER_TURN, Register};
use crate::encoder::Position;
use crate::motor::{
    Capabilities, Capability, Condition, Conditions, Health, Link, MotorName, TargetError,
};
use crate::time::Edge;
use crate::units::AngularVelocity;

/// Targets. Each replaces the previous one, works in RAM only, and counts until the command deadline
/// ([`Timeouts::command`](crate::motor::Timeouts::command)): if an application stops setting targets, its joints are disabled.
///
/// # Errors
/// A target fails, and is not kept for later, if the joint is detached, not armed, relaxed by a fault, not online, or has
/// [lost its zero](Joints::set_offset). NaN or infinity also fails, and cancels the present target.
impl Joints {
    /// Sets the position to go to, from the joint's zero. Saturates at the ±32768 turns of the joint's counter.
    ///
    /// Costs 83 instructions on a Cortex-M4F (`docs/figures.md`).
    ///
    /// # Errors
    /// Fails unless the joint is attached, armed and online, for NaN and infinity, and as [`TargetError::NotHomed`] after a loss of the zero.
    pub fn set_position(&mut self, joint: Joint, position: Position) -> Result<(), TargetError> {
        let turns = position.turns().clamp(-32_768, 32_767);
        let turns = i32::try_from(turns).unwrap_or(0) * PULSES_PER_TURN;
        let pulses = turns.saturating_add(to_pulses(position.angle().as_radians()));
        self.aim(joint, position.is_finite(), |slot| slot.set_target(pulses))
    }

    /// Sets the position to go to, in pulses from the joint's zero: the wire's own scale, 65536 a turn.
    ///
    /// # Errors
    /// Fails unless the joint is attached, armed and online, and as [`TargetError::NotHomed`] after a loss of the zero.
    pub fn set_pulses(&mut self, joint: Joint, pulses: i32) -> Result<(), TargetError> {
        self.aim(joint, true, |slot| slot.set_target(pulses))
    }

    /// Sets the speed of moves to a target; the sign does not count, and the value saturates at 255 rpm. A speed is no target: it can be
    /// set before arming, and does not keep a target alive.
    ///
    /// # Errors
    /// The joint is detached, or the speed is NaN or infinite, which counts as a refused target and cancels the present one.
    pub fn set_speed(&mut self, joint: Joint, speed: AngularVelocity) -> Result<(), TargetError> {
        let slot = self.slot_mut(joint).ok_or(TargetError::Detached)?;
        if !speed.is_finite() {
            return self.aim(joint, false, |_| {});
        }
        slot.set_speed(speed.as_rad_per_s());
        Ok(())
    }

    /// Changes the set-up registers of a joint to those of `config`: current, acceleration, deceleration and mode.
    ///
    /// The rest of `config` is ignored. The joint may move meanwhile. During a bring-up, a change may be written after the enable, within
    /// seven turns of the joint.
    ///
    /// # Errors
    /// A parameter is not usable. For a detached joint there is no effect.
    pub fn set_settings(&mut self, joint: Joint, config: &Config) -> Result<(), AttachError> {
        let settings = config.settings;
        let Some(slot) = self.slot_mut(joint) else { return Ok(()) };
        if let (Some(parameter), Some(joint)) = (settings.refused(), slot.name()) {
            return Err(AttachError::Parameter { joint, parameter });
        }
        slot.set_settings(settings);
        Ok(())
    }

    /// Discards the target of a joint: the joint is disabled, and stays armed.
    pub fn relax(&mut self, joint: Joint) {
        let Some(slot) = self.slot_mut(joint) else { return };
        slot.guard.relax();
        self.let_go(joint.index());
    }

    /// Makes the present position of a joint zero. A joint with a target is relaxed: the target refers to the old zero.
    ///
    /// The position is that of the last reply, even if the joint moves.
    ///
    /// # Errors
    /// The joint is detached, or not online: its position is then unknown.
    pub fn zero(&mut self, joint: Joint) -> Result<(), TargetError> {
        let slot = self.slot(joint).ok_or(TargetError::Detached)?;
        let raw = slot.raw.filter(|_| slot.guard.link() == Link::Online);
        self.set_offset(joint, raw.ok_or(TargetError::NoFeedback)?)
    }

    /// Sets the position of a joint's zero in the counts of its drive, in pulses: for example a stored one. A joint with a target is
    /// relaxed.
    ///
    /// A zero, of this function or of [`zero`](Self::zero), is lost when the drive may have lost its supply: such a drive may count from
    /// another angle. The state is then [`Homing::Uncertain`](crate::encoder::Homing::Uncertain), and targets are refused as
    /// [`TargetError::NotHomed`] until the zero is set again, once the joint is online. A stored zero is right only if the drive has kept its
    /// count. A joint that was never given a zero counts as its drive, and has none to lose.
    ///
    /// ```text
    /// position shown = raw - offset        target sent = wanted + offset
    /// ```
    ///
    /// # Errors
    /// The joint is detached.
    pub fn set_offset(&mut self, joint: Joint, raw_pulses: i32) -> Result<(), TargetError> {
        let slot = self.slots.get_mut(joint.index()).filter(|slot| slot.matches(joint));
        let (slot, now) = (slot.ok_or(TargetError::Detached)?, self.guard.updated());
        self.guard.change(slot, slot.place(), now, |slot| slot.set_offset(Offset(raw_pulses)));
        self.relax(joint);
        Ok(())
    }

    /// Returns the position of a joint's zero in the counts of its drive, in pulses, for storage. `None` for a detached joint.
    #[must_use]
    pub fn offset(&self, joint: Joint) -> Option<i32> {
        Some(self.slot(joint)?.offset.0)
    }

    /// Requests a register of a joint once, in its turn. [`answer`](Self::answer) then returns the reply.
    ///
    /// # Errors
    /// The joint is detached.
    pub fn read(&mut self, joint: Joint, register: Register) -> Result<(), TargetError> {
        let slot = self.slot_mut(joint).ok_or(TargetError::Detached)?;
        slot.question = Some(register);
        slot.answer = None;
        Ok(())
    }

    /// Returns register and value, as on the wire, of the reply to the last [`read`](Self::read), once.
    pub fn answer(&mut self, joint: Joint) -> Option<(Register, i32)> {
        self.slot_mut(joint)?.answer.take()
    }

    /// Returns the register of an outstanding reply.
    #[must_use]
    pub fn awaited(&self, joint: Joint) -> Option<Register> {
        self.slot(joint).and_then(|_| self.answers.of(joint.index()))
    }

    /// Declares that the driver receives its own frames. A frame of a controller is then no sign of a second controller, and the check for
    /// a second one is off.
    #[must_use]
    pub const fn with_loopback(mut self) -> Self {
        self.echoes = true;
        self
    }

    /// Returns the capabilities of a joint: positions over many turns, in radians or in its own pulses, and feedback of positions. Empty
    /// for a detached joint. There is no function for any other target.
    #[must_use]
    pub fn capabilities(&self, joint: Joint) -> Capabilities {
        const OFFERED: Capabilities =
            Capabilities::of(&[Capability::Raw, Capability::Position, Capability::Feedback]);
        self.slot(joint).map_or(Capabilities::NONE, |_| OFFERED)
    }

    /// Returns the health of a joint; `None` for a detached joint. The feedback rate is that of positions, and the ambiguous gaps are
    /// position changes larger than possible.
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

    /// Returns the conditions of a joint that hold; empty for a detached joint.
    #[must_use]
    pub fn conditions(&self, joint: Joint) -> Conditions {
        self.slot(joint).map_or(Conditions::NONE, |slot| slot.guard.latch.active())
    }

    /// Returns the oldest unread edge of a joint.
    ///
    /// No edge is lost, however late it is read. While an edge waits, the same change is not noted again. If more than 48 edges wait, the later
    /// ones, until all are read, come in the order of the joints, with the time of the last of these.
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
    /// assert_eq!((edge.source.id(), edge.condition, edge.began), (3, Condition::Late, true));
    /// assert_eq!(edge.at.as_micros() / 1_024, 42_000 / 1_024); // the first update after 40 ms
    /// assert_eq!(joints.next_edge(), None);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn next_edge(&mut self) -> Option<Edge<Condition, MotorName>> {
        let now = self.guard.updated();
        self.guard.journal.next_edge(&mut self.slots, now, Slot::name)
    }

    fn aim(
        &mut self,
        joint: Joint,
        is_finite: bool,
        set: impl FnOnce(&mut Slot),
    ) -> Result<(), TargetError> {
        let slot = self.slots.get_mut(joint.index()).filter(|slot| slot.matches(joint));
        let slot = slot.ok_or(TargetError::Detached)?;
        let outcome = slot.admit(is_finite);
        if outcome.is_ok() {
            self.guard.take_target(&mut slot.guard);
            set(slot);
        }
        // A refused target also cancels the present one.
        self.let_go(joint.index());
        outcome
    }
}
