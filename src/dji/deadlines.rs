//! Ages that exceed their limits, keep-alives, updates without a usable step.

use super::command::Outbox;
use super::motors::Motors;
use crate::motor::{Ages, Hold};
use crate::time::Instant;

/// Applies all time-outs and keep-alives that are due, and computes until when none can be; `false` if time did not move on.
#[cold]
#[inline(never)]
pub(super) fn apply<const N: usize>(
    motors: &mut Motors<N>,
    outbox: &mut Outbox,
    before: Instant,
) -> bool {
    if !motors.guard.moves_on(before) {
        return false;
    }
    if motors.guard.is_pause(before) {
        forget_bygones(motors, before);
    }
    motors.guard.run();
    let keep_alive_us = outbox.keep_alive(motors.guard.now());
    let ages = motors.guard.ages().map(|ages| add_ages(motors, ages));
    if let Some(micros) = ages.and_then(|ages| ages.within_limits_us()) {
        motors.guard.rest_for(micros.min(keep_alive_us));
    } else {
        expire(motors);
    }
    true
}

fn add_ages<const N: usize>(motors: &Motors<N>, mut ages: Ages) -> Ages {
    let mut rest = motors.taken();
    while let [slot, others @ ..] = rest {
        ages.add(&slot.guard);
        rest = others;
    }
    ages
}

/// Compares the ages of each motor with their limits.
#[cold]
#[inline(never)]
fn expire<const N: usize>(motors: &mut Motors<N>) {
    let (now, updated, timeouts) =
        (motors.guard.now(), motors.guard.updated(), *motors.guard.timeouts());
    for index in 0..motors.used {
        if motors.change(index, updated, |slot| slot.guard.age(now, &timeouts)) == Some(false) {
            motors.guard.disturb();
        }
    }
}

/// Discards each stamp whose age 32 bits can no longer tell; after a pause, discards all stamps.
///
/// To be called wherever time passes and ages are not compared.
#[cold]
#[inline(never)]
pub(super) fn forget_bygones<const N: usize>(motors: &mut Motors<N>, before: Instant) {
    let (now, is_pause) = (motors.guard.updated(), motors.guard.is_pause(before));
    motors.change_all(now, |slot| slot.guard.forget_bygones(now.stamp(), is_pause));
}

/// Ends an update whose time or time step is not usable.
#[cold]
#[inline(never)]
pub(super) fn hold<const N: usize>(
    motors: &mut Motors<N>,
    outbox: &mut Outbox,
    before: Instant,
    moves_on: bool,
) {
    forget_bygones(motors, before);
    match motors.guard.hold(before, moves_on) {
        Hold::Keep => {}
        Hold::Rest => outbox.clear(),
        Hold::LoseTime => {
            motors.change_all(motors.guard.updated(), |slot| slot.lose_time());
            outbox.clear();
            return outbox.finish_update();
        }
    }
    // A motor without a target rests at once.
    for slot in motors.slots.iter().filter(|slot| slot.has_rested()) {
        outbox.put(slot.place, 0);
    }
    outbox.keep_alive(motors.guard.now());
    outbox.finish_update();
}
