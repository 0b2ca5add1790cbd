//! The safety core: the rules by which every motor of any family is driven or rests.
//!
//! A [`MotorGuard`] has the rules of one motor, a [`DeviceGuard`] the rules shared by the motors of a device. A [`Guard`] is both, for a
//! motor that is a device by itself. The rules in order of decision:
//!
//! | question | decided by | if not |
//! |---|---|---|
//! | did time move on since the previous update, and is the update not before the arming? | `DeviceGuard::pass` | zeros in this cycle, all motors trip |
//! | is the feedback fresh? | `MotorGuard::age` | late: zero until the next feedback; offline: relaxed and latched |
//! | is there a target that is not expired? | `MotorGuard::age` | relaxed |
//! | is the time step usable? | `DeviceGuard::pass` | [`Hold`]: the last command once, then zeros |
//! | is the motor healthy? | `MotorGuard::judge`, `MotorGuard::react` | tripped, as configured; relaxed if no share of the output is left |
//! | is the motor armed, by a gesture? | `MotorGuard::admit`, `DeviceGuard::engage` | no target is taken |
//! | does a target from a zero have that zero? | `MotorGuard::require_zero` | relaxed, and the target is not taken |
//! | does the motor go on from its last command? | `MotorGuard::output`, `MotorGuard::end_rest` | no command is repeated; the loops start afresh, or after a pause take no rate |
//! | how far is the output range open, and which of its directions? | `MotorGuard::range` | that share of the full command |
//!
//! Ages count in each update whose time moved on, with a usable step or without. The first of some updates in a row without a usable step repeats
//! the last command of a motor without a rest since, unless the update itself is late.
//!
//! The [health](super::HealthConfig) of a family finds faults, heat and a stall, and says what a second master does; each acts by
//! [`MotorGuard::react`]. [`DeviceGuard::is_alone`] says when a second master is gone. The tables of links and of arming, with all
//! transitions, stand in the documentation of [`motor`](super#states).
//!
//! Times of a motor are stamps of 32 bits. Ages of several motors are compared together: no motor is checked again before the
//! greatest age can have exceeded its limit.

mod device;
mod motor;

use crate::time::Duration;

pub(crate) use device::DeviceGuard;
pub(crate) use motor::{Guarded, MotorGuard};

/// Default time in which the output range of a motor opens after arming: 0.2 s.
pub const OPENING: Duration = Duration::from_millis(200);

/// Whether a motor takes targets.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Arming {
    Disarmed,
    Armed,
    /// Relaxed since arming, because the feedback was lost.
    Latched,
    /// Relaxed since arming, for another reason.
    Tripped,
}

/// Rest of a motor since the last run of its loops.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Rest {
    /// No rest.
    None,
    /// The feedback was late, its count moved, or a target was refused meanwhile: older measurements give no rate.
    Pause,
    /// The target was discarded: the loops start afresh.
    Relaxed,
}

/// Output of an update without a usable step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Hold {
    /// Keep the last commands.
    Keep,
    /// Send zeros.
    Rest,
    /// Send zeros: time did not move on, and all motors are relaxed until armed again.
    LoseTime,
}

/// Action of an update for a motor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Output {
    /// Run its loops.
    Drive,
    /// Send its last command once more.
    Repeat,
    /// Send rest.
    Rest,
}

/// Time after the last command of another node from which there is no second master.
const RIVAL_US: u32 = 1_000_000;

/// Longest pause between two checks for which a 32-bit stamp still represents an age.
const LONGEST_PAUSE_US: u32 = 60_000_000;
