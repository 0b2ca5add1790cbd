//! Every `f32` that a loop could give.

use crate::dji::codec::Range;
use crate::dji::codec::{free_to_raw, loop_to_raw};
use crate::dji::model::ALL_FACTS;
use crate::dji::{Config, Gm6020Voltage};
use crate::math::tests::every_f32;

/// A scale, and two ranges of a motor: the whole scale, and less than a third of the scale in one direction.
#[derive(Debug, Clone, Copy)]
struct Case {
    raw_per_unit: f32,
    limit: i16,
    third: i16,
    whole: Range,
    positive: Range,
    negative: Range,
}

impl Case {
    fn new(limit: i16, full_scale: f32) -> Self {
        let third = limit / 3;
        let narrow = Range::within(third);
        Self {
            raw_per_unit: f32::from(limit) / full_scale,
            limit,
            third,
            whole: Range::within(limit),
            positive: narrow.and(Range::between(0, i16::MAX)),
            negative: narrow.and(Range::between(i16::MAX, 0)),
        }
    }

    /// Those of each model, and of the older scale of one.
    fn all() -> impl Iterator<Item = Self> {
        let usual = ALL_FACTS.iter().map(|facts| (facts.command_raw, facts.command_full_scale));
        let legacy = Config::<Gm6020Voltage>::at_once(1).with_legacy_full_scale().plain;
        let all = usual.chain([(legacy.command_raw, legacy.command_full_scale)]);
        all.map(|(limit, full_scale)| Self::new(limit, full_scale))
    }

    /// Compares the word of the whole range with the exact product, for which `f64` has room. A reversed motor gets the
    /// negative of that word. A motor with a limited range gets the nearest word in the range: upward for even bits, downward for odd bits.
    fn check(&self, bits: u32) {
        let (value, limit) = (f32::from_bits(bits), f64::from(self.limit));
        let product = f64::from(value) * f64::from(self.raw_per_unit);
        let word = loop_to_raw(value, self.raw_per_unit, self.whole);
        let inside = product.clamp(-limit, limit);
        let is_nearest = (f64::from(word) - inside).abs() < 0.5 || is_near_enough(word, inside);
        assert!(is_nearest, "{value:e}: {word} for {inside}, {self:?}");

        let (range, ends) = match bits & 1 {
            0 => (self.positive, (0, self.third)),
            _ => (self.negative, (-self.third, 0)),
        };
        let reversed = loop_to_raw(value, -self.raw_per_unit, range);
        assert_eq!(reversed, (-word).clamp(ends.0, ends.1), "{value:e}: {self:?}");
        if product.abs() <= limit {
            assert_eq!(free_to_raw(value, -self.raw_per_unit), -word, "{value:e}: {self:?}");
        }
    }
}

/// Tells whether a word is right for a product half a count away, or for NaN: half a count goes to the even neighbour, NaN to 0.
/// The product is rounded to the 24 bits of an `f32` first, possibly past the middle between two words.
#[cold]
#[expect(clippy::float_cmp, reason = "the difference is exact")]
fn is_near_enough(word: i16, product: f64) -> bool {
    let off = (f64::from(word) - product).abs();
    if product.is_nan() {
        word == 0
    } else if off == 0.5 {
        word % 2 == 0
    } else {
        off <= 0.5 + product.abs() / 16_777_216.0
    }
}

#[test]
fn values_about_each_step_and_each_end_become_the_nearest_word() {
    for case in Case::all() {
        for halves in -2 * i32::from(case.limit) - 3..=2 * i32::from(case.limit) + 3 {
            let value = f64::from(halves) * 0.5 / f64::from(case.raw_per_unit);
            #[expect(clippy::cast_possible_truncation, reason = "the nearest f32 is meant")]
            let value = value as f32;
            for bits in [value.next_down(), value, value.next_up()].map(f32::to_bits) {
                case.check(bits);
            }
        }
    }
}

#[test]
#[ignore = "2^32 values for one scale a day: by .ci/run"]
fn every_f32_of_a_loop_becomes_the_nearest_word() {
    let all = std::env::var("DRIVETRAIN_EXHAUSTIVE").is_ok_and(|share| share == "full");
    let since_1970 = std::time::UNIX_EPOCH.elapsed().unwrap();
    let today = since_1970.as_secs() / 86_400 % Case::all().count() as u64;
    for (turn, case) in (0..).zip(Case::all()) {
        let scale = (case.raw_per_unit, case.limit);
        if all || turn == today {
            every_f32(|bits| case.check(bits));
            std::println!("exhaustive: loop outputs at {scale:?}: 4294967296 values");
        } else {
            std::println!("exhaustive: loop outputs at {scale:?}: not today");
        }
    }
}
