//! Rules of a motor that is a device by itself, and feedback of a motor and of a joint of `snake`.

use super::safety::{DeviceGuard, Guarded, Hold, MotorGuard, OPENING, Output, Rest};
use super::{age, is_near};
use crate::motor::{Condition, Link, TargetError, Timeouts};
use crate::time::{Duration, Instant};

/// Decides whether one motor of your own may be driven, by the rules of all motors of this crate:
///
/// * Before arming, the output is zero. After a trip, a request to arm counts only after 100 ms without a request.
/// * Late or lost feedback, and a target that is old, NaN or infinite, give zero.
/// * An update without a later time than the update before gives zero in that cycle, and trips.
/// * The output range [opens](Self::share) from zero after arming.
/// * An emergency stop stays until cleared; the motor must then be armed again.
///
/// ```text
/// feedback ──> hear(now)          target ──> admit(is_finite)?
///                                 tick   ──> drives(now)?  then its output, otherwise zero
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
    pub(super) device: DeviceGuard<6>,
    pub(super) motor: MotorGuard,
}

impl Guard {
    /// Makes a guard for a motor with feedback: disarmed, unheard.
    #[must_use]
    pub const fn new() -> Self {
        Self { device: DeviceGuard::NEW, motor: MotorGuard::NEW }.with_opening(OPENING)
    }

    /// Makes a guard for a motor without feedback, such as a servo: the motor counts as online.
    #[must_use]
    pub const fn without_feedback() -> Self {
        Self { device: DeviceGuard::NEW, motor: MotorGuard::DEAF }.with_opening(OPENING)
    }

    /// Sets the ages at which feedback and commands count as lost.
    #[must_use]
    pub const fn with_timeouts(mut self, timeouts: Timeouts) -> Self {
        self.device.set_timeouts(timeouts);
        self.motor.trust(0);
        self
    }

    /// Sets the time in which the output range opens after arming, from zero to the whole: 0.2 s by default, in whole ms up to 65 s.
    #[must_use]
    pub const fn with_opening(self, time: Duration) -> Self {
        Self { motor: self.motor.with(time, false), ..self }
    }

    /// Notes valid feedback received at `now`.
    #[inline]
    pub fn hear(&mut self, now: Instant) {
        let is_usual = self.device.is_running()
            && self.motor.hear_soon(now.stamp(), self.device.now(), self.device.timeouts());
        if !is_usual {
            self.hear_anytime(now);
        }
    }

    /// Notes feedback after a gap of any length.
    #[cold]
    #[inline(never)]
    fn hear_anytime(&mut self, now: Instant) {
        self.device.hear_first(core::slice::from_mut(&mut self.motor), now);
        self.device.hear(&mut self.motor, 0, now, |_| {});
    }

    /// Returns the time since the last feedback in µs; `None` before the first.
    #[inline]
    pub(crate) fn gap_us(&self, now: Instant) -> Option<u32> {
        let is_heard = self.motor.link() != Link::Unheard;
        is_heard.then(|| age(now.stamp(), self.motor.heard))
    }

    /// Notes that the angle counts from an unknown zero, and [trips](Self::relax_until_armed).
    pub(crate) fn lose_zero(&mut self, now: Instant) {
        self.change(now, MotorGuard::lose_zero);
    }

    /// Notes a command of the motor by another node.
    pub(super) fn hear_rival(&mut self, now: Instant, change: impl FnOnce(&mut MotorGuard)) {
        let Self { device, motor } = self;
        device.hear_rival(now, |device| device.change(motor, 0, now, change));
    }

    /// Changes the motor, and notes the consequences.
    pub(crate) fn change<T>(
        &mut self,
        now: Instant,
        change: impl FnOnce(&mut MotorGuard) -> T,
    ) -> T {
        self.device.change(&mut self.motor, 0, now, change)
    }

    /// Tells whether a new target may be taken. If so, notes its time.
    ///
    /// # Errors
    /// Names the reason. A target that is not finite is counted. Such a target, or any target without fresh feedback, also cancels the
    /// present one: an older target must not act in place of a newer one when the feedback returns.
    #[inline]
    pub fn admit(&mut self, is_finite: bool) -> Result<(), TargetError> {
        self.motor.admit(is_finite)?;
        self.device.take_target(&mut self.motor);
        Ok(())
    }

