//! Frames outside the usual path: the first frame of a motor, a frame after a gap, a frame with an error, and frames that are no feedback.

use super::Feedback;
use super::command::Outbox;
use super::counters::Rejects;
use super::deadlines;
use super::motors::{FIRST_FEEDBACK_ID, IDS, Motors};
use super::rounds;
use super::slot::{Slot, gap, health};
use crate::frame::CanFrame;
use crate::motor::{Ingest, Malformed};
use crate::time::Instant;

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
        rounds::hear_command(motors, outbox, frame.header(), now);
        return Ingest::Unrelated;
    }
    let index = motors.slot_of(id_index);
    let Some(facts) = motors.slots.get(index).and_then(Slot::facts) else {
        rejects.unattached = rejects.unattached.saturating_add(1);
        return Ingest::Unrelated;
    };
    if frame.length() != 8 {
        rejects.bad_length = rejects.bad_length.saturating_add(1);
        return Ingest::Malformed(Malformed::Length(frame.length()));
    }
    let Some(feedback) = Feedback::decode(frame.bytes()) else {
        rejects.bad_field = rejects.bad_field.saturating_add(1);
        return Ingest::Malformed(Malformed::Field);
    };
    let running = motors.guard.is_running();
    if running && has_nothing_new(motors, index, feedback, now) {
        return Ingest::Taken;
    }
    if !running {
        let before = motors.guard.pass_unwatched(now);
        deadlines::forget_bygones(motors, before);
    }
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
