//! Attaching and detaching of motors.

use super::budget::Budget;
use super::command::{Outbox, Place};
use super::config::PlainConfig;
use super::motors::{FIRST_FEEDBACK_ID, Key, Motors};
use super::slot::config::configured;
use super::{AttachError, Facts};
use crate::motor::MotorName;

/// Attaches a motor; see [`Bus::attach`](super::Bus::attach).
pub(super) const fn attach<const N: usize>(
    motors: &mut Motors<N>,
    outbox: &mut Outbox,
    budget: &Budget,
    facts: &'static Facts,
    config: &PlainConfig,
) -> Result<Key, AttachError> {
    let motor = MotorName::new(facts.name, config.id);
    let Some((frame, slot)) = facts.place(config.id) else {
        return Err(AttachError::Id { motor, highest: facts.ids });
    };
    let feedback_id = facts.feedback_base + config.id as u16;
    let id_index = feedback_id as usize - FIRST_FEEDBACK_ID as usize;
    let Some(index) = motors.place_for(id_index) else {
        #[expect(clippy::cast_possible_truncation, reason = "at most 11")]
        let capacity = N as u8;
        return Err(AttachError::Full { motor, capacity });
    };
    let Some((_, [here, ..])) = motors.slots.split_at_checked(index as usize) else {
        return Err(AttachError::Id { motor, highest: facts.ids });
    };
    let place = Place::new(frame, slot);
    if let Some(with) = here.name() {
        let slot = if here.place.same_as(place) { Some((frame, slot)) } else { None };
        return Err(AttachError::Collision { motor, with, feedback_id, slot });
    }
    let Some(generation) = here.next_generation() else {
        return Err(AttachError::WornOut { motor });
    };
    let new = match configured(facts, config, place, generation) {
        Ok(slot) => slot,
        Err(error) => return Err(error),
    };
    let (count, commands) = (motors.count() + 1, outbox.frames_in_use_with(frame));
    let rate = motors.rounds.feedback_hz;
    if let Some((load, ceiling_percent, feedback_hz)) = budget.overload(count, rate, commands) {
        return Err(AttachError::Load { motor, load, ceiling_percent, feedback_hz });
    }
    motors.put(id_index, index, new);
    outbox.open(frame);
    Ok(Key::new(index, generation))
}

/// Attaches several motors, or none; see [`Bus::attach_all`](super::Bus::attach_all).
pub(super) fn attach_all<const N: usize, const K: usize>(
    motors: &mut Motors<N>,
    outbox: &mut Outbox,
    budget: &Budget,
    facts: &'static Facts,
    configs: &[PlainConfig; K],
) -> Result<[Key; K], AttachError> {
    let before = *outbox;
    let mut keys = [Key::NONE; K];
    for (key, config) in keys.iter_mut().zip(configs) {
        match attach(motors, outbox, budget, facts, config) {
            Ok(attached) => *key = attached,
            Err(error) => {
                for key in keys {
                    if let Some(slot) = motors.get_mut(key) {
                        slot.withdraw();
                        motors.forget(key.place());
                    }
                }
                *outbox = before;
                return Err(error);
            }
        }
    }
    Ok(keys)
}

/// Detaches a motor; see [`Bus::detach`](super::Bus::detach).
pub(super) fn detach<const N: usize>(motors: &mut Motors<N>, outbox: &mut Outbox, motor: Key) {
    let Some(slot) = motors.get_mut(motor) else { return };
    let place = slot.place;
    slot.free();
    motors.forget(motor.place());
    outbox.put(place, 0);
    let mut slots = motors.slots.iter();
    let shared = slots.any(|slot| slot.facts().is_some() && slot.place.frame() == place.frame());
    if !shared {
        outbox.close(place.frame());
    }
}

/// Returns id and mask of a hardware filter; see [`Bus::acceptance_filter`](super::Bus::acceptance_filter).
pub(super) fn acceptance_filter<const N: usize>(motors: &Motors<N>) -> (u16, u16) {
    let ids = || motors.by_id().map(|(id, ..)| id);
    let Some(first) = ids().next() else { return (0x7FF, 0x7FF) };
    let differing = ids().fold(0, |bits, id| bits | (id ^ first));
    let open = if differing == 0 { 0 } else { u16::MAX >> differing.leading_zeros() };
    (first & !open, 0x7FF & !open)
}
