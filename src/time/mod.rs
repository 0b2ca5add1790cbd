//! Time as an argument: instants, durations, and their sources.
//!
//! | item | meaning |
//! |---|---|
//! | [`Instant`], [`Duration`] | microseconds in 64 bits; they never wrap |
//! | [`Clock`] | the source of `now`, used by the runner only |
//! | [`ManualClock`] | a clock that a test moves by hand |
//! | [`ExtendedCounter`] | a 16- or 32-bit hardware counter, extended to an [`Instant`] |
//! | [`Ticker`], [`Tick`] | the cadence of the control loop, without drift, overruns counted |
//! | [`TimeStep`] | the step of a tick, validated once for all loops |
//! | [`ConditionEdge`] | a condition of a bus or of a source of data began or ended |
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

pub use clock::{Clock, ExtendedCounter, ManualClock};
pub use instant::{Duration, Instant};
pub use ticker::{Tick, Ticker, TimeStep};

/// The beginning or the end of a condition `C` of a bus or of a source of data.
///
/// The edge is latched until read, and read once. The last edge read tells the present state. The edges of a motor are
/// [`motor::Edge`](crate::motor::Edge)s, which name the motor too.
///
/// # Examples
/// ```
/// use drivetrain::runner::BusCondition;
/// use drivetrain::time::{ConditionEdge, Instant};
///
/// let at = Instant::from_micros(2_310_000);
/// let edge = ConditionEdge { condition: BusCondition::Silent, began: true, at };
/// assert_eq!(edge.to_string(), "bus silent began at 2310000 us");
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ConditionEdge<C> {
    /// The condition.
    pub condition: C,
    /// Whether the condition began; otherwise it ended.
    pub began: bool,
    /// Time of the beginning, the first since the last reading; or of the end, the last.
    pub at: Instant,
}

impl<C: core::fmt::Display> core::fmt::Display for ConditionEdge<C> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let phase = if self.began { "began" } else { "ended" };
        write!(f, "{} {phase} at {} us", self.condition, self.at.as_micros())
    }
}
