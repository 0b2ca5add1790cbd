//! Setpoints within the reach of a mechanism, and the effort to follow them.
//!
//! | type | bounds | use it when |
//! |---|---|---|
//! | [`SlewLimiter`] | the rate of change | the target keeps moving: a stick, another controller |
//! | [`Profile`] with [`MotionLimits::new`] | speed and acceleration (trapezoid) | a move from A to B, rigid mechanics |
//! | [`Profile`] with [`MotionLimits::with_jerk`] | jerk as well (S-curve) | a move from A to B, and nothing may shake |
//! | [`Motion`](crate::control::Motion) | jerk too | the state is not at rest, the target moves, or several axes go in step |
//! | [`Plant::effort`](crate::control::Plant::effort) | | the effort of the profile is known: leave the rest to the PID |

mod profile;

pub use profile::{MotionLimits, Profile, ProfileState};

use crate::error::{ConfigError, check, positive};
use crate::math::limited;
use crate::time::TimeStep;

/// Limits the rate of rise and fall of a value.
///
/// ```text
/// value += target - value, but no more than up dt, and no less than -down dt
/// ```
/// The rates are in units of the value a second. For a speed of either sign, [`with_braking`](Self::with_braking) sets the rate
/// towards zero apart from them.
///
/// # Edge behaviour
/// Starts from zero, or from the value given to [`reset_to`](Self::reset_to). If `dt_s` is zero, negative, NaN or infinite, or
/// the target is NaN or infinite, the last output is returned and [`rejected`](Self::rejected) grows. `dt_s` above 0.1 s (see
/// [`with_max_step`](Self::with_max_step)), in the first call too, counts as 0.1 s: a pause is no permission to jump. Steps
/// smaller than the spacing of `f32` at the value add up: the value arrives, at any slow rate. At any fast rate, the value stays
/// between its last value and the target.
///
/// # Examples
/// ```
/// use drivetrain::control::SlewLimiter;
///
/// let mut speed = SlewLimiter::new(2.0, 5.0)?; // up by 2, down by 5 a second
/// assert_eq!(speed.update(1.0, 0.1), 0.2);
/// assert_eq!(speed.update(-1.0, 0.1), -0.3);
/// # Ok::<(), drivetrain::error::ConfigError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct SlewLimiter {
    up_per_s: f32,
    down_per_s: f32,
    /// Towards zero; zero unless set.
    braking_per_s: f32,
    max_step_s: f32,
    value: f32,
    /// The part of the permitted way not yet contained in the value.
    rest: f32,
    rejected: u16,
}

impl SlewLimiter {
    /// Takes the largest rise and the largest fall a second, both more than zero.
    ///
    /// # Errors
    /// Names `up` or `down` when NaN, infinite, zero or negative.
    pub const fn new(up_per_s: f32, down_per_s: f32) -> Result<Self, ConfigError> {
        check!(positive("up", up_per_s));
        check!(positive("down", down_per_s));
        let max_step_s = TimeStep::MAX_S;
        Ok(Self {
            up_per_s,
            down_per_s,
            braking_per_s: 0.0,
            max_step_s,
            value: 0.0,
            rest: 0.0,
            rejected: 0,
        })
    }

    /// Sets the largest change a second towards zero, more than zero; away from zero, the rise and the fall hold.
    ///
    /// In a step across zero, the rest of the time is at the rate away from zero.
    ///
    /// # Errors
    /// Names `braking` when NaN, infinite, zero or negative.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::control::SlewLimiter;
    ///
    /// let mut speed = SlewLimiter::new(2.0, 2.0)?.with_braking(5.0)?; // speeds up by 2, brakes by 5 a second
    /// speed.reset_to(-1.0);
    /// assert_eq!(speed.update(1.0, 0.1), -0.5);
    /// assert_eq!(speed.update(1.0, 0.1), 0.0);
    /// assert_eq!(speed.update(1.0, 0.1), 0.2);
    /// # Ok::<(), drivetrain::error::ConfigError>(())
    /// ```
    pub const fn with_braking(self, per_s: f32) -> Result<Self, ConfigError> {
        check!(positive("braking", per_s));
        Ok(Self { braking_per_s: per_s, ..self })
    }

    /// Sets the longest step in seconds that counts in full.
    ///
    /// # Errors
    /// Names `max_step` when NaN, infinite, zero or negative.
    pub const fn with_max_step(self, max_step_s: f32) -> Result<Self, ConfigError> {
        check!(positive("max_step", max_step_s));
        Ok(Self { max_step_s, ..self })
    }

