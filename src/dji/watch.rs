//! Events outside the usual path of a tick:
//!
//! * frames: the first frame of a motor, a frame after a gap, a frame with an error, and frames that are no feedback;
//! * time: ages that exceed their limits, keep-alives, updates without a usable step;
//! * checks of one motor a tick, in rounds.

use super::motors::{FIRST_FEEDBACK_ID, IDS, Motors};
use super::outbox::Outbox;
use super::slot::health::CheckRound;
use super::slot::{Slot, Surroundings, gap, health};
use super::{CommandFrame, Feedback};
use crate::frame::CanFrame;
use crate::motor::{Condition, Hold, Ingest, MotorName, Output};
use crate::time::{Edge, Instant};

/// Takes any frame.
#[inline]
pub(super) fn ingest<const N: usize>(
    motors: &mut Motors<N>,
    outbox: &Outbox,
    rejects: &mut Rejects,
    frame: &CanFrame,
    now: Instant,
) -> Ingest {
    let id_index = frame.header().wrapping_sub(FIRST_FEEDBACK_ID) as usize;
    if id_index >= IDS {
        hear_command(motors, outbox, frame.header(), now);
        return Ingest::Unrelated;
    }
    let index = motors.slot_of(id_index);
    let Some(facts) = motors.slots.get(index).and_then(Slot::facts) else {
        rejects.unattached = rejects.unattached.saturating_add(1);
        return Ingest::Unrelated;
    };
    if frame.length() != 8 {
        rejects.bad_length = rejects.bad_length.saturating_add(1);
        return Ingest::WrongLength(frame.length());
    }
    let Some(feedback) = Feedback::decode(frame.bytes()) else {
        rejects.bad_field = rejects.bad_field.saturating_add(1);
        return Ingest::WrongField;
    };
    let running = motors.guard.is_running();
    if running && has_nothing_new(motors, index, feedback, now) {
        return Ingest::Taken;
    }
    let (guard, slots) = motors.parts();
    guard.hear_first(slots, now);
    let timeouts = *motors.guard.timeouts();
    #[expect(clippy::cast_possible_truncation, reason = "below 11")]
    let in_time = motors.change(index as u8, now, |slot| {
        let in_time = slot.receive(feedback, now.stamp());
        if !in_time {
            gap::receive(slot, facts, feedback, now.stamp(), &timeouts, running);
        }
        health::hear_error(slot, facts, feedback.error());
        in_time
    });
    if in_time == Some(false) {
        motors.guard.disturb();
    }
    Ingest::Taken
}

/// Takes feedback in time, without an error or with a known one. Returns `false` for any other feedback, or if the frame was not taken.
fn has_nothing_new<const N: usize>(
    motors: &mut Motors<N>,
    index: usize,
    feedback: Feedback,
    now: Instant,
) -> bool {
    let Some(slot) = motors.slots.get_mut(index) else { return false };
    let Some(facts) = slot.facts() else { return false };
    slot.guard.is_in_time(now.stamp())
        && health::hear_known_error(slot, facts, feedback.error())
        && slot.receive(feedback, now.stamp())
}

/// Applies all due time-outs and keep-alives. If time did not move on, ends the update and returns `false`.
#[cold]
#[inline(never)]
pub(super) fn apply_due<const N: usize>(
    motors: &mut Motors<N>,
    outbox: &mut Outbox,
    before: Instant,
) -> bool {
    let held = pass(motors, outbox, before, true);
    if let Some(hold) = held {
        finish(motors, outbox, hold);
    }
    held.is_none()
}

/// Ends an update without a usable time step.
#[cold]
#[inline(never)]
pub(super) fn end_without_step<const N: usize>(
    motors: &mut Motors<N>,
    outbox: &mut Outbox,
    before: Instant,
) {
    if let Some(hold) = pass(motors, outbox, before, false) {
        finish(motors, outbox, hold);
    }
}

