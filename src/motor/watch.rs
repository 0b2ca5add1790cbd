//! Checks and conditions of one motor outside of a bus, and the consequences of a condition for any motor.

use super::{
    Answers, Condition, Conditions, Guard, Health, HealthConfig, Latch, Link, Monitor, MotorGuard,
    MotorName, SILENCE_US, TargetError, Timeouts, Traffic, Vitals, age,
};
use crate::time::{Duration, Edge, Instant};

/// The checks of a motor without a configuration of its own.
static USUAL: HealthConfig = HealthConfig::new();

/// Period of the checks of slow quantities in µs: temperature, effort, speed. A power of two.
const PERIOD_US: u64 = 8_192;

/// Parts of the period: motors whose ids differ in three bits are checked in different parts, so that eight motors of one bus do not
/// make one tick in eight long.
const PARTS: u64 = 8;

/// Checks one motor outside the slots of a bus: counts its frames, and judges its vitals.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Watch {
    config: &'static HealthConfig,
    monitor: Monitor,
    traffic: Traffic,
    window_from: Instant,
    answers: Answers,
    saturated: u16,
    error_code: u8,
    checked: Instant,
    /// Time of the next check of slow quantities.
    next: Instant,
    /// The part of the period in which this motor is checked.
    part: u8,
    /// Share of the output that the conditions leave.
    share: f32,
}

impl Watch {
    pub(crate) const fn new() -> Self {
        Self {
            config: &USUAL,
            monitor: Monitor::NEW,
            traffic: Traffic::NONE,
            window_from: Instant::START,
            answers: Answers::NONE,
            saturated: 0,
            error_code: 0,
            checked: Instant::START,
            next: Instant::START,
            part: 0,
            share: 1.0,
        }
    }

