//! Conditions of a motor, their times, and their consequences.
//!
//! ```text
//! feedback, commands ──> checks ──> Conditions ──> less output, inward only, relaxed
//!                                       └─ each change, latched ──> Edge ──> next_edge()
//! ```
//!
//! A [`Condition`] holds or does not. Each change of a condition is an [`Edge`], latched until read. Conditions that decide about safety in
//! the next tick (ages of feedback and of targets) are checked in every tick. The others are checked for one motor a tick, so the cost does
//! not depend on the number of motors. Times until detection, on a [`Bus`](crate::dji::Bus) at 1 kHz:
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
//! A motor of your own and a motor without CAN are checked in each of their updates for errors, and each 8 ms for the rest.

mod condition;
mod config;
mod edge;
mod monitor;
mod traffic;

use super::{Link, MotorName};
use crate::time::Duration;

pub use condition::{Condition, Conditions};
pub use config::{HealthConfig, Reaction};
pub use edge::Edge;
pub(crate) use edge::{Journal, Latch};
pub(crate) use monitor::{Monitor, Sample, elapsed};
pub(crate) use traffic::{Rival, Traffic};

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
