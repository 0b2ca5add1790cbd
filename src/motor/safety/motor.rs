//! Rules of one motor.

use super::{Arming, Hold, LONGEST_PAUSE_US, Output, Rest};
use crate::math::limited;
use crate::motor::{Condition, Latch, Latched, Link, TargetError, Timeouts, age, is_near};
use crate::time::Duration;

/// Feedback after a shorter gap than is trusted, which needs no further check: the gap in µs, and below it the count of such feedback, in
/// one word to load and to store.
#[derive(Debug, Clone, Copy)]
pub(crate) struct InTime(u32);

impl InTime {
    /// Counts up to 32 767, or 4 s of a bus full of frames of one motor. The count is taken each second. Each overflow would lengthen the gap
    /// by 1 µs, for a minute at most: after a longer pause between two updates no age is known.
    const COUNT_BITS: u32 = 15;
    const COUNT: u32 = (1 << Self::COUNT_BITS) - 1;

    pub(crate) const NONE: Self = Self(0);

    /// Tells whether a time in µs is shorter than the trusted gap.
    #[inline(always)]
    pub(crate) const fn trusts(self, micros: u32) -> bool {
        micros < self.0 >> Self::COUNT_BITS
    }

    /// Returns the count since the last call.
    pub(crate) const fn take(&mut self) -> u16 {
        let [low, high, ..] = (self.0 & Self::COUNT).to_le_bytes();
        self.0 &= !Self::COUNT;
        u16::from_le_bytes([low, high])
    }

    /// Sets the trusted gap.
    pub(crate) const fn trust(&mut self, gap_us: u32) {
        let most = u32::MAX >> Self::COUNT_BITS;
        let gap_us = if gap_us < most { gap_us } else { most };
        self.0 = gap_us << Self::COUNT_BITS | self.0 & Self::COUNT;
    }
}

/// Decides whether one motor may be driven. See the [module](super) for its states.
#[derive(Debug, Clone, Copy)]
// In the order of use, so that neighbours are loaded and stored together.
#[repr(C)]
pub(crate) struct MotorGuard {
    /// Stamp of the last feedback.
    pub(crate) heard: u32,
    /// The trusted gap, 0 unless online, and the count of feedback within it.
    pub(crate) in_time: InTime,
    /// Stamp of the target.
    pub(super) commanded: u32,
    pub(super) link: Link,
    arming: Arming,
    pub(super) has_target: bool,
    pub(crate) rest: Rest,
    /// Stamp of the time when the output range began to open.
    opened: u32,
    /// Time in which the output range opens.
    opening_ms: u16,
    /// Less than the whole output range is open.
    pub(crate) is_opening: bool,
    good_frames: u8,
    /// Whether the motor has feedback.
    pub(super) listens: bool,
    /// Whether targets are taken again after a recovery.
    resumes: bool,
    pub(crate) refused_targets: u16,
    pub(crate) forgotten_targets: u16,
    pub(crate) latch: Latch,
}

/// A motor of a device, under the rules of its guard.
pub(crate) trait Guarded {
    fn guard(&mut self) -> &mut MotorGuard;

    /// Takes the consequences of a change of the guard.
    fn follow(&mut self) {}
}

impl<M: Guarded> Latched for M {
    fn latch(&mut self) -> &mut Latch {
        &mut self.guard().latch
    }
}

impl Guarded for MotorGuard {
    fn guard(&mut self) -> &mut MotorGuard {
        self
    }
}

impl MotorGuard {
    /// A motor with feedback: disarmed, unheard.
    pub(crate) const NEW: Self = Self {
        heard: 0,
        in_time: InTime::NONE,
        commanded: 0,
        link: Link::Unheard,
        arming: Arming::Disarmed,
        has_target: false,
        rest: Rest::Relaxed,
        opened: 0,
        opening_ms: 0,
        is_opening: false,
        good_frames: 0,
        listens: true,
        resumes: false,
        refused_targets: 0,
        forgotten_targets: 0,
        latch: Latch::NONE,
    };

    /// The place of a motor.
    pub(crate) const FREE: Self = Self { listens: false, ..Self::NEW };

    /// A motor without feedback, which counts as online.
    pub(crate) const DEAF: Self = Self { listens: false, link: Link::Online, ..Self::NEW };

    /// Sets the time in which the output range opens, at most 65 s, and whether targets are taken again after a recovery.
    pub(crate) const fn with(self, opening: Duration, resumes: bool) -> Self {
        let millis = opening.as_micros() / 1_000;
        #[expect(clippy::cast_possible_truncation, reason = "limited before")]
        let opening_ms = if millis < 65_000 { millis as u16 } else { 65_000 };
        Self { opening_ms, resumes, ..self }
    }