    /// Refuses a target from a zero that is not known, which is `None`, and discards the target before.
    pub(crate) fn require_zero<T>(&mut self, target: Option<T>) -> Result<T, TargetError> {
        self.motor.require_zero(target)
    }

    /// Moves the time on to a tick and tells whether the motor may be driven in this tick. If not, send zero. If
    /// [`has_target`](Self::has_target) is `false` as well, reset the loops. If the [`link`](Self::link) is late, the loops may keep their integral, as
    /// loops of `dji` and `pwm::Brushed` do.
    #[must_use]
    #[inline]
    pub fn drives(&mut self, now: Instant) -> bool {
        self.pass(now, true).is_none() && self.motor.drives()
    }

    /// Moves the time on to a tick and applies all due time-outs. Returns the [`Hold`] of an update without a usable time or step.
    #[inline]
    pub(crate) fn pass(&mut self, now: Instant, has_step: bool) -> Option<Hold> {
        let before = self.device.begin(now);
        if has_step && self.device.is_quiet(before, now) {
            return None;
        }
        self.compare_ages(before, now, has_step)
    }

    /// Applies all due time-outs, and computes the time of the next.
    #[cold]
    #[inline(never)]
    fn compare_ages(&mut self, before: Instant, now: Instant, has_step: bool) -> Option<Hold> {
        let motors = core::slice::from_mut(&mut self.motor);
        let held = self.device.pass(motors, before, has_step, u32::MAX);
        if held.is_some() {
            return held;
        }
        // The range of a motor that is not driven must be open before its stamp repeats.
        self.motor.share(now.stamp());
        if !self.motor.latch.active().is_empty() {
            let is_alone = self.device.is_alone();
            self.change(now, |motor| motor.latch.end_what_is_over(motor.has_target(), is_alone));
        }
        if self.motor.latch.has(Condition::SecondMaster) {
            self.device.wake_at(now);
        }
        None
    }

    /// Tells what the tick does, after [`pass`](Self::pass) and the health.
    #[inline]
    pub(crate) fn output(&self, held: Option<Hold>) -> Output {
        self.motor.output(held)
    }

    /// Ends the rest, as the loops run, and returns its kind.
    pub(crate) const fn end_rest(&mut self) -> Rest {
        self.motor.end_rest()
    }

    /// Returns the open share of the output range, 0 to 1; the share rises from zero after arming.
    pub fn share(&mut self) -> f32 {
        self.motor.share(self.device.now())
    }

    /// Returns the ends of the available output, as shares of the full output from -1 to 1, of which the conditions leave so much.
    pub(crate) fn range(&mut self, left: f32) -> (f32, f32) {
        self.motor.range(left, (false, false), self.device.now())
    }

    /// Closes the output range and opens it from now on: the drive did not follow before.
    pub(super) const fn reopen(&mut self) {
        self.motor.open(self.device.now());
    }

    /// Trips an armed motor, for a fault of its drive: discards the target and refuses others until the motor is armed again.
    pub fn relax_until_armed(&mut self) {
        self.change(self.device.updated(), MotorGuard::trip);
    }

    /// Tells whether the motor has a target that is not expired.
    #[must_use]
    pub const fn has_target(&self) -> bool {
        self.motor.has_target()
    }

    /// Discards the target.
    pub const fn relax(&mut self) {
        self.motor.relax();
    }

    /// Tells whether feedback is missing for arming at `now`. Once the motor has run or was heard, also `true` if `now` lies more than
    /// a minute from the last update.
    #[must_use]
    pub fn is_missing(&self, now: Instant) -> bool {
        self.device.misses(&self.motor, now)
    }

