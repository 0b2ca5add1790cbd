//! The joints as a device of the runner.

use super::slot::Slot;
use super::{Joints, schedule};
use crate::frame::CanFrame;
use crate::motor::{
    CanDevice, Claim, Condition, Conditions, Devices, Ingest, MotorName, Visitor, WrongSetting,
    are_armed,
};
use crate::time::{Edge, Instant, Tick};
use embedded_can::StandardId;

impl CanDevice for Joints {
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

    /// Requests and writes have turns of their own.
    fn put_back(&mut self, _frame: &CanFrame) -> bool {
        false
    }

    fn superseded(&self) -> u32 {
        self.counters.superseded
    }

    /// Each joint has one id, in both directions.
    fn claims(&self) -> impl Iterator<Item = Claim> {
        let joint = |slot: &Slot| StandardId::new(u16::from(slot.id?)).zip(slot.name());
        let joints = || self.slots.iter().filter_map(joint);
        let feedback = joints().map(|(id, name)| Claim::feedback(id, name));
        feedback.chain(joints().map(|(id, name)| Claim::command(id, name)))
    }

    fn missing(&self, now: Instant) -> impl Iterator<Item = MotorName> {
        let is_missing = move |slot: &&Slot| self.guard.misses(&slot.guard, now);
        self.slots.iter().filter(is_missing).filter_map(Slot::name)
    }

    /// A fault of a joint ends when the joint is armed again.
    fn faulty(&self) -> impl Iterator<Item = (MotorName, Conditions)> {
        core::iter::empty()
    }

    fn wrong_setting(&self) -> Option<WrongSetting> {
        None
    }

    fn second_master(&self) -> Option<Claim> {
        let slot = self.slots.iter().find(|slot| slot.guard.latch.has(Condition::SecondMaster))?;
        let id = StandardId::new(u16::from(slot.id?))?;
        Some(Claim::command(id, slot.name()?))
    }

    fn next_edge(&mut self) -> Option<Edge<Condition, MotorName>> {
        Self::next_edge(self)
    }

    fn ask(&mut self) -> bool {
        self.guard.ask()
    }

    fn engage(&mut self, now: Instant) {
        let is_chosen = |_, slot: &Slot| slot.id.is_some();
        // Earlier behaviour of the drive no longer counts.
        let begin = |slot: &mut Slot| slot.guard.latch.set(Condition::Fault, false);
        self.guard.engage(&mut self.slots, now, is_chosen, begin);
    }

    fn disarm(&mut self) {
        rest_all(self);
    }

    fn trip(&mut self) {
        rest_all(self);
        self.guard.trip();
    }

    fn is_armed(&self) -> bool {
        let attached = self.slots.iter().filter(|slot| slot.id.is_some());
        are_armed(attached.map(|slot| &slot.guard))
    }

    fn emergency_stop(&mut self) {
        if self.guard.set_stop(true) {
            rest_all(self);
            schedule::stop_all(self);
        }
    }

    fn clear_emergency_stop(&mut self) {
        self.guard.set_stop(false);
    }

    fn is_stopped(&self) -> bool {
        self.guard.is_stopped()
    }
}

impl Devices for Joints {
    #[inline]
    fn visit(&mut self, visitor: &mut impl Visitor) {
        visitor.visit(self);
    }

    fn ingest(&mut self, frame: &CanFrame, now: Instant) -> Ingest {
        Self::ingest(self, frame, now)
    }

    fn update(&mut self, tick: Tick) {
        Self::update(self, tick);
    }

    fn next_frame(&mut self, _turn: u32) -> Option<CanFrame> {
        Self::next_frame(self)
    }
}

/// Disarms every joint.
fn rest_all(joints: &mut Joints) {
    for index in 0..joints.slots.len() {
        let Some(slot) = joints.slots.get_mut(index).filter(|slot| slot.id.is_some()) else {
            continue;
        };
        let was_armed = slot.guard.is_armed();
        slot.guard.disarm();
        _ = slot.let_go();
        // A program may disarm in each tick: a joint disabled already is only reminded.
        if was_armed || !slot.is_told() {
            schedule::stop(joints, index);
        }
    }
}

impl Default for Joints {
    fn default() -> Self {
        Self::new()
    }
}
