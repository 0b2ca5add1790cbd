/// Position of a joint's zero in the counts of its motor.
///
/// ```text
/// position shown = raw - offset        target sent = wanted + offset
/// ```
/// [`Reset::Rezero`](crate::wire::host_link::Reset::Rezero) makes the present position zero. The robot's document states `offset = shown +
/// offset`, with a doubt. `shown + offset` is the raw position, so the raw position is the new offset. All arithmetic wraps as the motor's
/// own 32-bit counter does.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
pub(super) struct Offset(i32);

impl Offset {
    /// Takes the raw position of the zero in pulses.
    pub(super) const fn new(raw_pulses: i32) -> Self {
        Self(raw_pulses)
    }

    /// Returns the position from the zero, in pulses.
    pub(super) const fn shown(self, raw_pulses: i32) -> i32 {
        raw_pulses.wrapping_sub(self.0)
    }

    /// Returns the raw target for a wanted position from the zero, in pulses.
    pub(super) const fn target(self, wanted_pulses: i32) -> i32 {
        wanted_pulses.wrapping_add(self.0)
    }

    /// Returns the raw position of the zero in pulses.
    pub(super) const fn raw(self) -> i32 {
        self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_zero_is_shown_as_zero_and_moves_the_targets() {
        let offset = Offset::new(70_000);
        assert_eq!((offset.shown(70_000), offset.target(-1_000)), (0, 69_000));
        assert_eq!(Offset::new(69_000).shown(70_000), 1_000);
    }

    proptest! {
        #[test]
        fn the_documents_sum_is_the_raw_position(first: i32, raw: i32) {
            let sum = Offset::new(first).shown(raw).wrapping_add(first);
            let offset = Offset::new(raw);
            prop_assert_eq!(offset, Offset::new(sum));
            prop_assert_eq!(offset.shown(raw), 0);
        }

        #[test]
        fn a_target_that_is_reached_is_shown_as_wanted(zero: i32, wanted: i32) {
            let offset = Offset::new(zero);
            prop_assert_eq!(offset.shown(offset.target(wanted)), wanted);
        }
    }
}
