//! Statistics of the frames of a motor.

use crate::time::{Duration, Instant};

/// Gaps are kept in units of 16 µs, up to a second.
const GAP_SHIFT: u32 = 4;
/// From this number of jumps to and fro on, two motors answer.
const JUMPS: u8 = 16;

/// Rate and regularity of a motor's feedback, over windows of about a second.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Traffic {
    frames: u16,
    longest_gap: u16,
    /// Rate in the last whole window.
    rate_hz: u16,
    last_gap: u16,
    /// Jumps of the angle to and fro, while more frames come than one motor sends. The sign is the direction of the last jump.
    jumps: i8,
    crowded: bool,
}

impl Traffic {
    /// Window in which frames are counted.
    pub(crate) const WINDOW: Duration = Duration::from_secs(1);

    pub(crate) const NONE: Self =
        Self { frames: 0, longest_gap: 0, rate_hz: 0, last_gap: 0, jumps: 0, crowded: false };

    /// Counts a frame.
    #[inline]
    pub(crate) const fn count(&mut self) {
        self.frames = self.frames.wrapping_add(1);
    }

    /// Ends a window that began at `from`, at a rate that the application chose, if the window is over at `now`.
    pub(crate) fn end_window(&mut self, from: &mut Instant, now: Instant) -> bool {
        if now < *from {
            // The clock went back, and the length of the window is not known.
            (*from, self.frames) = (now, 0);
        }
        let window = now.since(*from);
        let is_over = window >= Self::WINDOW;
        if is_over {
            let units = u16::try_from(window.as_micros() >> 10).unwrap_or(u16::MAX);
            self.close(units, u32::MAX);
            *from = now;
        }
        is_over
    }

    /// Adds frames counted elsewhere.
    pub(crate) const fn add(&mut self, frames: u16) {
        self.frames = self.frames.wrapping_add(frames);
    }

    /// Notes the time since the previous frame, in µs.
    #[inline]
    pub(crate) const fn gap(&mut self, gap_us: u32) {
        let gap = saturated(gap_us >> GAP_SHIFT);
        if gap > self.longest_gap {
            self.longest_gap = gap;
        }
    }

    /// Returns the time in µs from which a gap is longer than the longest of the present window.
    pub(crate) const fn usual_gap_us(&self) -> u32 {
        (self.longest_gap as u32 + 1) << GAP_SHIFT
    }

    /// Tells whether more frames come than one motor sends: each must then be [compared](Self::compare).
    pub(crate) const fn is_crowded(&self) -> bool {
        self.crowded
    }

    /// Compares the change of the angle with the change predicted from the speed, both in counts, within `tolerance`.
    ///
    /// Two motors with one id take turns, so the angle jumps to and fro between theirs, each time by more than the speed explains. The
    /// angle of one motor may seem to jump, after a gap or if frames are stamped late, but not to and fro many times.
    pub(crate) const fn compare(&mut self, counts: i32, predicted: i32, tolerance: i32) {
        let off = counts.wrapping_sub(predicted);
        if off.unsigned_abs() <= tolerance.unsigned_abs() {
            return;
        }
        // A jump back counts one more. Another jump in the same direction does not count.
        if (off < 0) != (self.jumps < 0) || self.jumps == 0 {
            let jumps = self.jumps.saturating_abs().saturating_add(1);
            self.jumps = if off < 0 { -jumps } else { jumps };
        }
    }

    /// Tells whether two motors answer, as far as this window shows.
    pub(crate) const fn is_double(&self) -> bool {
        self.jumps.unsigned_abs() >= JUMPS
    }

    /// Ends a window of `window` units of 1.024 ms. A rate of more than one and a half times `nominal_hz` counts as crowded.
    pub(crate) const fn close(&mut self, window: u16, nominal_hz: u32) {
        let per_window = self.frames as u32 * 15_625 / 16; // 10^6 / 1024
        let rate = match per_window.checked_div(window as u32) {
            Some(rate) => saturated(rate),
            None => u16::MAX,
        };
        *self = Self {
            frames: 0,
            longest_gap: 0,
            rate_hz: rate,
            last_gap: self.longest_gap,
            jumps: 0,
            crowded: rate as u32 * 2 > nominal_hz.saturating_mul(3),
        };
    }

    /// Returns the frames a second of the last whole window; 0 before the first.
    pub(crate) const fn rate_hz(&self) -> u16 {
        self.rate_hz
    }

    /// Returns the longest time between two frames in µs, rounded down to 16, of the last whole window and the present one.
    pub(crate) const fn longest_gap_us(&self) -> u32 {
        let gap = if self.last_gap > self.longest_gap { self.last_gap } else { self.longest_gap };
        (gap as u32) << GAP_SHIFT
    }
}

