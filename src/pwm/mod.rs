//! Motors off CAN: an RC ESC or servo, and a brushed motor behind an H-bridge. Feature `hal`.
//!
//! ```text
//!                    ┌ RcPwm ───┐  SetDutyCycle     pulse of 1000 to 2000 us, 50 times a second
//! set_throttle ──────┤          ├────────────────>  ▁▁█▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁█▁▁▁▁
//!                    └──────────┘
//!                    ┌ Brushed ─┐  SetDutyCycle     ▁██▁██▁██▁  to the bridge
//! set_velocity ──────┤ PID      ├────────────────>
//! counts ────────────┤          ├─ OutputPin(s) ─>  direction
//!                    └──────────┘
//! ```
//!
//! | item | meaning |
//! |---|---|
//! | [`RcPwm`], [`RcConfig`] | an ESC or servo that listens to the length of a pulse |
//! | [`Brushed`], [`BrushedConfig`] | a DC motor with a bridge, and an encoder where it has one |
//! | [`Direction`]: an array of one pin, or a tuple of two | how the bridge is told which way |
//! | [`HealthConfig`](crate::motor::HealthConfig) | when a brushed motor with an encoder counts as stalled, or runs away |
//! | [`BrushedError`] | which pin failed |
//! | [`ConfigError`](crate::error::ConfigError) | fault of a configuration |
//!
//! The motors follow the rules of all motors here, by the same [`Guard`](crate::motor::Guard): disarmed at the start; a
//! target that is old, NaN or infinite, a bad time step, time that stands or goes back, lost feedback and an emergency
//! stop give the safe output. Each change is an [`Edge`](crate::motor::Edge), pending in `next_edge`. The motors are not
//! [`Devices`](crate::motor::Devices), so the program calls `update` in each tick itself. With
//! [`VelocityDrive`](crate::motor::VelocityDrive) they drive a chassis like any other motor.
//!
//! No runner watches these motors: if an [`EmergencyStop`](crate::runner::EmergencyStop) is set from an interrupt, call
//! `emergency_stop` in the next tick.
//!
//! # Limits
//! `update` reports a failed pin and tries again in the next call; meanwhile the hardware may continue with its last
//! state. When `update` is no longer called, the timer continues with its last pulse: a hardware watchdog is needed.

mod brushed;
mod direction;
mod rc;
#[cfg(test)]
mod tests;

pub use brushed::{Brushed, BrushedConfig, BrushedError};
pub use direction::Direction;
pub use rc::{RcConfig, RcPwm};
