//! The bus as a device of the runner, and as an owner of motors for a chassis.

use super::attach::{self, claim};
use super::slot::{Slot, health};
use super::{AnyHandle, Bus, Handle, Model};
use crate::frame::CanFrame;
use crate::motor::{
    AngleDrive, CanDevice, Capabilities, Claim, Condition, Conditions, Ingest, Link, MotorName,
    TargetError, VelocityDrive, WrongSetting,
};
use crate::time::{Edge, Instant, Tick};
use crate::units::{Angle, AngularVelocity};

impl<B, const N: usize> CanDevice for Bus<B, N> {
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

    fn put_back(&mut self, frame: &CanFrame) -> bool {
        self.outbox.put_back(frame.header())
    }

    fn superseded(&self) -> u32 {
        self.outbox.superseded
    }

    fn claims(&self) -> impl Iterator<Item = Claim> {
        let attached = || {
            let motors = self.motors.by_id();
            motors.filter_map(|(id, _, slot)| Some((slot.name()?, slot, id)))
        };
        let feedback = attached().filter_map(|(motor, _, id)| claim(id, Claim::feedback, motor));
        let commands = super::CommandFrame::ALL.into_iter().filter_map(move |frame| {
            let (motor, ..) = attached().find(|(_, slot, _)| slot.place.frame() == frame)?;
            claim(frame.id(), Claim::command, motor)
        });
        feedback.chain(commands)
    }

    fn missing(&self, now: Instant) -> impl Iterator<Item = MotorName> {
        let missing = move |slot: &&Slot| self.motors.guard.misses(&slot.guard, now);
        self.motors.slots.iter().filter(missing).filter_map(Slot::name)
    }

    fn faulty(&self) -> impl Iterator<Item = (MotorName, Conditions)> {
        self.motors.slots.iter().filter_map(health::unfit)
    }

    fn wrong_setting(&self) -> Option<WrongSetting> {
        None
    }

    fn second_master(&self) -> Option<Claim> {
        attach::rival_among(self.motors.slots.iter())
    }

    fn next_edge(&mut self) -> Option<Edge<Condition, MotorName>> {
        Self::next_edge(self)
    }

    fn ask(&mut self) -> bool {
        self.motors.guard.ask()
    }

    fn engage(&mut self, now: Instant) {
        attach::engage(&mut self.motors, now, |_, _| true);
    }

    fn disarm(&mut self) {
        Self::disarm(self);
    }

    fn trip(&mut self) {
        Self::disarm(self);
        self.motors.guard.trip();
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

impl Default for Bus {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(target_pointer_width = "32")]
const _: () = {
    assert!(size_of::<super::slot::Slot>() <= 296 && size_of::<Bus>() <= 3600);
    assert!(size_of::<Bus<(), 8>>() <= 2800 && size_of::<Bus<(), 1>>() <= 640);
};

impl<M: Model, B, const N: usize> VelocityDrive<Handle<M, B>> for Bus<B, N> {
    fn velocity(&self, motor: Handle<M, B>) -> Option<AngularVelocity> {
        velocity(self, motor.into())
    }

    fn capabilities(&self, motor: Handle<M, B>) -> Capabilities {
        Self::capabilities(self, motor)
    }

    fn set_velocity(
        &mut self,
        motor: Handle<M, B>,
        target: AngularVelocity,
    ) -> Result<(), TargetError> {
        Self::set_velocity(self, motor, target)
    }
}

impl<B, const N: usize> VelocityDrive<AnyHandle<B>> for Bus<B, N> {
    fn velocity(&self, motor: AnyHandle<B>) -> Option<AngularVelocity> {
        velocity(self, motor)
    }

    fn capabilities(&self, motor: AnyHandle<B>) -> Capabilities {
        Self::capabilities(self, motor)
    }

    fn set_velocity(
        &mut self,
        motor: AnyHandle<B>,
        target: AngularVelocity,
    ) -> Result<(), TargetError> {
        Self::set_velocity(self, motor, target)
    }
}

impl<M: Model, B, const N: usize> AngleDrive<Handle<M, B>> for Bus<B, N> {
    fn angle(&self, motor: Handle<M, B>) -> Option<Angle> {
        angle(self, motor.into())
    }

    fn set_angle(&mut self, motor: Handle<M, B>, target: Angle) -> Result<(), TargetError> {
        Self::set_angle(self, motor, target)
    }
}

impl<B, const N: usize> AngleDrive<AnyHandle<B>> for Bus<B, N> {
    fn angle(&self, motor: AnyHandle<B>) -> Option<Angle> {
        angle(self, motor)
    }

    fn set_angle(&mut self, motor: AnyHandle<B>, target: Angle) -> Result<(), TargetError> {
        Self::set_angle(self, motor, target)
    }
}

/// Returns the measured velocity of a motor that is online.
fn velocity<B, const N: usize>(bus: &Bus<B, N>, motor: AnyHandle<B>) -> Option<AngularVelocity> {
    let slot = bus.motors.get(motor.key())?;
    (slot.guard.link() == Link::Online).then(|| slot.velocity())
}

/// Returns the measured angle of a motor that is online, if its absolute angle is known.
fn angle<B, const N: usize>(bus: &Bus<B, N>, motor: AnyHandle<B>) -> Option<Angle> {
    let state = health::state(bus.motors.get(motor.key())?)?;
    (state.link == Link::Online && state.homing.is_known()).then(|| state.position.angle())
}
