//! The PID controller.

mod config;
mod controller;
mod error_pid;
mod law;

pub use config::PidConfig;
pub use controller::{Pid, Terms};
pub(crate) use error_pid::ErrorPid;
