//! Rules shared by the motors of a device: time, the request to arm, the emergency stop.

use super::motor::{Known, MotorGuard};
use super::{LONGEST_PAUSE_US, Repeat};
use crate::motor::{Journal, Link, Timeouts};
use crate::time::{Duration, Instant};

const LONGEST_PAUSE: Duration = Duration::from_micros(LONGEST_PAUSE_US as u64);

/// Decides whether an update may drive the motors of a device, and which motors may be armed. Keeps `N` times of edges.
#[derive(Debug, Clone, Copy)]
pub(crate) struct DeviceGuard<const N: usize> {
    /// Stamp of new targets.
    now: u32,
    timeouts: Timeouts,
    /// Time of the last update; before the first, time of the last feedback.
    updated: Instant,
    /// Until this time no age exceeds its limit, except after a [disturbance](Self::disturb).
    quiet_until: Instant,
    /// Time of the last arming: no update lies before it.
    armed_at: Instant,
    gesture: Gesture,
    /// Whether the next update must compare the ages of each motor.
    is_disturbed: bool,
    /// Whether there was an update.
    is_running: bool,
    is_stopped: bool,
    /// Updates in a row without a usable step.
    held_steps: u8,
    bad_steps: u32,
    journal: Journal<N>,
}

/// Output of an update without a usable step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Hold {
    /// Keep the last commands.
    Keep,
    /// Send zeros.
    Rest,
    /// Send zeros, and [relax](MotorGuard::lose_time) all motors until armed again: time did not move on.
    LoseTime,
}

impl<const N: usize> DeviceGuard<N> {
    pub(crate) const NEW: Self = Self {
        now: 0,
        timeouts: Timeouts::new(),
        updated: Instant::START,
        quiet_until: Instant::START,
        armed_at: Instant::START,
        gesture: Gesture::NEW,
        is_disturbed: true,
        is_running: false,
        is_stopped: false,
        held_steps: 0,
        bad_steps: 0,
        journal: Journal::EMPTY,
    };

    pub(crate) const fn with(timeouts: Timeouts) -> Self {
        Self { timeouts, ..Self::NEW }
    }

    pub(crate) const fn set_timeouts(&mut self, timeouts: Timeouts) {
        self.timeouts = timeouts;
        self.disturb();
    }

    pub(crate) const fn timeouts(&self) -> &Timeouts {
        &self.timeouts
    }

    /// Returns the stamp of a measurement of another sensor; `None` for a measurement too old, or too far ahead.
    pub(crate) fn stamp_of(&self, at: Instant) -> Option<u32> {
        // A 32-bit stamp alone would be fresh again every 71 minutes.
        let is_ahead = self.is_running && at.since(self.updated) > LONGEST_PAUSE;
        let is_far = is_ahead || self.updated.since(at) > self.timeouts.measured();
        (!is_far).then(|| at.stamp())
    }

    /// Returns the stamp of new targets.
    pub(crate) const fn now(&self) -> u32 {
        self.now
    }

    pub(crate) const fn updated(&self) -> Instant {
        self.updated
    }

    pub(crate) const fn is_running(&self) -> bool {
        self.is_running
    }

    pub(crate) const fn bad_steps(&self) -> u32 {
        self.bad_steps
    }

    pub(crate) const fn journal(&self) -> &Journal<N> {
        &self.journal
    }

    pub(crate) const fn journal_mut(&mut self) -> &mut Journal<N> {
        &mut self.journal
    }

    // Time.

    /// Sets the time of an update and returns the time of the previous one.
    #[inline(always)]
    pub(crate) const fn begin(&mut self, now: Instant) -> Instant {
        self.now = now.stamp();
        core::mem::replace(&mut self.updated, now)
    }

    /// Tells whether time moved on since `before`, and no age exceeds its limit.
    #[inline(always)]
    pub(crate) fn is_quiet(&self, before: Instant) -> bool {
        before < self.updated && self.updated < self.quiet_until
    }

    /// Tells whether time moves on until `now`, and no age exceeds its limit then.
    #[inline(always)]
    pub(in crate::motor) fn is_quiet_at(&self, now: Instant) -> bool {
        self.updated < now && now < self.quiet_until
    }

