use crate::control::number;
use crate::error::{ConfigError, check, finite, positive};
use crate::math;

/// How fast a [`Profile`] may go.
///
/// # Examples
/// ```
/// use drivetrain::control::MotionLimits;
///
/// let arm = MotionLimits::new(2.0, 8.0).with_jerk(100.0); // rad/s, rad/s², rad/s³
/// assert!(arm.validate().is_ok());
/// assert_eq!(MotionLimits::new(2.0, 0.0).validate().unwrap_err().parameter(), "acceleration");
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct MotionLimits {
    velocity: f32,
    acceleration: f32,
    jerk: Option<f32>,
}

impl MotionLimits {
    /// Takes the largest speed (units of the position a second) and the largest acceleration (a second squared), more than zero.
    #[must_use]
    pub const fn new(velocity: f32, acceleration: f32) -> Self {
        Self { velocity, acceleration, jerk: None }
    }

    /// Bounds the rate of change of the acceleration too (units of the position a second cubed), more than zero.
    #[must_use]
    pub const fn with_jerk(self, jerk: f32) -> Self {
        Self { jerk: Some(jerk), ..self }
    }

    /// Checks every limit.
    ///
    /// # Errors
    /// Names `velocity`, `acceleration` or `jerk` when NaN, infinite, zero or negative.
    pub const fn validate(&self) -> Result<(), ConfigError> {
        check!(positive("velocity", self.velocity));
        check!(positive("acceleration", self.acceleration));
        if let Some(jerk) = self.jerk {
            check!(positive("jerk", jerk));
        }
        Ok(())
    }

    /// Returns the limits of velocity, acceleration and jerk.
    pub(in crate::control) const fn parts(&self) -> (f32, f32, Option<f32>) {
        (self.velocity, self.acceleration, self.jerk)
    }
}

/// State of a motion at a moment, in units of the position and seconds: of a [`Profile`], or of a [`Motion`](crate::control::Motion).
///
/// # Examples
/// ```
/// use drivetrain::control::ProfileState;
///
/// let rest = ProfileState { position: 1.5, velocity: 0.0, acceleration: 0.0 };
/// assert_eq!(ProfileState::at_rest(1.5), rest);
/// ```
#[derive(Debug, Default, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ProfileState {
    /// Position.
    pub position: f32,
    /// Velocity, for a velocity feed-forward.
    pub velocity: f32,
    /// Acceleration, for an acceleration feed-forward.
    pub acceleration: f32,
}

impl ProfileState {
    /// Returns a state with a velocity and an acceleration of zero.
    #[must_use]
    pub const fn at_rest(position: f32) -> Self {
        Self { position, velocity: 0.0, acceleration: 0.0 }
    }
}

/// The fastest move from rest to rest within [`MotionLimits`]: a trapezoid of speed, or an S-curve when the jerk is bounded.
///
/// ```text
/// speed    ______            tj  jerk up, then the same down
///         /      \           ta  full acceleration between them
///        /        \          tv  full speed
///       tj ta tj tv tj ta tj     distance = peak speed (2 tj + ta + tv)
/// ```
/// A short move has no part at full speed, and a shorter move no part at full acceleration either. A profile is planned
/// once and then evaluated at any moment; the second half mirrors the first, so the end is exact.
///
/// # Edge behaviour
/// A profile has no state: any moment may be evaluated first, and after any pause. Before the start, and for a time of NaN, the
/// profile is at rest at the start; from [`duration_s`](Self::duration_s) on, at rest at exactly the end. A move of no length
/// lasts 0 s, and so does a move shorter than 1e-38 s. A move whose length or duration is beyond `f32` is an error. With
/// an acceleration near `f32::MAX` the speed may rise in less than 1e-38 s, the shortest time of an `f32`: the speed then jumps, and stays
/// within its limit.
///
/// # Examples
/// ```
/// use drivetrain::control::{MotionLimits, Profile};
///
/// // 3 m at 1 m/s and 2 m/s²: 0.5 s up, 2.5 s at full speed, 0.5 s down.
/// let travel = Profile::plan(0.0, 3.0, &MotionLimits::new(1.0, 2.0))?;
/// assert_eq!(travel.duration_s(), 3.5);
/// assert_eq!(travel.at(0.5).velocity, 1.0);
/// assert_eq!(travel.at(1.75).position, 1.5);
/// assert_eq!(travel.at(9.9).position, 3.0);
/// # Ok::<(), drivetrain::error::ConfigError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Profile {
    start: f32,
    end: f32,
    duration_s: f32,
    /// Time, distance, velocity and the rates of the speed-up; all for a move in the positive direction.
    jerk_time_s: f32,
    rise_time_s: f32,
    peak_velocity: f32,
    peak_acceleration: f32,
    peak_jerk: f32,
}

