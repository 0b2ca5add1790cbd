//! The bus as a device of the runner.

use super::slot::Slot;
use super::{AnyHandle, Bus};
use crate::frame::CanFrame;
use crate::motor::{
    ArmError, CanDevice, Claim, Devices, Edge, Ingest, Link, Missing, MotorName, Role, WrongSetting,
};
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

    fn next_frame(&mut self) -> Option<CanFrame> {
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
        let missing = move |slot: &&Slot| self.guard.misses(&slot.guard, now);
        self.slots.iter().filter(missing).filter_map(Slot::name)
    }

    fn faulty(&self) -> impl Iterator<Item = MotorName> {
        self.slots.iter().filter(|slot| slot.is_faulty()).filter_map(Slot::name)
    }

    fn wrong_setting(&self) -> Option<WrongSetting> {
        None
    }

    fn second_master(&self) -> Option<Claim> {
        self.rival_among(self.slots.iter())
    }

    fn next_edge(&mut self) -> Option<Edge> {
        Self::next_edge(self)
    }

    fn ask(&mut self) -> bool {
        self.guard.ask()
    }

    fn engage(&mut self, now: Instant) {
        if !self.guard.is_far(now) && self.guard.begin_arming(now).is_ok() {
            self.engage_all(0..self.used, now);
            self.keep_trip_of_others();
        }
    }

    fn disarm(&mut self) {
        Self::disarm(self);
    }

    fn trip(&mut self) {
        Self::disarm(self);
        self.guard.trip();
    }

    fn is_armed(&self) -> bool {
        Self::is_armed(self)
    }

    fn emergency_stop(&mut self) {
        Self::emergency_stop(self);
    }

    fn clear_emergency_stop(&mut self) {
        Self::clear_emergency_stop(self);
    }

    fn is_stopped(&self) -> bool {
        Self::is_stopped(self)
    }
}

/// Arming and stopping, as of [`Devices`].
impl<B> Bus<B> {
    /// Arms every motor: nothing moves before. After a trip, arming is granted only when nobody asked for 100 ms of updates.
    ///
    /// `now` is the time of the present tick: an update before it counts as a clock that went back.
    ///
    /// # Errors
    /// As [`Devices::arm`].
    pub fn arm(&mut self, now: Instant) -> Result<(), ArmError> {
        Devices::arm(self, now)
    }

    /// Relaxes every motor and refuses targets until armed again.
    pub fn disarm(&mut self) {
        for slot in &mut self.slots {
            slot.guard.disarm();
            slot.settle();
        }
        self.outbox.clear();
    }

    /// Tells whether every motor takes targets: false as long as one of them waits to be armed.
    #[must_use]
    pub fn is_armed(&self) -> bool {
        let mut attached = self.slots.iter().filter(|slot| slot.facts().is_some()).peekable();
        attached.peek().is_some() && attached.all(|slot| slot.guard.is_armed())
    }

    /// Relaxes every motor at once, until the stop is cleared and the bus armed.
    pub fn emergency_stop(&mut self) {
        if self.guard.stop() {
            Self::disarm(self);
        }
    }

    /// Clears the emergency stop. The bus stays disarmed, and arming needs a new request.
    pub const fn clear_emergency_stop(&mut self) {
        self.guard.clear_stop();
    }

    /// Tells whether the emergency stop is set.
    #[must_use]
    pub const fn is_stopped(&self) -> bool {
        self.guard.is_stopped()
    }

    /// Arms these motors only, whatever the others do.
    ///
    /// It knows this bus alone: where it is a part of a device of several families, look at
    /// [`clash`](Devices::clash) of the whole first.
    ///
    /// # Errors
    /// As [`Devices::arm`], which arms all: names those of `motors` that are not heard, or not fit to be driven.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::dji::{Bus, Config, M3508};
    /// use drivetrain::frame::CanFrame;
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
    pub fn arm_only(&mut self, motors: &[AnyHandle<B>], now: Instant) -> Result<(), ArmError> {
        self.guard.ask();
        if self.guard.is_stopped() {
            return Err(ArmError::Stopped);
        }
        let chosen = || motors.iter().filter_map(|motor| self.slot(*motor));
        if chosen().next().is_none() {
            return Err(ArmError::NoMotors);
        }
        let missing = chosen().filter(|slot| self.guard.misses(&slot.guard, now));
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
        self.guard.begin_arming(now)?;
        for motor in motors {
            if self.slot(*motor).is_some() {
                let place = motor.key().place();
                self.engage_all(place..place + 1, now);
            }
        }
        self.keep_trip_of_others();
        Ok(())
    }

    /// A motor that was left out still waits to be armed.
    fn keep_trip_of_others(&mut self) {
        if self.slots.iter().any(|slot| slot.guard.is_tripped()) {
            self.guard.keep_trip();
        }
    }

    fn engage_all(&mut self, motors: core::ops::Range<u8>, now: Instant) {
        for motor in motors {
            let slot = self.slots.get(usize::from(motor)).filter(|slot| slot.is_fit());
            if slot.is_some_and(|slot| self.guard.may_engage(&slot.guard, now)) {
                self.change(motor, now, |slot| slot.engage(now.stamp()));
            }
        }
    }

    /// Returns the measured velocity of a motor that is online.
    pub(super) fn fresh_velocity(&self, motor: AnyHandle<B>) -> Option<AngularVelocity> {
        let slot = self.slot(motor)?;
        (slot.guard.link() == Link::Online).then(|| slot.velocity())
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
