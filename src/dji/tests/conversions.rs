//! Every `f32` that a loop could give.

use crate::dji::command::{free_to_raw, loop_to_raw};
use crate::dji::range::Range;

/// Raw counts a unit, and the limit, of each model and scale.
const SCALES: [(f32, i16); 5] = [
    (10_000.0 / 10.0, 10_000),
    (16_384.0 / 20.0, 16_384),
    (25_000.0 / 24.0, 25_000),
    (30_000.0 / 24.0, 30_000),
    (16_384.0 / 3.0, 16_384),
];

/// The nearest word of the product in `f32`, half a count to the even neighbour, saturated; NaN gives 0.
fn expected(value: f32, raw_per_unit: f32, limit: i16) -> i16 {
    let exact = f64::from(value * raw_per_unit).round_ties_even();
    #[expect(clippy::cast_possible_truncation, reason = "saturated before; NaN gives 0")]
    let word = exact.clamp(-f64::from(limit), f64::from(limit)) as i16;
    word
}

fn check(bits: u32, raw_per_unit: f32, limit: i16) {
    let value = f32::from_bits(bits);
    let word = expected(value, raw_per_unit, limit);
    let range = Range::within(limit);
    assert_eq!(loop_to_raw(value, raw_per_unit, range), word, "{value:e} at {raw_per_unit}");
    if (value * raw_per_unit).abs() <= f32::from(limit) {
        assert_eq!(free_to_raw(value, raw_per_unit), word, "{value:e} at {raw_per_unit}");
    }
}

#[test]
fn values_about_each_step_and_each_end_become_the_nearest_word() {
    for (raw_per_unit, limit) in SCALES {
        for halves in -2 * i32::from(limit) - 3..=2 * i32::from(limit) + 3 {
            let value = f64::from(halves) * 0.5 / f64::from(raw_per_unit);
            #[expect(clippy::cast_possible_truncation, reason = "the nearest f32 is meant")]
            let value = value as f32;
            for bits in [value.next_down(), value, value.next_up()].map(f32::to_bits) {
                check(bits, raw_per_unit, limit);
            }
        }
    }
}

/// Two threads, as the machine of the checks has cores.
fn every_f32((raw_per_unit, limit): (f32, i16)) {
    std::thread::scope(|scope| {
        for sign in [0, 1 << 31] {
            scope.spawn(move || {
                for bits in 0..1 << 31 {
                    check(sign | bits, raw_per_unit, limit);
                }
            });
        }
    });
}

#[test]
#[ignore = "2^32 values for one of five scales a day: by .ci/run"]
fn every_f32_of_a_loop_becomes_the_nearest_word() {
    let all = std::env::var("DRIVETRAIN_EXHAUSTIVE").is_ok_and(|share| share == "full");
    let since_1970 = std::time::UNIX_EPOCH.elapsed().unwrap();
    let today = since_1970.as_secs() / 86_400 % SCALES.len() as u64;
    for (turn, scale) in (0..).zip(SCALES) {
        if all || turn == today {
            every_f32(scale);
            std::println!("exhaustive: loop outputs at {scale:?}: 4294967296 values");
        } else {
            std::println!("exhaustive: loop outputs at {scale:?}: not today");
        }
    }
}
