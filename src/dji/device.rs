//! The bus as a device of the runner.

use super::slot::Slot;
use super::{AnyHandle, Bus};
use crate::frame::CanFrame;
use crate::motor::{CanDevice, Claim, Ingest, Link, MotorName, Role};
use crate::time::{Instant, Tick};
use crate::units::AngularVelocity;
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
        let missing = move |slot: &&Slot| slot.is_missing(now.stamp(), &self.timeouts);
        self.slots.iter().filter(missing).filter_map(Slot::name)
    }

    fn engage(&mut self, now: Instant) {
        self.now = now.stamp();
        self.slots.iter_mut().for_each(|slot| slot.engage(now.stamp()));
        self.armed = true;
    }

    fn disarm(&mut self) {
        self.slots.iter_mut().for_each(Slot::disarm);
        self.outbox.clear();
        self.armed = false;
    }

    fn is_armed(&self) -> bool {
        self.armed
    }

    fn emergency_stop(&mut self) {
        self.disarm();
        self.stopped = true;
    }

    fn clear_emergency_stop(&mut self) {
        self.stopped = false;
    }

    fn is_stopped(&self) -> bool {
        self.stopped
    }
}

impl<B> Bus<B> {
    /// Returns the measured velocity of a motor that is online.
    pub(super) fn fresh_velocity(&self, motor: AnyHandle<B>) -> Option<AngularVelocity> {
        let slot = self.slot(motor)?;
        (slot.link() == Link::Online).then(|| slot.velocity())
    }
}

fn claim(id: u16, role: Role, motor: MotorName) -> Option<Claim> {
    Some(Claim::new(StandardId::new(id)?, role, motor))
}