    /// Steps by `dt_s` seconds towards `target` and returns the new value.
    ///
    /// Costs 72 instructions on a Cortex-M4F (`docs/figures.md`).
    pub const fn update(&mut self, target: f32, dt_s: f32) -> f32 {
        let step = TimeStep::new(dt_s, self.max_step_s);
        if step.admits(target.is_finite(), &mut self.rejected) {
            let (is_above, is_below) = (self.value > 0.0, self.value < 0.0);
            let lowest = self.rest - self.reach(self.down_per_s, is_above, step.dt_s);
            let highest = self.rest + self.reach(self.up_per_s, is_below, step.dt_s);
            let left = target - self.value;
            let change = limited(left, lowest, highest);
            // Rounding must take the value neither past the target nor, with a rest of the way
            // before, back.
            let (nearest, farthest) =
                if left > 0.0 { (self.value, target) } else { (target, self.value) };
            let value = limited(self.value + change, nearest, farthest);
            let within_reach = left >= lowest && left <= highest;
            let arrives = value.to_bits() == target.to_bits();
            if within_reach || arrives {
                (self.value, self.rest) = (target, 0.0);
            } else {
                (self.value, self.rest) = (value, change - (value - self.value));
            }
        }
        self.value
    }

    /// Returns the largest change in one direction: at `per_s`, but at the braking rate as far as zero.
    const fn reach(&self, per_s: f32, is_towards_zero: bool, dt_s: f32) -> f32 {
        if !is_towards_zero || self.braking_per_s <= 0.0 {
            return per_s * dt_s;
        }
        let (way, braked) = (self.value.abs(), self.braking_per_s * dt_s);
        if braked <= way {
            return braked;
        }
        let left_s = dt_s - way / self.braking_per_s;
        if left_s > 0.0 { way + per_s * left_s } else { way }
    }

    /// Puts the value at `value`. NaN and infinity count as zero.
    pub const fn reset_to(&mut self, value: f32) {
        self.value = if value.is_finite() { value } else { 0.0 };
        self.rest = 0.0;
    }

    /// Returns the last output.
    #[must_use]
    pub const fn value(&self) -> f32 {
        self.value
    }

    /// Returns the number of refused steps; stays at 65535.
    #[must_use]
    pub const fn rejected(&self) -> u16 {
        self.rejected
    }
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "exact results are the rule under test")]
mod tests {
    use super::*;
    use crate::control::Plant;
    use proptest::prelude::*;

    #[test]
    fn a_long_pause_is_no_permission_to_jump() {
        let mut limiter = SlewLimiter::new(1.0, 1.0).unwrap();
        assert_eq!(limiter.update(100.0, 10.0), 0.1);
        assert_eq!(limiter.with_max_step(2.0).unwrap().update(100.0, 10.0), 2.1);
    }

    #[test]
    fn braking_has_its_own_rate_in_both_directions_and_no_time_is_lost_at_zero() {
        for direction in [1.0_f32, -1.0] {
            // 2 up, 3 down, 10 towards zero; a step of 0.1 s.
            let away = if direction > 0.0 { 0.3 } else { 0.2 };
            let mut limiter = SlewLimiter::new(2.0, 3.0).unwrap().with_braking(10.0).unwrap();
            limiter.reset_to(2.5 * direction);
            for expected in [1.5, 0.5, -0.5 * away, -1.5 * away] {
                let value = limiter.update(-9.0 * direction, 0.1);
                assert!((value - expected * direction).abs() < 1e-6, "{value}, {expected}");
            }
            // Slower than the rates away from zero, too, and to a stop at zero.
            let mut limiter = SlewLimiter::new(2.0, 3.0).unwrap().with_braking(0.5).unwrap();
            limiter.reset_to(0.06 * direction);
            assert!((limiter.update(0.0, 0.1) - 0.01 * direction).abs() < 1e-6);
            assert_eq!(limiter.update(0.0, 0.1), 0.0);
        }
    }

    #[test]
    fn steps_below_the_spacing_of_f32_add_up() {
        // At 1000, the spacing is 6e-5; a step is 1e-5.
        let mut limiter = SlewLimiter::new(0.01, 0.01).unwrap();
        limiter.reset_to(1000.0);
        for (target, expected) in [(2000.0, 1000.1), (-2000.0, 1000.0), (1000.0, 1000.0)] {
            for _ in 0..10_000 {
                limiter.update(target, 0.001);
            }
            assert!((limiter.value() - expected).abs() < 1e-4, "{}", limiter.value());
        }
        assert_eq!(limiter.value(), 1000.0);
    }

    /// The fuzzer found both: a rest of the sum greater than the next step, and a product that underflowed.
    #[test]
    fn rounding_neither_reverses_the_value_nor_makes_a_jump() {
        for (start, fall) in [(0.3, 1.9), (0.4, 0.9), (0.6, 2.7)] {
            let mut limiter = SlewLimiter::new(1e-30, fall).unwrap().with_max_step(1.0).unwrap();
            limiter.reset_to(start);
            let fallen = limiter.update(-10.0, 1.0);
            assert!((fallen - (start - fall)).abs() < 1e-6);
            assert!(limiter.update(10.0, 1.0) >= fallen, "falls on from {fallen}");
        }

        let mut limiter = SlewLimiter::new(1e-30, 1e-30).unwrap();
        assert_eq!(limiter.update(1e-25, 0.1), 1e-31);
    }

