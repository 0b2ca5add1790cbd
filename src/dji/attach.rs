//! Attaching, arming and detaching of motors, the conditions that forbid arming, and the load of the bus.

use super::config::PlainConfig;
use super::motors::{FIRST_FEEDBACK_ID, Motors};
use super::outbox::{Outbox, Place};
use super::slot::config::configured;
use super::slot::{Key, Slot, health};
use super::{AttachError, Facts};
use crate::motor::{ArmError, BusLoad, Claim, Condition, MotorName, Obstacles, are_armed};
use crate::time::Instant;
use embedded_can::StandardId;

/// Attaches a motor; see [`Bus::attach`](super::Bus::attach).
pub(super) const fn attach<const N: usize>(
    motors: &mut Motors<N>,
    outbox: &mut Outbox,
    budget: &Budget,
    facts: &'static Facts,
    config: &PlainConfig,
) -> Result<Key, AttachError> {
    let motor = MotorName::new(facts.name, config.id);
    let Some((frame, slot)) = facts.place_in(config.id) else {
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
        let slot = if here.place.same_as(place) { Some((frame.id(), slot)) } else { None };
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
    let rate = motors.round.feedback_hz;
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

/// Arms chosen motors; see [`Bus::arm_only`](super::Bus::arm_only).
pub(super) fn arm_only<const N: usize>(
    motors: &mut Motors<N>,
    chosen: impl Iterator<Item = Key> + Clone,
    now: Instant,
) -> Result<(), ArmError> {
    let (granted, is_stopped) = (motors.guard.ask(), motors.guard.is_stopped());
    Obstacles::check(is_stopped, granted, |found| {
        let slots = || chosen.clone().filter_map(|motor| motors.get(motor));
        let missing = slots().filter(|slot| motors.guard.misses(&slot.guard, now));
        found.has_motors = slots().next().is_some();
        found.missing.extend(missing.filter_map(Slot::name));
        found.second_master = rival_among(slots());
        found.faulty.extend_unfit(slots().filter_map(health::unfit));
    })?;
    engage(motors, now, |index, slot| {
        chosen.clone().any(|motor| motor.place() == index && slot.matches(motor))
    });
    Ok(())
}

/// Arms the chosen motors that are online and fit.
pub(super) fn engage<const N: usize>(
    motors: &mut Motors<N>,
    now: Instant,
    is_chosen: impl Fn(u8, &Slot) -> bool,
) {
    let (guard, slots) = motors.parts();
    let is_chosen = |index, slot: &Slot| health::is_fit(slot) && is_chosen(index, slot);
    guard.engage(slots, now, is_chosen, |slot| health::start(slot, now.stamp()));
}

/// Tells whether there are motors, and all take targets.
pub(super) fn is_armed(slots: &[Slot]) -> bool {
    let attached = slots.iter().filter(|slot| slot.facts().is_some());
    are_armed(attached.map(|slot| &slot.guard))
}

/// Returns a command of one of these motors that another node has sent.
pub(super) fn rival_among<'a>(mut slots: impl Iterator<Item = &'a Slot>) -> Option<Claim> {
    let slot = slots.find(|slot| slot.guard.latch.has(Condition::SecondMaster))?;
    claim(slot.place.frame().id(), Claim::command, slot.name()?)
}

pub(super) fn claim(
    id: u16,
    direction: fn(StandardId, MotorName) -> Claim,
    motor: MotorName,
) -> Option<Claim> {
    Some(direction(StandardId::new(id)?, motor))
}

/// Rates for the computation of the load.
#[derive(Debug, Clone, Copy)]
pub(super) struct Budget {
    pub(super) bit_rate: u32,
    pub(super) tick_hz: u32,
    pub(super) ceiling_percent: Option<u16>,
}

impl Budget {
    pub(super) const fn new() -> Self {
        Self { bit_rate: 1_000_000, tick_hz: 1_000, ceiling_percent: None }
    }

    /// Sets the ceiling of the load, a share, to whole percent.
    pub(super) const fn set_ceiling(&mut self, ceiling: f32) {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "saturates, NaN gives 0: nothing can be attached"
        )]
        let percent = (ceiling * 100.0 + 0.5) as u16;
        self.ceiling_percent = Some(percent);
    }

    pub(super) const fn load(&self, motors: u32, feedback_hz: u32, commands: u32) -> BusLoad {
        BusLoad::new(self.bit_rate)
            .with_frames(motors, feedback_hz)
            .with_frames(commands, self.tick_hz)
    }

    /// Returns the highest feedback rate that fits below a ceiling beside the commands.
    const fn feedback_within(&self, percent: u16, motors: u32, commands: u32) -> u32 {
        let fits = BusLoad::new(self.bit_rate).frames_within(percent as f32 / 100.0);
        let left = fits.saturating_sub(self.tick_hz.saturating_mul(commands));
        let motors = if motors == 0 { 1 } else { motors };
        left / motors
    }

    /// Returns the load, the ceiling and the highest feedback rate that fits, if the load is above the ceiling.
    const fn overload(
        &self,
        motors: u32,
        feedback_hz: u32,
        commands: u32,
    ) -> Option<(BusLoad, u16, u32)> {
        let Some(ceiling) = self.ceiling_percent else { return None };
        let load = self.load(motors, feedback_hz, commands);
        if load.worst_percent() <= ceiling as u32 {
            return None;
        }
        Some((load, ceiling, self.feedback_within(ceiling, motors, commands)))
    }
}
