//! From a single-turn rotor angle to an exact multi-turn position of the output shaft.
//!
//! ```text
//! 13-bit angle ──shortest / resolve_gap──> rotor counts moved ──> turns: i64 + phase of the output shaft
//! ```
//!
//! | item | function |
//! |---|---|
//! | [`shortest`] | the way from one angle to the next, when less than half a rotor turn passed |
//! | [`resolve_gap`] | the same across lost frames, with the reported speeds; says when it cannot know |
//! | [`GearRatio`] | an exact fraction, 3591:187 say |
//! | [`Position`] | a multi-turn position as users write it |
//! | [`Homing`] | knowledge of the output shaft's absolute angle |
//!
//! All positions are exact: the phase of the output shaft is counted in rotor counts divided by the gear's
//! denominator, so neither a float nor a 64-bit division takes part, and an `f32` is made only of the
//! difference between two positions. An angle is counter-clockwise positive.

mod gear;
mod shaft;

pub use gear::{COUNTS_PER_TURN, GearRatio};
pub use shaft::{Position, shortest};
pub(crate) use shaft::{Shaft, furthest};

use crate::units::Angle;

/// Knowledge of the absolute angle of an output shaft.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Homing {
    /// The encoder sits on the output shaft: the angle is absolute from the first frame.
    Absolute,
    /// Geared, not zeroed yet: the position is relative to where the motor was at power-on.
    #[default]
    Relative,
    /// Geared and zeroed: the position is relative to the zero set.
    Homed,
    /// Was known, until a gap in the feedback left the number of turns in doubt.
    Uncertain,
}

impl Homing {
    /// Returns whether an absolute angle may be commanded.
    #[must_use]
    pub const fn is_known(self) -> bool {
        matches!(self, Self::Absolute | Self::Homed)
    }
}

/// Returns the way of the rotor across lost frames in counts, counter-clockwise positive; as an error the nearest way, if another
/// number of turns would fit as well.
///
/// Takes angle (counts) and speed (rpm) of the rotor before and after, the time between in µs, and the no-load speed of the
/// motor (rotor rpm).
///
/// Between two frames `T` apart, the rotor moved about the mean of both reported speeds times `T`. The angle fixes the
/// rest, as long as the error of the estimate is less than half a rotor turn. This error is at most
///
/// ```text
/// |v1 - v0| / 2 * T    the speed may have changed early or late
/// a / 4 * T^2          it may have risen and fallen again in between; a = no-load speed in 50 ms
/// v * 1 ms             the ESC took its samples up to a period before they arrived
/// ```
///
/// The frame may also have waited, in a queue or in a driver polled late, and describe a moment soon after the frame
/// before. So a way with a turn less in the same direction must not fit either: at speed `v` a gap of up to about one
/// rotor turn is sure, a longer gap is not.
///
/// # Errors
/// The nearest way, when the number of turns is in doubt.
///
/// # Examples
/// ```
/// use drivetrain::encoder::resolve_gap;
///
/// // Five frames of an M3508 at 9000 rpm are lost: 1228.8 counts a millisecond, 7373 in 6 ms.
/// assert_eq!(resolve_gap((1000, 9000), (181, 9000), 6_000, 9256), Ok(7373));
/// // After 40 ms it could be several turns: the nearest is taken, and flagged.
/// assert_eq!(resolve_gap((1000, 9000), (181, 9000), 40_000, 9256), Err(-819));
/// ```
pub fn resolve_gap(
    before: (u16, i16),
    after: (u16, i16),
    elapsed_us: u32,
    no_load_rpm: u16,
) -> Result<i32, i32> {
    const COUNTS_PER_RPM_MS: f32 = COUNTS_PER_TURN as f32 / 60_000.0;
    const HALF_TURN: f32 = COUNTS_PER_TURN as f32 / 2.0;
    let (angle, speed) = (before.0, f32::from(before.1) * COUNTS_PER_RPM_MS);
    let (next_angle, next_speed) = (after.0, f32::from(after.1) * COUNTS_PER_RPM_MS);
    let no_load = f32::from(no_load_rpm) * COUNTS_PER_RPM_MS;
    let elapsed_ms = elapsed_us as f32 * 1e-3;

    let estimate = (speed + next_speed) * 0.5 * elapsed_ms;
    let fastest = if speed.abs() > next_speed.abs() { speed.abs() } else { next_speed.abs() };
    let error = (next_speed - speed).abs() * 0.5 * elapsed_ms
        + no_load * (elapsed_ms * elapsed_ms * (0.25 / 50.0))
        + fastest;
    if error >= HALF_TURN {
        return Err(shortest(angle, next_angle));
    }
    #[expect(clippy::cast_possible_truncation, reason = "error bounds it: below 50 turns")]
    let estimate = estimate as i32;
    #[expect(clippy::cast_sign_loss, clippy::cast_possible_truncation, reason = "modulo one turn")]
    let expected_angle = (i32::from(angle) + estimate) as u16;
    let rest = shortest(expected_angle, next_angle);
    let counts = estimate + rest;
    let implausible = rest.unsigned_abs() as f32 > error + 1.0;
    if implausible || fits_an_earlier_frame(counts, error - fastest) {
        Err(counts)
    } else {
        Ok(counts)
    }
}

