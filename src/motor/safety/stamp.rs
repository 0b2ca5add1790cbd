//! Times as stamps of 32 bits in µs. A stamp repeats after 71 min 35 s.

use crate::time::{Duration, Instant};

/// Longest pause between two checks for which a 32-bit stamp still represents an age.
pub(super) const LONGEST_PAUSE_US: u32 = 60_000_000;

/// Tells whether a stamp lies within `limit` of `now`, before or after.
///
/// A stamp may lie after `now`, because an interrupt may stamp a frame just after a tick has read the clock. The limit holds there too:
/// after a set-back of the clock, an old stamp must not look fresh.
#[inline]
pub(crate) const fn is_near(now: u32, stamp: u32, limit: u32) -> bool {
    now.wrapping_sub(stamp).wrapping_add(limit) <= limit.wrapping_mul(2)
}

/// Returns the age of a stamp; zero for a stamp ahead.
pub(crate) const fn age(now: u32, stamp: u32) -> u32 {
    let age = now.wrapping_sub(stamp);
    if age.cast_signed() < 0 { 0 } else { age }
}

/// Returns the age of a stamp, which is brought to `now` if the clock went back behind it.
pub(crate) fn take_age(now: Instant, stamp: &mut u32) -> Duration {
    let micros = age(now.stamp(), *stamp);
    *stamp = now.stamp().wrapping_sub(micros);
    Duration::from_micros(micros.into())
}

/// Returns whole milliseconds, at most 65 s.
pub(super) const fn whole_ms(time: Duration) -> u16 {
    let millis = time.as_micros() / 1_000;
    #[expect(clippy::cast_possible_truncation, reason = "limited before")]
    if millis < 65_000 { millis as u16 } else { 65_000 }
}
