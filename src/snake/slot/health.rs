//! Feedback, update, conditions and state of one joint.

use super::{ALL, JUMP, LAST, Slot, Standing};
use crate::encoder::{Homing, Position};
use crate::motor::{Condition, Health, Link, MotorName, Reaction};
use crate::snake::model::{FASTEST, PULSES_PER_TURN};
use crate::snake::{Register, State};
use crate::time::{Duration, Edge, Instant};
use crate::units::{Angle, AngularVelocity};
use core::f32::consts::TAU;

/// A joint that moves less than this stands.
const STANDS: u32 = PULSES_PER_TURN.unsigned_abs() / 256;

/// Distance to the target within which a joint has arrived.
const THERE: u32 = PULSES_PER_TURN.unsigned_abs() / 64;

impl Slot {
    /// Takes a reply received at `now`. Every reply is kept, but only a position is a sign of life: only the position changes without the
    /// attention of the controller.
    pub(in crate::snake) fn receive(&mut self, (register, value): (Register, i32), now: Instant) {
        match register {
            Register::ActualPosition => self.receive_position(value, now),
            Register::ActualSpeed => self.raw_speed = value,
            Register::Enable if is_up(self) && value == 0 => {
                self.resets = self.resets.saturating_add(1);
                self.distrust(now);
            }
            _ => {}
        }
        if self.question == Some(register) {
            self.question = None;
            self.answer = Some((register, value));
        }
    }

    fn receive_position(&mut self, raw: i32, now: Instant) {
        if let (Some(before), Link::Online | Link::Late) = (self.raw, self.guard.link()) {
            let way = raw.wrapping_sub(before).unsigned_abs();
            let gap_ms = now.since(self.heard).micros_u32().map_or(u32::MAX, |us| us / 1_000 + 1);
            let furthest = gap_ms.saturating_mul(2 * FASTEST.unsigned_abs() / 1_000);
            if way > furthest.saturating_add(JUMP.unsigned_abs()) {
                self.position_jumps = self.position_jumps.saturating_add(1);
                self.distrust(now);
            }
        }
        count_position(self, now);
        self.raw = Some(raw);
        self.heard = now;
        self.guard.hear(now);
    }

    /// Handles a drive in an unexpected state: its zero may differ, so the joint stays relaxed until armed again.
    fn distrust(&mut self, now: Instant) {
        self.guard.note(Condition::Fault, true, now);
        self.lose_zero(now);
        self.guard.trip();
    }

    fn lose_zero(&mut self, now: Instant) {
        self.guard.note(Condition::PositionUncertain, true, now);
        if self.homing == Homing::Homed {
            self.homing = Homing::Uncertain;
        }
    }

    /// Brings the joint to `now`. Returns whether the joint must be disabled.
    pub(in crate::snake) fn update(&mut self, now: Instant) -> bool {
        let drives = self.guard.drives(now);
        if self.guard.link() == Link::Offline {
            self.lose_zero(now);
        }
        check(self, now);
        // The check may have relaxed the joint.
        let drives = drives && self.guard.is_armed();
        let stops = self.driven && !drives;
        if drives && !self.driven {
            (self.pending, self.ahead) = (ALL, ALL);
        }
        self.driven = drives;
        stops
    }

    /// Returns the state; `None` before the first position.
    pub(in crate::snake) fn state(&self) -> Option<State> {
        let (motor, raw_pulses) = (self.name()?, self.raw?);
        let pulses = self.directed(self.offset.shown(raw_pulses));
        let (turns, rest) =
            (pulses.div_euclid(PULSES_PER_TURN), pulses.rem_euclid(PULSES_PER_TURN));
        let speed = self.directed(self.raw_speed) as f32 * (TAU / PULSES_PER_TURN as f32);
        Some(State {
            motor,
            position: Position::new(
                i64::from(turns),
                Angle::from_turns(rest as f32 / PULSES_PER_TURN as f32),
            ),
            pulses,
            raw_pulses,
            homing: self.homing,
            velocity: AngularVelocity::from_rad_per_s(speed),
            link: self.guard.link(),
            is_driven: self.driven,
            unanswered: self.unanswered,
            bad_replies: self.bad_replies,
            position_jumps: self.position_jumps,
            resets: self.resets,
            refused_targets: self.guard.refused_targets(),
            forgotten_targets: self.guard.forgotten_targets(),
        })
    }
}