    /// Notes feedback before the first update, which moves the time on. Returns the previous time.
    pub(crate) const fn pass_unwatched(&mut self, now: Instant) -> Instant {
        core::mem::replace(&mut self.updated, now)
    }

    /// Tells whether the present update lies after the previous one, and not before the arming; otherwise all ages are meaningless. Call
    /// this once in each update that is not [quiet](Self::is_quiet).
    pub(crate) fn moves_on(&mut self, before: Instant) -> bool {
        let moves_on = self.armed_at <= self.updated && (!self.is_running || before < self.updated);
        let step = if self.is_running { self.updated.since(before) } else { Duration::ZERO };
        self.gesture.pass(moves_on.then_some(step));
        moves_on
    }

    /// Tells whether the pause before the present time was too long for the stamps.
    pub(crate) fn is_pause(&self, before: Instant) -> bool {
        self.updated > before + LONGEST_PAUSE
    }

    /// Notes an update with a usable step, for which time moved on.
    pub(crate) const fn run(&mut self) {
        self.is_running = true;
        self.held_steps = 0;
    }

    /// Returns the ages of no motor. Returns `None`, once, if each motor must be compared by itself.
    pub(crate) fn ages(&mut self) -> Option<Ages> {
        let is_disturbed = core::mem::replace(&mut self.is_disturbed, false);
        (!is_disturbed).then(|| Ages::none(self.now, &self.timeouts))
    }

    /// Sets for how long no age exceeds its limit.
    pub(crate) fn rest_for(&mut self, micros: u32) {
        // After a trip, each update counts towards the pause before a request to arm.
        let micros = if self.gesture.is_tripped() { 0 } else { micros };
        self.quiet_until = self.updated + Duration::from_micros(micros.into());
    }

    /// Counts as quiet until this time at most.
    pub(in crate::motor) fn wake_at(&mut self, time: Instant) {
        self.quiet_until = self.quiet_until.min(time);
    }

    /// Makes the next update compare the ages of each motor. Call this wherever an age may grow faster than time, or the limit of an age
    /// may change.
    pub(crate) const fn disturb(&mut self) {
        self.quiet_until = Instant::START;
        self.is_disturbed = true;
    }

    /// Ends an update without a usable time or time step, after the check by [`moves_on`](Self::moves_on).
    pub(crate) fn hold(&mut self, before: Instant, moves_on: bool) -> Hold {
        self.is_running = true;
        self.disturb();
        self.bad_steps = self.bad_steps.saturating_add(1);
        let repeat = Repeat::after(self.held_steps);
        self.held_steps = self.held_steps.saturating_add(1);
        if !moves_on {
            // No target is left, so an update before the arming can make no target younger.
            self.armed_at = self.updated;
            return Hold::LoseTime;
        }
        let is_late = self.updated.since(before) > self.timeouts.late();
        if repeat.admits(true) && !is_late { Hold::Keep } else { Hold::Rest }
    }

    /// Returns the number of updates in a row without a usable time or step.
    pub(crate) const fn held_steps(&self) -> u8 {
        self.held_steps
    }

    // Arming.

    /// Tells whether a motor's feedback is not fresh, as far as its stamp is valid.
    pub(crate) fn misses(&self, motor: &MotorGuard, now: Instant) -> bool {
        let is_dated = self.is_running || motor.listens();
        is_dated && self.is_far(now) || motor.is_missing(now.stamp(), &self.timeouts)
    }

    /// Tells whether the distance between a time and the last update, in either direction, is too long for a stamp.
    pub(crate) fn is_far(&self, now: Instant) -> bool {
        now > self.updated + LONGEST_PAUSE || self.updated > now + LONGEST_PAUSE
    }

    /// Takes a request to arm. Returns `false` if the request does not count.
    pub(crate) const fn ask(&mut self) -> bool {
        self.gesture.ask()
    }

    /// Tells whether motors may be [engaged](MotorGuard::engage) at `now`: neither while the emergency stop is set, nor without a request
    /// that counts. If so, ends the trip.
    pub(crate) fn begin_arming(&mut self, now: Instant) -> bool {
        if self.is_stopped || !self.gesture.take() {
            return false;
        }
        self.now = now.stamp();
        // An arming at an earlier time changes nothing: running motors may have targets of the later one.
        self.armed_at = self.armed_at.max(now);
        self.disturb();
        true
    }

