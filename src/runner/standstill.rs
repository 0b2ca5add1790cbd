//! Whether the clock stands, by the number of readings in a row that show no later time.

use crate::time::Instant;

/// The largest limit; it holds until the clock has moved on once. A fast loop takes 0.1 s to 1 s for so many readings.
const MOST_READINGS: u32 = 200_000;

/// The smallest limit that is learned.
const LEAST_READINGS: u32 = 1_000;

/// The limit is so many times the readings that the clock ever needed to show a later time.
const TIMES_THE_LONGEST: u32 = 100;

/// Readings in a microsecond of the clock's resolution: a fast loop polls 1 000 000 times a second.
const READINGS_A_MICRO: u32 = 2;

/// So many received frames are as good as the limit, for loops that sleep until a frame comes: a bus of 1 Mbit/s takes 80 ms and
/// more for them.
const FRAMES: u32 = 1_600;

/// Counts readings that show no later time, and learns how many of them are usual.
#[derive(Debug)]
pub(super) struct Standstill {
    limit: u32,
    is_fixed: bool,
    /// The latest reading since the last step.
    furthest: Option<Instant>,
    readings: u32,
    frames: u32,
    longest: u32,
    /// At least the resolution of the clock, in µs: the smallest advance, or difference of two.
    finest: u32,
    advance: u32,
}

impl Standstill {
    pub(super) const fn new() -> Self {
        Self {
            limit: MOST_READINGS,
            is_fixed: false,
            furthest: None,
            readings: 0,
            frames: 0,
            longest: 0,
            finest: u32::MAX,
            advance: 0,
        }
    }

    /// Sets the limit, at least 1; nothing is learned then.
    pub(super) const fn fix(&mut self, readings: u32) {
        self.limit = if readings == 0 { 1 } else { readings };
        self.is_fixed = true;
    }

    /// Notes a received frame: time passed.
    pub(super) const fn receive(&mut self) {
        self.frames = self.frames.saturating_add(1);
    }

    /// Notes a reading of the clock.
    pub(super) fn read(&mut self, now: Instant) {
        match self.furthest {
            Some(furthest) if now <= furthest => self.readings = self.readings.saturating_add(1),
            Some(furthest) => {
                self.learn(now.since(furthest).micros_u32().unwrap_or(u32::MAX));
                self.restart(now);
            }
            None => self.restart(now),
        }
    }

    fn learn(&mut self, advance: u32) {
        let difference = advance.abs_diff(core::mem::replace(&mut self.advance, advance));
        let finest = if difference == 0 { advance } else { difference.min(advance) };
        if self.readings <= self.longest && finest >= self.finest {
            return;
        }
        self.longest = self.longest.max(self.readings);
        self.finest = self.finest.min(finest);
        if !self.is_fixed {
            let usual = self.longest.saturating_mul(TIMES_THE_LONGEST);
            let coarse = self.finest.saturating_mul(READINGS_A_MICRO);
            self.limit = usual.max(coarse).clamp(LEAST_READINGS, MOST_READINGS);
        }
    }

    /// Counts from this time on: the clock may have gone back to it.
    pub(super) const fn restart(&mut self, now: Instant) {
        self.furthest = Some(now);
        (self.readings, self.frames) = (0, 0);
    }