impl Profile {
    /// Plans the move from `start` to `end`.
    ///
    /// Costs 199 instructions on a Cortex-M4F, for a trapezoid (`docs/figures.md`).
    ///
    /// # Errors
    /// Names a limit that is NaN, infinite, zero or negative, or `start` or `end` when NaN or infinite, or `distance` when the
    /// length or duration of the move is beyond `f32`.
    pub fn plan(start: f32, end: f32, limits: &MotionLimits) -> Result<Self, ConfigError> {
        limits.validate()?;
        finite("start", start)?;
        finite("end", end)?;
        let distance = (end - start).abs();
        finite("distance", distance)?;
        if distance == 0.0 {
            return Ok(Self::at_rest(start, end));
        }
        let (jerk_s, full_s) = match limits.jerk {
            Some(jerk) => jerk_limited(distance, limits.velocity, limits.acceleration, jerk),
            None => trapezoid(distance, limits.velocity, limits.acceleration),
        };
        let rise_time_s = 2.0 * jerk_s + full_s;
        // Without full speed the peak follows from the distance; the rates follow from the peak, so all fits exactly.
        let cruise_s = {
            let left = distance / limits.velocity - rise_time_s;
            if left > 0.0 { left } else { 0.0 }
        };
        let duration_s = 2.0 * rise_time_s + cruise_s;
        finite("distance", duration_s)?;
        let moving_s = rise_time_s + cruise_s;
        let peak_velocity = distance / moving_s;
        if !(moving_s.is_normal() && peak_velocity.is_finite() && peak_velocity > 0.0) {
            return Ok(Self::at_rest(end, end)); // too short for f32 to tell its parts
        }
        // A rise shorter than f32 can tell is a jump of the speed.
        let peak_acceleration = number::finite(peak_velocity / (jerk_s + full_s));
        Ok(Self {
            start,
            end,
            duration_s,
            jerk_time_s: jerk_s,
            rise_time_s,
            peak_velocity,
            peak_acceleration,
            peak_jerk: if jerk_s > 0.0 { number::finite(peak_acceleration / jerk_s) } else { 0.0 },
        })
    }

    const fn at_rest(start: f32, end: f32) -> Self {
        Self {
            start,
            end,
            duration_s: 0.0,
            jerk_time_s: 0.0,
            rise_time_s: 0.0,
            peak_velocity: 0.0,
            peak_acceleration: 0.0,
            peak_jerk: 0.0,
        }
    }

    /// Returns position, velocity and acceleration `time_s` seconds after the start.
    ///
    /// Costs 48 instructions on a Cortex-M4F, for a trapezoid (`docs/figures.md`).
    #[must_use]
    pub fn at(&self, time_s: f32) -> ProfileState {
        if time_s >= self.duration_s {
            return ProfileState { position: self.end, ..ProfileState::default() };
        }
        if time_s.is_nan() || time_s <= 0.0 {
            return ProfileState { position: self.start, ..ProfileState::default() };
        }
        let direction = 1.0_f32.copysign(self.end - self.start);
        let left_s = self.duration_s - time_s;
        if time_s <= left_s {
            let (travelled, velocity, acceleration) = self.first_half(time_s);
            ProfileState {
                position: self.start + direction * travelled,
                velocity: direction * velocity,
                acceleration: direction * acceleration,
            }
        } else {
            let (remaining, velocity, acceleration) = self.first_half(left_s);
            ProfileState {
                position: self.end - direction * remaining,
                velocity: direction * velocity,
                acceleration: -direction * acceleration,
            }
        }
    }