    /// Takes a request to arm. Returns `false` if the request does not count: after a trip, if another request or the trip lies less than
    /// 100 ms back. A request repeated in each tick never counts. The 100 ms consist of [updates](Self::drives), each of which counts for
    /// at most 20 ms.
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
        self.device.ask()
    }

    /// Arms at the time `now`: allows targets, beginning without one, unless feedback is [missing](Self::is_missing), or a trip waits for a request that
    /// [counts](Self::ask). A motor that is armed already keeps its target. Targets set before the next update have the time `now`; an update before `now` trips. While
    /// stopped, `engage` has no effect. Returns whether the motor was armed.
    pub fn engage(&mut self, now: Instant) -> bool {
        let motors = core::slice::from_mut(&mut self.motor);
        self.device.engage(motors, now, |_, _| true, |_| {})
    }

    /// Refuses targets until engaged again.
    pub const fn disarm(&mut self) {
        self.motor.disarm();
    }

    /// Disarms, and begins the pause before the next request to arm, also if the motor was not armed: for a fault outside of the motor, such as a lost bus.
    pub const fn trip(&mut self) {
        self.motor.disarm();
        self.device.trip();
    }

    /// Sets the emergency stop: disarms, and stays so until cleared and armed.
    pub const fn emergency_stop(&mut self) {
        if self.device.set_stop(true) {
            self.motor.disarm();
        }
    }

    /// Clears the emergency stop; the motor stays disarmed.
    pub const fn clear_emergency_stop(&mut self) {
        self.device.set_stop(false);
    }

    /// Tells whether targets are taken: armed, and not relaxed by a fault since.
    #[must_use]
    pub const fn is_armed(&self) -> bool {
        self.motor.is_armed()
    }

    /// Tells whether the emergency stop is set.
    #[must_use]
    pub const fn is_stopped(&self) -> bool {
        self.device.is_stopped()
    }

    /// Returns the state of the link.
    #[must_use]
    pub const fn link(&self) -> Link {
        self.motor.link()
    }

    /// Returns the number of NaN or infinite targets, saturating.
    #[must_use]
    pub const fn refused_targets(&self) -> u16 {
        self.motor.refused_targets
    }

    /// Returns the number of expired targets, saturating.
    #[must_use]
    pub const fn forgotten_targets(&self) -> u16 {
        self.motor.forgotten_targets
    }
}

impl Default for Guard {
    fn default() -> Self {
        Self::new()
    }
}

/// Targets, measurements and feedback of the motors of a device.
impl<const N: usize> DeviceGuard<N> {
    /// Sets the target of a motor. After an expired target, the next update ends that condition.
    #[inline]
    pub(crate) const fn take_target(&mut self, motor: &mut MotorGuard) {
        if !motor.has_target() {
            self.disturb();
        }
        motor.take_target(self.now());
    }

    /// Returns the stamp of a target measured by another sensor, which expires sooner than others; `None` if measured too long ago, or too
    /// far ahead.
    pub(crate) fn stamp_of_measurement(&self, at: Instant) -> Option<u32> {
        let (now, measured_us) = (self.now(), self.timeouts().measured_us());
        // A 32-bit stamp alone would be fresh again every 71 minutes.
        let is_fresh = !self.is_far(at) && is_near(now, at.stamp(), measured_us);
        let stamp = at.stamp().wrapping_add(measured_us).wrapping_sub(self.timeouts().command_us());
        // A stamp ahead has no age.
        is_fresh.then_some(if age(now, stamp) == 0 { now } else { stamp })
    }

    /// Notes feedback of a motor after a gap of any length, once the motor has taken the `consequences` of the gap.
    pub(crate) fn hear<M: Guarded>(
        &mut self,
        motor: &mut M,
        index: u8,
        now: Instant,
        consequences: impl FnOnce(&mut M),
    ) {
        let timeouts = *self.timeouts();
        self.disturb();
        self.change(motor, index, now, |motor| {
            consequences(motor);
            motor.guard().hear(now.stamp(), &timeouts);
        });
    }

    /// Trusts feedback of a motor after a shorter gap than this, once the device was updated.
    pub(crate) fn trust(&self, motor: &mut MotorGuard, gap_us: u32) {
        let gap_us = gap_us.min(self.timeouts().late_us());
        motor.trust(if self.is_running() { gap_us } else { 0 });
    }
}

