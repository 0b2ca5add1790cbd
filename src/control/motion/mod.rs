//! Motions from any state.

mod ascent;
mod brake;
mod follower;
mod in_step;
mod plan;
mod planner;
mod scale;
mod wide;

pub use follower::MotionFollower;
pub use in_step::Motions;
pub use plan::{Motion, MotionTarget};