#[expect(clippy::cast_possible_truncation, reason = "compared right before")]
const fn saturated(value: u32) -> u16 {
    if value < u16::MAX as u32 { value as u16 } else { u16::MAX }
}

/// Frames to a drive at rest that the drive answers with feedback, beside its feedback.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Answers {
    asked: u16,
    answered: u16,
    are_of_one: bool,
    /// Another node commanded the drive since the last comparison, and was answered too.
    has_rival: bool,
}

impl Answers {
    /// So many frames are compared with the feedback: more than a quarter beyond one answer each comes from two drives.
    const ENOUGH: u16 = 64;

    pub(crate) const NONE: Self =
        Self { asked: 0, answered: 0, are_of_one: false, has_rival: false };

    pub(crate) const BESIDE_RIVAL: Self = Self { has_rival: true, ..Self::NONE };

    /// Counts from zero, and keeps the last comparison.
    pub(crate) const fn begin(&mut self) {
        (self.asked, self.answered) = (0, 0);
    }

    pub(crate) const fn ask(&mut self, frames: u16) {
        self.asked = self.asked.saturating_add(frames);
    }

    #[inline]
    pub(crate) const fn add(&mut self, frames: u16) {
        self.answered = self.answered.saturating_add(frames);
    }

    pub(crate) const fn are_enough(&self) -> bool {
        self.asked >= Self::ENOUGH
    }

    /// Compares both numbers, and begins anew.
    pub(crate) fn compare(&mut self) {
        let are_of_one = 4 * u32::from(self.answered) <= 5 * u32::from(self.asked);
        *self = Self { are_of_one, ..Self::NONE };
    }

    /// Tells whether the last comparison found one drive.
    pub(crate) const fn are_of_one(&self) -> bool {
        self.are_of_one
    }

    pub(crate) const fn has_rival(&self) -> bool {
        self.has_rival
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn rate_and_longest_gap_are_those_of_the_window() {
        let mut traffic = Traffic::NONE;
        for frame in 0..998 {
            traffic.count();
            traffic.gap(if frame == 500 { 3_210 } else { 1_000 });
        }
        traffic.close(977, 1_000); // 1.0004 s
        assert_eq!((traffic.rate_hz(), traffic.longest_gap_us()), (997, 3_200));
        traffic.gap(u32::MAX);
        assert_eq!(traffic.longest_gap_us(), 1_048_560);
        traffic.close(0, 1_000);
        assert_eq!(traffic.rate_hz(), u16::MAX, "frames in no time");
    }

    #[test]
    fn a_crowd_is_half_as_many_frames_again() {
        for (frames, crowded) in [(1_000, false), (1_090, false), (1_510, true), (2_000, true)] {
            let mut traffic = Traffic::NONE;
            (0..frames).for_each(|_| traffic.count());
            traffic.close(977, 1_000);
            assert_eq!(traffic.is_crowded(), crowded, "{frames}");
        }
    }

    #[test]
    fn angles_that_take_turns_are_two_motors() {
        for (one, other) in [(100, 4_000), (100, 7_000), (0, 500)] {
            let mut traffic = Traffic::NONE;
            let way = crate::encoder::shortest(one, other);
            for frame in 0..100 {
                traffic.compare(if frame % 2 == 0 { way } else { -way }, 0, 200);
            }
            assert!(traffic.is_double(), "{one} {other}");
        }
    }

    proptest! {
        /// Law: one motor at any speed, however many of its frames are lost, doubled or stamped late in bursts, never
        /// looks like two.
        #[test]
        fn one_motor_never_looks_like_two(
            counts_per_ms in -1_400_i32..1_400,
            events in proptest::collection::vec(0_u8..100, 1_000),
        ) {
            let mut traffic = Traffic::NONE;
            let tolerance = 200 + 2 * counts_per_ms.abs();
            let (mut gap_ms, mut stalled) = (0, 0_u32);
            for event in events {
                gap_ms += 1;
                if stalled > 0 {
                    stalled -= 1;
                    continue;
                }
                match event {
                    0..5 => continue,                                         // lost
                    5..7 => traffic.compare(0, 0, tolerance),                 // doubled
                    7 => stalled = 8,                                         // and then the queue is full
                    _ => {}
                }
                let way = crate::encoder::shortest(
                    0,
                    u16::try_from((counts_per_ms * gap_ms).rem_euclid(8_192)).unwrap(),
                );
                if gap_ms <= 2 {
                    traffic.compare(way, counts_per_ms * gap_ms, tolerance);
                }
                gap_ms = 0;
            }
            prop_assert!(!traffic.is_double());
        }
    }
}