    /// Returns the time from start to end in seconds.
    #[must_use]
    pub const fn duration_s(&self) -> f32 {
        self.duration_s
    }

    /// Returns the end of the move.
    #[must_use]
    pub const fn end(&self) -> f32 {
        self.end
    }

    /// Distance, speed and acceleration after `time_s` of speeding up, or cruising.
    const fn first_half(&self, time_s: f32) -> (f32, f32, f32) {
        let (jerk, top) = (self.peak_jerk, self.peak_acceleration);
        let to_peak_s = self.rise_time_s - time_s;
        if time_s < self.jerk_time_s {
            let acceleration = jerk * time_s;
            let velocity = 0.5 * acceleration * time_s;
            (velocity * time_s * (1.0 / 3.0), velocity, acceleration)
        } else if to_peak_s >= self.jerk_time_s {
            let since_s = time_s - self.jerk_time_s;
            let velocity = 0.5 * top * self.jerk_time_s;
            let distance = velocity * self.jerk_time_s * (1.0 / 3.0);
            (distance + since_s * (velocity + 0.5 * top * since_s), velocity + top * since_s, top)
        } else if to_peak_s > 0.0 {
            let acceleration = jerk * to_peak_s;
            let below = 0.5 * acceleration * to_peak_s;
            let rise = 0.5 * self.peak_velocity * self.rise_time_s;
            let missing = to_peak_s * (self.peak_velocity - below * (1.0 / 3.0));
            (rise - missing, self.peak_velocity - below, acceleration)
        } else {
            let rise = 0.5 * self.peak_velocity * self.rise_time_s;
            (rise - self.peak_velocity * to_peak_s, self.peak_velocity, 0.0)
        }
    }
}

/// Returns the square root of a ratio, also where the ratio itself is beyond `f32`.
fn root_of_ratio(dividend: f32, divisor: f32) -> f32 {
    let ratio = dividend / divisor;
    if ratio.is_normal() { math::sqrt(ratio) } else { math::sqrt(dividend) / math::sqrt(divisor) }
}

/// Returns the times of jerk (none) and of full acceleration.
fn trapezoid(distance: f32, velocity: f32, acceleration: f32) -> (f32, f32) {
    let to_full_speed_s = velocity / acceleration;
    let to_half_way_s = root_of_ratio(distance, acceleration);
    (0.0, if to_full_speed_s < to_half_way_s { to_full_speed_s } else { to_half_way_s })
}

