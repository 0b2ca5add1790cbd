//! The PID controller.

mod config;
mod controller;
mod gate;
mod law;

pub use config::PidConfig;
pub use controller::{Pid, Terms};
pub(crate) use law::Input;
