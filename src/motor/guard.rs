use super::gesture::Gesture;
use super::opening::{OPENING, Opening};
use super::progress::Progress;
use super::{Condition, Journal, Latch, Link, TargetError, Timeouts};
use crate::time::{Duration, Instant};

mod edges;

/// Decides whether one motor may be driven: for motors that do not belong to a family of this crate.
///
/// The rules of all motors of this crate, for one motor of your own:
///
/// * Nothing moves before the motor is armed. After a trip, arming needs a request that nobody made for 100 ms before.
/// * Late or lost feedback, and a target that is old, NaN or infinite, give zero.
/// * An update that does not lie after the one before gives zero in that cycle, and trips.
/// * The output range [opens](Self::share) from zero after arming.
/// * An emergency stop stays until it is cleared, and the motor armed.
///
/// ```text
/// feedback ──> hear(now)          target ──> admit(is_finite)?
///                                 tick   ──> drives(now)?  then its output, otherwise zero and loops reset
/// ```
///
/// # Examples
/// ```
/// use drivetrain::motor::{Guard, TargetError};
/// use drivetrain::time::Instant;
///
/// let at_ms = |ms: u64| Instant::from_micros(ms * 1_000);
/// let mut guard = Guard::new();
/// assert_eq!(guard.admit(true), Err(TargetError::Disarmed));
/// guard.hear(at_ms(1));
/// guard.engage(at_ms(1));
/// assert_eq!(guard.admit(true), Ok(()));
/// assert!(guard.drives(at_ms(11))); // heard 10 ms ago
/// assert!(!guard.drives(at_ms(12))); // late: zero, until it is heard again
/// ```
#[derive(Debug, Clone, Copy)]
pub struct Guard {
    timeouts: Timeouts,
    now: Instant,
    progress: Progress,
    gesture: Gesture,
    opening: Opening,
    heard: Option<Instant>,
    commanded: Option<Instant>,
    link: Link,
    good_frames: u8,
    listens: bool,
    armed: bool,
    latched: bool,
    stopped: bool,
    refused_targets: u16,
    forgotten_targets: u16,
    reversals: u16,
    latch: Latch,
    journal: Journal<6>,
}

