//! The rows of motions from any state: planning one axis, its mean and its most over many states, and sampling.

use crate::meter::{CALLS, instructions, instructions_of};
use crate::report::row;
use core::hint::black_box;
use drivetrain::control::{Motion, MotionLimits, ProfileState};
use drivetrain::error::ConfigError;

type Plan = fn(&ProfileState, &ProfileState, &MotionLimits) -> Result<Motion, ConfigError>;

#[unsafe(no_mangle)]
#[inline(never)]
fn control_motion_plan(
    from: &ProfileState,
    to: &ProfileState,
    limits: &MotionLimits,
) -> Result<Motion, ConfigError> {
    Motion::plan(from, to, limits)
}

#[unsafe(no_mangle)]
#[inline(never)]
fn control_motion_at(motion: &Motion, time_s: f32) -> ProfileState {
    motion.at(time_s)
}

/// A motion to plan: state, target, limits.
type Case = (ProfileState, ProfileState, MotionLimits);

/// Draws numbers between -1 and 1.
struct Random(u32);

impl Random {
    fn number(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (self.0 >> 8) as f32 / 8_388_608.0 - 1.0
    }

    /// States inside and outside of the limits, short and long ways, targets at rest and moving.
    fn case(&mut self, call: u32) -> Case {
        let [position, velocity, acceleration] = [self.number(), self.number(), self.number()];
        let way = self.number() * if call.is_multiple_of(2) { 0.1 } else { 3.0 };
        let moving = if call % 4 < 2 { 0.0 } else { self.number() };
        let (top, steep, jerk) = (1.2 + self.number(), 3.0 + 2.5 * self.number(), 15.0);
        let from = ProfileState { position, velocity, acceleration: 4.0 * acceleration };
        let to =
            ProfileState { position: position + way, velocity: moving, ..ProfileState::default() };
        (from, to, MotionLimits::new(top, steep).with_jerk(jerk + 14.0 * self.number()))
    }

    /// About normal, with a deviation of 1.
    fn normal(&mut self) -> f32 {
        0.866 * [(); 4].map(|()| self.number()).iter().sum::<f32>()
    }

    /// Between 1/8 and 16.
    fn limit(&mut self) -> f32 {
        let exponent = 3.5 * (self.number() + 1.0);
        f32::from_bits((124 + exponent as u32) << 23) * (1.0 + exponent % 1.0)
    }

    /// States as those of `judges/motion.py`.
    fn judged(&mut self, call: u32) -> Case {
        let limits = [(); 3].map(|()| self.limit());
        let [top, steep, jerk] = limits;
        let position = 4.0 * self.normal();
        let target = if call.is_multiple_of(5) {
            position + 0.05 * self.normal()
        } else {
            4.0 * self.normal()
        };
        let moving = if call.is_multiple_of(2) { 0.0 } else { top * self.number() };
        let [velocity, acceleration] = [(); 2].map(|()| 0.8 * self.normal());
        let from = ProfileState { position, velocity, acceleration };
        let to = ProfileState { position: target, velocity: moving, ..ProfileState::default() };
        (from, to, MotionLimits::new(top, steep).with_jerk(jerk))
    }
}

/// States of the mean, and of the most.
const STATES: u32 = 200;
const JUDGED: u32 = 10_000;

pub fn rows() {
    let mut random = Random(1);
    let mut sum = 0;
    for call in 0..STATES {
        let (from, to, limits) = black_box(random.case(call));
        let figure = instructions(control_motion_plan as Plan, |plan, _| {
            _ = black_box(plan(&from, &to, &limits));
        });
        sum += figure;
    }
    let most = (0..JUDGED).map(|call| {
        let (from, to, limits) = black_box(random.judged(call));
        instructions_of(20, control_motion_plan as Plan, |plan, _| {
            _ = black_box(plan(&from, &to, &limits));
        })
    });
    let most = most.max().unwrap_or(0);
    row("motion_plan", &[(sum + STATES / 2) / STATES]);
    row("motion_plan_most", &[most]);

    let from = ProfileState { velocity: black_box(0.5), ..ProfileState::default() };
    let limits = MotionLimits::new(2.0, 8.0).with_jerk(80.0);
    let motion = Motion::plan(&from, &ProfileState::at_rest(3.0), &limits).unwrap();
    let step_s = motion.duration_s() / CALLS as f32;
    let each = |at: fn(&Motion, f32) -> ProfileState, call| {
        _ = black_box(at(&motion, call as f32 * step_s));
    };
    row("motion_at", &[instructions(control_motion_at as _, each)]);
}
