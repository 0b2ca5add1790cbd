//! Feedback, update, conditions and state of one joint.

use super::{ALL, JUMP, LAST, Rules, Slot, Standing};
use crate::encoder::{self, Homing, Position};
use crate::motor::{Condition, Health, Hold, Link, Output, Traffic};
use crate::snake::model::PULSES_PER_TURN;
use crate::snake::{Register, State};
use crate::time::{Duration, Instant};
use crate::units::{Angle, AngularVelocity};
use core::f32::consts::TAU;

/// The rate is that of so long: a position may have waited, and the next one not.
const RATE_SPAN: Duration = Duration::from_millis(20);

/// A joint that moves less than this stands.
const STANDS: u32 = PULSES_PER_TURN.unsigned_abs() / 256;

/// Distance to the target within which a joint has arrived.
const THERE: u32 = PULSES_PER_TURN.unsigned_abs() / 64;

impl Slot {
    /// Takes a reply received at `now`. Every reply is kept, but only a position is a sign of life: only the position changes without the
    /// attention of the controller.
    pub(in crate::snake) fn receive(
        &mut self,
        rules: &mut Rules,
        (register, value): (Register, i32),
        now: Instant,
    ) {
        match register {
            Register::ActualPosition => self.receive_position(rules, value, now),
            Register::ActualSpeed => self.raw_speed = value,
            Register::Enable if is_up(self) && value == 0 => {
                self.resets = self.resets.saturating_add(1);
                self.distrust(rules, now);
            }
            _ => {}
        }
        if self.question.take_if(|question| *question == register).is_some() {
            self.answer = Some((register, value));
        }
    }

    fn receive_position(&mut self, rules: &mut Rules, raw: i32, now: Instant) {
        let gap_us = now.since(self.heard).micros_u32().unwrap_or(u32::MAX);
        let link = self.guard.link();
        let was_heard = !matches!(link, Link::Unheard | Link::Offline);
        let is_further = |before| way(before, raw) > furthest(self, before, gap_us as f32 * 1e-6);
        if was_heard && self.raw.is_some_and(is_further) {
            self.position_jumps = self.position_jumps.saturating_add(1);
            self.distrust(rules, now);
        }
        self.was_led = is_up(self);
        measure_rate(self, raw, now);
        if self.guard.is_in_time(now.stamp()) {
            self.guard.hear_in_time(now.stamp());
        } else {
            match self.raw {
                Some(_) => self.traffic.gap(gap_us),
                None => self.window_from = now,
            }
            self.traffic.count();
            let is_silence = self.guard.is_silence(gap_us, rules.timeouts());
            rules.hear(self, self.place(), now, |slot| {
                if is_silence {
                    slot.lose_zero();
                }
            });
            rules.trust(&mut self.guard, self.traffic.usual_gap_us());
        }
        self.raw = Some(raw);
        self.heard = now;
    }

    /// Handles a drive in an unexpected state: its zero may differ, so the joint stays relaxed until armed again.
    fn distrust(&mut self, rules: &mut Rules, now: Instant) {
        // Two changes: the fault is the first edge.
        rules.change(self, self.place(), now, |slot| slot.guard.fail(slot.stall.health()));
        rules.change(self, self.place(), now, Self::lose_zero);
        // Of a joint that is not armed too: a request to arm counts once the jumps are over.
        rules.trip();
    }

    fn lose_zero(&mut self) {
        self.guard.lose_zero();
        if self.homing == Homing::Homed {
            self.homing = Homing::Uncertain;
        }
    }

    /// Brings the joint to the time of the update. Returns whether the joint must be disabled.
    pub(in crate::snake) fn update(
        &mut self,
        rules: &mut Rules,
        is_quiet: bool,
        held: Option<Hold>,
    ) -> bool {
        let now = rules.updated();
        let is_stalled = is_stalled(self, now);
        if is_stalled || !is_quiet || self.guard.link() != Link::Online {
            let is_alone = held.is_none().then(|| rules.is_alone());
            rules.change(self, self.place(), now, |slot| check(slot, is_stalled, is_alone, now));
            let waits = is_stalled || self.guard.latch.has(Condition::SecondMaster);
            rules.wake_at(if waits { now } else { self.window_from + Traffic::WINDOW });
        }
        let drives = self.guard.output(held) != Output::Rest;
        if drives {
            self.guard.end_rest();
        }
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
            refused_targets: self.guard.refused_targets,
            forgotten_targets: self.guard.forgotten_targets,
        })
    }
}

/// Returns the way between two positions in rad.
fn way(one: i32, other: i32) -> f32 {
    other.wrapping_sub(one).unsigned_abs() as f32 * (TAU / PULSES_PER_TURN as f32)
}

/// Returns the largest way in rad of a joint from a position, so many s after the position was heard: to its target, if led since.
fn furthest(slot: &Slot, before: i32, gap_s: f32) -> f32 {
    let target = if slot.was_led { slot.target } else { before };
    JUMP + encoder::furthest(gap_s, slot.rate, (way(before, target), way(0, slot.speed)))
}

fn measure_rate(slot: &mut Slot, raw: i32, now: Instant) {
    let (before, since) = slot.marked;
    let span = now.since(since);
    let is_new = slot.raw.is_none() || now < since;
    if is_new || span >= RATE_SPAN {
        slot.rate = if is_new { 0.0 } else { way(before, raw) / span.as_secs_f32() };
        slot.marked = (raw, now);
    }
}

/// Begins and ends conditions, and ends the window in which positions are counted.
fn check(slot: &mut Slot, is_stalled: bool, is_alone: Option<bool>, now: Instant) {
    let is_lost = slot.guard.link() == Link::Offline;
    if is_stalled || is_lost || !slot.guard.latch.active().is_empty() {
        if let Some(is_alone) = is_alone {
            slot.guard.latch.end_what_is_over(slot.guard.has_target(), is_alone);
        }
        if is_lost {
            slot.lose_zero();
        }
        slot.guard.judge(Condition::Stalled, is_stalled, slot.stall.health());
    }
    if slot.driven && slot.is_forgotten(now) {
        slot.renew(Register::Position);
    }
    slot.traffic.add(slot.guard.in_time.take());
    if slot.traffic.end_window(&mut slot.window_from, now) {
        slot.guard.trust(0);
    }
}

/// Tells whether a joint away from its target stands for too long: the joint is blocked, or its drive does not follow.
fn is_stalled(slot: &mut Slot, now: Instant) -> bool {
    let Some(raw) = slot.raw else { return false };
    let way = slot.target.wrapping_sub(raw).unsigned_abs();
    let moved = raw.wrapping_sub(slot.stands.at).unsigned_abs() > STANDS;
    let asked = is_up(slot) && way > THERE && slot.guard.link() == Link::Online;
    if moved || !(asked && is_fast_enough(slot)) {
        slot.stands = Standing { at: raw, since: now };
    }
    now.since(slot.stands.since) >= slot.stall.window
        && !slot.stall.health().ignores(Condition::Stalled)
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

/// Returns the health of the joint.
pub(in crate::snake) fn report(slot: &Slot) -> Option<Health> {
    Some(Health {
        feedback_hz: slot.traffic.rate_hz(),
        longest_gap: Duration::from_micros(slot.traffic.longest_gap_us().into()),
        ambiguous_gaps: slot.position_jumps,
        ..slot.guard.health(slot.name()?)
    })
}