impl Guard {
    /// Makes one for a motor with feedback: disarmed, not heard.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            timeouts: Timeouts::new(),
            now: Instant::START,
            progress: Progress::NEW,
            gesture: Gesture::NEW,
            opening: Opening::new(OPENING),
            heard: None,
            commanded: None,
            link: Link::Unheard,
            good_frames: 0,
            listens: true,
            armed: false,
            latched: false,
            stopped: false,
            refused_targets: 0,
            forgotten_targets: 0,
            reversals: 0,
            latch: Latch::NONE,
            journal: Journal::EMPTY,
        }
    }

    /// Makes one for a motor that reports nothing, such as a servo: it counts as heard.
    #[must_use]
    pub const fn without_feedback() -> Self {
        Self { listens: false, link: Link::Online, ..Self::new() }
    }

    /// Sets when feedback and commands count as lost.
    #[must_use]
    pub const fn with_timeouts(self, timeouts: Timeouts) -> Self {
        Self { timeouts, ..self }
    }

    /// Sets the time in which the output range opens after arming, from zero to the whole; 0.2 s at first.
    #[must_use]
    pub const fn with_opening(self, time: Duration) -> Self {
        Self { opening: Opening::new(time), ..self }
    }

    /// Notes valid feedback that arrived at `now`.
    pub fn hear(&mut self, now: Instant) {
        let in_a_row = self.heard.is_some_and(|heard| now.since(heard) <= self.timeouts.late());
        self.heard = Some(self.heard.map_or(now, |heard| heard.max(now)));
        self.link = match self.link {
            Link::Unheard | Link::Online | Link::Late => Link::Online,
            Link::Offline | Link::Recovering => {
                let before =
                    if self.link == Link::Recovering && in_a_row { self.good_frames } else { 0 };
                self.good_frames = before.saturating_add(1);
                let enough = self.good_frames >= self.timeouts.good_frames();
                if enough { Link::Online } else { Link::Recovering }
            }
        };
        if self.link == Link::Online {
            self.note(Condition::Late, false, now);
            self.note(Condition::Offline, false, now);
        }
    }

    /// Tells whether a new target may be taken, and notes its time when it is.
    ///
    /// # Errors
    /// Says why not. A target that is not finite is counted. It takes the present one away, as does any that comes without
    /// fresh feedback: an older target must not act in the place of a newer one when the feedback is back.
    pub fn admit(&mut self, is_finite: bool) -> Result<(), TargetError> {
        if !is_finite {
            self.refused_targets = self.refused_targets.saturating_add(1);
            self.commanded = None;
            return Err(TargetError::NotFinite);
        }
        if !self.armed {
            return Err(TargetError::Disarmed);
        }
        if self.latched {
            return Err(TargetError::Relaxed);
        }
        if !matches!(self.link, Link::Online) {
            self.commanded = None;
            return Err(TargetError::NoFeedback);
        }
        self.commanded = Some(self.now);
        self.note(Condition::CommandLost, false, self.now);
        Ok(())
    }

    /// Moves the time on to that of a tick and tells whether the motor may be driven in it. When it may not, send
    /// zero; when [`has_target`](Self::has_target) is `false` as well, reset the loops.
    #[must_use]
    pub fn drives(&mut self, now: Instant) -> bool {
        if let Some(step) = self.progress.advance(now) {
            self.gesture.pass(Some(step));
            self.note(Condition::ClockFault, false, now);
        } else {
            self.lose_time(now);
        }
        self.now = now;
        self.age(now);
        if let Some(commanded) = self.commanded {
            if now.since(commanded) > self.timeouts.command() {
                self.commanded = None;
                self.forgotten_targets = self.forgotten_targets.saturating_add(1);
                self.note(Condition::CommandLost, true, now);
            }
        }
        self.is_armed() && self.link == Link::Online && self.has_target()
    }

    /// Returns the share of the output range that is open, 0 to 1: it rises from zero after arming.
    pub fn share(&mut self) -> f32 {
        self.opening.share(self.now)
    }

    /// Closes the output range, which opens from now on: the drive did not follow before.
    pub(super) const fn reopen(&mut self) {
        self.opening.begin(self.now);
    }

    /// Time did not move on, so that no age is known: feedback counts as late until the next one, and the motor trips.
    pub(crate) fn lose_time(&mut self, now: Instant) {
        self.note(Condition::ClockFault, true, now);
        self.gesture.pass(None);
        self.reversals = self.reversals.saturating_add(1);
        self.heard = self.heard.map(|heard| heard.min(now));
        self.now = now;
        if self.listens && self.link == Link::Online {
            self.set_late(now);
        }
        self.relax_until_armed();
    }

    fn set_late(&mut self, now: Instant) {
        self.link = Link::Late;
        self.note(Condition::Late, true, now);
    }

    fn age(&mut self, now: Instant) {
        if !self.listens {
            return;
        }
        let Some(heard) = self.heard else { return };
        let age = now.since(heard);
        let ahead = heard.since(now) > self.timeouts.late();
        if age > self.timeouts.offline() {
            self.lose();
        } else if (ahead || age > self.timeouts.late()) && self.link == Link::Online {
            self.set_late(now);
        }
    }

    /// Takes the motor for lost: relaxed, and latched until it is armed again.
    fn lose(&mut self) {
        if matches!(self.link, Link::Online | Link::Late | Link::Recovering) && self.listens {
            self.link = Link::Offline;
            self.note(Condition::Late, true, self.now);
            self.note(Condition::Offline, true, self.now);
        }
        self.relax_until_armed();
    }

    /// Trips: takes the target away and refuses others until the motor is armed again.
    pub const fn relax_until_armed(&mut self) {
        if self.is_armed() {
            self.gesture.trip();
        }
        self.latched = true;
        self.commanded = None;
    }

    /// Tells whether there is a target that still counts.
    #[must_use]
    pub const fn has_target(&self) -> bool {
        self.commanded.is_some()
    }

    /// Takes the target away.
    pub const fn relax(&mut self) {
        self.commanded = None;
    }

    /// Tells whether feedback is missing for arming at `now`.
    #[must_use]
    pub fn is_missing(&self, now: Instant) -> bool {
        let late = self.timeouts.late();
        let fresh = |heard: Instant| now.since(heard) <= late && heard.since(now) <= late;
        self.listens && !(self.link == Link::Online && self.heard.is_some_and(fresh))
    }

    /// Takes a request to arm; `false` if it does not count: after a trip, when another request or the trip lies less than
    /// 100 ms back. A request that is repeated in each tick never counts. The 100 ms are those of [updates](Self::drives); one
    /// counts for no more than 20 ms.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::motor::Guard;
    /// use drivetrain::time::Instant;
    ///
    /// let at_ms = |ms: u64| Instant::from_micros(ms * 1_000);
    /// let mut guard = Guard::new();
    /// guard.hear(at_ms(1));
    /// assert!(guard.ask() && guard.engage(at_ms(1)));
    /// guard.relax_until_armed(); // a fault
    /// for ms in 1..=150 {
    ///     guard.hear(at_ms(ms));
    ///     assert!(!guard.drives(at_ms(ms)));
    ///     if ms == 50 {
    ///         assert!(!guard.ask() && !guard.engage(at_ms(ms))); // too soon: ask again 100 ms later
    ///     }
    /// }
    /// assert!(guard.ask() && guard.engage(at_ms(150)));
    /// ```
    pub const fn ask(&mut self) -> bool {
        self.gesture.ask()
    }

    /// Lets targets through from now on, starting from none, if the motor is heard and, after a trip, the last request
    /// [counts](Self::ask). A motor that takes targets already goes on undisturbed. Without effect while stopped. Returns
    /// whether it starts.
    pub fn engage(&mut self, now: Instant) -> bool {
        if self.stopped || self.is_armed() || self.is_missing(now) || !self.gesture.take() {
            return false;
        }
        self.now = self.now.max(now);
        self.progress.begin(now);
        self.opening.begin(now);
        self.note(Condition::CommandLost, false, self.now);
        self.commanded = None;
        self.latched = false;
        self.armed = true;
        true
    }

    /// Refuses targets until it is engaged again.
    pub const fn disarm(&mut self) {
        self.armed = false;
        self.commanded = None;
    }

    /// Disarms, and requires a new request to arm.
    pub const fn trip(&mut self) {
        self.disarm();
        self.gesture.trip();
    }

    /// Trips, and stays so until it is cleared and armed.
    pub const fn emergency_stop(&mut self) {
        if !self.stopped {
            self.trip();
        }
        self.stopped = true;
    }

    /// Takes the emergency stop back; the motor stays disarmed.
    pub const fn clear_emergency_stop(&mut self) {
        if self.stopped {
            self.gesture.trip();
        }
        self.stopped = false;
    }

    /// Tells whether targets are taken: armed, and not relaxed by a fault since.
    #[must_use]
    pub const fn is_armed(&self) -> bool {
        self.armed && !self.latched
    }

    /// Tells whether the emergency stop is set.
    #[must_use]
    pub const fn is_stopped(&self) -> bool {
        self.stopped
    }

    /// Returns whether the motor is heard.
    #[must_use]
    pub const fn link(&self) -> Link {
        self.link
    }

    /// Returns how often a target was NaN or infinite, saturating.
    #[must_use]
    pub const fn refused_targets(&self) -> u16 {
        self.refused_targets
    }

    /// Returns how often no target came in time, saturating.
    #[must_use]
    pub const fn forgotten_targets(&self) -> u16 {
        self.forgotten_targets
    }

    /// Returns how often an update did not lie after the one before, saturating.
    #[must_use]
    pub const fn reversals(&self) -> u16 {
        self.reversals
    }
}

