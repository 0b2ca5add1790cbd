//! Motions from any state to a target at rest or in motion, within limits that may change at any moment.
//!
//! | type | plans | use it for |
//! |---|---|---|
//! | [`Motion`] | one axis, the fastest way | a joint, a path, a heading |
//! | [`Motions`] | several axes that end together | an arm; a chassis with its heading |
//! | [`MotionFollower`] | anew with each new target or limit | what a pilot or another computer moves; a gimbal; the steering of a swerve module |
//!
//! ```text
//! state now: position, velocity, acceleration  --->  target: position, velocity, acceleration 0
//!                within limits of velocity, acceleration and jerk
//! ```
//! # Units
//! Those of the position, and seconds: m for a path, rad for a joint or a heading. A heading or a steering angle is not wrapped: add to the
//! angle now the shortest way to the target ([`wrap`](crate::math::wrap)). The rate at which a swerve module turns is the limit of
//! velocity of its angle.
//!
//! # How
//! In units in which the limits of acceleration and jerk are 1, a motion goes up to a crest and down from it, or down and up: the
//! family of `ascent`. The sum of the roots of both slopes is its only unknown, and the way a quartic in it, so there is a motion for
//! every finite input, and it is found by a bracket that halves at worst. A state outside of its limits is braked first (`task::Brake`). The
//! way that is left after a direct change of velocity is a small difference of large numbers, so it is calculated in twice the
//! precision of `f32` (`control::number`). Limits that differ by more than 10^15 in these units are brought nearer (`task::Scale`), which changes what
//! `f32` cannot show.
//!
//! # Limits
//! The target's acceleration is zero. Limits are the same in both directions. A target velocity beyond its limit counts as the limit.
//! A target that the direct change of velocity meets within two units in the last place of the positions counts as met.
//! A way of more than `f32::MAX` counts as that, a duration too, and a start acceleration beyond 10^6 times its limit raises the limit.
//!
//! Reference: L. Berscheid and T. Kröger, Jerk-limited real-time trajectory generation with arbitrary target states, RSS 2021, whose
//! program, Ruckig, is the judge: `judges/README.md`.

mod ascent;
mod axes;
mod planner;
mod task;
#[cfg(test)]
#[expect(clippy::float_cmp, reason = "exact results are the rule under test")]
mod tests;

pub use axes::{MotionFollower, Motions};

use crate::control::number::finite;
use crate::control::shaping::{MotionLimits, ProfileState};
use crate::error::ConfigError;
use planner::Planner;

/// Where a [`Motion`] ends: a position, and the velocity there; the acceleration there is zero.
#[derive(Debug, Default, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
struct End {
    position: f32,
    velocity: f32,
}

/// The phases of a motion from its start to its end, in seconds.
#[derive(Debug, Default, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
struct Phases {
    brake_s: f32,
    brake_hold_s: f32,
    /// From the acceleration of the state to the first peak, at it, and to zero.
    rise_s: f32,
    hold_s: f32,
    fall_s: f32,
    cruise_s: f32,
    /// The same to the second peak, and to zero at the end.
    last_rise_s: f32,
    last_hold_s: f32,
    last_fall_s: f32,
}

impl Phases {
    fn duration_s(&self) -> f32 {
        let braking_s = self.brake_s + self.brake_hold_s;
        let first_s = self.rise_s + self.hold_s + self.fall_s;
        let last_s = self.last_rise_s + self.last_hold_s + self.last_fall_s;
        finite(braking_s + first_s + self.cruise_s + last_s)
    }
}

/// The fastest motion from any position, velocity and acceleration to a position and a velocity, within [`MotionLimits`].
///
/// ```text
/// acceleration        first peak
///                      ______
///                     /      \
///  state, braked into_/        \__cruise__            end: acceleration zero
///  its limits                             \        /
///                                          \______/
///                                         second peak         either sign
/// ```
///
/// # Edge behaviour
/// Before the start, and for a time that is NaN, it is at the start; from [`duration_s`](Self::duration_s) on, at exactly the end. Its limits
/// hold to 1 in 10^6, and its duration is that of Ruckig to 2 in 10^6, or to 2 µs below a second.
///
/// # Examples
/// ```
/// use drivetrain::control::{Motion, MotionLimits, ProfileState};
///
/// // 1 rad/s already, and 2 rad to go within 2 rad/s, 4 rad/s², 40 rad/s³.
/// let joint = MotionLimits::new(2.0, 4.0).with_jerk(40.0);
/// let now = ProfileState { velocity: 1.0, ..ProfileState::default() };
/// let motion = Motion::plan(&now, &ProfileState::at_rest(2.0), &joint)?;
/// // Up to 2 rad/s: 0.35 s, 0.525 rad; down from it: 0.6 s, 0.6 rad; 0.875 rad between them.
/// assert!((motion.duration_s() - 1.3875).abs() < 1e-6);
/// assert!((motion.at(0.5).velocity - 2.0).abs() < 1e-6);
/// assert_eq!(motion.at(9.0).position, 2.0);
/// # Ok::<(), drivetrain::error::ConfigError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Motion {
    start: ProfileState,
    end: End,
    /// From the start to the end.
    way: f32,
    duration_s: f32,
    phases: Phases,
    /// With the sign that it has in the first rise; that of braking apart.
    jerk: f32,
    brake_jerk: f32,
    /// Accelerations: the first with its sign, the second with the opposite one.
    first_peak: f32,
    second_peak: f32,
}

