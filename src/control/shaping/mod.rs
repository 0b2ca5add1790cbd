//! Setpoints within the reach of a mechanism, and the effort to follow them.
//!
//! | type | bounds | use it when |
//! |---|---|---|
//! | [`SlewLimiter`] | the rate of change | the target keeps moving: a stick, another controller |
//! | [`Profile`] with [`MotionLimits::new`] | speed and acceleration (trapezoid) | a move from A to B, rigid mechanics |
//! | [`Profile`] with [`MotionLimits::with_jerk`] | jerk as well (S-curve) | a move from A to B, and nothing may shake |
//! | [`Motion`](crate::control::Motion) | jerk too | the state is not at rest, the target moves, or several axes go in step |
//! | [`FeedForward`] | | the effort of the profile is known: leave the rest to the PID |

mod feed_forward;
mod profile;
mod slew;

pub use feed_forward::FeedForward;
pub use profile::{MotionLimits, Profile, ProfileState};
pub use slew::SlewLimiter;
