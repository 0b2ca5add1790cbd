/// Where the zero of a joint lies in the counts of its motor.
///
/// ```text
/// position shown = raw - offset        target sent = wanted + offset
/// ```
/// [`Reset::Rezero`](crate::wire::host_link::Reset::Rezero) makes the present position zero. The robot's document does it as
/// `offset = shown + offset` and doubts that; as `shown + offset` is the raw position, it is right, and it is what
/// [`rezero`](Self::rezero) does. All arithmetic wraps as the motor's own 32-bit counter does.
///
/// # Examples
/// ```
/// use drivetrain::snake::Offset;
///
/// let mut offset = Offset::default();
/// offset.rezero(70_000); // the motor stands at raw 70 000
/// assert_eq!(offset.shown(70_000), 0);
/// assert_eq!(offset.target(-1_000), 69_000);
/// offset.rezero(69_000);
/// assert_eq!(offset.shown(70_000), 1_000);
/// ```
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Offset(i32);

impl Offset {
    /// Takes the raw position of the zero in pulses.
    #[must_use]
    pub const fn new(raw_pulses: i32) -> Self {
        Self(raw_pulses)
    }

    /// Returns the position from the zero, in pulses.
    #[must_use]
    pub const fn shown(self, raw_pulses: i32) -> i32 {
        raw_pulses.wrapping_sub(self.0)
    }

    /// Returns the raw target for a wanted position from the zero, in pulses.
    #[must_use]
    pub const fn target(self, wanted_pulses: i32) -> i32 {
        wanted_pulses.wrapping_add(self.0)
    }

    /// Makes the present raw position the zero.
    pub const fn rezero(&mut self, raw_pulses: i32) {
        self.0 = raw_pulses;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_documents_sum_is_the_raw_position(first: i32, raw: i32) {
            let mut offset = Offset::new(first);
            let sum = offset.shown(raw).wrapping_add(first);
            offset.rezero(raw);
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
