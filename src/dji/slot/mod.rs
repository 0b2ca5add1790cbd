//! One motor: feedback in, loops, raw command out.

mod capability;
mod health;
mod measured;
mod receive;
mod steep;
mod target;
mod update;

use super::command::{Place, to_raw};
use super::config::{PlainConfig, USUAL};
use super::handle::Key;
use super::range::Range;
use super::{AttachError, Facts, Feedback, State};
use crate::control::{Cascade, Pid, PidConfig};
use crate::encoder::{GearRatio, Homing, Position, Shaft};
use crate::motor::{
    Condition, HealthConfig, Link, Monitor, MotorGuard, MotorName, Recovery, TargetError, Traffic,
};
use crate::units::{AngularVelocity, Current};
use core::f32::consts::TAU;
pub(super) use health::Look;
use health::celsius;
use target::{Action, Duty, Goal};

#[derive(Debug, Clone, Copy)]
// In the order of use, so that neighbours are loaded and stored together.
#[repr(C)]
pub(super) struct Slot {
    feedback: Feedback,
    pub(super) guard: MotorGuard,
    shaft: Shaft,
    rad_per_s_per_rpm: f32,
    /// What an update does: what is asked for, or nothing while the feedback is late.
    duty: Duty,
    asked: Action,
    pub(super) place: Place,
    homing: Homing,
    /// What is left of the full limit.
    range: Range,
    full_limit: i16,
    calm_word: u16,
    raw_per_unit: f32,
    goal: Goal,
    loops: Cascade,
    facts: Option<&'static Facts>,
    nm_per_a: f32,
    ambiguous_gaps: u16,
    generation: u8,
    error_code: u8,
    /// Below this temperature byte, and below the calm command, the motor need not be looked at closely; 0 unless all was
    /// well when it was looked at last, and nothing has begun since.
    cool_below: u8,
    /// What the last update did.
    acted: Action,
    saturated: u16,
    health: &'static HealthConfig,
    monitor: Monitor,
    traffic: Traffic,
}

/// Stands where a motor has no loop: without gains, its output is zero, and needs no question.
const NO_LOOP: PidConfig = PidConfig::new(0.0, 0.0, 0.0);