/// Returns whether one turn less, in the direction of the way, is possible for a frame from an earlier moment.
fn fits_an_earlier_frame(counts: i32, slack: f32) -> bool {
    counts.unsigned_abs() as f32 + slack >= f32::from(COUNTS_PER_TURN)
}

/// The distance of a shaft from the turns that a drive can report, in ranges of the feedback.
#[derive(Debug, Default, Clone, Copy)]
pub(crate) struct Laps {
    laps: i32,
    /// The last reported position, in counts; `None` before the first.
    last: Option<u16>,
}

impl Laps {
    /// Takes an unbounded position, and the end of the range on both sides of zero.
    #[expect(clippy::cast_possible_truncation, reason = "saturates")]
    pub(crate) fn set(&mut self, position: f32, range: f32) {
        let laps = ((position.abs() + range) / (2.0 * range)) as i32;
        let signed = if position > 0.0 { laps } else { -laps };
        self.laps = if position.abs() <= range { 0 } else { signed };
    }

    /// Takes a reported position, in counts of 65535 from end to end: a way of more than half of them leads across an end.
    pub(crate) fn advance(&mut self, position: u16) {
        let way = i32::from(position) - i32::from(self.last.unwrap_or(position));
        let most = i32::from(u16::MAX / 2);
        self.laps = self.laps.saturating_add(i32::from(way < -most) - i32::from(way > most));
        self.last = Some(position);
    }

    pub(crate) const fn is_none(self) -> bool {
        self.laps == 0
    }
}

/// Turns and phase of an output shaft, in integers: the phase in counts times turns of the gear's fraction, so no count is ever lost.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Tachometer {
    last: i32,
    turns: i64,
    /// From 0 to `turn`.
    phase: i32,
    turn: i32,
    output: i32,
}

impl Tachometer {
    /// Begins where the count of the drive is 0. Takes the counts for so many turns of the output shaft as the gear's fraction has: their
    /// product is below 2^30.
    pub(crate) const fn new(turn: i32, output: i32) -> Self {
        Self { last: 0, turns: 0, phase: 0, turn, output }
    }

    /// Takes a count of the drive, which wraps. After a restart of the drive the angle begins at its new zero.
    pub(crate) fn take(&mut self, count: i32) {
        let way = count.wrapping_sub(self.last);
        self.last = count;
        // Whole runs of the gear's fraction leave the phase alone.
        let runs = way.checked_div(self.turn).unwrap_or_default();
        let rest = way.checked_rem(self.turn).unwrap_or_default();
        let sum = self.phase + rest * self.output;
        self.turns += i64::from(runs) * i64::from(self.output);
        self.turns += i64::from(sum.checked_div_euclid(self.turn).unwrap_or_default());
        self.phase = sum.checked_rem_euclid(self.turn).unwrap_or_default();
    }

