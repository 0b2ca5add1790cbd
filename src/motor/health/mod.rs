//! Conditions of a motor, their times, and their consequences.
//!
//! ```text
//! feedback, commands ──> checks ──> Conditions ──> less output, inward only, relaxed
//!                                       └─ each change, latched ──> Edge ──> next_edge()
//! ```
//!
//! A [`Condition`] holds or does not. Each change of a condition is an [`Edge`](crate::time::Edge), latched until read. Conditions that
//! decide about safety in the next tick (ages of feedback and of targets) are checked in every tick. The others are checked for one motor a
//! tick, so the cost does not depend on the number of motors. Times until detection, on a [`Bus`](crate::dji::Bus) at 1 kHz:
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
//! An [`Actuator`](super::Actuator) and a motor without CAN are checked in each of their updates for errors, and each 8.2 ms
//! for the rest: once armed, motors whose ids differ in the lower three bits in different milliseconds. A duplicate id is found while such a
//! motor rests, of drives that send answers alone: within 128 frames that the drive answers with feedback, which is a second at 250 Hz.

mod config;
mod edge;
mod monitor;
mod traffic;
mod vitals;

use super::{Link, MotorName};
use crate::time::Duration;

pub use config::{HealthConfig, Reaction};
pub(crate) use edge::{Journal, Latch, Latched};
pub(crate) use monitor::{
    BACK, BRAKING_S, Monitor, Sample, check_soft_limits, elapsed, velocity_inside,
};
pub(crate) use traffic::{Answers, Traffic};
pub use vitals::Vitals;

/// State and statistics of a motor, in one line of a log.
///
/// # Examples
/// ```
/// use drivetrain::motor::{Condition, Conditions, Health, Link, MotorName};
/// use drivetrain::time::Duration;
///
/// let health = Health {
///     motor: MotorName::new("M3508", 2),
///     link: Link::Online,
///     armed: true,
///     conditions: Conditions::NONE.with(Condition::Warm),
///     feedback_hz: 998,
///     longest_gap: Duration::from_micros(3_200),
///     temperature_c: Some(131),
///     error_code: 8,
///     saturated: 12,
///     refused_targets: 0,
///     forgotten_targets: 1,
///     ambiguous_gaps: 0,
/// };
/// assert_eq!(
///     health.to_string(),
///     "M3508 #2: online, armed, warm; 998 Hz, gap 3200 us, 131 C, error 8; saturated 12, refused 0, forgotten 1, ambiguous 0",
/// );
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Health {
    /// The motor.
    pub motor: MotorName,
    /// State of the link.
    pub link: Link,
    /// Whether the motor takes targets.
    pub armed: bool,
    /// The conditions that hold.
    pub conditions: Conditions,
    /// Feedback frames a second, over the last whole window of about a second; 0 before the first.
    pub feedback_hz: u16,
    /// The longest time between two feedback frames, in that window and in the present one; in steps of 16 µs, at most 1.05 s.
    ///
    /// Of a DJI motor only long gaps and gaps in doubt count. A long gap lasts at least half a rotor turn at no-load speed less 500 µs:
    /// 1166 µs for an M2006, 2741 µs for an M3508, 93 250 µs for a GM6020. A gap is in doubt if, at any time within the gap, the motor was
    /// not online, its bus was not updated yet, or `feedback_hz` was more than half above the rate configured at the bus. Without such a
    /// gap, 0.
    pub longest_gap: Duration,
    /// Temperature in °C; `None` for a motor without this reading.
    pub temperature_c: Option<i16>,
    /// The error code of the ESC as received, while its condition holds; 0 for no error.
    pub error_code: u8,
    /// Number of checks, one every few updates, that found the output at its limit; saturating.
    pub saturated: u16,
    /// Number of NaN or infinite targets, saturating.
    pub refused_targets: u16,
    /// Number of expired targets, saturating.
    pub forgotten_targets: u16,
    /// Number of feedback gaps that left the number of rotor turns in doubt, saturating.
    pub ambiguous_gaps: u16,
}

