//! Conditions of a motor, their times, and their consequences.
//!
//! ```text
//! feedback, commands ──> checks ──> Conditions ──> less output, inward only, relaxed
//!                                       └─ each change, latched ──> Edge ──> next_edge()
//! ```
//!
//! A [`Condition`] holds or does not. Each change of a condition is an [`Edge`], latched until read. Conditions that decide about safety in
//! the next tick (ages of feedback and of targets) are checked in every tick. The others are checked for one motor a tick, so the cost does
//! not depend on the number of motors. Times until detection, on a [`Bus`](crate::dji::Bus) at 1 kHz:
//!
//! | condition | checked | undetected |
//! |---|---|---|
//! | late, offline, lost command | each update | nothing |
//! | doubtful position, second master | each frame | nothing |
//! | error code of the ESC | each frame, if graver than the previous code | another code of the same severity for less than 12 ms |
//! | end of an error | each 12 ms | an error that returns within 12 to 24 ms is one |
//! | temperature, overspeed, soft limit | each 12 ms | a shorter excess; a soft limit looks ahead by as much |
//! | stalled, runaway, frozen | each 12 ms; must hold at each check of the whole window | a motion between two checks that ends at rest |
//! | duplicate id | each frame, after a second of too many frames | |
//!
//! A motor of your own and a motor without CAN are checked in each of their updates for errors, and each 8 ms for the rest.

mod condition;
mod config;
mod edge;
mod monitor;
mod report;
mod rival;
mod traffic;

pub use condition::{Condition, Conditions};
pub use config::{HealthConfig, Reaction};
pub use edge::Edge;
pub(crate) use edge::{Journal, Latch};
pub(crate) use monitor::{Monitor, Sample, elapsed};
pub use report::Health;
pub(crate) use rival::Rival;
pub(crate) use traffic::Traffic;
