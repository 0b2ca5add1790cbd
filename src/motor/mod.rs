//! What every motor has in common, whatever its family.
//!
//! The bus owns the motors and the application holds small `Copy` handles, so the traits here are
//! implemented by the *owner* of the motors and take the handle as an argument: nothing borrows a motor.
//!
//! ```text
//! CAN frame ──> CanDevice::ingest      update ──> next_frame ──> CAN frame
//!                        │                ▲           ▲ requeue
//! application ── VelocityDrive::set_velocity(handle, target)
//!             <─ VelocityDrive::velocity(handle)
//! ```
//!
//! | item | what it is |
//! |---|---|
//! | [`CanDevice`] | the seam between a device family and whatever moves its frames |
//! | [`VelocityDrive`] | an owner of motors that follow a velocity: all that a chassis needs |
//! | [`AngleDrive`] | an owner of motors that go to an angle: those that steer |
//! | [`Capabilities`] | what a motor offers: which targets, which readings |
//! | [`MotorName`], [`Link`] | how a motor is called, and whether it is heard |
//! | [`ArmError`], [`TargetError`] | why nothing moves |
//! | [`OwnMotor`], [`Own`], [`Guard`], [`Vitals`] | a motor of your own, and the rules that make it safe |
//! | [`StopHoming`] | finds the zero of a shaft at a mechanical stop |
//! | [`Condition`], [`Edge`], [`Health`] | what is wrong with a motor, each change of it, and all of it in a line |
//! | [`HealthConfig`] | what is looked for, and what follows |
//! | [`BusLoad`] | how full the bus is |
//!
//! A motor of your own joins by implementing [`OwnMotor`]: its ids, frames and loop, and nothing about safety. Whatever
//! does not fit that implements [`CanDevice`] itself, with a [`Guard`] for each motor. Devices are combined by tuples,
//! arrays and `&mut`, so an own struct needs only to forward to a tuple of its fields.

mod arming;
mod capability;
mod claim;
mod combine;
mod device;
mod drive;
mod guard;
mod health;
mod homing;
mod link;
mod load;
mod measured;
mod name;
mod own;
mod vitals;
mod watch;

pub use arming::{ArmError, Missing};
pub use capability::{Capabilities, Capability};
pub use claim::{Claim, Role};
pub use device::{CanDevice, Ingest, Malformed};
pub use drive::{AngleDrive, TargetError, VelocityDrive};
pub use guard::Guard;
pub use health::{Condition, Conditions, Edge, Health, HealthConfig, Reaction};
pub(crate) use health::{Journal, Latch, Monitor, Sample, Traffic, elapsed};
pub use homing::{HomingError, HomingStep, ShaftState, StopHoming, StopHomingConfig};
pub use link::{Link, Recovery, Timeouts};
pub use load::BusLoad;
pub use measured::Measured;
pub use name::MotorName;
pub use own::{Own, OwnMotor};
pub use vitals::{Severity, Vitals};
pub(crate) use watch::Watch;
