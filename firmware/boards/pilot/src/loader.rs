//! The loader of a shooter: a wheel with pockets, which feeds, and frees itself from a jam.

use drivetrain::time::{Duration, Instant};
use drivetrain::units::{AngularVelocity, Current};

/// Eight pockets: eight shots a second.
const FEED: AngularVelocity = AngularVelocity::from_rpm(60.0);
const BACK: AngularVelocity = AngularVelocity::from_rpm(-60.0);
/// A wheel that is slower than this is jammed if it also takes this current, for this time.
const SLOW: AngularVelocity = AngularVelocity::from_rpm(6.0);
const JAM: Current = Current::from_amperes(4.0);
const JAM_AFTER: Duration = Duration::from_millis(120);
const BACK_FOR: Duration = Duration::from_millis(100);
/// A wheel that fed for so long since its last jam is free.
const FREE_AFTER: Duration = Duration::from_millis(500);
const TRIES: u8 = 3;

#[derive(Debug, Clone, Copy, PartialEq)]
enum State {
    Rests,
    /// Since when it feeds, and since when it stands though it is driven.
    Feeds(Instant, Option<Instant>),
    /// Until when.
    TurnsBack(Instant),
    /// Until the trigger is let go.
    GaveUp,
}

/// Feeds while the trigger is held. Three jams in a row, and it rests until the trigger is let go.
#[derive(Debug)]
pub struct Loader {
    state: State,
    jams: u8,
}

impl Loader {
    /// Rests.
    pub const fn new() -> Self {
        Self { state: State::Rests, jams: 0 }
    }

    /// Tells whether it gave up.
    pub fn is_jammed(&self) -> bool {
        self.state == State::GaveUp
    }

    /// Returns how fast the wheel is to turn; `None` if its motor is to take no current. `velocity` and `current` are those of
    /// the motor, forward positive.
    ///
    /// A wheel at rest is braked while it turns, and takes no current as soon as it stands: a speed of zero would keep up the
    /// current with which the speed loop pushed against a jam.
    pub fn update(
        &mut self,
        is_wanted: bool,
        velocity: AngularVelocity,
        current: Current,
        now: Instant,
    ) -> Option<AngularVelocity> {
        self.state = match self.state {
            _ if !is_wanted => {
                self.jams = 0;
                State::Rests
            }
            State::Rests => State::Feeds(now, None),
            State::Feeds(since, slow) => {
                if now.since(since) >= FREE_AFTER {
                    self.jams = 0;
                }
                let stands = velocity.as_rad_per_s() < SLOW.as_rad_per_s()
                    && current.as_amperes() > JAM.as_amperes();
                match slow.filter(|_| stands) {
                    Some(slow) if now.since(slow) >= JAM_AFTER => {
                        self.jams += 1;
                        if self.jams >= TRIES {
                            State::GaveUp
                        } else {
                            State::TurnsBack(now + BACK_FOR)
                        }
                    }
                    slow => State::Feeds(since, slow.or(stands.then_some(now))),
                }
            }
            State::TurnsBack(until) if now >= until => State::Feeds(now, None),
            as_before => as_before,
        };
        match self.state {
            State::Feeds(..) => Some(FEED),
            State::TurnsBack(_) => Some(BACK),
            State::Rests | State::GaveUp => {
                let turns = velocity.as_rad_per_s().abs() >= SLOW.as_rad_per_s();
                turns.then_some(AngularVelocity::ZERO)
            }
        }
    }
}

impl Default for Loader {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What it asks for in each of so many milliseconds, in rpm, of a wheel that stands and takes so much current.
    fn asks(
        loader: &mut Loader,
        from_ms: u64,
        count: u64,
        is_wanted: bool,
        amperes: f32,
    ) -> Vec<Option<f32>> {
        let mut ask = |ms| {
            let now = Instant::START + Duration::from_millis(ms);
            let current = Current::from_amperes(amperes);
            let asked = loader.update(is_wanted, AngularVelocity::ZERO, current, now);
            asked.map(|velocity| velocity.as_rpm().round())
        };
        (from_ms..from_ms + count).map(&mut ask).collect()
    }

    #[test]
    fn a_blocked_wheel_turns_back_twice_and_then_rests_until_the_trigger_is_let_go() {
        let mut loader = Loader::new();
        let asked = asks(&mut loader, 0, 1_000, true, 9.0);
        let turned = asked.windows(2).filter(|pair| *pair == [Some(60.0), Some(-60.0)]).count();
        assert_eq!((turned, asked.last(), loader.is_jammed()), (2, Some(&None), true));
        assert_eq!(asks(&mut loader, 1_000, 500, true, 0.0).last(), Some(&None));
        asks(&mut loader, 1_500, 1, false, 0.0);
        assert_eq!(asks(&mut loader, 1_501, 2, true, 0.0).last(), Some(&Some(60.0)));
    }

    #[test]
    fn a_wheel_that_is_let_go_is_braked_until_it_stands_and_takes_no_current_then() {
        let mut loader = Loader::new();
        let mut asked = |is_wanted, rpm, ms| {
            let (velocity, now) =
                (AngularVelocity::from_rpm(rpm), Instant::START + Duration::from_millis(ms));
            loader.update(is_wanted, velocity, Current::ZERO, now)
        };
        assert_eq!(asked(true, 0.0, 1), Some(FEED));
        assert_eq!(asked(false, 50.0, 2), Some(AngularVelocity::ZERO));
        assert_eq!(asked(false, -7.0, 3), Some(AngularVelocity::ZERO));
        assert_eq!(asked(false, 5.0, 4), None);
    }

    #[test]
    fn a_wheel_that_starts_or_takes_little_current_is_not_jammed() {
        let mut loader = Loader::new();
        assert!(asks(&mut loader, 0, 100, true, 9.0).iter().all(|rpm| *rpm == Some(60.0)));
        assert!(asks(&mut loader, 100, 2_000, true, 1.0).iter().all(|rpm| *rpm == Some(60.0)));
    }
}
