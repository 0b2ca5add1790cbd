//! Scaling of commands between the update of the loops and the frames.

use super::command::Outbox;
use super::motors::{Key, Motors};

/// Scales the command of a motor by a factor; see [`Bus::scale_outputs`](super::Bus::scale_outputs).
pub(super) fn scale_output<const N: usize>(
    motors: &mut Motors<N>,
    outbox: &mut Outbox,
    motor: Key,
    factor: f32,
) {
    let Some(slot) = motors.get_mut(motor) else { return };
    let before = outbox.get(slot.place);
    let after = cut(before, factor);
    if after != before {
        outbox.put(slot.place, after);
        // Meanwhile the loop must not wind up.
        let passed = slot.in_units(after);
        slot.speed_loop_mut().keep_integral_within(passed);
    }
}

/// Returns the command scaled by a factor: never larger than before, never of the other sign.
const fn cut(raw: i16, factor: f32) -> i16 {
    if factor >= 1.0 {
        return raw;
    }
    if factor > 0.0 {
        #[expect(clippy::cast_possible_truncation, reason = "rounds towards zero, within raw")]
        let less = (raw as f32 * factor) as i16;
        return less;
    }
    0
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn nothing_is_raised_or_turned_around(raw in any::<i16>(), factor in any::<f32>()) {
            let after = cut(raw, factor);
            prop_assert!(after.unsigned_abs() <= raw.unsigned_abs(), "{raw} {factor} {after}");
            prop_assert!(after == 0 || (after < 0) == (raw < 0), "{raw} {factor} {after}");
        }

        #[test]
        fn what_is_left_is_the_share_to_a_count(raw in any::<i16>(), factor in 0.0_f32..1.0) {
            let share = f32::from(raw) * factor;
            prop_assert!((f32::from(cut(raw, factor)) - share).abs() <= 1.0);
        }
    }

    #[test]
    fn a_factor_that_is_no_share_takes_all_or_nothing() {
        for factor in [f32::NAN, f32::NEG_INFINITY, -1.0, -0.0, 0.0] {
            assert_eq!(cut(-12_345, factor), 0);
        }
        for factor in [1.0, 1.5, f32::INFINITY] {
            assert_eq!((cut(-12_345, factor), cut(i16::MIN, factor)), (-12_345, i16::MIN));
        }
    }
}
