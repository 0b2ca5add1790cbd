//! Time as an argument: instants, durations, and their sources.
//!
//! | item | meaning |
//! |---|---|
//! | [`Instant`], [`Duration`] | microseconds in 64 bits; they never wrap |
//! | [`Clock`] | the source of `now`, used by the runner only; in a test, a `&Cell<Instant>` set by hand |
//! | [`ExtendedCounter`] | a 16- or 32-bit hardware counter, extended to an [`Instant`] |
//! | [`Ticker`], [`Tick`] | the cadence of the control loop, without drift, overruns counted |
//! | [`TimeStep`] | the step of a tick, validated once for all loops |
//! | [`Edge`] | a condition of a motor, of a bus or of a receiver began or ended |
//!
//! ```
//! use drivetrain::time::{Duration, Instant, Ticker};
//!
//! let mut ticker = Ticker::new(Duration::from_millis(1));
//! let start = Instant::from_micros(500);
//! assert!(ticker.due(start).is_some()); // the first call starts the cadence
//! assert!(ticker.due(start + Duration::from_micros(999)).is_none());
//! assert!(ticker.due(start + Duration::from_micros(1000)).is_some());
//! ```

mod clock;
mod instant;
mod ticker;

pub use clock::{Clock, ExtendedCounter};
pub use instant::{Duration, Instant};
pub use ticker::{Tick, Ticker, TimeStep};

/// The beginning or the end of a condition.
///
/// | returned by | condition | source |
/// |---|---|---|
/// | a device, such as [`Bus::next_edge`](crate::dji::Bus::next_edge) | [`Condition`](crate::motor::Condition) | [`MotorName`](crate::motor::MotorName) |
/// | [`Runner::next_edge`](crate::runner::Runner::next_edge) | [`BusCondition`](crate::runner::BusCondition) | `()` |
/// | a receiver, such as [`Dbus::edge`](crate::wire::dbus::Dbus::edge) | the text `"silence"`, its only condition | `()` |
///
/// An edge is latched until read, and read once. While an edge waits, the same change is not latched again: an error of a motor that comes
/// and goes at 1 kHz is one edge. The last edge read of a bus or of a receiver tells the present state.
///
/// # Examples
/// ```
/// use drivetrain::motor::{Condition, MotorName};
/// use drivetrain::runner::BusCondition;
/// use drivetrain::time::{Edge, Instant};
///
/// let (source, at) = (MotorName::new("M3508", 2), Instant::from_micros(11_264));
/// let edge = Edge { source, condition: Condition::Late, began: true, at };
/// assert_eq!(edge.to_string(), "M3508 #2: late began at 11264 us");
///
/// let (source, at) = ((), Instant::from_micros(2_310_000));
/// let edge = Edge { source, condition: BusCondition::Silent, began: true, at };
/// assert_eq!(edge.to_string(), "bus silent began at 2310000 us");
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Edge<C, S = ()> {
    /// The motor with the condition; `()` if the runner or the receiver that returned the edge is the only source.
    pub source: S,
    /// The condition.
    pub condition: C,
    /// Whether the condition began; otherwise the condition ended.
    pub began: bool,
    /// Time of the beginning, the first since the last reading; or of the end, the last.
    ///
    /// For a motor: time of detection, rounded down to 1.024 ms, up to an age of 24 days. If more edges wait than the owner of the motor
    /// has times for (12 for a [`Bus`](crate::dji::Bus), 48 for a bus of joints, 6 for a motor outside of a bus), the later edges have the last
    /// time kept: they came later.
    pub at: Instant,
}

impl<C: core::fmt::Display> core::fmt::Display for Edge<C> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let phase = if self.began { "began" } else { "ended" };
        write!(f, "{} {phase} at {} us", self.condition, self.at.as_micros())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::string::ToString;

    #[test]
    fn an_edge_reads_with_its_condition_and_time() {
        let at = Instant::from_micros(7);
        let edge = Edge { condition: "silence", began: false, at, source: () };
        assert_eq!(edge.to_string(), "silence ended at 7 us");
    }
}