    /// Tells whether the clock stands; once for each time that it takes to be sure.
    pub(super) const fn take(&mut self) -> bool {
        let a_frame = if self.limit < FRAMES { 1 } else { self.limit / FRAMES };
        let passed = self.readings.saturating_add(self.frames.saturating_mul(a_frame));
        let stands = passed >= self.limit;
        if stands {
            (self.readings, self.frames) = (0, 0);
        }
        stands
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Reads a clock of this resolution after each of these gaps in ns, `times` times in a row; returns how often it stood.
    fn stood(resolution_us: u64, phases: &[(u64, u32)]) -> usize {
        let (mut standstill, mut ns, mut stood) = (Standstill::new(), 12_345_678, 0);
        let mut heard_ns = ns;
        for (gap_ns, times) in phases {
            for _ in 0..*times {
                ns += gap_ns;
                // As many frames as a bus of 1 Mbit/s carries.
                while heard_ns + 111_000 <= ns {
                    heard_ns += 111_000;
                    standstill.receive();
                }
                let us = ns / 1_000 / resolution_us * resolution_us;
                standstill.read(Instant::from_micros(us));
                stood += usize::from(standstill.take());
            }
        }
        stood
    }

    /// Reads a clock of this resolution each `gap_us` for 2 s, then one that stands; returns after how many µs it is one.
    fn noticed_us(resolution_us: u64, gap_us: u64) -> u64 {
        let mut standstill = Standstill::new();
        let mut now = Instant::START;
        for us in (0..2_000_000).step_by(usize::try_from(gap_us).unwrap()) {
            // Loops are never quite regular.
            let us = us + us / gap_us % 7 * gap_us / 10;
            now = Instant::from_micros(us / resolution_us * resolution_us);
            standstill.read(now);
            assert!(!standstill.take());
        }
        let stands = |standstill: &mut Standstill| {
            standstill.read(now);
            standstill.take()
        };
        (1..).find(|_| stands(&mut standstill)).unwrap() * gap_us
    }

    #[test]
    fn a_clock_that_stands_is_noticed_within_a_second_by_any_loop_of_a_kilohertz_or_more() {
        let ms = |us| us / 1_000;
        assert_eq!(ms(noticed_us(1, 1)), 1);
        assert_eq!(ms(noticed_us(1, 10)), 10);
        assert_eq!(ms(noticed_us(1, 250)), 250);
        assert_eq!(ms(noticed_us(1, 1_000)), 1_000);
        // Ticks of 1 ms and of 10 ms, polled 1 000 000 times a second.
        assert!((95..=100).contains(&ms(noticed_us(1_000, 1))));
        assert!((185..=200).contains(&ms(noticed_us(10_000, 1))));
        assert!((490..=500).contains(&ms(noticed_us(1_000, 250))));
        // It may be read faster at any time.
        assert!((1_990..=2_000).contains(&ms(noticed_us(1_000, 1_000))));
    }

    #[test]
    fn a_limit_that_was_set_is_kept() {
        for (fixed, limit) in [(0, 1), (100, 100), (1_000_000, 1_000_000)] {
            let mut standstill = Standstill::new();
            standstill.fix(fixed);
            for ms in 1..100 {
                standstill.read(Instant::from_micros(1_000 * ms));
            }
            let now = Instant::from_micros(99_000);
            let stands = |standstill: &mut Standstill| {
                standstill.read(now);
                standstill.take()
            };
            assert!((1..limit).all(|_| !stands(&mut standstill)));
            assert!(stands(&mut standstill));
        }
    }

    fn gap_ns() -> impl Strategy<Value = u64> {
        prop_oneof![501..2_000_u64, 2_000..1_000_000_u64, 1_000_000..20_000_000_u64]
    }

    proptest! {
        /// Law: a clock of any resolution that goes on is none that stands, however the pace of the loop changes, up to
        /// 2 000 000 readings a second.
        #[test]
        fn a_clock_that_goes_on_never_stands(
            resolution_us in prop_oneof![1..100_u64, 100..1_000_u64, Just(1_000), Just(10_000)],
            phases in prop::collection::vec((gap_ns(), 1..20_000_u32), 1..6),
        ) {
            prop_assert_eq!(stood(resolution_us, &phases), 0);
        }

        /// Law: nor when the pace is the same all the time, up to 10 000 000 readings a second.
        #[test]
        fn a_clock_that_is_read_at_one_pace_never_stands(
            resolution_us in prop_oneof![1..20_000_u64, Just(1_000), Just(10_000)],
            gap_ns in 100..1_000_000_u64,
        ) {
            prop_assert_eq!(stood(resolution_us, &[(gap_ns, 200_000)]), 0);
        }
    }
}
