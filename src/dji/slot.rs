//! One motor in a tick: feedback, targets of the same kind, loops, and the short check.
//!
//! Less frequent tasks of a motor are in the files of the folder.

pub(super) mod config;
pub(super) mod gap;
pub(super) mod health;
mod target;

use super::codec::{Range, free_to_raw, loop_to_raw, saturate};
use super::config::USUAL;
use super::outbox::Place;
use super::{Facts, Feedback};
use crate::control::{ErrorPid, Pid, PidConfig};
use crate::encoder::{GearRatio, Homing, Position, Shaft, shortest};
use crate::error::ConfigError;
use crate::motor::{HealthConfig, Monitor, MotorGuard, MotorName, Traffic};
use crate::time::TimeStep;
use crate::units::AngularVelocity;

/// The refusal of a handle of a detached motor.
pub(super) const DETACHED: ConfigError = ConfigError::Unusable("handle of a detached motor");
pub(super) use health::Surroundings;

/// Current of a motor that does not drive itself: a fifth of the full scale of the smallest ESC.
const CALM_CURRENT: i32 = 2_000;

/// Slot index in the low half, generation in the high half.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Key(u8);

impl Key {
    pub(super) const GENERATIONS: u8 = 16;
    /// Names no slot: there are 11.
    pub(super) const NONE: Self = Self(0xFF);

    pub(super) const fn new(index: u8, generation: u8) -> Self {
        Self(generation << 4 | (index & 15))
    }

    pub(super) const fn index(self) -> usize {
        (self.0 & 15) as usize
    }

    /// Returns the index as a byte.
    pub(super) const fn place(self) -> u8 {
        self.0 & 15
    }

    pub(super) const fn generation(self) -> u8 {
        self.0 >> 4
    }
}

#[derive(Debug, Clone, Copy)]
// In the order of use, so that neighbours are loaded and stored together.
#[repr(C)]
pub(super) struct Slot {
    feedback: Feedback,
    pub(super) guard: MotorGuard,
    shaft: Shaft,
    rad_per_s_per_rpm: f32,
    /// Task of an update: the action, or rest while the feedback is late.
    duty: Duty,
    asked: Action,
    pub(super) place: Place,
    homing: Homing,
    /// Available part of the full limit.
    range: Range,
    full_limit: i16,
    calm_word: u16,
    raw_per_unit: f32,
    goal: Goal,
    speed: Pid,
    position: ErrorPid,
    facts: Option<&'static Facts>,
    nm_per_a: f32,
    ambiguous_gaps: u16,
    generation: u8,
    error_code: u8,
    /// Below this temperature byte and the calm command, the motor needs no full check. 0 unless the last check found no condition, and no
    /// condition has begun since.
    cool_below: u8,
    /// Action of the last update.
    acted: Action,
    saturated: u16,
    health: &'static HealthConfig,
    monitor: Monitor,
    traffic: Traffic,
}

/// Action set by the target of a motor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
enum Action {
    Rest,
    Raw,
    Velocity,
    /// By the shortest way.
    Angle,
    Position,
    /// By the remaining way that another sensor measures.
    Measured,
}

impl Action {
    /// Tells whether the action goes to a position of the shaft.
    const fn is_way(self) -> bool {
        matches!(self, Self::Angle | Self::Position)
    }
}

/// Task of an update: the action itself in the usual, simple case.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
enum Duty {
    Rest,
    /// The first run of any action since a rest.
    First,
    Raw,
    /// The speed loop, plain and with the full output: its own limit is enough.
    Velocity,
    /// Both loops, as above.
    Position,
    /// Any other action, within the available output; also the first run of an action in place of another.
    Other,
}

/// Goal of an action, separate from the action, so that an update tests only one byte.
#[derive(Debug, Clone, Copy)]
struct Goal {
    /// The lower half of the turns, [near](crate::encoder::Shaft::near) to those of the shaft; or bits of the rad/s.
    turns: u32,
    /// Raw command, bits of the rad/s or of the way, or phase of the shaft.
    value: i32,
}

impl Goal {
    const NONE: Self = Self::of(0);

    const fn of(value: i32) -> Self {
        Self { turns: 0, value }
    }

    const fn rad_per_s(&self) -> f32 {
        f32::from_bits(self.value.cast_unsigned())
    }

    /// A way in rad, and its rate in rad/s.
    const fn measured(way: f32, rad_per_s: f32) -> Self {
        Self { turns: rad_per_s.to_bits(), value: way.to_bits().cast_signed() }
    }

    const fn way(&self) -> f32 {
        f32::from_bits(self.value.cast_unsigned())
    }

