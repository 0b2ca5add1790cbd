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
//! every finite input, and it is found by a bracket that halves at worst. A state outside of its limits is braked first (`brake`). The
//! way that is left after a direct change of velocity is a small difference of large numbers, so it is calculated in twice the
//! precision of `f32` (`control::wide`). Limits that differ by more than 10^15 in these units are brought nearer (`scale`), which changes what
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
mod brake;
mod follower;
mod in_step;
mod plan;
mod planner;
mod roots;
mod scale;
mod task;
#[cfg(test)]
#[expect(clippy::float_cmp, reason = "exact results are the rule under test")]
mod tests;

pub use follower::MotionFollower;
pub use in_step::Motions;
pub use plan::{Motion, MotionTarget};
