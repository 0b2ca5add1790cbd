//! What is wrong with a motor, since when, and what follows.
//!
//! ```text
//! feedback, commands ──> checks ──> Conditions ──> less output, inward only, relaxed
//!                                       └─ each change, latched ──> Edge ──> next_edge()
//! ```
//!
//! A [`Condition`] holds or does not. Each change of one is an [`Edge`] that waits until it is read, however late. What
//! decides about safety in the next tick (ages of feedback and of targets) is looked at in every tick; the rest one motor
//! a tick, so that all of it costs the same however many motors there are. How soon each is noticed, on a
//! [`Bus`](crate::dji::Bus) at 1 kHz:
//!
//! | what | looked at | what may pass unseen |
//! |---|---|---|
//! | late, offline, lost command | each update | nothing |
//! | doubtful position, second master | each frame | nothing |
//! | error code of the ESC | each frame, where it is worse than the one before | another code of the same weight for less than 12 ms |
//! | end of an error | each 12 ms | an error that comes back within 12 to 24 ms is one |
//! | temperature, overspeed, soft limit | each 12 ms | what lasts less; a soft limit looks ahead by as much |
//! | stalled, runaway, frozen | each 12 ms, and only what holds at each look for the whole window | a motion between two looks that ends at rest |
//! | duplicate id | each frame, once a second of too many frames | |
//!
//! A motor of your own and one off CAN are looked at in each of their updates for errors, and each 8 ms for the rest.

mod condition;
mod config;
mod edge;
mod monitor;
mod report;
mod traffic;

pub use condition::{Condition, Conditions};
pub use config::{HealthConfig, Reaction};
pub use edge::Edge;
pub(crate) use edge::{Journal, Latch};
pub(crate) use monitor::{Monitor, Sample, elapsed};
pub use report::Health;
pub(crate) use traffic::Traffic;
