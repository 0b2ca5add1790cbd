//! The rows of motions from any state: planning one axis, its mean and its most over states of each kind, and sampling.

use crate::meter::{CALLS, instructions};
use crate::report::row;
use core::hint::black_box;
use drivetrain::control::{Motion, MotionLimits, MotionTarget, ProfileState};
use drivetrain::error::ConfigError;

type Plan = fn(&ProfileState, &MotionTarget, &MotionLimits) -> Result<Motion, ConfigError>;

#[unsafe(no_mangle)]
#[inline(never)]
fn control_motion_plan(
    from: &ProfileState,
    to: &MotionTarget,
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
type Case = (ProfileState, MotionTarget, MotionLimits);

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
        let to = MotionTarget { position: position + way, velocity: moving };
        (from, to, MotionLimits::new(top, steep).with_jerk(jerk + 14.0 * self.number()))
    }
}

/// States of which the most is taken.
const STATES: u32 = 200;

pub fn rows() {
    let mut random = Random(1);
    let mut most = 0;
    let mut sum = 0;
    for call in 0..STATES {
        let (from, to, limits) = black_box(random.case(call));
        let figure = instructions(control_motion_plan as Plan, |plan, _| {
            _ = black_box(plan(&from, &to, &limits));
        });
        most = most.max(figure);
        sum += figure;
    }
    row("motion_plan", &[(sum + STATES / 2) / STATES]);
    row("motion_plan_most", &[most]);

    let from = ProfileState { velocity: black_box(0.5), ..ProfileState::default() };
    let limits = MotionLimits::new(2.0, 8.0).with_jerk(80.0);
    let motion = Motion::plan(&from, &MotionTarget::at_rest(3.0), &limits).unwrap();
    let step_s = motion.duration_s() / CALLS as f32;
    let each = |at: fn(&Motion, f32) -> ProfileState, call| {
        _ = black_box(at(&motion, call as f32 * step_s));
    };
    row("motion_at", &[instructions(control_motion_at as _, each)]);
}
