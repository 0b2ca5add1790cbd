//! How old feedback and targets are, of several motors together.

use super::MotorGuard;
use crate::motor::{Link, Timeouts};

/// The greatest ages among some motors, each counted from as far ahead of now as it may reach back: from 0 to twice its
/// limit a stamp is near.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Ages {
    now: u32,
    timeouts: Timeouts,
    heard: u32,
    commanded: u32,
}

impl Ages {
    /// The ages of no motor; but a target may come at any time from now on.
    pub(super) const fn none(now: u32, timeouts: Timeouts) -> Self {
        Self { now, timeouts, heard: 0, commanded: timeouts.command_us() }
    }

    /// Adds the ages of a motor's feedback and target, when it is heard.
    #[inline]
    pub(crate) fn add(&mut self, motor: &MotorGuard) {
        if motor.link != Link::Online {
            return;
        }
        let since = |stamp, limit| self.now.wrapping_add(limit).wrapping_sub(stamp);
        let heard = since(motor.heard, self.timeouts.late_us());
        let commanded = since(motor.commanded, self.timeouts.command_us());
        self.heard = self.heard.max(heard);
        if motor.has_target {
            self.commanded = self.commanded.max(commanded);
        }
    }

    /// Returns after how many µs one of them is above its limit; `None` when one is already.
    pub(crate) fn within_limits_us(&self) -> Option<u32> {
        let heard = (2 * self.timeouts.late_us()).checked_sub(self.heard)?;
        let commanded = (2 * self.timeouts.command_us()).checked_sub(self.commanded)?;
        Some(heard.min(commanded) + 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Below a limit, next to it on both sides, and far above.
    fn about(limit: u32) -> impl Strategy<Value = u32> {
        prop_oneof![0..=limit, limit - 2..=limit + 2, limit..=100 * limit]
    }

    proptest! {
        /// Law: nothing is above its limit for as long as it is told, and something is a microsecond later.
        #[test]
        fn it_is_quiet_until_the_oldest_age_is_above_its_limit(heard in about(20_000), commanded in about(200_000)) {
            let ages = Ages { heard, commanded, ..Ages::none(0, Timeouts::new()) };
            // 10 ms and 100 ms, and as far ahead.
            let is_within = |passed| heard + passed <= 20_000 && commanded + passed <= 200_000;
            match ages.within_limits_us() {
                Some(quiet) => prop_assert!(is_within(quiet - 1) && !is_within(quiet)),
                None => prop_assert!(!is_within(0)),
            }
        }
    }
}