/// Returns the times of jerk and of full acceleration.
fn jerk_limited(distance: f32, velocity: f32, acceleration: f32, jerk: f32) -> (f32, f32) {
    let to_full_acceleration_s = acceleration / jerk;
    // Up to the peak speed in two parts of jerk, reaching full acceleration or not.
    let to_full_speed_s = root_of_ratio(velocity, jerk);
    let (jerk_s, full_s) = if to_full_speed_s < to_full_acceleration_s {
        (to_full_speed_s, 0.0)
    } else {
        (to_full_acceleration_s, velocity / acceleration - to_full_acceleration_s)
    };
    if velocity * (2.0 * jerk_s + full_s) <= distance {
        return (jerk_s, full_s);
    }
    // The distance ends before full speed: peak (2 tj + ta) = distance with peak = a (tj + ta).
    let only_jerk_s = math::cube_root(0.5 * distance / jerk);
    if only_jerk_s <= to_full_acceleration_s {
        return (only_jerk_s, 0.0);
    }
    let half = 0.5 * to_full_acceleration_s;
    let full_s = math::sqrt(half * half + distance / acceleration) - 3.0 * half;
    (to_full_acceleration_s, if full_s > 0.0 { full_s } else { 0.0 })
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "exact results are the rule under test")]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const TRAPEZOID: MotionLimits = MotionLimits::new(2.0, 4.0);
    const S_CURVE: MotionLimits = TRAPEZOID.with_jerk(20.0);

    #[test]
    fn the_end_point_is_exact_up_and_down_short_and_overlong() {
        for limits in [TRAPEZOID, S_CURVE] {
            for (start, end) in [
                (0.0, 3.0),
                (3.0, 0.0),
                (-0.1, 0.3),
                (0.1, 0.100_001),
                (1.0, 1.0),
                (0.0, 1e-30),
                (-1e6, 1e6),
                (1e20, -1e20),
            ] {
                let profile = Profile::plan(start, end, &limits).unwrap();
                let rest = ProfileState { position: end, ..ProfileState::default() };
                assert_eq!(profile.at(profile.duration_s()), rest);
                assert_eq!(profile.at(f32::INFINITY), rest);
                assert_eq!(profile.end(), end);
            }
        }
    }

    #[test]
    fn an_acceleration_or_a_jerk_near_the_largest_number_keeps_the_speed_limit() {
        for huge in [1e30, 1e38, 3e38, f32::MAX] {
            for limits in [
                MotionLimits::new(1.0, huge),
                MotionLimits::new(1.0, huge).with_jerk(huge),
                MotionLimits::new(1.0, 4.0).with_jerk(huge),
                MotionLimits::new(1.0, huge).with_jerk(1e-3 * huge),
            ] {
                let profile = Profile::plan(0.0, 3.0, &limits).unwrap();
                assert!((3.0..=3.2501).contains(&profile.duration_s()), "{profile:?}");
                for step in 1..30_u8 {
                    let time_s = f32::from(step) * 0.1;
                    let ProfileState { position, velocity, acceleration } = profile.at(time_s);
                    assert!((position - time_s).abs() < 0.126, "{limits:?} {position} at {time_s}");
                    assert!((0.39..=1.000_001).contains(&velocity) && acceleration.is_finite());
                }
            }
            // A speed limit as large: the move is over before a clock can tell.
            let profile = Profile::plan(0.0, 3.0, &MotionLimits::new(huge, huge)).unwrap();
            assert!(profile.duration_s() < 1e-14 && profile.at(1e-9).position == 3.0);
            let slow = Profile::plan(0.0, 1e-3, &MotionLimits::new(1e-6, huge)).unwrap();
            assert!(
                (slow.duration_s() - 1000.0).abs() < 1e-3
                    && (slow.at(500.0).position - 5e-4).abs() < 1e-9
            );
        }
    }

    /// The fuzzer found a speed above its limit: the time of the move had three digits left.
    #[test]
    fn a_move_shorter_than_the_resolution_of_f32_is_over_at_once() {
        for (end, velocity) in [(5.6e-44, 0.0316), (1e-45, 1e-6), (-1e-39, 1.0)] {
            let limits = MotionLimits::new(velocity, f32::MAX);
            let profile = Profile::plan(0.0, end, &limits).unwrap();
            assert_eq!(profile.duration_s(), 0.0, "{profile:?}");
            let rest = ProfileState { position: end, ..ProfileState::default() };
            assert_eq!(profile.at(f32::MIN_POSITIVE), rest);
        }
    }

    /// The fuzzer found a speed of minus infinity: a ratio overflowed, and the time at full acceleration was below zero.
    #[test]
    fn a_jerk_near_zero_keeps_the_speed_limit() {
        for (acceleration, jerk) in [(6e-9, 1e-45), (1.0, 1e-39), (f32::MAX, 1e-39), (1e30, 1e-8)] {
            let limits = MotionLimits::new(2.7, acceleration).with_jerk(jerk);
            let profile = Profile::plan(3e38, -1.0, &limits).unwrap();
            for share in 0..=100_u8 {
                let at = profile.at(profile.duration_s() * (f32::from(share) / 100.0));
                assert!(at.velocity.abs() <= 2.700_01, "{at:?} of {profile:?}");
                assert!(at.position.abs() <= 3e38 && at.acceleration.abs() <= acceleration);
            }
        }
    }

    #[test]
    fn before_the_start_and_at_a_time_of_nan_a_profile_rests_at_the_start() {
        let profile = Profile::plan(1.0, 2.0, &S_CURVE).unwrap();
        for time_s in [0.0, -1.0, f32::NAN, f32::NEG_INFINITY] {
            assert_eq!(
                profile.at(time_s),
                ProfileState { position: 1.0, ..ProfileState::default() }
            );
        }
    }

    #[test]
    fn a_short_move_is_a_triangle_in_both_directions() {
        for direction in [1.0, -1.0] {
            let profile = Profile::plan(0.0, direction * 0.25, &TRAPEZOID).unwrap();
            assert!((profile.duration_s() - 0.5).abs() < 1e-6); // 2 sqrt(d / a)
            assert!((profile.at(0.25).velocity - direction).abs() < 1e-6);
            assert!((profile.at(0.25).position - direction * 0.125).abs() < 1e-6);
        }
    }

    #[test]
    fn an_s_curve_takes_a_over_j_longer_than_the_trapezoid() {
        let (straight, smooth) = (
            Profile::plan(0.0, 9.0, &TRAPEZOID).unwrap(),
            Profile::plan(0.0, 9.0, &S_CURVE).unwrap(),
        );
        assert!((straight.duration_s() - 5.0).abs() < 1e-5); // d / v + v / a
        assert!((smooth.duration_s() - 5.2).abs() < 1e-5); // + a / j
    }

    #[test]
    fn an_impossible_move_is_named() {
        for bad in [0.0, -1.0, f32::NAN, f32::INFINITY] {
            for (limits, name) in [
                (MotionLimits::new(bad, 1.0), "velocity"),
                (MotionLimits::new(1.0, bad), "acceleration"),
                (TRAPEZOID.with_jerk(bad), "jerk"),
            ] {
                assert_eq!(Profile::plan(0.0, 1.0, &limits).unwrap_err().parameter(), name);
            }
        }
        assert_eq!(Profile::plan(f32::NAN, 1.0, &TRAPEZOID).unwrap_err().parameter(), "start");
        assert_eq!(Profile::plan(0.0, f32::INFINITY, &TRAPEZOID).unwrap_err().parameter(), "end");
        let too_far = Profile::plan(f32::MIN, f32::MAX, &TRAPEZOID).unwrap_err();
        assert_eq!(too_far.parameter(), "distance");
        let too_slow = Profile::plan(0.0, 1e30, &MotionLimits::new(1e-30, 1.0)).unwrap_err();
        assert_eq!(too_slow.parameter(), "distance");
    }

    proptest! {
        #[test]
        fn limits_hold_and_the_parts_join(
            start in -100.0_f32..100.0, end in -100.0_f32..100.0,
            velocity in 0.1_f32..50.0, acceleration in 0.1_f32..100.0, jerk in prop::option::of(0.1_f32..1e4),
        ) {
            let mut limits = MotionLimits::new(velocity, acceleration);
            limits.jerk = jerk;
            let profile = Profile::plan(start, end, &limits).unwrap();
            let step_s = profile.duration_s() / 500.0;
            let slack = 1e-4 * (1.0 + start.abs().max(end.abs()));
            let mut last = profile.at(0.0);
            for step in 1..=500_u16 {
                let now = profile.at(f32::from(step) * step_s);
                prop_assert!(now.velocity.abs() <= velocity * 1.001);
                prop_assert!(now.acceleration.abs() <= acceleration * 1.001);
                prop_assert!(now.velocity * (end - start) >= -1e-6);
                let travelled = now.position - last.position;
                prop_assert!((travelled - 0.5 * (now.velocity + last.velocity) * step_s).abs()
                    <= acceleration * step_s * step_s + slack);
                last = now;
            }
            prop_assert_eq!(last.position, end);
        }
    }
}