/// In ASCII, for terminals without Unicode.
impl core::fmt::Display for Health {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let link = match self.link {
            Link::Unheard => "unheard",
            Link::Online => "online",
            Link::Late => "late",
            Link::Offline => "offline",
            Link::Recovering => "recovering",
        };
        let armed = if self.armed { "armed" } else { "disarmed" };
        write!(f, "{}: {link}, {armed}, {}; ", self.motor, self.conditions)?;
        write!(f, "{} Hz, gap {} us, ", self.feedback_hz, self.longest_gap.as_micros())?;
        match self.temperature_c {
            Some(celsius) => write!(f, "{celsius} C, ")?,
            None => f.write_str("no temperature, ")?,
        }
        write!(
            f,
            "error {}; saturated {}, refused {}, forgotten {}, ambiguous {}",
            self.error_code,
            self.saturated,
            self.refused_targets,
            self.forgotten_targets,
            self.ambiguous_gaps
        )
    }
}

/// Abnormal condition of one motor.
///
/// | condition | holds while | the motor |
/// |---|---|---|
/// | [`Late`](Self::Late) | there is no fresh feedback | is safe, and goes on by itself |
/// | [`Offline`](Self::Offline) | the motor is lost, until ten good frames in a row | is relaxed |
/// | [`PositionUncertain`](Self::PositionUncertain) | turns may have been missed, or the zero is lost, until the position is set | goes on (`dji`; with a gearbox and a zero, positions are refused); is relaxed, and its zero is lost (actuator, joint of `snake`) |
/// | [`Warning`](Self::Warning) | the ESC reports a warning | goes on |
/// | [`Fault`](Self::Fault) | the ESC reports a fault, has started again without being *offline*, or was found in a state that it was not told | is relaxed |
/// | [`Warm`](Self::Warm) | the motor is above its warning temperature | has less output |
/// | [`Hot`](Self::Hot) | the motor is above its limit temperature | has no output |
/// | [`Stalled`](Self::Stalled) | the motor is driven and does not turn | as configured; goes on |
/// | [`Runaway`](Self::Runaway) | the motor sped up against its command, until armed | is relaxed |
/// | [`Frozen`](Self::Frozen) | the feedback stands still in contradiction to itself | as configured; goes on |
/// | [`Overspeed`](Self::Overspeed) | the reported speed is more than twice the speed without load | goes on |
/// | [`DuplicateId`](Self::DuplicateId) | two motors answer with one id | is relaxed |
/// | [`SoftLimit`](Self::SoftLimit) | the shaft is at or outside of a soft limit; of an actuator also 0.02 rad inside, and where its angle is not known | turns inward only; rests without an angle |
/// | [`CommandLost`](Self::CommandLost) | the application let the target expire | is relaxed, until the next target |
/// | [`SecondMaster`](Self::SecondMaster) | another node sends the command frame of the motor | as configured; goes on |
/// | [`ClockFault`](Self::ClockFault) | the time of an update did not move on, until it does | is relaxed |
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
#[repr(u8)]
pub enum Condition {
    /// No fresh feedback.
    Late,
    /// The motor is lost.
    Offline,
    /// Rotor turns may have been missed.
    PositionUncertain,
    /// The ESC reports a warning.
    Warning,
    /// The ESC reports a fault.
    Fault,
    /// Above the warning temperature.
    Warm,
    /// Above the limit temperature.
    Hot,
    /// The motor is driven, and does not turn.
    Stalled,
    /// The motor speeds up without or against its command.
    Runaway,
    /// The feedback stands still in contradiction to itself.
    Frozen,
    /// More than twice the speed without load.
    Overspeed,
    /// Two motors answer with one id.
    DuplicateId,
    /// At or outside of a soft limit.
    SoftLimit,
    /// The target expired.
    CommandLost,
    /// Another node sends the command frame.
    SecondMaster,
    /// The last update did not lie after the one before: the clock stands or went back. The motor trips.
    ClockFault,
}

impl Condition {
    /// All conditions.
    pub const ALL: [Self; 16] = [
        Self::Late,
        Self::Offline,
        Self::PositionUncertain,
        Self::Warning,
        Self::Fault,
        Self::Warm,
        Self::Hot,
        Self::Stalled,
        Self::Runaway,
        Self::Frozen,
        Self::Overspeed,
        Self::DuplicateId,
        Self::SoftLimit,
        Self::CommandLost,
        Self::SecondMaster,
        Self::ClockFault,
    ];