/// Feedback and updates for which no rule is due.
impl Guard {
    /// Notes feedback within the [trusted](Self::trust) gap; otherwise returns `false`, and notes nothing.
    #[inline]
    pub(crate) fn hear_in_time(&mut self, now: Instant) -> bool {
        let now = now.stamp();
        let since_update = now.wrapping_sub(self.device.now());
        let is_in_time = self.motor.is_in_time(now) && self.motor.in_time.trusts(since_update);
        if is_in_time {
            self.motor.hear_in_time(now);
        }
        is_in_time
    }

    /// Trusts feedback after a shorter gap than this, once the motor was updated.
    pub(crate) fn trust(&mut self, gap_us: u32) {
        self.device.trust(&mut self.motor, gap_us);
    }

    /// Moves the time on to a tick in which no rule has to be applied and the motor may be driven; otherwise returns `false`, and moves
    /// nothing.
    #[inline]
    pub(super) fn goes_on(&mut self, now: Instant) -> bool {
        let goes_on = self.is_quiet(now) && self.motor.drives();
        if goes_on {
            self.device.begin(now);
        }
        goes_on
    }

    /// Tells whether an update at `now` has no rule to apply.
    #[inline]
    pub(crate) fn is_quiet(&self, now: Instant) -> bool {
        self.device.is_quiet(self.device.updated(), now)
    }