#[inline(always)]
fn pass<const N: usize>(
    motors: &mut Motors<N>,
    outbox: &mut Outbox,
    before: Instant,
    has_step: bool,
) -> Option<Hold> {
    let keep_alive_us = outbox.keep_alive(motors.guard.now());
    let (guard, slots) = motors.parts();
    guard.pass(slots, before, has_step, keep_alive_us)
}

fn finish<const N: usize>(motors: &mut Motors<N>, outbox: &mut Outbox, hold: Hold) {
    motors.bad_steps = motors.bad_steps.saturating_add(1);
    if hold != Hold::Keep {
        outbox.clear();
    }
    let repeats = |slot: &Slot| slot.guard.output(Some(hold)) == Output::Repeat;
    for slot in motors.slots.iter().filter(|slot| !repeats(slot)) {
        outbox.put(slot.place, 0);
    }
    outbox.finish_update();
}

/// Checks a motor in a round that ends a window, or begins a round.
#[cold]
#[inline(never)]
pub(super) fn check_without_slot<const N: usize>(motors: &mut Motors<N>, outbox: &Outbox) {
    let index = motors.round.next & !CheckRound::CLOSING;
    match motors.slots.get(usize::from(index)) {
        Some(slot) => {
            let word = outbox.get(slot.place);
            motors.round.next += 1;
            check(motors, index, word);
        }
        // A round has a turn for each id: it takes the same time on every bus.
        None if usize::from(index) < IDS => motors.round.next += 1,
        None => motors.round.begin(motors.guard.now()),
    }
}

/// Checks a motor in full.
#[inline(never)]
pub(super) fn check<const N: usize>(motors: &mut Motors<N>, index: u8, word: i16) {
    let now = motors.guard.now();
    let seen = Surroundings {
        now,
        elapsed: motors.round.elapsed,
        word,
        window: motors.round.window(),
        feedback_hz: motors.round.feedback_hz,
        is_alone: motors.guard.is_alone(),
    };
    motors.change(index, motors.guard.updated(), |slot| health::check(slot, &seen));
}

/// Takes a frame of another node that may be a command of this bus.
fn hear_command<const N: usize>(motors: &mut Motors<N>, outbox: &Outbox, id: u32, now: Instant) {
    let Some(frame) = CommandFrame::with_id(id) else { return };
    if motors.round.echoes || !outbox.is_in_use(frame) {
        return;
    }
    let (guard, slots) = motors.parts();
    let begin = |slot: &mut Slot| {
        if slot.facts().is_some() && slot.place.frame() == frame {
            health::begin(slot, Condition::SecondMaster);
        }
    };
    guard.hear_rival(now, |guard| guard.change_all(slots, now, begin));
}

/// Takes the oldest unread edge.
#[inline(never)]
pub(super) fn take_edge<const N: usize>(
    motors: &mut Motors<N>,
) -> Option<Edge<Condition, MotorName>> {
    let (guard, slots) = motors.parts();
    guard.journal.next_edge(slots, guard.updated(), Slot::name)
}

/// Counters of a bus. All saturate, except `packed` and `superseded`, which wrap at 2^32.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Counters {
    /// Feedback frames of another length than 8 bytes.
    pub bad_length: u32,
    /// Feedback frames with an angle above 8191.
    pub bad_field: u32,
    /// Frames with a feedback id of this family but no attached motor: a sign of a wrong id switch.
    pub unattached: u32,
    /// Updates with a time step of zero, negative or NaN, or with a time that did not move on.
    pub bad_steps: u32,
    /// Command frames made ready by updates; wraps.
    pub packed: u32,
    /// Command frames replaced by newer ones before they were taken, or after they were given back; wraps.
    pub superseded: u32,
}

/// Refused frames.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rejects {
    pub(super) bad_length: u32,
    pub(super) bad_field: u32,
    pub(super) unattached: u32,
}

impl Rejects {
    pub(super) const NONE: Self = Self { bad_length: 0, bad_field: 0, unattached: 0 };
}
