//! Checks of one motor a tick, and its health.

use super::{Slot, coarse};
use crate::dji::command::to_raw;
use crate::dji::range::Range;
use crate::dji::{Facts, State};
use crate::encoder::Homing;
use crate::motor::{
    Condition, Conditions, Health, HealthConfig, Link, Monitor, MotorName, Sample, age,
};
use crate::time::Duration;
use crate::units::Current;

/// Inside of a soft limit by this much the motor is no longer at it.
const CLEAR_RAD: f32 = 0.01;

/// The temperature byte that stands for -40 °C.
const FIRST_BELOW_ZERO: u8 = 216;

/// A motor with one of these is not armed.
const OBSTACLES: Conditions = Conditions::NONE.with(Condition::Fault).with(Condition::DuplicateId);

/// What a look at a motor has to know of its bus.
#[derive(Debug, Clone, Copy)]
pub(in crate::dji) struct Look {
    pub(in crate::dji) now: u32,
    /// Time since the look before, in units of 1.024 ms.
    pub(in crate::dji) elapsed: u8,
    /// The command that was sent.
    pub(in crate::dji) word: i16,
    /// Its length in units of 1.024 ms, when a window in which frames are counted ends.
    pub(in crate::dji) window: Option<u16>,
    pub(in crate::dji) feedback_hz: u32,
    /// Nobody else sends commands any more.
    pub(in crate::dji) is_alone: bool,
}

impl Slot {
    /// Something began: the motor is looked at closely until all is [well](Self::relent) again.
    pub(super) const fn attend(&mut self) {
        self.cool_below = 0;
    }

    /// From now on a glance is enough, if all is well.
    #[inline(never)]
    pub(super) fn relent(&mut self, facts: &Facts) {
        let is_well = self.guard.latch().active().is_empty()
            && self.guard.link() == Link::Online
            && !self.guard.is_opening()
            && self.error_code == 0
            && self.range == Range::within(self.full_limit)
            && self.health.soft_limits.is_none();
        if is_well {
            let (warning, _) = temperatures(facts, self.health);
            let known = u8::try_from(warning.max(0)).unwrap_or(FIRST_BELOW_ZERO);
            self.cool_below =
                if facts.has_temperature { known.min(FIRST_BELOW_ZERO) } else { FIRST_BELOW_ZERO };
        }
    }

    /// A condition began that a look at the motor has to end, or is to see.
    pub(super) const fn begin(&mut self, condition: Condition) {
        self.guard.latch_mut().set(condition, true);
        self.attend();
    }

    /// Looks at everything that need not be looked at in every tick.
    pub(in crate::dji) fn check(&mut self, look: &Look) {
        let Some(facts) = self.facts else { return };
        let before = self.guard.latch().active();
        if let Some(window) = look.window {
            self.close_window(window, look.feedback_hz);
        }
        if !before.is_empty() {
            self.end_what_is_over(look);
        }
        if self.guard.link() == Link::Online {
            let share = self.examine(facts, look);
            self.narrow(share, look.elapsed, look.now);
        } else {
            self.monitor = Monitor::NEW;
        }
        if !self.guard.latch().active().is_empty() || self.error_code != 0 {
            self.attend();
            self.react(before);
        } else if self.cool_below == 0 {
            self.relent(facts);
        }
    }

    /// Takes the error code of a frame. One that weighs more than that before counts at once: by the motor's turn it may be
    /// over. A lesser one waits for that turn, so that codes which come and go are no flood.
    pub(in crate::dji) fn hear_error(&mut self, facts: &Facts, code: u8) {
        if code == 0 {
            return;
        }
        self.monitor.hear_error();
        if facts.errors.severity(code) > facts.errors.severity(self.error_code) {
            let before = self.guard.latch().active();
            self.take_error(facts, code);
            self.attend();
            self.react(before);
        }
    }

    fn take_error(&mut self, facts: &Facts, code: u8) {
        if code != self.error_code {
            self.error_code = code;
            self.guard.latch_mut().report(facts.errors.severity(code), true, self.health);
        }
    }

