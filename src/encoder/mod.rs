//! From a single-turn rotor angle to an exact multi-turn position of the output shaft.
//!
//! ```text
//! 13-bit angle ──shortest / resolve──> rotor counts moved ──Shaft──> turns: i64 + phase of the output shaft
//! ```
//!
//! | item | function |
//! |---|---|
//! | [`shortest`] | the way from one angle to the next, when less than half a rotor turn passed |
//! | [`resolve_gap`] | the same across lost frames, with the reported speeds; says when it cannot know |
//! | [`GearRatio`] | an exact fraction, 3591:187 say |
//! | [`Shaft`] | turns and phase of the output shaft, in integers, for any number of turns |
//! | [`Position`] | a multi-turn position as users write it |
//! | [`Homing`] | knowledge of the output shaft's absolute angle |
//!
//! All positions are exact: the phase of the output shaft is counted in rotor counts divided by the gear's
//! denominator, so neither a float nor a 64-bit division takes part, and an `f32` is made only of the
//! difference between two positions. An angle is counter-clockwise positive.

mod gap;
mod gear;
mod homing;
mod shaft;

pub use gap::resolve_gap;
pub use gear::GearRatio;
pub use homing::Homing;
pub use shaft::{Position, Shaft, shortest};

/// Counts in one rotor turn of a 13-bit encoder.
pub const COUNTS_PER_TURN: u16 = 8192;