    /// Returns the condition in the words of a log line.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Late => "late",
            Self::Offline => "offline",
            Self::PositionUncertain => "position uncertain",
            Self::Warning => "ESC warning",
            Self::Fault => "ESC fault",
            Self::Warm => "warm",
            Self::Hot => "hot",
            Self::Stalled => "stalled",
            Self::Runaway => "runaway",
            Self::Frozen => "frozen feedback",
            Self::Overspeed => "overspeed",
            Self::DuplicateId => "duplicate id",
            Self::SoftLimit => "soft limit",
            Self::CommandLost => "command lost",
            Self::SecondMaster => "second master",
            Self::ClockFault => "clock fault",
        }
    }

    const fn bit(self) -> u16 {
        1 << self as u8
    }
}

impl core::fmt::Display for Condition {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(self.as_str())
    }
}

/// A set of conditions, in 16 bits.
///
/// # Examples
/// ```
/// use drivetrain::motor::{Condition, Conditions};
///
/// let conditions = Conditions::NONE.with(Condition::Stalled).with(Condition::Warm);
/// assert!(conditions.contains(Condition::Warm));
/// assert_eq!(conditions.iter().count(), 2);
/// assert_eq!(conditions.to_string(), "warm, stalled");
/// assert_eq!(Conditions::NONE.to_string(), "healthy");
/// ```
#[derive(Default, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Conditions(u16);

impl Conditions {
    /// No condition: healthy.
    pub const NONE: Self = Self(0);

    /// Adds a condition.
    #[must_use]
    pub const fn with(self, condition: Condition) -> Self {
        Self(self.0 | condition.bit())
    }

    /// Removes a condition.
    #[must_use]
    pub const fn without(self, condition: Condition) -> Self {
        Self(self.0 & !condition.bit())
    }

    /// Tells whether a condition is in the set.
    #[must_use]
    pub const fn contains(self, condition: Condition) -> bool {
        self.0 & condition.bit() != 0
    }

    /// Tells whether the set is empty.
    #[must_use]
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// Iterates over the conditions, in the order of [`Condition::ALL`].
    pub fn iter(self) -> impl Iterator<Item = Condition> {
        let mut left = self.0;
        core::iter::from_fn(move || {
            // Above the last bit there is no condition.
            let first = Condition::ALL.get(left.trailing_zeros() as usize)?;
            left &= left.wrapping_sub(1);
            Some(*first)
        })
    }

    /// Returns the conditions in both sets.
    pub(crate) const fn and(self, other: Self) -> Self {
        Self(self.0 & other.0)
    }

    /// Returns the conditions in either set.
    pub(crate) const fn or(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// Returns the conditions in this set and not in the other.
    pub(crate) const fn minus(self, other: Self) -> Self {
        Self(self.0 & !other.0)
    }
}

impl core::fmt::Debug for Conditions {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_set().entries(self.iter()).finish()
    }
}

/// Names the conditions in one line, separated by commas.
impl core::fmt::Display for Conditions {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        if self.is_empty() {
            return f.write_str("healthy");
        }
        for (index, condition) in self.iter().enumerate() {
            write!(f, "{}{condition}", if index == 0 { "" } else { ", " })?;
        }
        Ok(())
    }
}

#[cfg(feature = "defmt")]
impl defmt::Format for Conditions {
    fn format(&self, f: defmt::Formatter<'_>) {
        if self.is_empty() {
            return defmt::write!(f, "healthy");
        }
        for (index, condition) in self.iter().enumerate() {
            let separator = if index == 0 { "" } else { ", " };
            defmt::write!(f, "{=str}{=str}", separator, condition.as_str());
        }
    }
}

/// Severity of an error reported by an ESC.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Severity {
    /// The ESC continues, with a warning.
    Warning,
    /// The motor must not be driven.
    Fault,
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::string::ToString;

    #[test]
    fn each_condition_has_a_bit_and_a_name_of_its_own() {
        let all = Condition::ALL.into_iter().fold(Conditions::NONE, Conditions::with);
        assert_eq!(all.iter().count(), Condition::ALL.len());
        for condition in Condition::ALL {
            let others = all.without(condition);
            assert!(!others.contains(condition) && others.iter().count() == 15);
            assert!(!others.to_string().contains(condition.as_str()), "{condition}");
        }
    }
}
