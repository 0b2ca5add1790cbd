//! Checks of one motor a tick, and its state and health.

use super::{Slot, coarse};
use crate::dji::codec::{FIRST_BELOW_ZERO, Range, celsius, to_raw};
use crate::dji::{Facts, State};
use crate::encoder::Homing;
use crate::motor::{
    Condition, Conditions, Health, HealthConfig, Link, Monitor, MotorName, Sample, Traffic,
    check_soft_limits, elapsed,
};
use crate::time::Duration;
use crate::units::Current;

/// Values of the bus for a check of a motor.
#[derive(Debug, Clone, Copy)]
pub(in crate::dji) struct Surroundings {
    pub(in crate::dji) now: u32,
    /// Time since the previous check, in units of 1.024 ms.
    pub(in crate::dji) elapsed: u8,
    /// The command sent.
    pub(in crate::dji) word: i16,
    /// Length of the counting window in units of 1.024 ms, if the window ends.
    pub(in crate::dji) window: Option<u16>,
    pub(in crate::dji) feedback_hz: u32,
    pub(in crate::dji) is_alone: bool,
}

/// The motor to check next, and the times of the round.
#[derive(Debug, Clone, Copy)]
pub(in crate::dji) struct CheckRound {
    /// Begin of the present counting window.
    window_from: u32,
    /// Begin of the present round.
    begun: u32,
    /// The rate of each motor's feedback, as configured.
    pub(in crate::dji) feedback_hz: u32,
    /// The length of the window that ends in this round, in units of 1.024 ms.
    window: u16,
    /// The length of the previous round.
    pub(in crate::dji) elapsed: u8,
    /// Place of the motor to check next; in a round that ends a window, beyond [`CLOSING`](Self::CLOSING).
    pub(in crate::dji) next: u8,
    has_begun: bool,
    /// Whether sent frames are received again.
    pub(in crate::dji) echoes: bool,
}

impl CheckRound {
    pub(in crate::dji) const NEW: Self = Self {
        window_from: 0,
        begun: 0,
        feedback_hz: 1_000,
        window: 0,
        elapsed: 0,
        next: 0,
        has_begun: false,
        echoes: false,
    };

    /// In a round that ends a window, each motor is checked in full: no slot has such a number, so the quick check is skipped.
    pub(in crate::dji) const CLOSING: u8 = 0x80;

    /// Returns the length of the window that ends in this round; `None` if no window ends.
    pub(in crate::dji) const fn window(&self) -> Option<u16> {
        if self.next & Self::CLOSING != 0 { Some(self.window) } else { None }
    }

    /// Begins a new round: one tick for each place, and one for this call.
    pub(in crate::dji) fn begin(&mut self, now: u32) {
        self.elapsed = elapsed(Some(now.wrapping_sub(self.begun)));
        self.begun = now;
        let elapsed = now.wrapping_sub(self.window_from);
        let closes_window = self.has_begun && u64::from(elapsed) >= Traffic::WINDOW.as_micros();
        self.next = if closes_window { Self::CLOSING } else { 0 };
        if closes_window || !self.has_begun {
            self.window = u16::try_from(elapsed >> 10).unwrap_or(u16::MAX);
            self.window_from = now;
            self.has_begun = true;
        }
    }
}

/// Allows quick checks from now on, if all is well.
#[inline(never)]
pub(super) fn waive_check(slot: &mut Slot, facts: &Facts) {
    let is_well = slot.guard.latch.active().is_empty()
        && slot.guard.link() == Link::Online
        && !slot.guard.is_opening
        && slot.error_code == 0
        && slot.range == Range::within(slot.full_limit)
        && slot.health.soft_limits.is_none();
    if is_well {
        let (warning, _) = temperatures(facts, slot.health);
        let known = u8::try_from(warning.max(0)).unwrap_or(FIRST_BELOW_ZERO);
        slot.cool_below =
            if facts.has_temperature { known.min(FIRST_BELOW_ZERO) } else { FIRST_BELOW_ZERO };
    }
}

/// Begins a condition that is not ignored. A full check must end the condition.
pub(in crate::dji) fn begin(slot: &mut Slot, condition: Condition) {
    slot.guard.judge(condition, true, slot.health);
    slot.require_check();
}

/// Runs all checks that do not run in every tick.
pub(in crate::dji) fn check(slot: &mut Slot, seen: &Surroundings) {
    let Some(facts) = slot.facts else { return };
    let before = slot.guard.latch.active();
    if let Some(window) = seen.window {
        close_window(slot, window, seen.feedback_hz);
    }
    if !before.is_empty() {
        slot.guard.latch.end_what_is_over(slot.guard.has_target(), seen.is_alone);
    }
    let mut left = 1.0;
    if slot.guard.link() == Link::Online {
        left = run_checks(slot, facts, seen);
        narrow(slot, left, seen.elapsed, seen.now);
    } else {
        slot.monitor = Monitor::NEW;
    }
    if !slot.guard.latch.active().is_empty() || slot.error_code != 0 {
        slot.require_check();
        slot.guard.react(before, left, slot.health);
    } else if slot.cool_below == 0 {
        waive_check(slot, facts);
    }
}

