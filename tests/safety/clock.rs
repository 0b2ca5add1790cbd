//! Random clocks that wrap early, swing, jump and stand.

/// xorshift64.
pub(super) struct Random(pub(super) u64);

impl Random {
    /// Below 2^`lowest` to 2^(`lowest` + `spread` - 1), each of these as often.
    pub(super) fn of_any_size(&mut self, lowest: u64, spread: u64) -> u64 {
        let bits = lowest + self.below(spread);
        self.below(1 << bits)
    }

    pub(super) fn below(&mut self, limit: u64) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0 % limit
    }

    pub(super) fn pick<T: Copy, const N: usize>(&mut self, of: [T; N]) -> T {
        of[usize::try_from(self.below(N as u64)).unwrap()]
    }

    pub(super) fn one_in(&mut self, count: u64) -> bool {
        self.below(count) == 0
    }
}

/// One clock, as it is wrong in some way.
enum Kind {
    Wraps(u64),
    Swings(u64),
    Jumps,
    Stands,
    Right,
}

/// How far apart the updates are.
enum Pace {
    /// Any distance.
    Any,
    /// About as far as a program's.
    Even,
    /// Whole milliseconds, or one microsecond beside: the limits are met to the microsecond.
    Grid,
    /// The same, and slow: a second is over before the clock is.
    Slow,
}

/// Real time, and a clock that reads it.
pub(super) struct Clock {
    kind: Kind,
    real: u64,
    read: u64,
    pace: Pace,
}

impl Clock {
    pub(super) fn draw(random: &mut Random) -> Self {
        let kind = match random.below(6) {
            0 => Kind::Wraps(1 << (8 + random.below(25))),
            1 => Kind::Swings(1 + random.of_any_size(0, 20)),
            2 => Kind::Jumps,
            3 => Kind::Stands,
            _ => Kind::Right,
        };
        // Half of them shortly before a 32-bit stamp wraps.
        let start = if random.one_in(2) {
            (1 << 32) - random.below(400_000)
        } else {
            random.below(1 << 33)
        };
        let pace = match random.below(4) {
            0 => Pace::Any,
            1 => Pace::Even,
            2 => Pace::Slow,
            _ => Pace::Grid,
        };
        Self { kind, real: start, read: 0, pace }
    }

    pub(super) fn next(&mut self, random: &mut Random) -> u64 {
        self.real += match self.pace {
            _ if random.one_in(512) => 59_900_000 + random.below(200_000),
            Pace::Any => 1 + random.of_any_size(4, 13),
            Pace::Even => 1 + random.below(16_000),
            Pace::Slow => 1_000 * (1 + random.below(60)) + random.pick([0, 0, 0, 0, 0, 0, 1]),
            Pace::Grid => 1_000 * (1 + random.below(12)) + random.pick([0, 0, 0, 0, 0, 0, 1]),
        };
        self.read = match self.kind {
            Kind::Wraps(period) => self.real % period,
            Kind::Swings(by) => 1_000_000 + self.real % 2 * by,
            Kind::Jumps if random.one_in(64) => u64::MAX - random.below(2),
            // A clock that is wrong by a multiple of 2^32 is not noticed: none from the end to the start.
            Kind::Jumps if random.one_in(8) => 1_000_000 + random.of_any_size(4, 36),
            Kind::Jumps => self.read.saturating_add(random.below(30_000)),
            Kind::Stands if random.one_in(4) => self.read,
            Kind::Stands => self.read + random.below(20_000),
            Kind::Right => self.real,
        };
        self.read
    }
}
