//! The safety core: the rules by which every motor is driven or rests, whatever its family.
//!
//! A [`MotorGuard`] has the rules of one motor, a [`DeviceGuard`] those that the motors of a device share. A [`Guard`] is both,
//! for a motor that is a device by itself. In the order in which they decide:
//!
//! | question | asked of | where the answer is no |
//! |---|---|---|
//! | did time move on since the update before, and is it not before the arming? | `DeviceGuard::moves_on` | zeros in this cycle, every motor trips |
//! | is the time step usable? | `DeviceGuard::hold` | the last commands once, then zeros |
//! | is the feedback fresh? | `MotorGuard::age` | late: zero until it is heard; offline: relaxed and latched |
//! | is the motor armed, and was that a gesture? | `MotorGuard::admit`, `DeviceGuard::begin_arming` | no target is taken |
//! | is there a target that is young enough? | `MotorGuard::age` | relaxed |
//! | how far is the output range open? | `MotorGuard::share` | that share of the full command |
//!
//! Faults, a second master, heat and a stall are found by the [health](super::HealthConfig) of a family, and act by
//! [`MotorGuard::trip`]: one of the transitions below.
//!
//! | link | feedback comes | it is older than *late* | it is older than *offline* |
//! |---|---|---|---|
//! | unheard | online | | |
//! | online | online | late | offline |
//! | late | online | | offline |
//! | offline | recovering, or online when one frame is enough | | |
//! | recovering | online with the last of the good frames in a row | | offline |
//!
//! | arming | engage | offline | a fault, lost time | disarm, emergency stop |
//! |---|---|---|---|---|
//! | disarmed | armed | | | |
//! | armed | | latched | tripped | disarmed |
//! | latched | armed | | tripped | disarmed |
//! | tripped | armed | | | disarmed |
//!
//! Latched and tripped differ in one thing: a motor that is latched takes targets again by itself when it is online, where
//! [`with_resume`](crate::dji::Config::with_resume) is configured. What latches or trips a motor, and the emergency stop, begins the pause of the
//! gesture; to disarm does not.
//!
//! Times of a motor are stamps of 32 bits. Ages of several motors are judged together ([`Ages`]): nobody looks at a motor again
//! before the oldest of them can have exceeded its limit.

mod device;
mod gesture;
mod guard;
mod motor;
mod stamp;
mod state;

use crate::time::Duration;

pub(crate) use device::{Ages, DeviceGuard, Hold, LONGEST_PAUSE};
pub use guard::Guard;
pub(crate) use motor::MotorGuard;
pub(crate) use stamp::age;
pub(crate) use state::Rest;

/// The time in which the output range of a motor opens after arming, unless configured otherwise: 0.2 s.
pub const OPENING: Duration = Duration::from_millis(200);