/// Takes the error code of a frame. A graver code than before counts at once: the error may be over at the motor's turn. Any other code
/// waits for that turn, so that intermittent codes do not flood the edges.
pub(in crate::dji) fn hear_error(slot: &mut Slot, facts: &Facts, code: u8) {
    if code == 0 {
        return;
    }
    slot.monitor.hear_error();
    if is_graver(slot, facts, code) {
        let before = slot.guard.latch.active();
        take_error(slot, facts, code);
        slot.require_check();
        slot.guard.react(before, 1.0, slot.health);
    }
}

/// Takes the code of a frame in time; `false` for a [graver](is_graver) code than before.
pub(in crate::dji) fn hear_known_error(slot: &mut Slot, facts: &Facts, code: u8) -> bool {
    if code != 0 {
        if is_graver(slot, facts, code) {
            return false;
        }
        slot.monitor.hear_error();
    }
    true
}

/// Tells whether an error code is graver than the previous one.
fn is_graver(slot: &Slot, facts: &Facts, code: u8) -> bool {
    code != slot.error_code && facts.errors.severity(code) > facts.errors.severity(slot.error_code)
}

fn take_error(slot: &mut Slot, facts: &Facts, code: u8) {
    if code != slot.error_code {
        slot.error_code = code;
        slot.guard.latch.report(facts.errors.severity(code), true, slot.health);
    }
}

fn run_checks(slot: &mut Slot, facts: &Facts, seen: &Surroundings) -> f32 {
    let feedback = slot.feedback;
    let came = slot.monitor.take_error();
    // An error that came and went since the previous check is not over yet: it may be intermittent.
    if !came || feedback.error() != 0 {
        take_error(slot, facts, feedback.error());
    }
    let at_limit = slot.range.is_end(seen.word);
    slot.saturated = slot.saturated.saturating_add(u16::from(at_limit));
    let sample = Sample {
        elapsed: seen.elapsed,
        fresh: slot.guard.was_heard_within(seen.now, u32::from(seen.elapsed) << 10),
        effort: f32::from(seen.word) / f32::from(slot.full_limit),
        speed: f32::from(feedback.rpm()) / f32::from(facts.rotor_no_load_rpm()),
        current: f32::from(feedback.current()) / f32::from(facts.current_raw),
        word: coarse(seen.word),
        // A fifth of the motor's limit.
        word_change: (coarse(slot.full_limit) / 5).max(1).unsigned_abs(),
        angle: feedback.angle(),
        rest: mixed(feedback.current().cast_unsigned(), feedback.rpm().cast_unsigned()),
        temperature: facts
            .has_temperature
            .then(|| (celsius(feedback.temperature()), temperatures(facts, slot.health))),
    };
    slot.monitor.check(&mut slot.guard.latch, &sample, slot.health)
}

/// Narrows the output to what is available, of which the conditions leave a share.
fn narrow(slot: &mut Slot, share: f32, elapsed: u8, now: u32) {
    let barred = soft_limits(slot, elapsed);
    slot.range = available(slot, share, barred, now);
    slot.apply_rules();
    if slot.range != Range::within(slot.full_limit) {
        hold_back(slot);
    }
}

/// Narrows the output further, where less is available than at the last check.
pub(super) fn narrow_further(slot: &mut Slot, barred: (bool, bool), now: u32) {
    slot.range = slot.range.and(available(slot, 1.0, barred, now));
    slot.apply_rules();
}

/// Narrows the output further, and to what the soft limits leave where the shaft is.
pub(super) fn keep_inside(slot: &mut Slot, now: u32) {
    let barred = soft_limits(slot, 0);
    narrow_further(slot, barred, now);
}

/// Returns the available commands.
fn available(slot: &mut Slot, share: f32, barred: (bool, bool), now: u32) -> Range {
    let (lower, upper) = slot.guard.range(share, barred, now);
    let word = |share: f32| to_raw(share.abs(), f32::from(slot.full_limit), slot.full_limit);
    let (down, up) = (word(lower), word(upper));
    if slot.raw_per_unit > 0.0 { Range::between(down, up) } else { Range::between(up, down) }
}

/// Keeps the integral of the speed loop within the available output: the loop knows only the full limit, and would wind up.
fn hold_back(slot: &mut Slot) {
    let end = |raw: i16| f32::from(slot.range.nearest(raw.into())) / slot.raw_per_unit;
    let (one, other) = (end(i16::MIN), end(i16::MAX));
    slot.speed.keep_integral_between(one.min(other), one.max(other));
}

