//! Arming as a deliberate act.

use crate::time::Duration;

/// Distinguishes a deliberate request to arm from a request repeated by a program.
///
/// After a trip, a request counts only if neither a trip nor another request lies within [`PAUSE_US`](Self::PAUSE_US) before it. A switch
/// that stays on, read in each tick, does not re-arm. A program that reads its switch more slowly must detect the edge of the switch.
///
/// The pause consists of updates whose time moved on. A gap between two updates counts for no more than
/// [`LONGEST_STEP_US`](Self::LONGEST_STEP_US): a stall of the program, or a jump of its clock, is no release of the switch.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Gesture {
    /// Time of the updates since the last request or trip.
    quiet_us: u32,
    /// Whether a motor was relaxed since arming, and waits to be armed again.
    tripped: bool,
    /// Whether the last request counts.
    granted: bool,
}

impl Gesture {
    /// Pause without requests before a request that counts.
    const PAUSE_US: u32 = 100_000;
    const LONGEST_STEP_US: u32 = 20_000;

    pub(crate) const NEW: Self = Self { quiet_us: 0, tripped: false, granted: false };

    /// Notes an update, `step` after the previous one. `None`, for a time that did not move on, begins the pause anew.
    pub(crate) fn pass(&mut self, step: Option<Duration>) {
        let step_us = step.map(|step| step.micros_u32().unwrap_or(u32::MAX));
        self.quiet_us = step_us
            .map_or(0, |step_us| self.quiet_us.saturating_add(step_us.min(Self::LONGEST_STEP_US)));
    }

    /// Notes a trip: a motor was relaxed until armed again.
    pub(crate) const fn trip(&mut self) {
        *self = Self { quiet_us: 0, tripped: true, granted: false };
    }

    /// Takes a request to arm. Returns `false` if the request does not count.
    pub(crate) const fn ask(&mut self) -> bool {
        self.granted = !self.tripped || self.quiet_us >= Self::PAUSE_US;
        self.quiet_us = 0;
        self.granted
    }

    /// Keeps the trip: another motor of the device still waits to be armed.
    pub(crate) const fn keep(&mut self) {
        self.tripped = true;
        self.granted = false;
    }

    /// Tells whether the device may be armed. If so, ends the trip.
    pub(crate) const fn take(&mut self) -> bool {
        let is_free = !self.tripped || self.granted;
        self.tripped = self.tripped && !is_free;
        is_free
    }

    /// Tells whether updates must be [noted](Self::pass): a request counts only after a pause.
    pub(crate) const fn is_tripped(&self) -> bool {
        self.tripped
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pass_ms(gesture: &mut Gesture, ms: u64, steps: usize) {
        (0..steps).for_each(|_| gesture.pass(Some(Duration::from_millis(ms))));
    }

    #[test]
    fn a_request_that_is_repeated_is_one_request() {
        let mut gesture = Gesture::NEW;
        assert!(gesture.ask() && gesture.ask() && gesture.take(), "no trip yet");
        gesture.trip();
        for update in 0..5_000 {
            pass_ms(&mut gesture, 1, 1);
            assert!(!gesture.ask() && !gesture.take(), "{update}");
        }
        pass_ms(&mut gesture, 1, 99);
        assert!(!gesture.ask());
        pass_ms(&mut gesture, 1, 100);
        assert!(gesture.ask() && gesture.take());
        assert!(gesture.ask() && gesture.take());
    }

    #[test]
    fn a_trip_after_the_request_takes_it_back() {
        let mut gesture = Gesture::NEW;
        assert!(gesture.ask());
        gesture.trip();
        assert!(!gesture.take());
    }

    #[test]
    fn a_trip_that_is_kept_needs_a_pause_of_its_own() {
        let mut gesture = Gesture::NEW;
        gesture.trip();
        pass_ms(&mut gesture, 10, 10);
        assert!(gesture.ask() && gesture.take());
        gesture.keep();
        pass_ms(&mut gesture, 10, 1);
        assert!(!gesture.take() && !gesture.ask());
        pass_ms(&mut gesture, 10, 10);
        assert!(gesture.ask());
    }

    #[test]
    fn a_stall_makes_no_pause() {
        let mut gesture = Gesture::NEW;
        gesture.trip();
        for _ in 0..1_000 {
            pass_ms(&mut gesture, 3_600_000, 1);
            assert!(!gesture.ask());
        }
        pass_ms(&mut gesture, u64::MAX / 1_000, 4);
        assert!(!gesture.ask());
        pass_ms(&mut gesture, 3_600_000, 5);
        assert!(gesture.ask());
    }

    #[test]
    fn a_clock_that_swings_makes_no_pause() {
        let mut gesture = Gesture::NEW;
        gesture.trip();
        for _ in 0..1_000 {
            pass_ms(&mut gesture, 200, 4);
            gesture.pass(None);
            assert!(!gesture.ask());
        }
    }
}
