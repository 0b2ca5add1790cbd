//! Rules shared by the motors of a device: time, the request to arm, the emergency stop.

use super::motor::{Guarded, MotorGuard};
use super::{Hold, LONGEST_PAUSE_US, RIVAL_US};
use crate::motor::{Journal, Link, Timeouts, is_near};
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
    /// Until this time no age exceeds its limit; from the beginning after a [disturbance](Self::disturb).
    quiet_until: Instant,
    /// Time of the last granted request to arm, or of lost time: no update lies before it.
    armed_at: Instant,
    gesture: Gesture,
    /// Whether there was an update.
    is_running: bool,
    is_stopped: bool,
    /// Updates in a row without a usable step.
    held_steps: u8,
    /// Stamp of the last command of another node.
    rival_heard: u32,
    pub(crate) journal: Journal<N>,
}

impl<const N: usize> DeviceGuard<N> {
    pub(crate) const NEW: Self = Self {
        now: 0,
        timeouts: Timeouts::new(),
        updated: Instant::START,
        quiet_until: Instant::START,
        armed_at: Instant::START,
        gesture: Gesture::NEW,
        is_running: false,
        is_stopped: false,
        held_steps: 0,
        rival_heard: 0,
        journal: Journal::EMPTY,
    };

    pub(crate) const fn set_timeouts(&mut self, timeouts: Timeouts) {
        self.timeouts = timeouts;
        self.disturb();
    }

