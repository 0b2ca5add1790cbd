//! The bus as a device of the runner.

use super::bus::LONGEST_PAUSE;
use super::slot::Slot;
use super::{AnyHandle, Bus};
use crate::frame::CanFrame;
use crate::motor::{ArmError, CanDevice, Claim, Edge, Ingest, Link, Missing, MotorName, Role};
use crate::time::{Instant, Tick};
use crate::units::{Angle, AngularVelocity};
use embedded_can::StandardId;

impl<B> CanDevice for Bus<B> {
    fn ingest(&mut self, frame: &CanFrame, now: Instant) -> Ingest {
        Self::ingest(self, frame, now)
    }

    fn update(&mut self, tick: Tick) {
        Self::update(self, tick);
    }

    fn next_frame(&mut self, _turn: u32) -> Option<CanFrame> {
        Self::next_frame(self)
    }

    fn requeue(&mut self, frame: &CanFrame) -> bool {
        Self::requeue(self, frame)
    }

    fn superseded(&self) -> u32 {
        self.outbox.superseded
    }

    fn claims(&self) -> impl Iterator<Item = Claim> {
        let attached = || {
            self.slots
                .iter()
                .zip(0x201_u16..)
                .filter_map(|(slot, id)| Some((slot.name()?, slot, id)))
        };
        let feedback = attached().filter_map(|(motor, _, id)| claim(id, Role::Feedback, motor));
        let commands = super::CommandFrame::ALL.into_iter().filter_map(move |frame| {
            let (motor, ..) = attached().find(|(_, slot, _)| slot.place.frame() == frame)?;
            claim(frame.id(), Role::Command, motor)
        });
        feedback.chain(commands)
    }

    fn missing(&self, now: Instant) -> impl Iterator<Item = MotorName> {
        let missing = move |slot: &&Slot| self.misses(slot, now);
        self.slots.iter().filter(missing).filter_map(Slot::name)
    }

    fn faulty(&self) -> impl Iterator<Item = MotorName> {
        self.slots.iter().filter(|slot| slot.is_faulty()).filter_map(Slot::name)
    }

    fn second_master(&self) -> Option<Claim> {
        self.rival_among(self.slots.iter())
    }

    fn next_edge(&mut self) -> Option<Edge> {
        Self::next_edge(self)
    }

    fn engage(&mut self, now: Instant) {
        if !self.stopped && !self.is_far(now) {
            self.now = now.stamp();
            self.disturb();
            for motor in 0..self.used {
                self.engage_slot(motor, now);
            }
        }
    }

    fn disarm(&mut self) {
        self.slots.iter_mut().for_each(Slot::disarm);
        self.outbox.clear();
    }

    fn is_armed(&self) -> bool {
        let mut attached = self.slots.iter().filter(|slot| slot.facts().is_some()).peekable();
        attached.peek().is_some() && attached.all(Slot::is_armed)
    }

    fn emergency_stop(&mut self) {
        if !self.stopped {
            self.disarm();
            self.stopped = true;
        }
    }

    fn clear_emergency_stop(&mut self) {
        self.stopped = false;
    }

    fn is_stopped(&self) -> bool {
        self.stopped
    }
}

impl<B> Bus<B> {
    /// Arms these motors only, whatever the others do.
    ///
    /// It knows this bus alone: where it is a part of a device of several families, look at
    /// [`clash`](CanDevice::clash) of the whole first.
    ///
    /// # Errors
    /// As [`CanDevice::arm`], which arms all: names those of `motors` that are not heard, or not fit to be driven.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::dji::{Bus, Config, M3508};
    /// use drivetrain::frame::CanFrame;
    /// use drivetrain::motor::CanDevice;
    /// use drivetrain::time::Instant;
    ///
    /// let mut bus = Bus::new();
    /// let [left, right] = bus.attach_all([1, 2].map(Config::<M3508>::new))?;
    /// let now = Instant::from_micros(1_000);
    /// bus.ingest(&CanFrame::standard(0x201, [0; 8]).ok_or("not an 11-bit id")?, now);
    /// bus.arm_only(&[left.erase()], now)?;
    /// assert!(bus.is_motor_armed(left) && !bus.is_motor_armed(right));
    /// assert!(!bus.is_armed()); // not all of them
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[expect(clippy::result_large_err, reason = "no heap, and arming is rare")]
    pub fn arm_only(&mut self, motors: &[AnyHandle<B>], now: Instant) -> Result<(), ArmError> {
        if self.stopped {
            return Err(ArmError::Stopped);
        }
        let chosen = || motors.iter().filter_map(|motor| self.slot(*motor));
        if chosen().next().is_none() {
            return Err(ArmError::NoMotors);
        }
        let missing = chosen().filter(|slot| self.misses(slot, now));
        if let Some(missing) = Missing::collect(missing.filter_map(Slot::name)) {
            return Err(ArmError::Missing(missing));
        }
        if let Some(claim) = self.rival_among(chosen()) {
            return Err(ArmError::SecondMaster(claim));
        }
        let faulty = chosen().filter(|slot| slot.is_faulty());
        if let Some(faulty) = Missing::collect(faulty.filter_map(Slot::name)) {
            return Err(ArmError::Faulty(faulty));
        }
        self.now = now.stamp();
        self.disturb();
        for motor in motors {
            if self.slot(*motor).is_some() {
                self.engage_slot(motor.key().place(), now);
            }
        }
        Ok(())
    }

    /// Tells whether a motor has no fresh feedback, as far as its stamp tells.
    fn misses(&self, slot: &Slot, now: Instant) -> bool {
        self.is_far(now) || slot.is_missing(now.stamp(), &self.timeouts)
    }

    /// Tells whether a time lies so far after or before the last one that no stamp tells how far.
    fn is_far(&self, now: Instant) -> bool {
        now > self.updated + LONGEST_PAUSE || self.updated > now + LONGEST_PAUSE
    }

    fn engage_slot(&mut self, motor: u8, now: Instant) {
        let Some(slot) = self.slots.get_mut(usize::from(motor)) else { return };
        let before = slot.conditions;
        slot.engage(now.stamp(), &self.timeouts);
        self.journal.note(motor, &before, &slot.conditions, now);
    }

    /// Returns the measured velocity of a motor that is online.
    pub(super) fn fresh_velocity(&self, motor: AnyHandle<B>) -> Option<AngularVelocity> {
        let slot = self.slot(motor)?;
        (slot.link() == Link::Online).then(|| slot.velocity())
    }

    /// Returns the measured angle of a motor that is online and knows where its shaft points.
    pub(super) fn fresh_angle(&self, motor: AnyHandle<B>) -> Option<Angle> {
        let state = self.slot(motor)?.state()?;
        (state.link == Link::Online && state.homing.is_known()).then(|| state.position.angle())
    }
}

pub(super) fn claim(id: u16, role: Role, motor: MotorName) -> Option<Claim> {
    Some(Claim::new(StandardId::new(id)?, role, motor))
}