    pub(crate) fn with_config(self, config: &'static HealthConfig) -> Result<Self, &'static str> {
        config.validate()?;
        Ok(Self { config, ..self })
    }

    /// Returns the soft limits in rad.
    #[inline]
    pub(crate) const fn soft_limits(&self) -> Option<(f32, f32)> {
        self.config.soft_limits
    }

    /// Counts feedback before the guard takes its time.
    #[inline]
    pub(crate) fn hear(&mut self, gap_us: Option<u32>, now: Instant) {
        match gap_us {
            Some(gap_us) => self.traffic.gap(gap_us),
            None => (self.window_from, self.answers) = (now, Answers::NONE),
        }
        self.traffic.count();
        self.answers.add(1);
    }

    /// Forgets that one drive answers: another may have come.
    pub(crate) const fn forget_drive(&mut self) {
        self.answers = Answers::NONE;
    }

    /// Tells whether a drive that answers each frame is known to be the only one with its id, or need not be.
    pub(crate) fn is_single(&self) -> bool {
        let forbids = self.config.forbids(Conditions::NONE.with(Condition::DuplicateId));
        // Beside a second master that is ignored, no answer is of one frame.
        let has_rival = self.answers.has_rival() && self.config.ignores(Condition::SecondMaster);
        !forbids || has_rival || self.answers.are_of_one()
    }

    /// Returns the gap from which feedback lengthens the longest gap of the present window.
    pub(crate) const fn usual_gap_us(&self) -> u32 {
        self.traffic.usual_gap_us()
    }

    /// Returns the time of the next check of slow quantities: until then, a motor without a condition needs none.
    pub(crate) const fn next(&self) -> Instant {
        self.next
    }

    /// Begins a rest: answers to commands are none to the frames of the rest.
    pub(crate) fn begin_rest(&mut self, guard: &mut Guard) {
        self.traffic.add(guard.motor.in_time.take());
        self.answers.begin();
    }

    /// Notes so many frames to a drive at rest that sends nothing but answers.
    pub(crate) const fn ask(&mut self, frames: u16) {
        self.answers.ask(frames);
    }

    /// Notes a command of another node, which relaxes the motor where a second master demands rest. The drive answers that node too.
    pub(crate) fn hear_rival(&mut self, guard: &mut Guard, now: Instant) {
        self.answers = Answers::BESIDE_RIVAL;
        guard.hear_rival(now, |motor| motor.judge(Condition::SecondMaster, true, self.config));
    }

    /// Trips the motor, with a [fault](Condition::Fault) as if the drive reported the fault in one update. If the motor is not online, there is no fault.
    pub(crate) fn fail(&mut self, guard: &mut Guard, error_code: u8, now: Instant) {
        self.error_code = error_code;
        let is_online = guard.link() == Link::Online;
        guard.change(now, |motor| if is_online { motor.fail(self.config) } else { motor.trip() });
    }

    /// Tells whether the motor must not be armed.
    pub(crate) fn is_faulty(&self, guard: &Guard) -> bool {
        self.config.forbids(guard.conditions())
    }

    /// Begins anew before the motor is driven.
    pub(crate) fn start(&mut self, guard: &mut Guard, motor: MotorName, now: Instant) {
        self.part = motor.id();
        // What is left of the output is found with the first update.
        (self.checked, self.next) = (now, now);
        // Another drive may come while nobody counts.
        self.forget_drive();
        guard.change_conditions(now, |latch| self.monitor.start(latch));
    }

    /// Checks the motor, relaxes the motor where a condition demands rest, and returns the remaining share of the output.
    #[inline]
    pub(crate) fn check(
        &mut self,
        guard: &mut Guard,
        vitals: impl Fn() -> Vitals,
        now: Instant,
    ) -> f32 {
        if now < self.checked {
            // The clock went back.
            (self.checked, self.next) = (now, self.after(now));
        }
        let Vitals { has_fault, has_warning, .. } = vitals();
        let is_well = !(has_fault || has_warning)
            && guard.link() == Link::Online
            && guard.conditions().is_empty();
        if is_well && now < self.next {
            return self.share;
        }
        let vitals = vitals();
        let heard = guard.motor.in_time.take();
        self.traffic.add(heard);
        self.answers.add(heard);
        if self.traffic.end_window(&mut self.window_from, now) {
            guard.trust(0);
        }
        let is_online = guard.link() == Link::Online;
        // A frame that nobody answers tells nothing of a second drive, and nobody counts the commands.
        if guard.has_target() || !is_online {
            self.answers.begin();
        } else if self.answers.are_enough() {
            self.compare_answers(guard, now);
        }
        let since = if is_online { self.begin_slow(guard.is_armed(), &vitals, now) } else { None };
        let passes = |since| self.monitor.passes(&vitals.sample(since, self.config), self.config);
        if is_well && since.is_some_and(passes) {
            self.share = 1.0;
            return self.share;
        }
        self.check_all(guard, vitals, since, now)
    }

    /// Notes two drives with one id: the motor at rest had more answers than frames for one drive, and no second master asked.
    #[cold]
    #[inline(never)]
    fn compare_answers(&mut self, guard: &mut Guard, now: Instant) {
        self.answers.compare();
        let is_alone = !guard.conditions().contains(Condition::SecondMaster);
        let is_double = is_alone && !self.answers.are_of_one();
        guard.change(now, |motor| motor.judge(Condition::DuplicateId, is_double, self.config));
    }

    #[cold]
    #[inline(never)]
    fn check_all(
        &mut self,
        guard: &mut Guard,
        vitals: Vitals,
        since: Option<Duration>,
        now: Instant,
    ) -> f32 {
        let before = guard.conditions();
        if guard.link() != Link::Online {
            self.monitor = Monitor::NEW;
        }
        guard.change_conditions(now, |latch| {
            // An error that was reported before the feedback was late counts too.
            self.read_error(latch, &vitals);
            if let Some(since) = since {
                let sample = vitals.sample(since, self.config);
                self.share = self.monitor.check(latch, &sample, self.config);
            }
        });
        guard.change(now, |motor| motor.react(before, self.share, self.config));
        self.share
    }

    /// Returns the time since the last check of the slow quantities, if a check is due.
    #[inline]
    fn begin_slow(&mut self, is_armed: bool, vitals: &Vitals, now: Instant) -> Option<Duration> {
        if now < self.next {
            return None;
        }
        let since = now.since(self.checked);
        (self.checked, self.next) = (now, self.after(now));
        let saturated = is_armed && vitals.effort.abs() >= 1.0;
        self.saturated = self.saturated.saturating_add(u16::from(saturated));
        Some(since)
    }

    /// Returns the next beginning of the part of this motor, at most a period after `now`.
    fn after(&self, now: Instant) -> Instant {
        let begins_us = (self.part as u64 % PARTS) * (PERIOD_US / PARTS);
        let passed_us = now.as_micros().wrapping_sub(begins_us) % PERIOD_US;
        now + Duration::from_micros(PERIOD_US - passed_us)
    }

    fn read_error(&mut self, latch: &mut Latch, vitals: &Vitals) {
        let before = core::mem::replace(&mut self.error_code, vitals.error_code);
        let changed = before != vitals.error_code;
        latch.report(vitals.error(), changed, self.config);
    }

    pub(crate) fn health(&self, motor: MotorName, guard: &Guard, vitals: &Vitals) -> Health {
        Health {
            feedback_hz: self.traffic.rate_hz(),
            longest_gap: Duration::from_micros(self.traffic.longest_gap_us().into()),
            temperature_c: vitals.temperature_c,
            error_code: vitals.error_code,
            saturated: self.saturated,
            ..guard.health(motor)
        }
    }
}

/// Conditions and their unread edges.
impl Guard {
    /// Sets whether a condition of the motor holds. A change is an edge, latched until read.
    ///
    /// The guard itself notes late and lost feedback and old targets. A second master, noted with each of its commands, is gone in the first
    /// update more than a second after the last.
    pub fn note(&mut self, condition: Condition, holds: bool, now: Instant) {
        if condition == Condition::SecondMaster && holds {
            return self.hear_rival(now, |motor| motor.latch.set(condition, holds));
        }
        self.change_conditions(now, |latch| latch.set(condition, holds));
    }