/// Tells whether there is a motor that may be armed.
pub(in crate::dji) fn is_fit(slot: &Slot) -> bool {
    slot.facts.is_some() && unfit(slot).is_none()
}

/// Begins as the motor is armed. A condition that relaxed the motor is detected anew.
pub(in crate::dji) fn start(slot: &mut Slot, now: u32) {
    slot.monitor.start(&mut slot.guard.latch);
    keep_inside(slot, now);
}

/// Returns whether a soft limit bars the way downward, and whether one bars the way upward. `ahead` is the time to look ahead, in units of
/// 1.024 ms.
fn soft_limits(slot: &mut Slot, ahead: u8) -> (bool, bool) {
    let Some((lower, upper)) = slot.health.soft_limits else { return (false, false) };
    if slot.homing == Homing::Relative {
        slot.guard.latch.set(Condition::SoftLimit, false);
        return (false, false);
    }
    let here = slot.shaft.position().as_angle().as_radians();
    // The position at the next check.
    let there = here + slot.velocity().as_rad_per_s() * (f32::from(ahead) * 1.024e-3);
    check_soft_limits(&mut slot.guard.latch, (lower, upper), here, there)
}

fn close_window(slot: &mut Slot, window: u16, feedback_hz: u32) {
    let was_crowded = slot.traffic.is_crowded();
    let double = slot.traffic.is_double();
    slot.traffic.add(slot.guard.in_time.take());
    slot.traffic.close(window, feedback_hz);
    if slot.traffic.is_crowded() {
        // Every frame is compared from now on.
        slot.guard.trust(0);
    }
    if was_crowded && !double {
        slot.guard.latch.set(Condition::DuplicateId, false);
    }
}

/// Returns the state; `None` before the first frame.
// Inline only: the compiler then drops the fields without a reader.
#[inline(always)]
pub(in crate::dji) fn state(slot: &Slot) -> Option<State> {
    let facts = slot.facts?;
    if slot.guard.link() == Link::Unheard {
        return None;
    }
    let amperes =
        slot.direction() * f32::from(slot.feedback.current()) * facts.current_full_scale_a
            / f32::from(facts.current_raw);
    Some(State {
        motor: MotorName::new(facts.name, slot.id(facts)),
        position: slot.shaft.position(),
        homing: slot.homing,
        velocity: slot.velocity(),
        current: Current::from_amperes(amperes),
        torque_nm: amperes * slot.nm_per_a,
        temperature_c: facts.has_temperature.then_some(celsius(slot.feedback.temperature())),
        error: facts.errors.read(slot.feedback.error()),
        rotor_counts: slot.shaft.rotor_counts(),
        ambiguous_gaps: slot.ambiguous_gaps,
        refused_targets: slot.guard.refused_targets,
        forgotten_targets: slot.guard.forgotten_targets,
        conditions: slot.guard.latch.active(),
        link: slot.guard.link(),
        feedback: slot.feedback,
    })
}

/// Returns the health of the motor.
pub(in crate::dji) fn report(slot: &Slot) -> Option<Health> {
    let facts = slot.facts?;
    let heard = slot.guard.link() != Link::Unheard;
    let celsius = celsius(slot.feedback.temperature());
    Some(Health {
        feedback_hz: slot.traffic.rate_hz(),
        longest_gap: Duration::from_micros(slot.traffic.longest_gap_us().into()),
        temperature_c: (heard && facts.has_temperature).then_some(celsius),
        error_code: slot.error_code,
        saturated: slot.saturated,
        ambiguous_gaps: slot.ambiguous_gaps,
        ..slot.guard.health(slot.name()?)
    })
}

/// Returns a motor that must not be armed, with its conditions.
pub(in crate::dji) fn unfit(slot: &Slot) -> Option<(MotorName, Conditions)> {
    let conditions = slot.guard.latch.active();
    Some((slot.name()?, conditions)).filter(|_| slot.health.forbids(conditions))
}

/// Mixes two numbers so that the upper bits change with each (Knuth's multiplicative hash).
const fn mixed(one: u16, other: u16) -> u16 {
    one.wrapping_mul(0x9E37) ^ other.wrapping_mul(0x79B9)
}

/// Returns the temperatures from which the motor is warm, and from which the motor is hot.
const fn temperatures(facts: &Facts, health: &HealthConfig) -> (i16, i16) {
    match health.temperatures_c() {
        Some(temperatures) => temperatures,
        None => facts.temperatures_c,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Current and speed of a motor at rest differ by little, and still by chance one in eight is alike.
    #[test]
    fn the_upper_bits_of_a_mixture_take_each_value_as_often() {
        let mut seen = [0_u16; 8];
        for one in 0..64 {
            for other in 0..64 {
                seen[usize::from(mixed(one, other) >> 13)] += 1;
            }
        }
        assert!(seen.iter().all(|times| (400..=624).contains(times)), "{seen:?}");
    }
}