impl Default for Guard {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motor::MotorName;

    fn at_ms(ms: u64) -> Instant {
        Instant::START + Duration::from_millis(ms)
    }

    fn driving() -> Guard {
        let mut guard = Guard::new();
        guard.hear(at_ms(1));
        guard.engage(at_ms(1));
        guard.admit(true).unwrap();
        guard
    }

    #[test]
    fn an_offline_motor_needs_ten_frames_in_a_row_and_arming() {
        let mut guard = driving();
        assert!(!guard.drives(at_ms(102)));
        assert_eq!((guard.link(), guard.admit(true)), (Link::Offline, Err(TargetError::Relaxed)));
        for ms in (103..112).chain(130..139) {
            guard.hear(at_ms(ms));
            assert!(guard.link() == Link::Recovering && guard.is_missing(at_ms(ms)), "{ms}");
        }
        guard.hear(at_ms(139));
        assert_eq!((guard.link(), guard.admit(true)), (Link::Online, Err(TargetError::Relaxed)));
        assert!(!guard.ask() && !guard.engage(at_ms(139)), "no update since the trip");
        for ms in 140..240 {
            guard.hear(at_ms(ms));
            assert!(!guard.drives(at_ms(ms)));
        }
        assert!(guard.ask() && guard.engage(at_ms(239)));
        assert_eq!(guard.admit(true), Ok(()));
        assert!(guard.drives(at_ms(240)));
    }

