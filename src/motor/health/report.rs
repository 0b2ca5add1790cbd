use super::Conditions;
use crate::motor::{Link, MotorName};
use crate::time::Duration;

/// How a motor is, in one line of a log.
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
    /// Whether it is heard.
    pub link: Link,
    /// Whether it takes targets.
    pub armed: bool,
    /// What is wrong with it.
    pub conditions: Conditions,
    /// Feedback frames a second, over the last whole window of about a second; 0 before there was one.
    pub feedback_hz: u16,
    /// The longest time between two of them, in that window and in the present one; in steps of 16 µs, at most 1.05 s.
    ///
    /// Of a DJI motor only some gaps count: those of at least half a rotor turn at no-load speed less 500 µs, which
    /// is 1166 µs for an M2006, 2741 µs for an M3508 and 93 250 µs for a GM6020; and those in which, at any time, the
    /// motor was not online, its bus was not updated yet, or `feedback_hz` was more than half above the rate that the
    /// bus was told. 0 without such a gap.
    pub longest_gap: Duration,
    /// Temperature in °C; `None` for a motor that reports none.
    pub temperature_c: Option<i16>,
    /// The error code of the ESC as it came, for as long as its condition holds; 0 for none.
    pub error_code: u8,
    /// How often the output was found at its limit, saturating: one look every few updates.
    pub saturated: u16,
    /// How often a target was NaN or infinite, saturating.
    pub refused_targets: u16,
    /// How often no target came in time, saturating.
    pub forgotten_targets: u16,
    /// How often a gap in the feedback left the number of rotor turns in doubt, saturating.
    pub ambiguous_gaps: u16,
}

/// In ASCII, for terminals that know no more.
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
