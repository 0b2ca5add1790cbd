/// A small reproducible source of chance: the same seed and stream, the same numbers on every target.
///
/// The generator is PCG32 (XSH-RR): M. E. O'Neill, "PCG: A Family of Simple Fast Space-Efficient Statistically
/// Good Algorithms for Random Number Generation" (2014), section 6.3.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Random {
    state: u64,
    increment: u64,
}

const MULTIPLIER: u64 = 6_364_136_223_846_793_005;

impl Random {
    /// Seeds one of 2^63 streams; numbers of different streams are independent.
    pub(crate) const fn new(seed: u64, stream: u64) -> Self {
        let increment = (stream << 1) | 1;
        let first = increment.wrapping_add(seed).wrapping_mul(MULTIPLIER).wrapping_add(increment);
        Self { state: first, increment }
    }

    #[expect(clippy::cast_possible_truncation, reason = "the generator takes parts of the state")]
    pub(crate) const fn next_u32(&mut self) -> u32 {
        let old = self.state;
        self.state = old.wrapping_mul(MULTIPLIER).wrapping_add(self.increment);
        let mixed = (((old >> 18) ^ old) >> 27) as u32;
        mixed.rotate_right((old >> 59) as u32)
    }

    /// Returns a number below `bound`; 0 for the bound 0. Its bias is below one in 2^32 / `bound`.
    pub(crate) const fn below(&mut self, bound: u32) -> u32 {
        ((self.next_u32() as u64 * bound as u64) >> 32) as u32
    }

    /// Returns a number within ±`most`, evenly distributed.
    pub(crate) fn within(&mut self, most: f32) -> f32 {
        // 24 bits are exact in f32.
        let drawn = (self.next_u32() >> 8) as f32 * (1.0 / 8_388_608.0);
        most * (drawn - 1.0)
    }

    /// Tells yes with the given probability: never at 0 and below, always at 1 and above, never for NaN.
    pub(crate) fn chance(&mut self, probability: f32) -> bool {
        // 24 bits are exact in f32.
        let drawn = (self.next_u32() >> 8) as f32 * (1.0 / 16_777_216.0);
        drawn < probability
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_numbers_are_those_of_the_reference_implementation() {
        // pcg32-demo of the author: seed 42, stream 54.
        let mut random = Random::new(42, 54);
        let drawn: std::vec::Vec<u32> = (0..6).map(|_| random.next_u32()).collect();
        assert_eq!(
            drawn,
            [0xA15C_02B7, 0x7B47_F409, 0xBA1D_3330, 0x83D2_F293, 0xBFA4_784B, 0xCBED_606E]
        );
    }

    #[test]
    fn chances_keep_their_probability_and_their_ends() {
        let mut random = Random::new(1, 2);
        let hits = (0..100_000).filter(|_| random.chance(0.25)).count();
        assert!(hits.abs_diff(25_000) < 500, "{hits}");
        assert!((0..1000).all(|_| random.chance(1.0) && !random.chance(0.0)));
        assert!(!random.chance(f32::NAN) && !random.chance(-1.0));
        assert!((0..1000).all(|_| random.below(7) < 7 && random.below(0) == 0));
    }
}
