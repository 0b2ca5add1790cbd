//! Arming as a deliberate act.

use crate::time::{Duration, Instant};

/// Tells a deliberate request to arm from a request that a program repeats.
///
/// After a trip, a request counts only if neither a trip nor another request lies within [`PAUSE`](Self::PAUSE) before
/// it. A switch that stays on, read in each tick, does not re-arm. A program that reads its switch more slowly than that has to
/// detect its edge.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Gesture {
    /// The time of the last request or trip.
    last: Instant,
    /// Whether something was relaxed since it was armed, and waits to be armed again.
    tripped: bool,
    /// Whether the last request counts.
    granted: bool,
}

impl Gesture {
    /// The pause in which nothing may ask for arming.
    pub(crate) const PAUSE: Duration = Duration::from_millis(100);

    pub(crate) const NEW: Self = Self { last: Instant::START, tripped: false, granted: false };

    /// Notes a trip: a motor was relaxed until it is armed again.
    pub(crate) const fn trip(&mut self, now: Instant) {
        self.last = now;
        self.tripped = true;
        self.granted = false;
    }

    /// Takes a request to arm; `false` if it does not count.
    pub(crate) fn ask(&mut self, now: Instant) -> bool {
        self.granted = !self.tripped || now.since(self.last) >= Self::PAUSE;
        self.last = now;
        self.granted
    }

    /// Keeps the trip: another motor of the device still waits to be armed.
    pub(crate) const fn keep(&mut self) {
        self.tripped = true;
        self.granted = false;
    }

    /// Tells whether the device may be armed, and takes the trip back if so.
    pub(crate) const fn take(&mut self) -> bool {
        let is_free = !self.tripped || self.granted;
        self.tripped = self.tripped && !is_free;
        is_free
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at_ms(ms: u64) -> Instant {
        Instant::START + Duration::from_millis(ms)
    }

    #[test]
    fn a_request_that_is_repeated_is_one_request() {
        let mut gesture = Gesture::NEW;
        assert!(gesture.ask(at_ms(1)) && gesture.ask(at_ms(2)) && gesture.take(), "no trip yet");
        gesture.trip(at_ms(500));
        for ms in 501..5_000 {
            assert!(!gesture.ask(at_ms(ms)) && !gesture.take(), "{ms}");
        }
        assert!(!gesture.ask(at_ms(5_098)) && gesture.ask(at_ms(5_198)) && gesture.take());
        assert!(gesture.ask(at_ms(5_199)) && gesture.take());
    }

    #[test]
    fn a_trip_after_the_request_takes_it_back() {
        let mut gesture = Gesture::NEW;
        assert!(gesture.ask(at_ms(200)));
        gesture.trip(at_ms(200));
        assert!(!gesture.take());
    }

    #[test]
    fn a_trip_that_is_kept_needs_a_pause_of_its_own() {
        let mut gesture = Gesture::NEW;
        gesture.trip(at_ms(100));
        assert!(gesture.ask(at_ms(200)) && gesture.take());
        gesture.keep();
        assert!(!gesture.take() && !gesture.ask(at_ms(201)) && gesture.ask(at_ms(301)));
    }

    #[test]
    fn a_clock_that_swings_makes_no_pause() {
        let mut gesture = Gesture::NEW;
        gesture.trip(at_ms(10));
        assert!((0..1_000).all(|turn| !gesture.ask(at_ms(10 + 90 * (turn % 2)))));
        gesture.trip(at_ms(1_000_000));
        assert!(!gesture.ask(at_ms(5)), "the clock was set back");
        assert!(gesture.ask(at_ms(105)));
    }
}
