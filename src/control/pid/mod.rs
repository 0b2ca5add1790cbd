//! The positional and the incremental PID controller.

mod config;
mod cut;
mod gate;
mod incremental;
mod plain;
mod positional;
mod settings;
mod work;

pub use config::PidConfig;
pub use incremental::{IncrementalPid, IncrementalPidConfig};
pub use positional::{Pid, Terms};