/// Counts a position received at `now`, before its time replaces the previous time.
fn count_position(slot: &mut Slot, now: Instant) {
    if slot.raw.is_some() {
        let gap = now.since(slot.heard).micros_u32();
        slot.traffic.gap(gap.unwrap_or(u32::MAX));
    } else {
        slot.window_from = now;
    }
    slot.traffic.count();
}

/// Notes a write or a request of another node.
pub(in crate::snake) fn hear_rival(slot: &mut Slot, now: Instant) {
    slot.rival.hear(now);
    slot.guard.note(Condition::SecondMaster, true, now);
}

pub(in crate::snake) const fn has_rival(slot: &Slot) -> bool {
    slot.rival.is_present()
}

/// Ends expired conditions, and the window in which positions are counted.
fn check(slot: &mut Slot, now: Instant) {
    slot.rival.check(now);
    slot.guard.note(Condition::SecondMaster, has_rival(slot), now);
    check_stall(slot, now);
    if slot.raw.is_some() {
        slot.traffic.end_window(&mut slot.window_from, now);
    }
}

/// Checks a joint away from its target: without a motion, the joint is blocked, or its drive does not follow.
fn check_stall(slot: &mut Slot, now: Instant) {
    let Some(raw) = slot.raw else { return };
    let (window, reaction) = (slot.stall.window, slot.stall.reaction);
    let way = slot.target.wrapping_sub(raw).unsigned_abs();
    let moved = raw.wrapping_sub(slot.stands.at).unsigned_abs() > STANDS;
    let asked = is_up(slot) && way > THERE;
    let is_watched = reaction != Reaction::Ignore && slot.guard.link() == Link::Online;
    if moved || !(asked && is_watched && is_fast_enough(slot)) {
        slot.stands = Standing { at: raw, since: now };
    }
    let begins = now.since(slot.stands.since) >= window;
    if begins && reaction == Reaction::Relax {
        slot.guard.relax_until_armed();
    }
    slot.guard.note(Condition::Stalled, begins, now);
}

/// Tells whether the joint was enabled. Before, the drive reports itself as disabled. Afterwards, there may be changed values all the time,
/// from an application that moves the target along.
const fn is_up(slot: &Slot) -> bool {
    slot.driven && slot.pending & LAST == 0
}

/// Tells whether the joint would move visibly within the window, from rest.
fn is_fast_enough(slot: &Slot) -> bool {
    let time_s = slot.stall.window.as_secs_f32();
    let sped_up = 0.5 * slot.settings.acceleration as f32 * time_s * time_s;
    sped_up.min(slot.speed as f32 * time_s) > 4.0 * STANDS as f32
}

/// Returns the time of the edge that is read next.
pub(in crate::snake) fn next_edge_at(slot: &Slot) -> Option<Instant> {
    slot.id.and_then(|_| slot.guard.next_edge_at())
}

pub(in crate::snake) fn next_edge(slot: &mut Slot) -> Option<Edge<Condition, MotorName>> {
    let motor = slot.name()?;
    slot.guard.next_edge(motor)
}

/// Returns the health of the joint.
pub(in crate::snake) fn report(slot: &Slot) -> Option<Health> {
    Some(Health {
        feedback_hz: slot.traffic.rate_hz(),
        longest_gap: Duration::from_micros(slot.traffic.longest_gap_us().into()),
        ambiguous_gaps: slot.position_jumps,
        ..slot.guard.health(slot.name()?)
    })
}
