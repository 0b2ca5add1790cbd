//! Ages that exceed their limits, keep-alives, updates without a usable step.

use super::command::Outbox;
use super::motors::Motors;
use crate::motor::{Ages, Hold};
use crate::time::Instant;

/// Applies all due time-outs and keep-alives, and computes the time of the next. Returns `false` if time did not move on.
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

/// Discards each stamp whose age a 32-bit counter can no longer represent; after a pause, discards all stamps.
///
/// Call this wherever time passes without a comparison of ages.
#[cold]
#[inline(never)]
pub(super) fn forget_bygones<const N: usize>(motors: &mut Motors<N>, before: Instant) {
    let (now, is_pause) = (motors.guard.updated(), motors.guard.is_pause(before));
    motors.change_all(now, |slot| slot.guard.forget_bygones(now.stamp(), is_pause));
}

/// Ends an update without a usable time or time step.
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
