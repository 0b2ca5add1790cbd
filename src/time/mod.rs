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
mod counter;
mod duration;
mod edge;
mod instant;
mod step;
mod ticker;

pub use clock::{Clock, ManualClock};
pub use counter::ExtendedCounter;
pub use duration::Duration;
pub use edge::ConditionEdge;
pub use instant::Instant;
pub use step::TimeStep;
pub use ticker::{Tick, Ticker};
