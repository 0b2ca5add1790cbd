//! Feedback after a gap, and the position of the shaft after the gap.

use super::{Slot, health};
use crate::dji::{Facts, Feedback};
use crate::encoder::{COUNTS_PER_TURN, Homing, Position, resolve_gap, shortest};
use crate::motor::{Condition, Link, TargetError, Timeouts, age};

/// Takes a feedback frame received at `now`, after a gap of any length.
pub(in crate::dji) fn receive(
    slot: &mut Slot,
    facts: &Facts,
    feedback: Feedback,
    now: u32,
    timeouts: &Timeouts,
    running: bool,
) {
    let (link, gap_us) = (slot.guard.link(), age(now, slot.guard.heard));
    let in_time = now.wrapping_sub(slot.guard.heard) < trusted_gap_us(facts);
    if link != Link::Unheard {
        slot.traffic.gap(gap_us);
    }
    slot.traffic.count();
    match link {
        Link::Unheard => slot.shaft.seed(feedback.angle()),
        Link::Online | Link::Late if in_time && !running => move_shortest(slot, feedback),
        Link::Online | Link::Late => follow(slot, facts, feedback, gap_us),
        Link::Offline => {
            move_shortest(slot, feedback);
            doubt_position(slot);
        }
        Link::Recovering => move_shortest(slot, feedback),
    }
    slot.feedback = feedback;
    slot.guard.hear(now, timeouts);
    if slot.guard.link() == Link::Online {
        // Before the first update no tick checks ages, so every frame must: all frames then take this path.
        let is_trusted = running && !slot.traffic.is_crowded();
        slot.guard.trust(if is_trusted { trusted_gap_us(facts) } else { 0 });
        if link == Link::Recovering || link == Link::Offline {
            health::narrow_further(slot, (false, false), now);
        }
        health::waive_check(slot, facts);
    }
}

/// Follows the angle of a motor whose last feedback is `gap_us` old.
fn follow(slot: &mut Slot, facts: &Facts, feedback: Feedback, gap_us: u32) {
    let (before, after) = (slot.feedback, feedback);
    if slot.traffic.is_crowded() && gap_us < trusted_gap_us(facts) {
        compare(slot, feedback, gap_us);
        return move_shortest(slot, feedback);
    }
    let no_load_rpm = facts.rotor_no_load_rpm();
    let absurd = |rpm: i16| u32::from(rpm.unsigned_abs()) > 2 * u32::from(no_load_rpm);
    if absurd(before.rpm()) || absurd(after.rpm()) {
        move_shortest(slot, feedback);
        return doubt_position(slot);
    }
    let (before, after) = ((before.angle(), before.rpm()), (after.angle(), after.rpm()));
    let gap = resolve_gap(before, after, gap_us, no_load_rpm);
    let (Ok(counts) | Err(counts)) = gap;
    slot.shaft.advance_far(counts);
    if gap.is_err() {
        doubt_position(slot);
    }
}

/// Checks whether two motors take turns, if more frames come than one motor sends.
fn compare(slot: &mut Slot, feedback: Feedback, gap_us: u32) {
    const COUNTS_PER_RPM_MS: f32 = COUNTS_PER_TURN as f32 / 60_000.0;
    let (one, other) = (f32::from(slot.feedback.rpm()), f32::from(feedback.rpm()));
    let predicted = (one + other) * 0.5 * COUNTS_PER_RPM_MS * (gap_us as f32 * 1e-3);
    // Either sample is up to a period old.
    let tolerance = 200.0 + 2.0 * COUNTS_PER_RPM_MS * one.abs().max(other.abs());
    let counts = shortest(slot.feedback.angle(), feedback.angle());
    #[expect(clippy::cast_possible_truncation, reason = "saturates")]
    slot.traffic.compare(counts, predicted as i32, tolerance as i32);
    if slot.traffic.is_double() {
        health::begin(slot, Condition::DuplicateId);
    }
}

/// Follows the angle by the shortest way, without turns in between.
fn move_shortest(slot: &mut Slot, feedback: Feedback) {
    slot.shaft.advance(shortest(slot.feedback.angle(), feedback.angle()));
}

fn doubt_position(slot: &mut Slot) {
    slot.ambiguous_gaps = slot.ambiguous_gaps.saturating_add(1);
    slot.guard.latch.set(Condition::PositionUncertain, true);
    slot.require_check();
    if slot.homing == Homing::Homed && !slot.shaft.is_direct() {
        slot.homing = Homing::Uncertain;
        drop_way(slot);
    }
}

/// Discards a target from the zero before.
fn drop_way(slot: &mut Slot) {
    if slot.asked.is_way() {
        slot.relax();
    }
}

/// Sets the present position to `position`. A motor that holds an angle or position is relaxed: its target refers to the old zero.
pub(in crate::dji) fn set_present_position(
    slot: &mut Slot,
    position: Position,
    now: u32,
) -> Result<(), TargetError> {
    if slot.guard.link() != Link::Online {
        return Err(TargetError::NoFeedback);
    }
    if !position.is_finite() {
        return Err(TargetError::NotFinite);
    }
    drop_way(slot);
    slot.shaft.set_position(position);
    slot.homing = Homing::Homed;
    slot.guard.latch.set(Condition::PositionUncertain, false);
    health::keep_inside(slot, now);
    Ok(())
}

/// Returns half a rotor turn at no-load speed, 30 s / rpm, less the delay of a frame by others on the bus.
fn trusted_gap_us(facts: &Facts) -> u32 {
    let half_turn_us = 30_000_000 / u32::from(facts.rotor_no_load_rpm()).max(1);
    half_turn_us.saturating_sub(500)
}
