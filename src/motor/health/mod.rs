//! What is wrong with a motor, since when, and what follows.
//!
//! ```text
//! feedback, commands ──> checks ──> Conditions ──> less output, inward only, relaxed
//!                                       └─ each change, latched ──> Edge ──> next_edge()
//! ```
//!
//! A [`Condition`] holds or does not. Each change of one is an [`Edge`] that waits until it is read, however late. What
//! decides about safety in the next tick (ages of feedback and of targets) is looked at in every tick; the rest one motor
//! a tick, so that all of it costs the same however many motors there are.

mod condition;
mod config;
mod edge;
mod frozen;
mod monitor;
mod report;
mod runaway;
mod stall;
mod thermal;
mod traffic;

pub use condition::{Condition, Conditions};
pub use config::{HealthConfig, Reaction};
pub use edge::Edge;
pub(crate) use edge::{Journal, Latch};
use monitor::Timer;
pub(crate) use monitor::{Monitor, Sample, elapsed};
pub use report::Health;
pub(crate) use traffic::Traffic;
