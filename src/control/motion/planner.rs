use crate::control::motion::ascent::{Ascent, Beginning, Curve};
use crate::control::motion::task::{self, Brake, Limits, Task};
use crate::control::motion::{End, Motion, Phases};
use crate::control::number::{self, Wide};
use crate::control::shaping::{MotionLimits, ProfileState};
use crate::error::{ConfigError, finite, positive};
use crate::math::limited;

/// A task after braking, and the way back to units of the position and seconds.
#[derive(Debug, Default, Clone, Copy, PartialEq)]
pub(super) struct Planner {
    start: ProfileState,
    end: End,
    distance: f32,
    limits: Limits,
    unit_s: f32,
    brake: Brake,
    task: Task,
    /// The resolution of `f32` at the positions, in the units of the task.
    rounding: f32,
}

/// The share of a way lost to rounding, at most.
const ROUNDING: f32 = 2e-6;
const HALVINGS: u32 = 30;

impl Planner {
    /// Takes a state whose exact position is farther by `rest`, a target and the limits.
    pub(super) fn new(
        from: &ProfileState,
        rest: f32,
        to: &ProfileState,
        limits: &MotionLimits,
    ) -> Result<Self, ConfigError> {
        let (velocity, acceleration, jerk) = limits.parts();
        let jerk = jerk.unwrap_or(0.0);
        positive("velocity", velocity)?;
        positive("acceleration", acceleration)?;
        positive("jerk", jerk)?;
        finite("position", from.position)?;
        finite("start_velocity", from.velocity)?;
        finite("start_acceleration", from.acceleration)?;
        finite("target", to.position)?;
        finite("target_velocity", to.velocity)?;
        if to.acceleration != 0.0 {
            return Err(ConfigError::Unusable("target_acceleration"));
        }
        let limits = Limits { velocity, acceleration, jerk };
        let end =
            End { position: to.position, velocity: limited(to.velocity, -velocity, velocity) };
        let distance = Wide::difference(end.position, from.position) - rest;
        let distance = if distance.narrow().abs() <= f32::MAX {
            distance
        } else {
            Wide::of(number::finite(end.position - from.position))
        };
        let (task, limits) = task::scaled(distance, from, &end, limits);
        let brake = Brake::of(&task);
        let size = from.position.abs() + end.position.abs();
        let rate = limits.jerk / limits.acceleration;
        let rounding = 2.0 * f32::EPSILON * size * rate * rate / limits.acceleration;
        Ok(Self {
            start: *from,
            end,
            distance: distance.narrow(),
            limits,
            unit_s: limits.acceleration / limits.jerk,
            brake,
            task: brake.after(task),
            rounding,
        })
    }

    /// Returns the fastest motion.
    pub(super) fn fastest(&self) -> Motion {
        let falls = self.task.falls();
        let direct = if falls { self.task } else { self.task.mirrored() };
        let beyond = direct.beyond().narrow();
        let goes_on = beyond >= 0.0;
        let task = if goes_on { direct } else { direct.mirrored() };
        let beginning = if goes_on { Beginning::Down(beyond) } else { Beginning::Up(-beyond) };
        let ascent = Ascent::of(&task);
        let direct = if beyond.abs() <= self.rounding { ascent.direct(beginning) } else { None };
        let curve = direct.unwrap_or_else(|| ascent.fastest(beginning));
        self.motion(falls == goes_on, &curve)
    }

    /// Returns the shortest duration from `duration_s` on that the motion can have.
    ///
    /// Each can be had if the target is at rest. Otherwise some may be too long to get there, and too short to come back.
    pub(super) fn duration_from(&self, duration_s: f32) -> f32 {
        let time = self.time_of(duration_s);
        for task in [self.task, self.task.mirrored()] {
            let ascent = Ascent::of(&task);
            let (_, beyond) = ascent.lasting(time);
            let rounding = ROUNDING * task.distance.narrow().abs();
            if beyond < -rounding {
                let (brake_s, hold_s) = self.braking_s();
                return brake_s + hold_s + self.unit_s * ascent.passing(time, HALVINGS);
            }
        }
        duration_s
    }

    /// Returns two motions of this duration, the one too long and the other too short, and the share of the first that is right.
    pub(super) fn lasting(&self, duration_s: f32) -> (Motion, Motion, f32) {
        let time = self.time_of(duration_s);
        let (high, above) = Ascent::of(&self.task).lasting(time);
        let (low, below) = Ascent::of(&self.task.mirrored()).lasting(time);
        let share = below / (above + below);
        let share = if share.is_nan() { 1.0 } else { limited(share, 0.0, 1.0) };
        let unit = self.limits.acceleration * self.unit_s * self.unit_s;
        let adjusted = |motion: Motion, beyond: f32| Motion {
            duration_s,
            way: motion.way + unit * beyond,
            ..motion
        };
        let high = adjusted(self.motion(true, &high), above);
        (high, adjusted(self.motion(false, &low), -below), share)
    }

    fn time_of(&self, duration_s: f32) -> f32 {
        let (brake_s, hold_s) = self.braking_s();
        (duration_s - brake_s - hold_s) / self.unit_s
    }

    fn braking_s(&self) -> (f32, f32) {
        let (_, brake, hold) = self.brake.parts();
        (self.seconds(brake), self.seconds(hold))
    }

    fn seconds(&self, time: f32) -> f32 {
        if time > 0.0 { number::finite(self.unit_s * time) } else { 0.0 }
    }

    /// Returns a motion in units of the position and seconds, whose first slope goes up or down.
    fn motion(&self, goes_up: bool, curve: &Curve) -> Motion {
        let Limits { acceleration, jerk, .. } = self.limits;
        let sign = if goes_up { 1.0 } else { -1.0 };
        let start = sign * self.task.acceleration.narrow();
        let (first, second) = (curve.first.root, curve.second.root);
        // Rounding must not let the acceleration jump back.
        let first = if first < start { start } else { first };
        let (brake_s, brake_hold_s) = self.braking_s();
        let phases = Phases {
            brake_s,
            brake_hold_s,
            rise_s: self.seconds(first - start),
            hold_s: self.seconds(curve.first.hold),
            fall_s: self.seconds(first),
            cruise_s: self.seconds(curve.cruise),
            last_rise_s: self.seconds(if first < 0.0 { second + first } else { second }),
            last_hold_s: self.seconds(curve.second.hold),
            last_fall_s: self.seconds(second),
        };
        Motion {
            start: self.start,
            end: self.end,
            way: self.distance,
            duration_s: phases.duration_s(),
            phases,
            jerk: sign * jerk,
            brake_jerk: self.brake.parts().0 * jerk,
            first_peak: sign * acceleration * first,
            second_peak: sign * acceleration * second,
        }
    }
}