    fn examine(&mut self, facts: &Facts, look: &Look) -> f32 {
        let feedback = self.feedback;
        let came = self.monitor.take_error();
        // What came and went since the look before is not over yet: it may come and go.
        if !came || feedback.error() != 0 {
            self.take_error(facts, feedback.error());
        }
        let at_limit = self.range.is_end(look.word);
        self.saturated = self.saturated.saturating_add(u16::from(at_limit));
        let sample = Sample {
            elapsed: look.elapsed,
            fresh: age(look.now, self.guard.heard()) <= u32::from(look.elapsed) << 10,
            effort: f32::from(look.word) / f32::from(self.full_limit),
            speed: f32::from(feedback.rpm()) / f32::from(facts.rotor_no_load_rpm()),
            current: f32::from(feedback.current()) / f32::from(facts.current_raw),
            word: coarse(look.word),
            // A fifth of the motor's limit.
            word_change: (coarse(self.full_limit) / 5).max(1).unsigned_abs(),
            angle: feedback.angle(),
            rest: mixed(feedback.current().cast_unsigned(), feedback.rpm().cast_unsigned()),
            temperature: facts
                .has_temperature
                .then(|| (celsius(feedback.temperature()), temperatures(facts, self.health))),
        };
        self.monitor.look(self.guard.latch_mut(), &sample, self.health)
    }

    /// Narrows the output to the share that is left, in the directions that are left.
    fn narrow(&mut self, share: f32, elapsed: u8, now: u32) {
        let share = share.min(self.guard.share(now));
        let limit = to_raw(share, f32::from(self.full_limit), self.full_limit);
        self.range = Range::within(limit);
        self.keep_inside(elapsed);
        if self.range != Range::within(self.full_limit) {
            self.hold_back();
        }
    }

    /// Keeps the integral of the speed loop within what is left of the output: the loop knows only the full limit, and would
    /// wind up.
    fn hold_back(&mut self) {
        let end = |raw: i16| f32::from(self.range.nearest(raw.into())) / self.raw_per_unit;
        let (one, other) = (end(i16::MIN), end(i16::MAX));
        self.speed.keep_integral_between(one.min(other), one.max(other));
    }

    /// Tells whether there is a motor, and nothing that keeps it from being armed.
    pub(in crate::dji) fn is_fit(&self) -> bool {
        self.facts.is_some() && !self.is_faulty()
    }

    /// Takes targets from now on, starting from rest; what relaxed the motor before is noticed anew.
    pub(in crate::dji) fn engage(&mut self, now: u32) {
        self.guard.engage(now);
        for condition in Monitor::NOTICED_ANEW {
            self.guard.latch_mut().set(condition, false);
        }
        self.monitor = Monitor::NEW;
        self.begin_opening();
        self.keep_inside(0);
    }

    /// The output range opens from zero, where it does not open at once.
    pub(super) fn begin_opening(&mut self) {
        if self.guard.is_opening() {
            self.range = Range::ZERO;
        }
    }

    /// Takes the outward direction away at a soft limit. `ahead` is how far to look, in units of 1.024 ms.
    pub(super) fn keep_inside(&mut self, ahead: u8) {
        let (up_only, down_only) = self.soft_limits(ahead);
        let upward = self.raw_per_unit > 0.0;
        let (positive_only, negative_only) =
            if upward { (up_only, down_only) } else { (down_only, up_only) };
        if positive_only {
            self.range = self.range.without_negative();
        }
        if negative_only {
            self.range = self.range.without_positive();
        }
        self.settle();
    }

    /// Returns whether the shaft may turn up only, and whether down only.
    fn soft_limits(&mut self, ahead: u8) -> (bool, bool) {
        let Some((lower, upper)) = self.health.soft_limits else { return (false, false) };
        if self.homing == Homing::Relative {
            self.guard.latch_mut().set(Condition::SoftLimit, false);
            return (false, false);
        }
        let here = self.shaft.position().as_angle().as_radians();
        // Where it is when it is looked at next.
        let there = here + self.velocity().as_rad_per_s() * (f32::from(ahead) * 1.024e-3);
        let (below, above) = (here.min(there) <= lower, here.max(there) >= upper);
        let lingers = self.guard.latch().has(Condition::SoftLimit)
            && !(here > lower + CLEAR_RAD && here < upper - CLEAR_RAD);
        self.guard.latch_mut().set(Condition::SoftLimit, below || above || lingers);
        (below, above)
    }

    fn end_what_is_over(&mut self, look: &Look) {
        self.guard.end_what_is_over();
        if look.is_alone {
            self.guard.latch_mut().set(Condition::SecondMaster, false);
        }
    }

