//! The PID controller.

mod config;
mod controller;
mod law;

pub use config::PidConfig;
pub use controller::{Pid, Terms};
pub(crate) use law::Input;