    pub(crate) const fn timeouts(&self) -> &Timeouts {
        &self.timeouts
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

    // Time.

    /// Tells whether time moves on from `before`, the time of the previous update, and no age exceeds its limit.
    #[inline(always)]
    pub(crate) fn is_quiet(&self, before: Instant, now: Instant) -> bool {
        before < now && now < self.quiet_until
    }

    /// Sets the time of an update and returns the time of the previous one.
    #[inline(always)]
    pub(crate) const fn begin(&mut self, now: Instant) -> Instant {
        self.now = now.stamp();
        core::mem::replace(&mut self.updated, now)
    }

    /// Decides whether an update outside of a [quiet](Self::is_quiet) time, `before` being the time of the previous one, has a usable time
    /// and step. If time moved on, applies all due time-outs; with a usable step, computes until when none is due again; otherwise returns the
    /// [`Hold`].
    pub(crate) fn pass<M: Guarded>(
        &mut self,
        motors: &mut [M],
        before: Instant,
        has_step: bool,
        longest_us: u32,
    ) -> Option<Hold> {
        if !self.moves_on(before) {
            return Some(self.lose_time(motors, before));
        }
        if self.is_pause(before) {
            self.forget_bygones(motors, before);
        }
        if !has_step {
            self.expire(motors);
            return Some(self.hold(before));
        }
        self.is_running = true;
        self.held_steps = 0;
        let quiet_until = core::mem::replace(&mut self.quiet_until, self.updated);
        match self.quiet(motors, longest_us).filter(|_| quiet_until > Instant::START) {
            Some(_) if self.gesture.tripped => {}
            Some(quiet) => self.quiet_until = self.updated + quiet,
            None => self.expire(motors),
        }
        None
    }

    /// Tells whether the present update lies after the previous one, and not before the arming; otherwise all ages are meaningless.
    pub(crate) fn moves_on(&mut self, before: Instant) -> bool {
        let moves_on = self.armed_at <= self.updated && (!self.is_running || before < self.updated);
        let step = if self.is_running { self.updated.since(before) } else { Duration::ZERO };
        self.gesture.pass(moves_on.then_some(step));
        moves_on
    }

    /// Tells whether the pause before the present time was too long for the stamps.
    fn is_pause(&self, before: Instant) -> bool {
        self.updated > before.max(self.armed_at) + LONGEST_PAUSE
    }

    /// Returns the time after which the age of a motor exceeds its limit, at most `longest_us`; `None` if an age already does. A new target
    /// may come at any time from now on.
    fn quiet<M: Guarded>(&self, motors: &mut [M], longest_us: u32) -> Option<Duration> {
        let (late_us, command_us) = (self.timeouts.late_us(), self.timeouts.command_us());
        // Counted from one limit ahead of now, so that a stamp is near for values from 0 to twice the limit.
        let since = |stamp, limit| self.now.wrapping_add(limit).wrapping_sub(stamp);
        let (mut heard, mut commanded) = (0, command_us);
        for motor in motors.iter_mut().map(M::guard) {
            let is_online = motor.link == Link::Online;
            if is_online {
                heard = since(motor.heard, late_us).max(heard);
            }
            if is_online && motor.has_target {
                commanded = since(motor.commanded, command_us).max(commanded);
            }
        }
        let quiet_us =
            (2 * late_us).checked_sub(heard)?.min((2 * command_us).checked_sub(commanded)?);
        Some(Duration::from_micros((quiet_us + 1).min(longest_us).into()))
    }

    /// Compares the ages of each motor with their limits.
    #[cold]
    fn expire<M: Guarded>(&mut self, motors: &mut [M]) {
        let (now, timeouts, mut is_settled) = (self.now, self.timeouts, true);
        self.change_all(motors, self.updated, |motor| {
            is_settled &= motor.guard().age(now, &timeouts);
        });
        if !is_settled {
            self.disturb();
        }
    }

    /// Discards each stamp whose age a 32-bit counter can no longer represent; after a pause, discards all stamps.
    ///
    /// Called after a pause, and with feedback before the first update.
    #[cold]
    fn forget_bygones<M: Guarded>(&mut self, motors: &mut [M], before: Instant) {
        let (now, is_pause) = (self.updated.stamp(), self.is_pause(before));
        self.change_all(motors, self.updated, |motor| motor.guard().forget_bygones(now, is_pause));
    }

    /// Notes the time of feedback: before the first update, feedback moves the time on.
    #[inline]
    pub(crate) fn hear_first<M: Guarded>(&mut self, motors: &mut [M], now: Instant) {
        if !self.is_running {
            let before = core::mem::replace(&mut self.updated, now);
            self.forget_bygones(motors, before);
        }
    }

    /// Changes each motor.
    pub(crate) fn change_all<M: Guarded>(
        &mut self,
        motors: &mut [M],
        now: Instant,
        mut change: impl FnMut(&mut M),
    ) {
        for (index, motor) in (0..).zip(motors) {
            self.change(motor, index, now, &mut change);
        }
    }

    /// Changes a motor, and notes the consequences: edges, and the pause after a trip.
    pub(crate) fn change<M: Guarded, T>(
        &mut self,
        motor: &mut M,
        index: u8,
        now: Instant,
        change: impl FnOnce(&mut M) -> T,
    ) -> T {
        let (latch, was_armed) = (motor.guard().latch, motor.guard().is_armed());
        let outcome = change(motor);
        motor.follow();
        self.journal.note(index, &latch, &motor.guard().latch, now);
        if was_armed && !motor.guard().is_armed() {
            self.trip();
        }
        outcome
    }

    /// Counts as quiet until this time at most.
    pub(crate) const fn wake_at(&mut self, time: Instant) {
        if time.as_micros() < self.quiet_until.as_micros() {
            self.quiet_until = time;
        }
    }

    /// Makes the next update compare the ages of each motor. Call this wherever an age may grow faster than time, or the limit of an age
    /// may change.
    pub(crate) const fn disturb(&mut self) {
        self.quiet_until = Instant::START;
    }

    /// Ends an update without a usable step.
    #[cold]
    fn hold(&mut self, before: Instant) -> Hold {
        self.is_running = true;
        self.disturb();
        let repeats = self.held_steps == 0 && self.updated.since(before) <= self.timeouts.late();
        self.held_steps = self.held_steps.saturating_add(1);
        if repeats { Hold::Keep } else { Hold::Rest }
    }

    /// Ends an update whose time did not move on: no age is known.
    #[cold]
    pub(crate) fn lose_time<M: Guarded>(&mut self, motors: &mut [M], before: Instant) -> Hold {
        self.hold(before);
        // No target is left, so an update before the arming can make no target younger.
        self.armed_at = self.updated;
        self.change_all(motors, self.updated, |motor| motor.guard().lose_time());
        Hold::LoseTime
    }

    /// Returns the number of updates in a row without a usable time or step.
    pub(crate) const fn held_steps(&self) -> u8 {
        self.held_steps
    }

    /// Notes a command of another node. `change` begins the condition of a [second master](crate::motor::Condition::SecondMaster), which ends
    /// after a second without such a command.
    pub(crate) fn hear_rival(&mut self, now: Instant, change: impl FnOnce(&mut Self)) {
        self.rival_heard = now.stamp();
        change(self);
        self.disturb();
    }

    /// Tells whether no other node has sent a command for a second.
    pub(crate) const fn is_alone(&self) -> bool {
        !is_near(self.now, self.rival_heard, RIVAL_US)
    }

    // Arming.

    /// Tells whether a motor's feedback is not fresh, as far as its stamp is valid.
    pub(crate) fn misses(&self, motor: &MotorGuard, now: Instant) -> bool {
        let is_dated = self.is_running || motor.listens;
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

    /// Arms each chosen motor that is online and not armed yet, and lets each `begin`; an armed motor keeps its target. While the emergency stop
    /// is set, without a request that counts, or where none is online, nothing changes. Otherwise no update may lie before
    /// `now`, later targets have this time, and the trip ends, unless a tripped motor is left. Returns whether a motor was armed.
    pub(crate) fn engage<M: Guarded>(
        &mut self,
        motors: &mut [M],
        now: Instant,
        is_chosen: impl Fn(u8, &M) -> bool,
        begin: impl Fn(&mut M),
    ) -> bool {
        let is_ready = |device: &Self, index, motor: &mut M| {
            is_chosen(index, motor) && !device.misses(motor.guard(), now)
        };
        let is_due = (0..).zip(&mut *motors).any(|(index, motor)| is_ready(self, index, motor));
        if !is_due || self.is_stopped || !self.gesture.take() {
            return false;
        }
        self.now = now.stamp();
        // An arming at an earlier time changes nothing: running motors may have targets of the later one.
        self.armed_at = self.armed_at.max(now);
        self.disturb();
        let mut begins = false;
        for (index, motor) in (0..).zip(&mut *motors) {
            if is_ready(self, index, motor) && !motor.guard().is_armed() {
                begins = true;
                self.change(motor, index, now, |motor| {
                    motor.guard().engage(now.stamp());
                    begin(motor);
                });
            }
        }
        if motors.iter_mut().any(|motor| motor.guard().is_tripped()) {
            (self.gesture.tripped, self.gesture.granted) = (true, false);
        }
        begins
    }

    /// Begins the pause after a trip. Each update counts towards it.
    pub(crate) const fn trip(&mut self) {
        self.gesture.trip();
        self.wake_at(self.updated);
    }

    /// Sets or clears the emergency stop; the caller disarms the motors. Returns `false` if nothing changes.
    pub(crate) const fn set_stop(&mut self, is_stopped: bool) -> bool {
        let changes = core::mem::replace(&mut self.is_stopped, is_stopped) != is_stopped;
        if changes {
            self.trip();
        }
        changes
    }

    pub(crate) const fn is_stopped(&self) -> bool {
        self.is_stopped
    }
}

/// Distinguishes a deliberate request to arm from a request repeated by a program.
///
/// After a trip, a request counts only if neither a trip nor another request lies within [`PAUSE_US`](Self::PAUSE_US) before it. A switch
/// that stays on, read in each tick, does not re-arm. A program that reads its switch more slowly must detect the edge of the switch.
///
/// The pause consists of updates whose time moved on. A gap between two updates counts for no more than
/// [`MOST_US`](Self::MOST_US): a stall of the program, or a jump of its clock, is no release of the switch.
#[derive(Debug, Clone, Copy)]
struct Gesture {
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
    const MOST_US: u32 = 20_000;

    const NEW: Self = Self { quiet_us: 0, tripped: false, granted: false };

    /// Notes an update, `step` after the previous one. `None`, for a time that did not move on, begins the pause anew.
    fn pass(&mut self, step: Option<Duration>) {
        let micros = |step: Duration| step.micros_u32().unwrap_or(u32::MAX).min(Self::MOST_US);
        self.quiet_us = step.map_or(0, |step| self.quiet_us.saturating_add(micros(step)));
    }

    const fn trip(&mut self) {
        *self = Self { quiet_us: 0, tripped: true, granted: false };
    }

    /// As [`DeviceGuard::ask`].
    const fn ask(&mut self) -> bool {
        self.granted = !self.tripped || self.quiet_us >= Self::PAUSE_US;
        self.quiet_us = 0;
        self.granted
    }

    /// Tells whether the device may be armed. If so, ends the trip.
    const fn take(&mut self) -> bool {
        let is_free = !self.tripped || self.granted;
        self.tripped = self.tripped && !is_free;
        is_free
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
            let mut motor = MotorGuard::NEW;
            motor.hear(10_000_u32.wrapping_sub(heard), &Timeouts::new());
            motor.take_target(100_000_u32.wrapping_sub(commanded));
            let device = DeviceGuard::<0>::NEW;
            // 10 ms and 100 ms, and as far ahead; a target may come at any time.
            let commanded = commanded.max(100_000);
            let is_within = |passed| heard + passed <= 20_000 && commanded + passed <= 200_000;
            match device.quiet(&mut [motor], u32::MAX) {
                Some(quiet) => {
                    let quiet = quiet.micros_u32().unwrap();
                    prop_assert!(is_within(quiet - 1) && !is_within(quiet));
                }
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
    fn a_trip_after_an_arming_needs_a_pause_of_its_own() {
        let mut gesture = Gesture::NEW;
        gesture.trip();
        pass_ms(&mut gesture, 10, 10);
        assert!(gesture.ask() && gesture.take());
        gesture.trip();
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
