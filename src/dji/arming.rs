//! Arming, and the conditions that forbid arming.

use super::motors::{Key, Motors};
use super::slot::{Slot, health};
use crate::motor::{ArmError, Claim, Condition, Missing, MotorName, Role};
use crate::time::Instant;
use core::ops::Range;
use embedded_can::StandardId;

/// Arms chosen motors; see [`Bus::arm_only`](super::Bus::arm_only).
pub(super) fn arm_only<const N: usize>(
    motors: &mut Motors<N>,
    chosen: impl Iterator<Item = Key> + Clone,
    now: Instant,
) -> Result<(), ArmError> {
    motors.guard.ask();
    if motors.guard.is_stopped() {
        return Err(ArmError::Stopped);
    }
    let slots = || chosen.clone().filter_map(|motor| motors.get(motor));
    if slots().next().is_none() {
        return Err(ArmError::NoMotors);
    }
    let missing = slots().filter(|slot| motors.guard.misses(&slot.guard, now));
    if let Some(missing) = Missing::collect(missing.filter_map(Slot::name)) {
        return Err(ArmError::Missing(missing));
    }
    if let Some(claim) = rival_among(slots()) {
        return Err(ArmError::SecondMaster(claim));
    }
    let faulty = slots().filter(|slot| health::is_faulty(slot));
    if let Some(faulty) = Missing::collect(faulty.filter_map(Slot::name)) {
        return Err(ArmError::Faulty(faulty));
    }
    motors.guard.begin_arming(now)?;
    for motor in chosen {
        if motors.get(motor).is_some() {
            let place = motor.place();
            engage(motors, place..place + 1, now);
        }
    }
    keep_trip_of_others(motors);
    Ok(())
}

/// Arms the motors of some slots that are online and fit.
pub(super) fn engage<const N: usize>(motors: &mut Motors<N>, slots: Range<u8>, now: Instant) {
    for index in slots {
        let slot = motors.slots.get(usize::from(index)).filter(|slot| health::is_fit(slot));
        if slot.is_some_and(|slot| motors.guard.may_engage(&slot.guard, now)) {
            motors.change(index, now, |slot| health::engage(slot, now.stamp()));
        }
    }
}

/// Keeps the trip if a motor without an arming still waits to be armed.
pub(super) fn keep_trip_of_others<const N: usize>(motors: &mut Motors<N>) {
    if motors.slots.iter().any(|slot| slot.guard.is_tripped()) {
        motors.guard.keep_trip();
    }
}

/// Tells whether there are motors, and all take targets.
pub(super) fn is_armed(slots: &[Slot]) -> bool {
    let mut attached = slots.iter().filter(|slot| slot.facts().is_some()).peekable();
    attached.peek().is_some() && attached.all(|slot| slot.guard.is_armed())
}

/// Returns a command of one of these motors that another node has sent.
pub(super) fn rival_among<'a>(mut slots: impl Iterator<Item = &'a Slot>) -> Option<Claim> {
    let slot = slots.find(|slot| slot.guard.latch().has(Condition::SecondMaster))?;
    claim(slot.place.frame().id(), Role::Command, slot.name()?)
}

pub(super) fn claim(id: u16, role: Role, motor: MotorName) -> Option<Claim> {
    Some(Claim::new(StandardId::new(id)?, role, motor))
}