    pub(crate) const fn link(&self) -> Link {
        self.link
    }

    pub(crate) const fn is_armed(&self) -> bool {
        matches!(self.arming, Arming::Armed)
    }

    /// Tells whether the motor was relaxed since arming, and waits to be armed again.
    pub(super) const fn is_tripped(&self) -> bool {
        matches!(self.arming, Arming::Latched | Arming::Tripped)
    }

    pub(crate) const fn has_target(&self) -> bool {
        self.has_target
    }

    /// Tells whether the motor may be driven: armed, online, with a target that is not expired.
    pub(crate) fn drives(&self) -> bool {
        self.is_armed() && self.link == Link::Online && self.has_target
    }

    /// Tells what an update does, once ages are compared and the health is checked; `held` is `None` in an update with a usable step.
    pub(crate) fn output(&self, held: Option<Hold>) -> Output {
        match held {
            _ if !self.drives() => Output::Rest,
            None => Output::Drive,
            Some(Hold::Keep) if !self.has_rested() => Output::Repeat,
            Some(_) => Output::Rest,
        }
    }

    /// Tells whether the loops have not run since a rest.
    pub(crate) fn has_rested(&self) -> bool {
        self.rest != Rest::None
    }

    /// Tells whether the feedback is not fresh.
    pub(in crate::motor) fn is_missing(&self, now: u32, timeouts: &Timeouts) -> bool {
        self.listens && !(self.link == Link::Online && self.is_fresh(now, timeouts))
    }

    fn is_fresh(&self, now: u32, timeouts: &Timeouts) -> bool {
        !self.listens || is_near(now, self.heard, timeouts.late_us())
    }

    /// Tells whether feedback now comes within the trusted gap, for a motor that is online.
    #[inline(always)]
    pub(crate) const fn is_in_time(&self, now: u32) -> bool {
        self.in_time.trusts(now.wrapping_sub(self.heard))
    }

    /// Notes feedback that is [in time](Self::is_in_time).
    #[inline(always)]
    pub(crate) const fn hear_in_time(&mut self, now: u32) {
        self.heard = now;
        self.in_time.0 = self.in_time.0.wrapping_add(1);
    }

    /// Sets the trusted gap; 0 unless the motor is online.
    pub(crate) const fn trust(&mut self, gap_us: u32) {
        self.in_time.trust(if matches!(self.link, Link::Online) { gap_us } else { 0 });
    }

    /// Notes feedback of an online motor, if the previous feedback and update are recent; otherwise does nothing and returns `false`.
    pub(crate) fn hear_soon(&mut self, now: u32, updated: u32, timeouts: &Timeouts) -> bool {
        let is_soon = |before| now.wrapping_sub(before) <= timeouts.late_us();
        let is_usual = self.link == Link::Online && is_soon(self.heard) && is_soon(updated);
        if is_usual {
            self.heard = now;
        }
        is_usual
    }

    /// Notes feedback after a gap of any length.
    pub(crate) fn hear(&mut self, now: u32, timeouts: &Timeouts) {
        let was_offline = matches!(self.link, Link::Offline | Link::Recovering);
        let in_a_row = self.link == Link::Recovering && self.is_fresh(now, timeouts);
        self.heard = now;
        self.good_frames = if in_a_row { self.good_frames.saturating_add(1) } else { 1 };
        if was_offline && self.good_frames < timeouts.good_frames() {
            self.link = Link::Recovering;
            return;
        }
        self.link = Link::Online;
        self.latch.set(Condition::Late, false);
        self.latch.set(Condition::Offline, false);
        if was_offline && self.arming == Arming::Latched && self.resumes {
            self.arming = Arming::Armed;
            self.open(now);
        }
    }

    /// Applies expired time-outs. Returns `false` if the motor must be checked again on the next update regardless of new input.
    pub(crate) fn age(&mut self, now: u32, timeouts: &Timeouts) -> bool {
        if matches!(self.link, Link::Unheard | Link::Offline) {
            return true;
        }
        let is_settled = self.link == Link::Online && self.is_fresh(now, timeouts);
        if !is_settled && age(now, self.heard) > timeouts.offline_us() {
            self.lose();
        } else if !is_settled && self.link == Link::Online {
            self.set_late();
        }
        if self.has_target && !is_near(now, self.commanded, timeouts.command_us()) {
            self.forget_target();
        }
        is_settled
    }