    /// Tells whether a motor may be [engaged](MotorGuard::engage): online, and not armed yet. An armed motor goes on undisturbed.
    pub(crate) fn may_engage(&self, motor: &MotorGuard, now: Instant) -> bool {
        !motor.is_armed() && !self.misses(motor, now)
    }

    /// Keeps the trip: another motor still waits to be armed.
    pub(crate) const fn keep_trip(&mut self) {
        self.gesture.keep();
    }

    /// Notes the consequences of a change of a motor, compared with the state [known](MotorGuard::known) before: edges, and the pause after
    /// a trip.
    pub(crate) fn note(&mut self, index: u8, before: Known, motor: &MotorGuard, now: Instant) {
        self.journal.note(index, &before.latch, motor.latch(), now);
        if before.is_armed && !motor.is_armed() {
            self.trip();
        }
    }

    /// Begins the pause after a trip. Each update counts towards it.
    pub(crate) const fn trip(&mut self) {
        self.gesture.trip();
        self.quiet_until = Instant::START;
    }

    /// Sets the emergency stop. Returns `false` if the stop is set already. The caller disarms the motors.
    pub(crate) const fn stop(&mut self) -> bool {
        if self.is_stopped {
            return false;
        }
        self.trip();
        self.is_stopped = true;
        true
    }

    pub(crate) const fn clear_stop(&mut self) {
        if self.is_stopped {
            self.trip();
            self.is_stopped = false;
        }
    }

    pub(crate) const fn is_stopped(&self) -> bool {
        self.is_stopped
    }
}

/// Greatest ages among some motors. An age is counted from one limit ahead of now, so a stamp is near for values from 0 to twice the limit.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Ages {
    now: u32,
    late_us: u32,
    command_us: u32,
    heard: u32,
    commanded: u32,
}

impl Ages {
    /// Returns the ages of no motor. A new target may come at any time from now on.
    pub(in crate::motor) const fn none(now: u32, timeouts: &Timeouts) -> Self {
        let (late_us, command_us) = (timeouts.late_us(), timeouts.command_us());
        Self { now, late_us, command_us, heard: 0, commanded: command_us }
    }

    /// Adds the ages of a motor's feedback and target, if the motor is online.
    #[inline]
    pub(crate) fn add(&mut self, motor: &MotorGuard) {
        if motor.link != Link::Online {
            return;
        }
        let since = |stamp, limit| self.now.wrapping_add(limit).wrapping_sub(stamp);
        let heard = since(motor.heard, self.late_us);
        let commanded = since(motor.commanded, self.command_us);
        self.heard = self.heard.max(heard);
        if motor.has_target {
            self.commanded = self.commanded.max(commanded);
        }
    }

    /// Returns the time in µs after which an age exceeds its limit; `None` if an age already does.
    pub(crate) fn within_limits_us(&self) -> Option<u32> {
        let heard = (2 * self.late_us).checked_sub(self.heard)?;
        let commanded = (2 * self.command_us).checked_sub(self.commanded)?;
        Some(heard.min(commanded) + 1)
    }
}

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
    use proptest::prelude::*;

    /// Below a limit, next to it on both sides, and far above.
    fn about(limit: u32) -> impl Strategy<Value = u32> {
        prop_oneof![0..=limit, limit - 2..=limit + 2, limit..=100 * limit]
    }

    proptest! {
        /// Law: nothing is above its limit for as long as it is told, and something is a microsecond later.
        #[test]
        fn it_is_quiet_until_the_oldest_age_is_above_its_limit(heard in about(20_000), commanded in about(200_000)) {
            let ages = Ages { heard, commanded, ..Ages::none(0, &Timeouts::new()) };
            // 10 ms and 100 ms, and as far ahead.
            let is_within = |passed| heard + passed <= 20_000 && commanded + passed <= 200_000;
            match ages.within_limits_us() {
                Some(quiet) => prop_assert!(is_within(quiet - 1) && !is_within(quiet)),
                None => prop_assert!(!is_within(0)),
            }
        }
    }

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