    /// Returns the position since the drive has started.
    pub(crate) fn position(&self) -> Position {
        Position::new(self.turns, Angle::from_turns(self.phase as f32 / self.turn as f32))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_gap_at_rest_is_the_shortest_way() {
        assert_eq!(resolve_gap((10, 0), (8190, 0), 3_000, 9256), Ok(-12));
    }

    #[test]
    fn laps_are_whole_ranges_and_grow_where_a_position_crosses_the_end() {
        for (position, laps) in [
            (0.0, 0),
            (4.0, 0),
            (-4.0, 0),
            (4.5, 1),
            (11.5, 1),
            (12.5, 2),
            (20.5, 3),
            (-4.5, -1),
            (-12.5, -2),
        ] {
            let mut found = Laps::default();
            found.set(position, 4.0);
            assert_eq!((found.laps, found.is_none()), (laps, laps == 0), "{position}");
        }
        let mut laps = Laps::default();
        for (position, expected) in [
            (0xFF00, 0),
            (0x0100, 1),
            (0x80FF, 1),
            (0x0100, 1),
            (0x8100, 0),
            (0x0100, 1),
            (0xFF00, 0),
            (0x8000, 0),
            (0x0100, 0),
            (0xFF00, -1),
        ] {
            laps.advance(position);
            assert_eq!((laps.laps, laps.is_none()), (expected, expected == 0), "{position:#06X}");
        }
    }

    #[test]
    fn a_tachometer_gives_turns_and_the_angle_within_the_turn() {
        let mut tachometer = Tachometer::new(40, 2);
        tachometer.take(45); // of 20 a turn
        assert_eq!(tachometer.position(), Position::new(2, Angle::from_turns(0.25)));
    }

    #[test]
    fn an_angle_that_contradicts_the_speed_is_flagged() {
        // 2 ms at 6000 rpm is 1638 counts; a quarter turn backward cannot be.
        assert!(resolve_gap((0, 6000), (6144, 6000), 2_000, 9256).is_err());
    }

    #[test]
    fn a_possible_change_of_speed_in_between_is_accepted_and_no_more() {
        // From 0 to 3000 rpm in 4 ms, or back: 819.2 counts on the mean, and as many for an early or a late change;
        // 101.1 for a rise and fall in between; 409.6 for 1 ms at the faster speed: 1329.9.
        for (before, after) in [(0, 3000), (3000, 0)] {
            let gap = |counts| resolve_gap((0, before), (counts, after), 4_000, 9256);
            assert_eq!(gap(819 + 1325), Ok(819 + 1325));
            assert!(gap(819 + 1335).is_err());
        }
    }

    #[test]
    fn one_count_of_rounding_is_allowed_for() {
        let gap = |counts| resolve_gap((0, 0), (counts, 0), 1_000, 0);
        assert_eq!(gap(1), Ok(1));
        assert_eq!(gap(2), Err(2));
    }

    #[test]
    fn a_gap_of_any_length_is_finite() {
        for elapsed in [0, 1, u32::MAX] {
            let gap = resolve_gap((0, i16::MIN), (8191, i16::MAX), elapsed, u16::MAX);
            assert!(gap.is_err_and(|counts| counts.abs() <= 4096));
        }
    }

    proptest! {
        /// Law: at constant acceleration within the motor's means, a gap is resolved exactly or flagged.
        #[test]
        fn resolved_or_flagged_never_silently_wrong(
            start in 0_u16..8192, rpm in -9256_i16..=9256, change in -3000_i16..=3000, elapsed_us in 0_u32..60_000,
        ) {
            let next_rpm = (rpm + change).clamp(-9256, 9256);
            let mean = (f64::from(rpm) + f64::from(next_rpm)) / 2.0;
            #[expect(clippy::cast_possible_truncation, reason = "below 2^20")]
            let moved = (mean * 8192.0 / 60e6 * f64::from(elapsed_us)).round() as i32;
            #[expect(clippy::cast_possible_truncation, reason = "0..8192")]
            let end = (i32::from(start) + moved).rem_euclid(8192) as u16;
            let gap = resolve_gap((start, rpm), (end, next_rpm), elapsed_us, 9256);
            prop_assert!(gap.is_err() || gap == Ok(moved), "{gap:?} moved {moved}");
        }
    }
    proptest! {
        /// Law: a frame that waited is resolved exactly or flagged, for any time of waiting.
        #[test]
        fn a_frame_that_waited_is_never_silently_wrong(
            start in 0_u16..8192, rpm in -9256_i16..=9256, moved_us in 0_u32..30_000, waited_us in 0_u32..30_000,
        ) {
            #[expect(clippy::cast_possible_truncation, reason = "below 2^20")]
            let moved = (f64::from(rpm) * 8192.0 / 60e6 * f64::from(moved_us)).round() as i32;
            #[expect(clippy::cast_possible_truncation, reason = "0..8192")]
            let end = (i32::from(start) + moved).rem_euclid(8192) as u16;
            let gap = resolve_gap((start, rpm), (end, rpm), moved_us + waited_us, 9256);
            prop_assert!(gap.is_err() || gap == Ok(moved), "{gap:?} moved {moved}");
        }
    }
}