    const fn rate(&self) -> f32 {
        f32::from_bits(self.turns)
    }
}

/// Stands for a missing loop: without gains, the output is zero, and no branch is needed.
const NO_GAINS: PidConfig = PidConfig::new(0.0, 0.0, 0.0);

const NO_LOOP: Pid = match Pid::new(NO_GAINS) {
    Ok(pid) => pid,
    // Evaluated by the compiler.
    Err(_) => panic!("zero gains are refused: a bus cannot be made"),
};

impl Slot {
    pub(super) const FREE: Self = Self {
        facts: None,
        duty: Duty::Rest,
        asked: Action::Rest,
        goal: Goal::NONE,
        shaft: Shaft::new(GearRatio::DIRECT, false),
        feedback: Feedback::NONE,
        guard: MotorGuard::FREE,
        rad_per_s_per_rpm: 0.0,
        raw_per_unit: 0.0,
        nm_per_a: 0.0,
        range: Range::ZERO,
        full_limit: 0,
        ambiguous_gaps: 0,
        speed: NO_LOOP,
        position: NO_LOOP.core,
        generation: 0,
        place: Place::Nowhere,
        homing: Homing::Relative,
        error_code: 0,
        cool_below: 0,
        acted: Action::Rest,
        calm_word: 0,
        saturated: 0,
        health: &USUAL,
        monitor: Monitor::NEW,
        traffic: Traffic::NONE,
    };

    /// Tells whether a handle's key names the present motor.
    pub(super) const fn matches(&self, key: Key) -> bool {
        self.facts.is_some() && self.generation == key.generation()
    }