    #[test]
    fn targets_grow_old_are_counted_and_can_be_set_again() {
        let mut guard = driving();
        for ms in 2..=110 {
            guard.hear(at_ms(ms));
            assert_eq!(guard.drives(at_ms(ms)), ms <= 101, "{ms}");
        }
        assert_eq!((guard.forgotten_targets(), guard.has_target()), (1, false));
        assert_eq!(guard.admit(false), Err(TargetError::NotFinite));
        assert_eq!((guard.refused_targets(), guard.admit(true)), (1, Ok(())));
    }

    #[test]
    fn time_that_goes_back_is_never_fresh_for_ever() {
        for mut guard in [driving(), Guard { listens: false, ..driving() }] {
            assert!(guard.drives(at_ms(5)));
            assert!(!guard.drives(at_ms(4)));
            assert_eq!((guard.reversals(), guard.admit(true)), (1, Err(TargetError::Relaxed)));
        }
    }

    #[test]
    fn time_that_stands_still_trips() {
        for mut guard in [driving(), Guard { listens: false, ..driving() }] {
            assert!(guard.drives(at_ms(1)), "the tick in which it was armed");
            assert!(!guard.drives(at_ms(1)) && !guard.is_armed() && !guard.has_target());
            guard.hear(at_ms(2));
            assert!(!guard.ask() && !guard.engage(at_ms(2)) && !guard.drives(at_ms(2)));
        }
    }

    #[test]
    fn an_update_before_the_arming_trips() {
        let mut guard = driving();
        assert!(!guard.drives(Instant::from_micros(999)) && !guard.is_armed());
    }

    #[test]
    fn time_that_goes_back_is_an_edge_for_a_motor_that_is_not_heard_too() {
        let mut guard = Guard { listens: false, ..driving() };
        assert!(guard.drives(at_ms(5)) && !guard.drives(at_ms(4)));
        let edge = guard.next_edge(MotorName::new("fan", 1)).unwrap();
        assert_eq!((edge.condition, edge.began), (Condition::ClockFault, true));
    }

    #[test]
    fn a_stamp_a_little_ahead_is_fresh_and_one_far_ahead_is_not() {
        let mut guard = driving();
        guard.hear(at_ms(20));
        assert!(guard.drives(at_ms(12)) && !guard.drives(at_ms(9)));
        let mut guard = driving();
        guard.hear(at_ms(1_000));
        assert!(guard.is_missing(at_ms(2)) && !guard.drives(at_ms(2)));
    }

    #[test]
    fn an_emergency_stop_outlasts_engaging() {
        let mut guard = driving();
        guard.emergency_stop();
        guard.engage(at_ms(2));
        assert!(!guard.is_armed() && guard.is_stopped() && !guard.drives(at_ms(2)));
        guard.clear_emergency_stop();
        assert_eq!(guard.admit(true), Err(TargetError::Disarmed));
    }

    #[test]
    fn a_hundred_thousand_silences_end_with_the_first_tick_after_the_limit() {
        let mut state = 1_u64;
        let mut below = |limit: u64| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (state >> 33) % limit
        };
        for _ in 0..100_000 {
            let (mut guard, heard) = (Guard::new(), below(1_000_000_000));
            guard.hear(Instant::from_micros(heard));
            assert!(guard.engage(Instant::from_micros(heard)));
            let (mut now, mut drives) = (heard, true);
            while drives {
                _ = guard.admit(true);
                now += 800 + below(400);
                drives = guard.drives(Instant::from_micros(now));
                assert_eq!(drives, now <= heard + 10_000, "heard at {heard}, now {now}");
            }
        }
    }
}
