use super::{Condition, Latch};

/// A condition ends this far below the temperature at which it began.
const HYSTERESIS_K: i16 = 5;

/// Looks at a temperature and returns the share of the output that it leaves: 1 up to the warning, 0 from the limit on,
/// a straight line between; 0 also until a motor that was at the limit is 5 K below it. What is not looked for is `None`, and
/// takes nothing away.
pub(super) fn check(
    latch: &mut Latch,
    celsius: i16,
    warning: Option<i16>,
    limit: Option<i16>,
) -> f32 {
    for (condition, from) in [(Condition::Warm, warning), (Condition::Hot, limit)] {
        let Some(from) = from else { continue };
        let below = celsius < from.saturating_sub(HYSTERESIS_K);
        latch.set(condition, celsius >= from || (latch.has(condition) && !below));
    }
    match (warning, limit) {
        _ if latch.has(Condition::Hot) => 0.0,
        (Some(warning), Some(limit)) if celsius > warning => {
            f32::from(limit.saturating_sub(celsius)) / f32::from(limit.saturating_sub(warning))
        }
        _ => 1.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_output_falls_on_a_line_and_comes_back_with_hysteresis() {
        let mut latch = Latch::NONE;
        let mut at = |celsius| {
            let share = check(&mut latch, celsius, Some(100), Some(120));
            (share, latch.has(Condition::Warm), latch.has(Condition::Hot))
        };
        assert_eq!(at(99), (1.0, false, false));
        assert_eq!(at(100), (1.0, true, false));
        assert_eq!(at(105), (0.75, true, false));
        assert_eq!(at(119), (0.05, true, false));
        assert_eq!(at(120), (0.0, true, true));
        assert_eq!(at(115), (0.0, true, true));
        assert_eq!(at(114), (0.3, true, false));
        assert_eq!(at(95), (1.0, true, false));
        assert_eq!(at(94), (1.0, false, false));
    }

    #[test]
    fn what_is_not_looked_for_is_no_edge_and_takes_nothing_away() {
        for (warning, limit) in [(None, Some(120)), (Some(100), None), (None, None)] {
            let mut latch = Latch::NONE;
            let share = check(&mut latch, 119, warning, limit);
            assert!(share >= 1.0, "{share}");
            let share = check(&mut latch, i16::MAX, warning, limit);
            assert_eq!(share > 0.0, limit.is_none());
            let seen = (latch.has(Condition::Warm), latch.has(Condition::Hot));
            assert_eq!(seen, (warning.is_some(), limit.is_some()));
        }
    }

    proptest! {
        /// Law: the share is within 0..=1, and less for a hotter motor with the same past.
        #[test]
        fn hotter_is_never_more(celsius: i16, more: u8, warning in -100_i16..300, span in 1_i16..200, hot: bool) {
            let share = |celsius: i16| {
                let mut latch = Latch::NONE;
                if hot {
                    check(&mut latch, i16::MAX, Some(warning), Some(warning + span));
                }
                check(&mut latch, celsius, Some(warning), Some(warning + span))
            };
            let cool = share(celsius);
            prop_assert!((0.0..=1.0).contains(&cool));
            prop_assert!(share(celsius.saturating_add(more.into())) <= cool);
        }
    }
}