    /// Ends the quiet time here, if the quiet time lasts longer: the next update then applies the rules.
    pub(crate) fn wake_at(&mut self, time: Instant) {
        self.device.wake_at(time);
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

    fn deaf() -> Guard {
        let mut guard = Guard::without_feedback();
        guard.engage(at_ms(1));
        guard.admit(true).unwrap();
        guard
    }

    #[test]
    fn feedback_within_the_trusted_gap_is_in_time_once_the_motor_was_updated() {
        let mut guard = driving();
        guard.trust(5_000);
        assert!(!guard.hear_in_time(at_ms(2)), "no update yet");
        assert!(guard.drives(at_ms(2)));
        assert!(!guard.hear_in_time(at_ms(3)), "nothing trusted");
        guard.trust(5_000);
        assert!(guard.hear_in_time(at_ms(3)));
        assert!(!guard.hear_in_time(at_ms(9)));
        guard.trust(0);
        assert!(!guard.hear_in_time(at_ms(4)));
        assert_eq!((guard.motor.in_time.take(), guard.motor.in_time.take()), (1, 0));
    }

    #[test]
    fn a_pause_while_the_range_opens_leaves_it_open() {
        for pause_ms in [60_001, 2_400_000, 4_290_000] {
            let mut guard = deaf();
            assert!(guard.drives(at_ms(50)) && guard.share() < 0.5);
            assert!(!guard.drives(at_ms(pause_ms)), "the target is too old");
            guard.admit(true).unwrap();
            assert!(guard.drives(at_ms(pause_ms + 1)));
            assert_eq!(guard.share().to_bits(), 1.0_f32.to_bits(), "{pause_ms} ms");
        }
    }

    #[test]
    fn a_target_ends_in_a_pause_before_the_first_update_too() {
        for (pause, drives) in
            [(Duration::from_millis(50), true), (Duration::from_micros(1 << 32), false)]
        {
            let mut guard = deaf();
            assert_eq!(guard.drives(at_ms(51) + pause), drives, "{pause:?}");
        }
    }

    #[test]
    fn a_range_that_begins_to_open_at_the_end_of_a_pause_is_not_open_at_once() {
        let mut guard = Guard::without_feedback();
        assert!(!guard.drives(at_ms(1)));
        guard.engage(at_ms(60_000));
        guard.admit(true).unwrap();
        for ms in [60_002, 60_010] {
            _ = guard.drives(at_ms(ms));
            assert!(guard.share() < 0.06, "{} at {ms} ms", guard.share());
        }
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
    fn a_motor_that_was_relaxed_takes_no_target_until_armed_again() {
        let mut guard = driving();
        guard.relax_until_armed();
        assert_eq!((guard.has_target(), guard.admit(true)), (false, Err(TargetError::Relaxed)));
        assert!(!guard.ask() && !guard.engage(at_ms(2)));
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
    fn each_target_that_is_no_number_is_counted() {
        let mut guard = driving();
        let counts = [true, false, true, false, false].map(|is_finite| {
            _ = guard.admit(is_finite);
            guard.refused_targets()
        });
        assert_eq!(counts, [0, 1, 1, 2, 3]);
    }

    #[test]
    fn time_that_goes_back_is_never_fresh_for_ever() {
        for mut guard in [driving(), deaf()] {
            assert!(guard.drives(at_ms(5)));
            assert!(!guard.drives(at_ms(4)));
            assert_eq!(guard.admit(true), Err(TargetError::Relaxed));
        }
    }

    #[test]
    fn time_that_stands_still_trips() {
        for mut guard in [driving(), deaf()] {
            assert!(guard.drives(at_ms(1)), "the tick in which it was armed");
            assert!(!guard.drives(at_ms(1)) && !guard.is_armed() && !guard.has_target());
            guard.hear(at_ms(2));
            assert!(!guard.ask() && !guard.engage(at_ms(2)) && !guard.drives(at_ms(2)));
        }
    }

    /// Quiet updates lie between the expiry and the next target.
    #[test]
    fn an_expired_target_is_over_in_the_first_update_with_another() {
        let mut guard = driving();
        let has_expired = |guard: &Guard| guard.conditions().contains(Condition::CommandLost);
        for ms in 2..=200 {
            guard.hear(at_ms(ms));
            assert_eq!(guard.drives(at_ms(ms)), ms <= 101, "{ms}");
            assert_eq!(has_expired(&guard), ms > 101, "{ms}");
        }
        guard.admit(true).unwrap();
        assert!(has_expired(&guard) && guard.drives(at_ms(201)) && !has_expired(&guard));
    }

    #[test]
    fn a_trip_disarms_and_needs_a_pause() {
        let mut guard = driving();
        guard.trip();
        assert_eq!(guard.admit(true), Err(TargetError::Disarmed));
        assert!(!guard.ask() && !guard.engage(at_ms(1)));
    }

    #[test]
    fn an_update_before_the_arming_trips() {
        let mut guard = driving();
        assert!(!guard.drives(Instant::from_micros(999)) && !guard.is_armed());
    }

    #[test]
    fn time_that_goes_back_is_an_edge_for_a_motor_that_is_not_heard_too() {
        let mut guard = deaf();
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
    fn a_stamp_far_ahead_is_not_fresh_before_the_next_limit_either() {
        let mut guard = driving();
        assert!(
            guard.drives(at_ms(2)) && guard.drives(at_ms(3)),
            "no age exceeds its limit until 11 ms"
        );
        guard.hear(at_ms(20));
        assert!(!guard.drives(at_ms(9)));
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
    fn a_range_that_nobody_asks_for_opens_and_stays_open() {
        let mut guard = Guard::without_feedback();
        assert!(guard.engage(at_ms(0)));
        for minute in 1..=90 {
            assert!(!guard.drives(at_ms(minute * 50_000)));
        }
        guard.admit(true).unwrap();
        assert!(guard.drives(at_ms(90 * 50_000 + 1)));
        assert_eq!(guard.share().to_bits(), 1.0_f32.to_bits());
    }

    #[test]
    fn a_first_update_late_in_the_day_forgets_no_target() {
        let mut guard = Guard::without_feedback();
        assert!(guard.engage(at_ms(61_000)));
        guard.admit(true).unwrap();
        assert!(guard.drives(at_ms(61_001)) && guard.forgotten_targets() == 0);
    }

    #[test]
    fn a_motor_without_feedback_is_not_engaged_an_age_of_the_stamps_ago() {
        let mut guard = Guard::without_feedback();
        assert!(!guard.drives(Instant::from_micros(5_000_000_000)));
        assert!(!guard.engage(Instant::from_micros(5_000_000_000 - (1 << 32) + 99_000)));
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