    pub(super) const fn facts(&self) -> Option<&'static Facts> {
        self.facts
    }

    /// Returns the velocity of the output shaft.
    #[inline(always)]
    pub(super) fn velocity(&self) -> AngularVelocity {
        AngularVelocity::from_rad_per_s(f32::from(self.feedback.rpm()) * self.rad_per_s_per_rpm)
    }

    /// Tells a loop from [`NO_LOOP`], the only one without limits.
    #[inline]
    const fn has_speed_loop(&self) -> bool {
        self.speed.core.is_limited()
    }

    #[inline]
    const fn has_position_loop(&self) -> bool {
        self.position.is_limited()
    }

    /// Frees the slot; handles of the motor find nothing from now on.
    pub(super) const fn free(&mut self) {
        *self = Self { generation: self.generation + 1, ..Self::FREE };
    }

    /// Frees a slot whose handle was never returned.
    pub(super) const fn withdraw(&mut self) {
        *self = Self { generation: self.generation, ..Self::FREE };
    }

    /// Returns the generation of the next motor here; `None` if all generations are used.
    pub(super) const fn next_generation(&self) -> Option<u8> {
        if self.generation < Key::GENERATIONS { Some(self.generation) } else { None }
    }

    pub(super) const fn name(&self) -> Option<MotorName> {
        match self.facts {
            Some(facts) => Some(MotorName::new(facts.name, self.id(facts))),
            None => None,
        }
    }

    /// Returns the id on the ESC, computed from the place of the command word.
    const fn id(&self, facts: &Facts) -> u8 {
        let [lower, _] = facts.command;
        let before = if self.place.frame() as u8 == lower as u8 { 0 } else { 4 };
        before + self.place.slot() + 1
    }

    fn direction(&self) -> f32 {
        1.0_f32.copysign(self.raw_per_unit)
    }

    // Feedback.

    /// Takes a feedback frame received at `now`, shortly after the previous one. Otherwise does nothing and returns `false`. A motor that
    /// is not online, and a free slot, trust no gap.
    #[inline(always)]
    pub(super) fn receive(&mut self, feedback: Feedback, now: u32) -> bool {
        let in_time = self.guard.is_in_time(now);
        if in_time {
            self.shaft.advance(shortest(self.feedback.angle(), feedback.angle()));
            self.feedback = feedback;
            self.guard.hear_in_time(now);
        }
        in_time
    }

    // Targets.

    /// Replaces a target in rad/s of the output shaft by another: a motor with such a target is armed and has a loop.
    #[inline]
    pub(super) fn renew_velocity(&mut self, motor: Key, rad_per_s: f32, now: u32) -> bool {
        let goes_on = self.asked == Action::Velocity
            && self.generation == motor.generation()
            && self.guard.may_renew_target(rad_per_s.is_finite());
        if goes_on {
            self.goal.value = rad_per_s.to_bits().cast_signed();
            self.guard.renew_target(now);
        }
        goes_on
    }

    /// Replaces a target in turns and angle of the output shaft by another, without soft limits.
    #[inline]
    pub(super) fn renew_position(&mut self, motor: Key, position: Position, now: u32) -> bool {
        let goes_on = self.asked == Action::Position
            && self.generation == motor.generation()
            && self.guard.may_renew_target(position.is_finite())
            && self.health.soft_limits.is_none();
        if goes_on {
            let (turns, phase) = self.shaft.locate(position);
            self.goal = Goal { turns: self.shaft.near(turns), value: phase };
            self.guard.renew_target(now);
        }
        goes_on
    }

    // Update.

    /// Runs the loops of this motor and returns its raw command; `None` outside of the usual path, where the caller
    /// [updates carefully](Self::update_carefully). `step` is the step of `dt_s`: only the usual path uses `step`, so the step stays in
    /// registers.
    #[inline(always)]
    pub(super) fn update(&mut self, step: &TimeStep, dt_s: f32) -> Option<i16> {
        let velocity = self.velocity().as_rad_per_s();
        let goal = match self.duty {
            Duty::Velocity => self.goal.rad_per_s(),
            Duty::Position => {
                let way = self.shaft.way_to(self.goal.turns, self.goal.value);
                self.position.plain((way, velocity), step).ok()?
            }
            Duty::Raw => return Some(saturate(self.goal.value, self.range)),
            // Out of line too: inline, every update of every motor would load a zero for these.
            Duty::Rest | Duty::First | Duty::Other => return None,
        };
        let sample = self.speed.sample(goal, velocity, step);
        let Ok(output) = self.speed.core.plain(sample, step) else {
            return Some(self.follow_velocity(goal, velocity, dt_s));
        };
        self.speed.measurement = velocity;
        Some(free_to_raw(output, self.raw_per_unit))
    }

    // Cold, so that the usual path runs straight on. Loops with options also come here, with no other cost.
    #[cold]
    #[inline(never)]
    fn follow_velocity(&mut self, goal: f32, velocity: f32, dt_s: f32) -> i16 {
        let output = self.speed.step(goal, velocity, &TimeStep::of_motor(dt_s));
        loop_to_raw(output, self.raw_per_unit, self.range)
    }

    /// Requires full checks of the motor until all is [well](health::waive_check) again.
    const fn require_check(&mut self) {
        self.cool_below = 0;
    }

    /// Checks a motor in the usual state: online, cool, turning, no condition and no error. Returns `false` if another state is possible:
    /// the motor must then be [checked](health::check) in full. `elapsed` is the time since its last check, in units of 1.024 ms.
    #[inline(always)]
    pub(super) fn is_well(&mut self, word: i16, elapsed: u8) -> bool {
        let (feedback, driven) = (self.feedback, i32::from(word));
        let Some(facts) = self.facts else { return true };
        let (calm, fastest) = (i32::from(self.calm_word), i32::from(facts.rotor_rpm));
        let is_usual = feedback.error_and_temperature() < u32::from(self.cool_below)
            && is_within(feedback.rpm().into(), fastest);
        if !is_usual {
            return false;
        }
        if !is_within(driven, calm) {
            return is_driven_well(self, facts, word, elapsed);
        }
        (is_within(feedback.current().into(), CALM_CURRENT) || !is_within(driven, calm / 4))
            && self.monitor.follow(feedback.angle(), coarse(word))
    }
}

/// As [`check`](health::check), for a motor that is well and driven hard: cool, no condition, no error. Returns `false` if a stall, runaway or frozen
/// feedback may begin.
#[inline(never)]
fn is_driven_well(slot: &mut Slot, facts: &Facts, word: i16, elapsed: u8) -> bool {
    let speed = f32::from(slot.feedback.rpm()) / f32::from(facts.rotor_no_load_rpm());
    let effort = f32::from(word) / f32::from(slot.full_limit);
    let angle = slot.feedback.angle();
    if !slot.monitor.follow_driven(angle, coarse(word), (effort, speed), elapsed, slot.health) {
        return false;
    }
    slot.saturated = slot.saturated.saturating_add(u16::from(slot.range.is_end(word)));
    true
}

/// Tells whether a value is within ±`limit`, with a tolerance of 1 and one comparison for both ends; with a limit of 0, no value is within.
const fn is_within(value: i32, limit: i32) -> bool {
    (value + limit).cast_unsigned() < 2 * limit.cast_unsigned()
}

/// A command in units of 256.
const fn coarse(word: i16) -> i8 {
    let [high, _] = word.to_be_bytes();
    high.cast_signed()
}