impl Motion {
    /// Plans the fastest motion from a state to a position and a velocity. The acceleration of `to` has to be zero.
    ///
    /// Costs 1747 instructions on a Cortex-M4F, in the mean of 200 states (`docs/figures.md`).
    ///
    /// # Errors
    /// Names the limit that is NaN, infinite, zero, negative or (`jerk`) missing, or the value that is NaN or infinite: `position`,
    /// `start_velocity`, `start_acceleration`, `target` or `target_velocity`. [`ConfigError::Unusable`] with `target_acceleration` when
    /// that is not zero.
    pub fn plan(
        from: &ProfileState,
        to: &ProfileState,
        limits: &MotionLimits,
    ) -> Result<Self, ConfigError> {
        Ok(Planner::new(from, 0.0, to, limits)?.fastest())
    }

    /// Returns position, velocity and acceleration `time_s` seconds after the start.
    ///
    /// Costs 138 instructions on a Cortex-M4F (`docs/figures.md`).
    #[must_use]
    pub fn at(&self, time_s: f32) -> ProfileState {
        let sample = self.sample(time_s);
        let position = if sample.is_last {
            self.end.position - sample.way
        } else {
            self.start.position + sample.way
        };
        sample.state(finite(position))
    }

    /// Returns the jerk `time_s` seconds after the start, in units of the position a second cubed.
    #[must_use]
    pub fn jerk_at(&self, time_s: f32) -> f32 {
        self.sample(time_s).jerk
    }

    /// Returns the time from start to end in seconds.
    #[must_use]
    pub const fn duration_s(&self) -> f32 {
        self.duration_s
    }

    /// Returns the state at the end, with an acceleration of zero.
    #[must_use]
    pub const fn end(&self) -> ProfileState {
        let End { position, velocity } = self.end;
        ProfileState { position, velocity, acceleration: 0.0 }
    }

    /// Returns how far it is from the start.
    fn way_at(&self, sample: &Sample) -> f32 {
        if sample.is_last { self.way - sample.way } else { sample.way }
    }

    /// The first part walks from the start, and the last one back from the end, so that both ends are exact.
    fn sample(&self, time_s: f32) -> Sample {
        let time_s = if time_s > 0.0 { time_s } else { 0.0 };
        let left_s = self.duration_s - time_s;
        if left_s <= 0.0 {
            return Sample { is_last: true, ..Sample::new(0.0, self.end.velocity) };
        }
        let phases = &self.phases;
        if left_s < phases.last_fall_s + phases.last_hold_s + phases.last_rise_s {
            let mut walk = Sample::new(left_s, self.end.velocity);
            _ = walk.ends_in(phases.last_fall_s, 0.0, self.jerk)
                || walk.ends_in(phases.last_hold_s, self.second_peak, 0.0)
                || walk.ends_in(f32::INFINITY, self.second_peak, -self.jerk);
            return Sample { acceleration: -walk.acceleration, is_last: true, ..walk };
        }
        let braked = self.start.acceleration + self.brake_jerk * phases.brake_s;
        let mut walk = Sample::new(time_s, self.start.velocity);
        _ = walk.ends_in(phases.brake_s, self.start.acceleration, self.brake_jerk)
            || walk.ends_in(phases.brake_hold_s, braked, 0.0)
            || walk.ends_in(phases.rise_s, braked, self.jerk)
            || walk.ends_in(phases.hold_s, self.first_peak, 0.0)
            || walk.ends_in(phases.fall_s, self.first_peak, -self.jerk)
            || walk.ends_in(f32::INFINITY, 0.0, 0.0);
        walk
    }
}

/// A moment of a motion, found by a walk over its phases.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Sample {
    left_s: f32,
    /// From the start, or in the last part to the end.
    way: f32,
    is_last: bool,
    velocity: f32,
    acceleration: f32,
    jerk: f32,
}

impl Sample {
    const fn new(left_s: f32, velocity: f32) -> Self {
        Self { left_s, way: 0.0, is_last: false, velocity, acceleration: 0.0, jerk: 0.0 }
    }

    const fn state(&self, position: f32) -> ProfileState {
        ProfileState {
            position,
            velocity: finite(self.velocity),
            acceleration: finite(self.acceleration),
        }
    }

    /// Goes over a phase, or as far as the time allows: then it ends there.
    #[inline]
    const fn ends_in(&mut self, phase_s: f32, acceleration: f32, jerk: f32) -> bool {
        let ends = self.left_s < phase_s;
        let time_s = if ends { self.left_s } else { phase_s };
        let change = jerk * time_s;
        self.way += time_s * (self.velocity + time_s * (0.5 * acceleration + change * (1.0 / 6.0)));
        self.velocity += time_s * (acceleration + 0.5 * change);
        self.left_s -= time_s;
        (self.acceleration, self.jerk) = (acceleration + change, jerk);
        ends
    }
}