    fn close_window(&mut self, window: u16, feedback_hz: u32) {
        let was_crowded = self.traffic.is_crowded();
        let double = self.traffic.is_double();
        self.traffic.add(self.guard.take_in_time());
        self.traffic.close(window, feedback_hz);
        if self.traffic.is_crowded() {
            // Every frame is compared from now on.
            self.guard.trust(0);
        }
        if was_crowded && !double {
            self.guard.latch_mut().set(Condition::DuplicateId, false);
        }
    }

    /// Relaxes the motor when something began, or still holds, for which it has to be.
    pub(super) fn react(&mut self, before: Conditions) {
        let active = self.guard.latch().active();
        let begun = active.minus(before).and(self.health.relaxing());
        if !begun.is_empty() || self.is_faulty() {
            self.guard.trip();
        }
    }

    /// Another node has sent the motor's command frame.
    pub(in crate::dji) fn hear_rival(&mut self) {
        if !self.health.ignores(Condition::SecondMaster) {
            let before = self.guard.latch().active();
            self.begin(Condition::SecondMaster);
            self.react(before);
        }
    }

    /// Returns how the motor is.
    pub(in crate::dji) fn health(&self) -> Option<Health> {
        let facts = self.facts?;
        let heard = self.guard.link() != Link::Unheard;
        let celsius = celsius(self.feedback.temperature());
        Some(Health {
            motor: self.name()?,
            link: self.guard.link(),
            armed: self.guard.is_armed(),
            conditions: self.guard.latch().active(),
            feedback_hz: self.traffic.rate_hz(),
            longest_gap: Duration::from_micros(self.traffic.longest_gap_us().into()),
            temperature_c: (heard && facts.has_temperature).then_some(celsius),
            error_code: self.error_code,
            saturated: self.saturated,
            refused_targets: self.guard.refused_targets(),
            forgotten_targets: self.guard.forgotten_targets(),
            ambiguous_gaps: self.ambiguous_gaps,
        })
    }

    /// Tells whether the motor must not be armed.
    pub(in crate::dji) fn is_faulty(&self) -> bool {
        !self.guard.latch().active().and(OBSTACLES).and(self.health.relaxing()).is_empty()
    }

    /// Returns what is known; `None` before the first frame.
    // The compiler leaves out what nobody reads, in line only.
    #[inline(always)]
    pub(in crate::dji) fn state(&self) -> Option<State> {
        let facts = self.facts?;
        if self.guard.link() == Link::Unheard {
            return None;
        }
        let amperes =
            self.direction() * f32::from(self.feedback.current()) * facts.current_full_scale_a
                / f32::from(facts.current_raw);
        Some(State {
            motor: MotorName::new(facts.name, self.id(facts)),
            position: self.shaft.position(),
            homing: self.homing,
            velocity: self.velocity(),
            current: Current::from_amperes(amperes),
            torque_nm: amperes * self.nm_per_a,
            temperature_c: facts.has_temperature.then_some(celsius(self.feedback.temperature())),
            error: facts.errors.read(self.feedback.error()),
            rotor_counts: self.shaft.rotor_counts(),
            ambiguous_gaps: self.ambiguous_gaps,
            refused_targets: self.guard.refused_targets(),
            forgotten_targets: self.guard.forgotten_targets(),
            conditions: self.guard.latch().active(),
            link: self.guard.link(),
            feedback: self.feedback,
        })
    }

    /// Time did not move on. A free slot loses nothing.
    pub(in crate::dji) fn lose_time(&mut self) {
        if self.facts.is_some() {
            self.guard.lose_time();
        }
    }
}

/// Mixes two numbers so that the upper bits change with each (Knuth's multiplicative hash).
const fn mixed(one: u16, other: u16) -> u16 {
    one.wrapping_mul(0x9E37) ^ other.wrapping_mul(0x79B9)
}

/// Returns from which temperature on the motor is warm, and from which on it is hot.
const fn temperatures(facts: &Facts, health: &HealthConfig) -> (i16, i16) {
    match health.temperatures_c() {
        Some(temperatures) => temperatures,
        None => facts.temperatures_c,
    }
}

/// The byte is signed in some drivers and unsigned in others: -40 to -1 is meant rather than 216 to 255.
fn celsius(byte: u8) -> i16 {
    if byte < FIRST_BELOW_ZERO { byte.into() } else { i16::from(byte) - 256 }
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