    fn set_late(&mut self) {
        self.link = Link::Late;
        self.in_time.trust(0);
        self.latch.set(Condition::Late, true);
        self.pause();
    }

    /// Handles a lost motor: relaxes, and refuses targets until armed again or, if configured, until recovered.
    fn lose(&mut self) {
        self.set_late();
        self.link = Link::Offline;
        self.latch.set(Condition::Offline, true);
        if self.is_armed() {
            self.arming = Arming::Latched;
        }
        self.relax();
    }

    /// Discards an expired target.
    pub(in crate::motor) fn forget_target(&mut self) {
        self.relax();
        self.latch.set(Condition::CommandLost, true);
        self.forgotten_targets = self.forgotten_targets.saturating_add(1);
    }

    /// Discards each stamp whose age a 32-bit counter can no longer represent; after a pause, discards all stamps.
    pub(crate) fn forget_bygones(&mut self, now: u32, is_pause: bool) {
        // The stamp of the beginning could lie ahead when it repeats.
        self.is_opening &= !is_pause;
        let is_bygone = |stamp| is_pause || age(now, stamp) > LONGEST_PAUSE_US;
        if self.listens && self.link != Link::Unheard && is_bygone(self.heard) {
            self.lose();
        } else if self.has_target && is_bygone(self.commanded) {
            self.forget_target();
        }
    }

    /// Tells whether a new target may be taken.
    /// A value that is not finite cancels the previous target: an older value must not act in its place when the feedback returns.
    #[inline]
    pub(crate) fn admit(&mut self, is_finite: bool) -> Result<(), TargetError> {
        if is_finite && self.is_armed() && self.link == Link::Online {
            return Ok(());
        }
        Err(self.refuse(is_finite))
    }

    #[cold]
    fn refuse(&mut self, is_finite: bool) -> TargetError {
        if !is_finite {
            self.refused_targets = self.refused_targets.saturating_add(1);
            self.relax();
            return TargetError::NotFinite;
        }
        match self.arming {
            Arming::Disarmed => TargetError::Disarmed,
            Arming::Latched | Arming::Tripped => TargetError::Relaxed,
            Arming::Armed => {
                // A pause is enough, without a reset of the loops: a late motor is soon offline.
                self.has_target = false;
                self.pause();
                TargetError::NoFeedback
            }
        }
    }

    /// Refuses a target from a zero that is not known, which is `None`, and discards the target before.
    pub(crate) fn require_zero<T>(&mut self, target: Option<T>) -> Result<T, TargetError> {
        if target.is_none() {
            self.relax();
        }
        target.ok_or(TargetError::NotHomed)
    }

    /// Tells whether a target may replace an earlier one: a motor with a target is armed.
    #[inline]
    pub(crate) fn may_renew_target(&self, is_finite: bool) -> bool {
        self.link == Link::Online && is_finite
    }

    /// Sets a target.
    pub(crate) const fn take_target(&mut self, now: u32) {
        self.has_target = true;
        self.renew_target(now);
    }

    /// Replaces a target by a newer one.
    #[inline]
    pub(crate) const fn renew_target(&mut self, now: u32) {
        self.commanded = now;
    }

    /// Discards the target.
    pub(crate) const fn relax(&mut self) {
        self.has_target = false;
        self.rest = Rest::Relaxed;
    }

    /// Notes a pause: older measurements give no rate, and the last command is not sent again.
    pub(crate) fn pause(&mut self) {
        self.rest = self.rest.max(Rest::Pause);
    }

    /// Ends the rest, as the loops run, and returns its kind.
    pub(crate) const fn end_rest(&mut self) -> Rest {
        core::mem::replace(&mut self.rest, Rest::None)
    }

    /// Takes targets from now on, beginning at rest.
    pub(super) const fn engage(&mut self, now: u32) {
        self.relax();
        self.arming = Arming::Armed;
        self.open(now);
    }

    pub(crate) const fn disarm(&mut self) {
        self.relax();
        self.arming = Arming::Disarmed;
    }

    /// Relaxes the motor, and refuses targets until armed again.
    pub(crate) const fn trip(&mut self) {
        if !matches!(self.arming, Arming::Disarmed) {
            self.arming = Arming::Tripped;
        }
        self.relax();
    }

    /// Handles a time that did not move on: no age is known. Feedback counts as late until the next frame, and the motor trips.
    pub(crate) fn lose_time(&mut self) {
        self.latch.set(Condition::ClockFault, self.listens || self.link == Link::Online);
        if self.listens && self.link == Link::Online {
            self.set_late();
        }
        self.trip();
    }