const NO_LOOPS: Cascade = match Cascade::new(NO_LOOP, NO_LOOP) {
    Ok(loops) => loops,
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
        guard: MotorGuard::NEW,
        rad_per_s_per_rpm: 0.0,
        raw_per_unit: 0.0,
        nm_per_a: 0.0,
        range: Range::ZERO,
        full_limit: 0,
        ambiguous_gaps: 0,
        loops: NO_LOOPS,
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

    /// Makes the slot of a motor, validating its configuration.
    pub(super) const fn new(
        facts: &'static Facts,
        config: &PlainConfig,
        place: Place,
        generation: u8,
    ) -> Result<Self, AttachError> {
        let motor = MotorName::new(facts.name, config.id);
        macro_rules! parameter {
            ($name:expr) => {
                AttachError::Parameter { motor, parameter: $name }
            };
        }
        let full_scale = config.command_full_scale;
        if !(full_scale.is_finite() && full_scale > 0.0) {
            return Err(parameter!("nominal voltage"));
        }
        let limit = match config.limit {
            Some(limit) => limit,
            None => full_scale,
        };
        if !(limit > 0.0 && limit <= full_scale) {
            return Err(parameter!("command limit"));
        }
        let nm_per_a = match config.torque_constant_nm_per_a {
            Some(nm_per_a) => nm_per_a,
            None => facts.torque_constant_nm_per_a * config.gear.as_f32() / facts.gear.as_f32(),
        };
        if !(nm_per_a.is_finite() && nm_per_a > 0.0) {
            return Err(parameter!("torque constant"));
        }
        let sign = if config.reversed { -1.0 } else { 1.0 };
        let raw_per_unit = config.command_raw as f32 / full_scale;
        let limit_raw = to_raw(limit, raw_per_unit, config.command_raw);
        let rad_per_s_per_rpm = sign * (TAU / 60.0) / config.gear.as_f32();
        let fastest = no_load_velocity(facts, rad_per_s_per_rpm);
        let position = within(config.position, fastest);
        let speed = within(config.speed, limit);
        let loops = match Cascade::new(position, speed) {
            Ok(loops) => loops,
            Err(error) => return Err(parameter!(error.parameter())),
        };
        if let Some(gain) = steep::position(&position, facts) {
            return Err(AttachError::Gain { motor, gain });
        }
        if let Some(gain) = steep::speed(&speed, facts, rad_per_s_per_rpm) {
            return Err(AttachError::Gain { motor, gain });
        }
        if let Err(name) = config.health.validate() {
            return Err(parameter!(name));
        }
        let direct = config.gear.rotor() == config.gear.output();
        Ok(Self {
            facts: Some(facts),
            shaft: Shaft::new(config.gear, config.reversed),
            rad_per_s_per_rpm,
            raw_per_unit: sign * raw_per_unit,
            nm_per_a,
            range: Range::within(limit_raw),
            full_limit: limit_raw,
            guard: MotorGuard::NEW
                .with(config.opening, matches!(config.recovery, Recovery::Resume)),
            loops,
            generation,
            place,
            health: config.health,
            calm_word: Self::calm_word(config.health, limit_raw),
            homing: if direct { Homing::Absolute } else { Homing::Relative },
            ..Self::FREE
        })
    }

    /// Frees the slot; handles of the motor find nothing from now on.
    pub(super) const fn free(&mut self) {
        *self = Self { generation: self.generation + 1, ..Self::FREE };
    }

    /// Frees a slot whose handle nobody was given.
    pub(super) const fn withdraw(&mut self) {
        *self = Self { generation: self.generation, ..Self::FREE };
    }

    /// Tells whether a handle's key names the motor that is here now.
    pub(super) const fn matches(&self, key: Key) -> bool {
        self.facts.is_some() && self.generation == key.generation()
    }

    /// Returns the generation of the next motor here, or `None` when there is none left.
    pub(super) const fn next_generation(&self) -> Option<u8> {
        if self.generation < Key::GENERATIONS { Some(self.generation) } else { None }
    }

    pub(super) const fn facts(&self) -> Option<&'static Facts> {
        self.facts
    }

    pub(super) const fn name(&self) -> Option<MotorName> {
        match self.facts {
            Some(facts) => Some(MotorName::new(facts.name, self.id(facts))),
            None => None,
        }
    }

    /// Returns the id on the ESC, which the place of the command word tells.
    const fn id(&self, facts: &Facts) -> u8 {
        let [lower, _] = facts.command;
        let before = if self.place.frame() as u8 == lower as u8 { 0 } else { 4 };
        before + self.place.slot() + 1
    }

    /// Returns what is known; `None` before the first frame.
    pub(super) fn state(&self) -> Option<State> {
        let facts = self.facts?;
        if self.guard.link() == Link::Unheard {
            return None;
        }
        let amperes =
            self.direction() * f32::from(self.feedback.current()) * facts.current_full_scale_a
                / f32::from(facts.current_raw);
        Some(State {
            motor: MotorName::new(facts.name, self.id(facts)),
            position: self.shaft.position(),
            homing: self.homing,
            velocity: self.velocity(),
            current: Current::from_amperes(amperes),
            torque_nm: amperes * self.nm_per_a,
            temperature_c: facts.has_temperature.then_some(celsius(self.feedback.temperature())),
            error: facts.errors.read(self.feedback.error()),
            rotor_counts: self.shaft.rotor_counts(),
            ambiguous_gaps: self.ambiguous_gaps,
            refused_targets: self.guard.refused_targets(),
            forgotten_targets: self.guard.forgotten_targets(),
            conditions: self.guard.latch().active(),
            link: self.guard.link(),
            feedback: self.feedback,
        })
    }

    /// Time did not move on. A free slot loses nothing.
    pub(super) fn lose_time(&mut self) {
        if self.facts.is_some() {
            self.guard.lose_time();
        }
    }

    /// Returns the velocity of the output shaft.
    #[inline]
    pub(super) fn velocity(&self) -> AngularVelocity {
        AngularVelocity::from_rad_per_s(f32::from(self.feedback.rpm()) * self.rad_per_s_per_rpm)
    }

    /// Calls the present position `position`. A motor that holds an angle or position is relaxed: its target
    /// was given in the old terms.
    pub(super) fn set_present_position(&mut self, position: Position) -> Result<(), TargetError> {
        if self.guard.link() != Link::Online {
            return Err(TargetError::NoFeedback);
        }
        if !position.is_finite() {
            return Err(TargetError::NotFinite);
        }
        if self.asked.is_way() {
            self.relax();
        }
        self.shaft.set_position(position);
        self.homing = Homing::Homed;
        self.guard.latch_mut().set(Condition::PositionUncertain, false);
        self.keep_inside(0);
        Ok(())
    }

    /// Returns a raw command in A or V, in the direction of the shaft.
    pub(super) fn in_units(&self, raw: i16) -> f32 {
        f32::from(raw) / self.raw_per_unit
    }

    pub(super) const fn speed_loop_mut(&mut self) -> &mut Pid {
        self.loops.speed_mut()
    }

    fn direction(&self) -> f32 {
        1.0_f32.copysign(self.raw_per_unit)
    }
}

/// The velocity of the output shaft without load: what a position loop may ask for.
const fn no_load_velocity(facts: &Facts, rad_per_s_per_rpm: f32) -> f32 {
    facts.rotor_no_load_rpm() as f32 * rad_per_s_per_rpm.abs()
}

/// Tells a loop from [`NO_LOOP`], the only one without limits.
const fn is_loop(pid: &Pid) -> bool {
    pid.config().output_range().1 < f32::MAX
}

/// Narrows the output of a loop to ±`limit`, where there is a loop.
const fn within(config: Option<PidConfig>, limit: f32) -> PidConfig {
    let Some(config) = config else { return NO_LOOP };
    let (lower, upper) = config.output_range();
    let lower = if lower < -limit { -limit } else { lower };
    let upper = if upper > limit { limit } else { upper };
    config.with_output_range(lower, upper)
}
