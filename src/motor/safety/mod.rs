//! The safety core: the rules by which every motor of any family is driven or rests.
//!
//! A [`MotorGuard`] has the rules of one motor, a [`DeviceGuard`] the rules shared by the motors of a device. A [`Guard`] is both, for a
//! motor that is a device by itself. The rules in order of decision:
//!
//! | question | decided by | if not |
//! |---|---|---|
//! | did time move on since the previous update, and is the update not before the arming? | `DeviceGuard::moves_on` | zeros in this cycle, all motors trip |
//! | is the time step usable? | `DeviceGuard::hold` | the last commands once, then zeros |
//! | is the feedback fresh? | `MotorGuard::age` | late: zero until the next feedback; offline: relaxed and latched |
//! | is the motor armed, by a gesture? | `MotorGuard::admit`, `DeviceGuard::begin_arming` | no target is taken |
//! | is there a target that is not expired? | `MotorGuard::age` | relaxed |
//! | how far is the output range open? | `MotorGuard::share` | that share of the full command |
//!
//! The [health](super::HealthConfig) of a family finds faults, a second master, heat and a stall. Each acts by [`MotorGuard::trip`], as one
//! of the transitions below.
//!
//! | link | feedback is received | feedback is older than *late* | feedback is older than *offline* |
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
//! A latched and a tripped motor differ in one thing: if [`with_resume`](crate::dji::Config::with_resume) is configured, a latched motor
//! takes targets again by itself when online. Each latch, each trip and the emergency stop begin the pause of the gesture; disarming does
//! not.
//!
//! Times of a motor are stamps of 32 bits. Ages of several motors are compared together ([`Ages`]): no motor is checked again before the
//! greatest age can have exceeded its limit.

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
pub(crate) use stamp::{age, take_age};
pub(crate) use state::Rest;

/// Default time in which the output range of a motor opens after arming: 0.2 s.
pub const OPENING: Duration = Duration::from_millis(200);