    /// Runs a change of the conditions, and notes its consequences.
    pub(super) fn change_conditions<T>(
        &mut self,
        now: Instant,
        change: impl FnOnce(&mut Latch) -> T,
    ) -> T {
        self.change(now, |motor| change(&mut motor.latch))
    }

    /// Returns the conditions of the motor that hold.
    #[must_use]
    pub const fn conditions(&self) -> Conditions {
        self.motor.latch.active()
    }

    /// Returns the oldest unread edge, with the name passed as `motor`: the guard has no name of its motor.
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
    pub fn next_edge(&mut self, motor: MotorName) -> Option<Edge<Condition, MotorName>> {
        let (motors, now) = (core::slice::from_mut(&mut self.motor), self.device.updated());
        self.device.journal.next_edge(motors, now, |_| Some(motor))
    }

    /// Returns the part of a motor's health that the guard holds.
    pub(crate) const fn health(&self, motor: MotorName) -> Health {
        self.motor.health(motor)
    }
}

/// Age of feedback, conditions with their consequences, and the part of the health that a guard holds.
impl MotorGuard {
    /// Sets whether a condition holds that is not ignored, and takes its consequences.
    pub(crate) fn judge(&mut self, condition: Condition, holds: bool, config: &HealthConfig) {
        let before = self.latch.active();
        self.latch.set(condition, holds && !config.ignores(condition));
        self.react(before, 1.0, config);
    }

    /// Refuses a target measured too long ago or too far ahead, which is `None`: the target before counts as expired.
    pub(crate) fn require_fresh(&mut self, stamp: Option<u32>) -> Result<u32, TargetError> {
        if stamp.is_none() && self.has_target() {
            self.forget_target();
        }
        stamp.ok_or(TargetError::StaleMeasurement)
    }

    /// Tells whether the last feedback is at most `micros` old.
    pub(crate) const fn was_heard_within(&self, now: u32, micros: u32) -> bool {
        age(now, self.heard) <= micros
    }

    /// Trips the motor: the drive is in an unexpected state, which counts as its fault.
    pub(crate) fn fail(&mut self, config: &HealthConfig) {
        self.judge(Condition::Fault, true, config);
        self.trip();
    }