    /// Opens the output range from zero.
    pub(crate) const fn open(&mut self, now: u32) {
        self.is_opening = true;
        self.opened = now;
    }

    /// Returns the open share of the output range, 0 to 1; 0 for a time before the beginning.
    pub(crate) fn share(&mut self, now: u32) -> f32 {
        let (passed, whole) = (age(now, self.opened), u32::from(self.opening_ms) * 1_000);
        self.is_opening &= passed < whole;
        if self.is_opening { passed as f32 / whole as f32 } else { 1.0 }
    }

    /// Returns the ends of the available output, as shares of the full output from -1 to 1: the [open](Self::share) share, at most as much
    /// as the conditions leave, and zero downward or upward where that way is barred.
    pub(crate) fn range(&mut self, left: f32, barred: (bool, bool), now: u32) -> (f32, f32) {
        let most = limited(left, 0.0, self.share(now));
        let end = |is_barred| if is_barred { 0.0 } else { most };
        (-end(barred.0), end(barred.1))
    }
}

#[cfg(test)]
mod tests {
    use super::super::OPENING;
    use super::*;

    #[test]
    fn the_range_opens_in_proportion_to_time_and_stays_open() {
        let at_ms = |ms: u32| (1_000 * ms).wrapping_sub(1_100_000); // over the wrap
        let mut motor = MotorGuard::NEW.with(OPENING, false);
        assert_eq!(motor.share(at_ms(5)).to_bits(), 1.0_f32.to_bits(), "never closed");
        motor.open(at_ms(1_000));
        let shares = [990, 1_000, 1_100, 1_200, 1_000].map(|ms| motor.share(at_ms(ms)));
        assert_eq!(shares.map(f32::to_bits), [0.0, 0.0, 0.5, 1.0, 1.0].map(f32::to_bits));
        let mut at_once = MotorGuard::NEW.with(Duration::ZERO, false);
        at_once.open(at_ms(1));
        assert_eq!(at_once.share(at_ms(1)).to_bits(), 1.0_f32.to_bits());
    }

    /// Law: no end is further out than what is open or what the conditions leave, and the end of a way that is barred is zero.
    #[test]
    fn the_range_has_the_smaller_share_toward_each_way_that_is_not_barred() {
        let mut motor = MotorGuard::NEW.with(OPENING, false);
        motor.open(0);
        for (now_ms, left, most) in
            [(50, 1.0, 0.25), (100, 0.3, 0.3), (150, 0.0, 0.0), (200, 0.7, 0.7)]
        {
            let ends = [(false, false), (true, false), (false, true), (true, true)]
                .map(|barred| motor.range(left, barred, 1_000 * now_ms));
            assert_eq!(
                ends,
                [(-most, most), (-0.0, most), (-most, 0.0), (-0.0, 0.0)],
                "{now_ms} ms"
            );
        }
    }

    #[test]
    fn a_range_is_closed_before_its_beginning_and_open_after_a_pause_of_any_length() {
        let opening = || {
            let mut motor = MotorGuard::NEW.with(OPENING, false);
            motor.open(20_000);
            motor
        };
        let mut motor = opening();
        motor.forget_bygones(15_000, false);
        assert_eq!(motor.share(15_000).to_bits(), 0.0_f32.to_bits(), "5 ms before");
        for pause_us in [60_000_001, 2_400_000_000, 4_290_000_000_u32] {
            let (mut motor, now) = (opening(), pause_us.wrapping_add(20_000));
            motor.forget_bygones(now, true);
            assert_eq!(motor.share(now).to_bits(), 1.0_f32.to_bits(), "{pause_us} us");
        }
    }

    #[test]
    fn feedback_in_time_is_counted_beside_the_gap_that_is_trusted() {
        let mut motor = MotorGuard::NEW;
        motor.hear(1_000, &Timeouts::new());
        assert!(!motor.is_in_time(1_000), "no gap is trusted yet");
        motor.trust(2_741);
        for us in 1_001..=4_000 {
            assert!(motor.is_in_time(us + 2_739) && !motor.is_in_time(us + 2_740));
            motor.hear_in_time(us);
        }
        motor.trust(93_250);
        assert!(motor.is_in_time(4_000 + 93_249) && !motor.is_in_time(4_000 + 93_250));
        assert_eq!([motor.in_time.take(), motor.in_time.take()], [3_000, 0]);
        assert!(motor.is_in_time(4_000 + 93_249) && !motor.is_in_time(4_000 + 93_250));
        motor.trust(u32::MAX);
        assert!(motor.is_in_time(4_000 + 131_070) && !motor.is_in_time(4_000 + 131_071));
    }
}
