use super::{
    Condition, Conditions, Edge, Health, Journal, Latch, Link, MotorName, TargetError, Timeouts,
};
use crate::time::{Duration, Instant};

/// Decides whether one motor may be driven: for motors that do not belong to a family of this crate.
///
/// It keeps the rules that all motors here have in common, so that an own motor has them too: nothing before it is
/// armed; feedback that is late or lost, a target that is old, NaN or infinite, and time that stands or goes back give
/// zero; an emergency stop stays until it is cleared and armed. Times do not wrap.
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
    /// How often in a row the time of a tick was that of the one before.
    stands: u8,
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
            stands: 0,
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
        if now < self.now {
            // Ages cannot be told any more.
            self.reversals = self.reversals.saturating_add(1);
            self.heard = self.heard.map(|heard| heard.min(now));
            if self.commanded.is_some() {
                self.note(Condition::CommandLost, true, now);
            }
            self.lose();
        }
        // Ages stand as well then; one repetition is that of a tick in which it was armed.
        self.stands = if now == self.now { self.stands.saturating_add(1) } else { 0 };
        self.now = now;
        self.age(now);
        if let Some(commanded) = self.commanded {
            if now.since(commanded) > self.timeouts.command() {
                self.commanded = None;
                self.forgotten_targets = self.forgotten_targets.saturating_add(1);
                self.note(Condition::CommandLost, true, now);
            }
        }
        self.is_armed() && self.link == Link::Online && self.has_target() && self.stands < 2
    }

    fn age(&mut self, now: Instant) {
        if !self.listens {
            return;
        }
        let Some(heard) = self.heard else { return };
        let age = now.since(heard);
        let ahead = heard.since(now) > self.timeouts.late();
        if age > self.timeouts.offline().max(self.timeouts.late()) {
            self.lose();
        } else if (ahead || age > self.timeouts.late()) && self.link == Link::Online {
            self.link = Link::Late;
            self.note(Condition::Late, true, now);
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

    /// Takes the target away and refuses others until it is engaged again: a fault.
    pub const fn relax_until_armed(&mut self) {
        self.latched = true;
        self.commanded = None;
    }

    /// Says whether a condition of the motor holds. A change is an edge, and waits to be read.
    ///
    /// Late and lost feedback and old targets are noted by the guard itself.
    pub fn note(&mut self, condition: Condition, holds: bool, now: Instant) {
        self.look(now, |latch| latch.set(condition, holds));
    }

    /// Lets conditions change.
    pub(super) fn look<T>(&mut self, now: Instant, look: impl FnOnce(&mut Latch) -> T) -> T {
        let before = self.latch;
        let seen = look(&mut self.latch);
        self.journal.note(0, &before, &self.latch, now);
        seen
    }

    /// Returns what is wrong with the motor.
    #[must_use]
    pub const fn conditions(&self) -> Conditions {
        self.latch.active()
    }

    /// Returns the oldest change of a condition that was not read yet; the guard does not know its motor's name.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::motor::{Condition, Guard, MotorName};
    /// use drivetrain::time::Instant;
    ///
    /// let at_ms = |ms: u64| Instant::from_micros(ms * 1_000);
    /// let mut guard = Guard::new();
    /// guard.hear(at_ms(1));
    /// assert!(!guard.drives(at_ms(12)));
    /// let edge = guard.next_edge(MotorName::new("mine", 1)).ok_or("none")?;
    /// assert_eq!((edge.condition, edge.began), (Condition::Late, true));
    /// assert_eq!(guard.next_edge(MotorName::new("mine", 1)), None);
    /// # Ok::<(), &str>(())
    /// ```
    pub fn next_edge(&mut self, motor: MotorName) -> Option<Edge> {
        while let Some(entry) = self.journal.pop() {
            if self.latch.take(entry.condition, entry.began) {
                let at = self.journal.time_of(&entry, self.now);
                let (condition, began) = (entry.condition, entry.began);
                return Some(Edge { motor, condition, began, at });
            }
        }
        let (condition, began) = self.latch.next()?;
        self.latch.take(condition, began);
        Some(Edge { motor, condition, began, at: self.journal.last_time(self.now) })
    }

    /// Returns what the guard knows of a motor's health.
    pub(crate) const fn health(&self, motor: MotorName) -> Health {
        Health {
            motor,
            link: self.link,
            armed: self.is_armed(),
            conditions: self.conditions(),
            feedback_hz: 0,
            longest_gap: Duration::ZERO,
            temperature_c: None,
            error_code: 0,
            saturated: 0,
            refused_targets: self.refused_targets,
            forgotten_targets: self.forgotten_targets,
            ambiguous_gaps: 0,
        }
    }

    /// Returns when the change that [`next_edge`](Self::next_edge) returns next was noted: to read several motors in order.
    pub(crate) fn next_edge_at(&self) -> Option<Instant> {
        self.latch.next()?;
        Some(self.journal.first_time(self.now).unwrap_or_else(|| self.journal.last_time(self.now)))
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

    /// Lets targets through from now on, starting from none, if the motor is heard; one that takes them already goes
    /// on undisturbed. Without effect while stopped. Returns whether it starts.
    pub fn engage(&mut self, now: Instant) -> bool {
        if self.stopped || self.is_armed() || self.is_missing(now) {
            return false;
        }
        self.now = self.now.max(now);
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

    /// Disarms, and stays so until it is cleared and engaged.
    pub const fn emergency_stop(&mut self) {
        self.disarm();
        self.stopped = true;
    }

    /// Takes the emergency stop back; the motor stays disarmed.
    pub const fn clear_emergency_stop(&mut self) {
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

    /// Returns how often time went back, saturating.
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
        guard.engage(at_ms(139));
        assert_eq!(guard.admit(true), Ok(()));
        assert!(guard.drives(at_ms(140)));
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
    fn time_that_stands_still_is_never_fresh_for_ever() {
        for mut guard in [driving(), Guard { listens: false, ..driving() }] {
            assert!(guard.drives(at_ms(1)), "the tick in which it was armed");
            assert!(!guard.drives(at_ms(1)) && !guard.drives(at_ms(1)));
            assert!(guard.has_target() && guard.drives(at_ms(2)), "it ends by itself");
        }
    }

    #[test]
    fn time_that_goes_back_is_an_edge_for_a_motor_that_is_not_heard_too() {
        let mut guard = Guard { listens: false, ..driving() };
        assert!(guard.drives(at_ms(5)) && !guard.drives(at_ms(4)));
        let edge = guard.next_edge(MotorName::new("fan", 1)).unwrap();
        assert_eq!((edge.condition, edge.began), (Condition::CommandLost, true));
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