    /// Tells whether a drive may have started again in this gap before feedback: in a long one, or while the motor was offline. Feedback that is
    /// late only after more is polled seldom.
    pub(crate) fn is_silence(&self, gap_us: u32, timeouts: &Timeouts) -> bool {
        let is_long = gap_us > timeouts.late_us() && gap_us > timeouts.offline_us().min(SILENCE_US);
        self.link() == Link::Offline || self.link() != Link::Unheard && is_long
    }

    /// Notes that the angle counts from an unknown zero, and trips.
    pub(crate) const fn lose_zero(&mut self) {
        self.latch.set(Condition::PositionUncertain, true);
        self.trip();
    }

    /// Returns the part of a motor's health that the guard holds.
    pub(crate) const fn health(&self, motor: MotorName) -> Health {
        Health {
            motor,
            link: self.link(),
            armed: self.is_armed(),
            conditions: self.latch.active(),
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

    /// Trips the motor if a condition that began since `before` demands rest, or the motor must not be armed. Discards the target if the
    /// conditions leave no share of the output.
    pub(crate) const fn react(&mut self, before: Conditions, left: f32, config: &HealthConfig) {
        if config.relaxes(before, self.latch.active()) {
            self.trip();
        } else if left <= 0.0 {
            self.relax();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn feedback_counts_as_heard_for_as_long_as_is_asked() {
        let heard = u32::MAX - 5_000; // before the wrap
        let mut motor = MotorGuard::NEW;
        motor.heard = heard;
        let ages = [0, 12_288, 12_289].map(|age| heard.wrapping_add(age));
        assert_eq!(ages.map(|now| motor.was_heard_within(now, 12_288)), [true, true, false]);
        assert!(motor.was_heard_within(heard.wrapping_sub(1), 0), "stamped ahead");
    }

    #[test]
    fn a_second_master_counts_for_a_second_on_both_sides_of_its_last_command() {
        let at_ms = |ms: u64| Instant::from_micros(ms * 1_000);
        for (now_ms, is_present) in [(2_500, true), (4_500, true), (2_499, false), (4_501, false)] {
            let mut guard = Guard::new();
            _ = guard.drives(at_ms(1));
            for at in [1_000, 3_500] {
                guard.note(Condition::SecondMaster, true, at_ms(at));
            }
            _ = guard.drives(at_ms(now_ms));
            let holds = guard.conditions().contains(Condition::SecondMaster);
            assert_eq!(holds, is_present, "{now_ms} ms");
        }
    }

    #[test]
    fn eight_motors_of_a_bus_are_checked_in_eight_ticks_of_a_period() {
        for from_us in [0, 1, 8_191, 8_192, 77_777_777, u64::MAX - 20_000] {
            let now = Instant::from_micros(from_us);
            let next = |part| Watch { part, ..Watch::new() }.after(now);
            let mut times = [1, 2, 3, 4, 5, 6, 7, 8].map(next);
            times.sort();
            assert!(times[0] > now && times[7].since(now).as_micros() <= PERIOD_US);
            let apart = times.windows(2).map(|pair| pair[1].since(pair[0]).as_micros());
            assert!(apart.into_iter().all(|micros| micros == 1_024), "{from_us}");
            assert_eq!(next(3), next(11), "a ninth motor shares a tick");
            assert_eq!(next(3).since(now).as_micros() % 1_024, (1_024 - from_us % 1_024) % 1_024);
        }
    }

    #[test]
    fn a_motor_is_checked_once_a_period_also_after_its_clock_went_back() {
        let sample = |watch: &mut Watch, at_us| {
            let now = Instant::from_micros(at_us);
            watch.begin_slow(true, &Vitals::default(), now).is_some()
        };
        let mut watch = Watch::new();
        let times = (1..=82).filter(|ms| sample(&mut watch, ms * 1_000)).count();
        assert_eq!(times, 11, "in ten periods, and the first");
        _ = watch.check(&mut Guard::new(), Vitals::default, Instant::from_micros(500));
        assert_eq!(
            (watch.checked, watch.next),
            (Instant::from_micros(500), Instant::from_micros(8_192))
        );
    }
}