    #[test]
    fn a_way_from_one_end_of_f32_to_the_other_stays_finite() {
        let mut limiter = SlewLimiter::new(f32::MAX, 1.0).unwrap();
        limiter.reset_to(f32::MIN);
        let mut last = f32::MIN;
        for _ in 0..40 {
            let value = limiter.update(f32::MAX, 0.1);
            assert!(value.is_finite() && value >= last);
            last = value;
        }
        assert_eq!(last, f32::MAX);
        assert_eq!(limiter.with_max_step(f32::MAX).unwrap().update(0.0, 1e30), f32::MAX - 1e30);
    }

    #[test]
    fn bad_targets_and_bad_times_change_nothing_and_are_counted() {
        let mut limiter = SlewLimiter::new(1.0, 1.0).unwrap();
        limiter.reset_to(0.5);
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            assert_eq!((limiter.update(bad, 0.01), limiter.update(1.0, bad)), (0.5, 0.5));
        }
        assert_eq!((limiter.update(1.0, 0.0), limiter.update(1.0, -0.01)), (0.5, 0.5));
        assert_eq!(limiter.rejected(), 8);
    }

    #[test]
    fn a_rate_that_cannot_be_is_named() {
        for bad in [0.0, -1.0, f32::NAN, f32::INFINITY] {
            assert_eq!(SlewLimiter::new(bad, 1.0).unwrap_err().parameter(), "up");
            assert_eq!(SlewLimiter::new(1.0, bad).unwrap_err().parameter(), "down");
            let limiter = SlewLimiter::new(1.0, 1.0).unwrap();
            assert_eq!(limiter.with_max_step(bad).unwrap_err().parameter(), "max_step");
            assert_eq!(limiter.with_braking(bad).unwrap_err().parameter(), "braking");
        }
    }

    proptest! {
        /// Law: braking at the rate of rise and fall is no braking rate at all.
        #[test]
        fn one_rate_for_all_is_the_plain_limiter(
            rate in 1e-2_f32..1e3, start in -10.0_f32..10.0, targets in prop::collection::vec(-10.0_f32..10.0, 1..30),
        ) {
            let mut plain = SlewLimiter::new(rate, rate).unwrap();
            plain.reset_to(start);
            let mut braking = plain.with_braking(rate).unwrap();
            for target in targets {
                let (expected, value) = (plain.update(target, 0.01), braking.update(target, 0.01));
                prop_assert!((value - expected).abs() <= 1e-5, "{} instead of {}", value, expected);
            }
        }

        #[test]
        fn the_value_goes_towards_the_target_and_never_past_it(
            up in 1e-3_f32..1e3, down in 1e-3_f32..1e3, start in -100.0_f32..100.0, target in -100.0_f32..100.0,
        ) {
            let mut limiter = SlewLimiter::new(up, down).unwrap();
            limiter.reset_to(start);
            let mut last = start;
            for _ in 0..50 {
                let value = limiter.update(target, 0.01);
                prop_assert!((target - value).abs() <= (target - last).abs());
                prop_assert!(value - last <= up * 0.01 + 1e-5 && last - value <= down * 0.01 + 1e-5);
                prop_assert!((value - target) * (start - target) >= 0.0);
                last = value;
            }
        }
    }

    #[test]
    fn the_time_optimal_acceleration_is_odd() {
        let feed_forward = Plant::of_gains(0.3, 0.05, 0.01).unwrap();
        for (velocity, acceleration) in [(3.0, 1.0), (-3.0, 1.0), (0.0, 2.0), (0.0, 0.0)] {
            let forward = feed_forward.effort(velocity, acceleration);
            assert_eq!(feed_forward.effort(-velocity, -acceleration), -forward);
        }
        assert_eq!(feed_forward.effort(0.0, 0.0), 0.0);
    }

    #[test]
    fn bad_arguments_take_no_effort_and_huge_ones_stay_finite() {
        let feed_forward = Plant::of_gains(0.3, 1e30, 1e30).unwrap();
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            assert_eq!((feed_forward.effort(bad, 1.0), feed_forward.effort(1.0, bad)), (0.0, 0.0));
        }
        assert_eq!(feed_forward.effort(1e30, 1e30), f32::MAX);
        assert!(feed_forward.effort(1e30, -1e30).is_finite());
    }

    #[test]
    fn a_gain_that_cannot_be_is_named() {
        for bad in [-1.0, f32::NAN, f32::INFINITY] {
            assert_eq!(Plant::of_gains(bad, 0.0, 0.0).unwrap_err().parameter(), "ks");
            assert_eq!(Plant::of_gains(0.0, bad, 0.0).unwrap_err().parameter(), "kv");
            assert_eq!(Plant::of_gains(0.0, 0.0, bad).unwrap_err().parameter(), "ka");
        }
    }
}
