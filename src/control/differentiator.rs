use super::number::{Sum, finite};
use crate::error::{ConfigError, check, positive};
use crate::math;
use crate::time::TimeStep;

/// A tracking differentiator: follows a signal and gives its rate of change, by a linear or a time-optimal law.
///
/// ```text
/// linear    value' = rate,   rate' = -r^2 (value - input) - 2 r rate
/// optimal   value' = rate,   rate' = fhan(value - input, rate, r, h0)
/// ```
/// [`linear`](Self::linear) follows as a critically damped system would. A step of the input is followed to 4 % after `5 / r`
/// seconds, and without overshoot as long as `r dt <= 1`.
///
/// [`optimal`](Self::optimal) is Han's: it follows with a bounded acceleration `r`, in the shortest time. `h0`, at least 1.25
/// time steps, is the width over which the switching is smoothed: a larger `h0` filters more noise. From rest, the value comes to
/// rest at a constant input without overshoot. Source: Han, "From PID to Active Disturbance Rejection Control", IEEE Transactions
/// on Industrial Electronics 56 (2009), section IV.A.
///
/// Both are stepped by Euler's rule. `OPTIMAL` is the law, chosen by the constructor.
///
/// # Edge behaviour
/// If `dt_s` is zero, negative, NaN or infinite, or the input is NaN or infinite, nothing changes and
/// [`rejected`](Self::rejected) grows. `dt_s` above the maximum, on the first call too: counts as the maximum. Starts from zero
/// at rest; see [`reset_to`](Self::reset_to). Steps smaller than the spacing of `f32` at the value add up: the value arrives, at
/// any distance from zero. A value beyond `f32` stays at its largest number.
///
/// # Examples
/// ```
/// use drivetrain::control::Differentiator;
///
/// let mut follow = Differentiator::linear(100.0, 0.001)?;
/// for _ in 0..50 {
///     follow.update(1.0, 0.001);
/// }
/// assert!((follow.value() - 0.96).abs() < 0.01 && follow.rate() > 0.0);
///
/// // 1 m at no more than 4 m/s²: half a second up, half a second down.
/// let mut follow = Differentiator::optimal(4.0, 0.002, 0.001)?;
/// for _ in 0..500 {
///     follow.update(1.0, 0.001);
/// }
/// assert!((follow.value() - 0.5).abs() < 0.01 && (follow.rate() - 2.0).abs() < 0.02);
/// # Ok::<(), drivetrain::error::ConfigError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Differentiator<const OPTIMAL: bool = false> {
    r: f32,
    /// Zero of the linear law.
    h0_s: f32,
    follower: Follower,
}

impl Differentiator {
    /// Takes `r`, the speed of following in 1/s, and the longest step in seconds, of the linear law.
    ///
    /// # Errors
    /// Names `r` or `max_step` when NaN, infinite, zero or negative; `r` when `r * max_step_s` is above 1, where the value
    /// would oscillate.
    pub const fn linear(r: f32, max_step_s: f32) -> Result<Self, ConfigError> {
        check!(positive("r", r));
        check!(positive("max_step", max_step_s));
        if r * max_step_s > 1.0 {
            return Err(ConfigError::Unstable("r"));
        }
        Ok(Self { r, h0_s: 0.0, follower: Follower::new(max_step_s) })
    }
}

impl Differentiator<true> {
    /// Rounding of the two times and of their product takes off up to three parts in 2^24.
    const LEAST_STEPS: f32 = 1.25 - 3.0 * f32::EPSILON;

    /// Takes the acceleration `r` (units of the input per s²), the smoothing width `h0_s` and the longest step, both in seconds,
    /// of the time-optimal law.
    ///
    /// # Errors
    /// Names a parameter that is NaN, infinite, zero or negative; `h0` when below 1.25 `max_step_s`. Han's text allows an `h0` of
    /// one step, but then a step of the input of `3 r h0²` overshoots by 4 %; from 1.15 on no step overshoots.
    pub const fn optimal(r: f32, h0_s: f32, max_step_s: f32) -> Result<Self, ConfigError> {
        check!(positive("r", r));
        check!(positive("h0", h0_s));
        check!(positive("max_step", max_step_s));
        if h0_s < Self::LEAST_STEPS * max_step_s {
            return Err(ConfigError::Unstable("h0"));
        }
        Ok(Self { r, h0_s, follower: Follower::new(max_step_s) })
    }
}

impl<const OPTIMAL: bool> Differentiator<OPTIMAL> {
    /// Steps by `dt_s` seconds towards `input` and returns the new value.
    ///
    /// Costs 54 instructions on a Cortex-M4F, for the linear one (`docs/figures.md`).
    pub fn update(&mut self, input: f32, dt_s: f32) -> f32 {
        let (r, h0_s) = (self.r, self.h0_s);
        let step = TimeStep::new(dt_s, self.follower.max_step_s);
        if OPTIMAL {
            self.follower.step(input, &step, |error, rate| fhan(error, rate, r, h0_s))
        } else {
            self.follower.step(input, &step, |error, rate| -r * finite(r * error + 2.0 * rate))
        }
    }

    /// Puts the value at `value`, at rest. NaN and infinity count as zero.
    pub const fn reset_to(&mut self, value: f32) {
        self.follower.reset_to(value);
    }

    /// Returns the value, which follows the input.
    #[must_use]
    pub const fn value(&self) -> f32 {
        self.follower.value.value()
    }

    /// Returns its rate of change a second.
    #[must_use]
    pub const fn rate(&self) -> f32 {
        self.follower.rate.value()
    }

    /// Returns the number of refused steps; stays at 65535.
    #[must_use]
    pub const fn rejected(&self) -> u16 {
        self.follower.rejected
    }
}

/// A value and its rate, stepped by Euler's rule to follow an input.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
struct Follower {
    max_step_s: f32,
    value: Sum,
    rate: Sum,
    rejected: u16,
}

impl Follower {
    const fn new(max_step_s: f32) -> Self {
        Self { max_step_s, value: Sum::ZERO, rate: Sum::ZERO, rejected: 0 }
    }

    /// Steps by the acceleration that `pull` calculates from the error and the rate; the step is no longer than the
    /// longest step.
    #[inline]
    fn step(&mut self, input: f32, step: &TimeStep, pull: impl FnOnce(f32, f32) -> f32) -> f32 {
        if step.admits(input.is_finite(), &mut self.rejected) {
            let rate = self.rate.value();
            let acceleration = pull(self.value.above(input), rate);
            self.value.add(step.dt_s * rate);
            self.rate.add(step.dt_s * acceleration);
        }
        self.value.value()
    }

    const fn reset_to(&mut self, value: f32) {
        self.value = Sum::from(if value.is_finite() { value } else { 0.0 });
        self.rate = Sum::ZERO;
    }
}

/// Returns Han's time-optimal acceleration, in ±`r`, to bring the discrete double integrator (`x1`, `x2`) to rest at zero.
///
/// `r` is the largest acceleration and `h` the step in seconds, both more than zero. If an argument is NaN, or the result
/// would be, the result is 0.
///
/// # Examples
/// ```
/// use drivetrain::control::fhan;
///
/// assert_eq!(fhan(1.0, 0.0, 2.0, 0.01), -2.0); // far off: full acceleration
/// assert_eq!(fhan(0.0, 0.0, 2.0, 0.01), 0.0);
/// ```
#[must_use]
pub fn fhan(x1: f32, x2: f32, r: f32, h: f32) -> f32 {
    let d = r * h * h;
    let drift = h * x2;
    let y = x1 + drift;
    let a = if y.abs() < d {
        // Within reach in two steps.
        drift + y
    } else {
        let root = math::sqrt(d) * math::sqrt(d + 8.0 * y.abs());
        drift + (0.5 * (root - d)).copysign(y)
    };
    let pull = if a.abs() < d { -r * (a / d) } else { -r.copysign(a) };
    if a.is_nan() || pull.is_nan() { 0.0 } else { pull }
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "exact results are the rule under test")]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::format;
    use std::string::{String, ToString};

    const DT_S: f32 = 0.001;
    const WIDTH_S: f32 = 1.25 * DT_S;
    const BAD: [f32; 3] = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY];

    #[test]
    fn r_dt_from_a_tenth_to_three_never_overshoots_or_is_an_error() {
        for tenths in 1..=30_u8 {
            let r = f32::from(tenths) * 100.0;
            match Differentiator::linear(r, DT_S) {
                Err(error) => {
                    assert!(tenths > 10);
                    assert_eq!(error, ConfigError::Unstable("r"));
                }
                Ok(mut follow) => {
                    assert!(tenths <= 10);
                    for _ in 0..1000 {
                        assert!((0.0..=1.000_001).contains(&follow.update(1.0, DT_S)));
                    }
                    assert!((follow.value() - 1.0).abs() < 1e-5);
                }
            }
        }
    }

    #[test]
    fn a_parameter_that_cannot_be_is_named() {
        for bad in [0.0, -1.0, f32::NAN, f32::INFINITY] {
            assert_eq!(Differentiator::linear(bad, DT_S).unwrap_err().parameter(), "r");
            assert_eq!(Differentiator::linear(1.0, bad).unwrap_err().parameter(), "max_step");
            assert_eq!(Differentiator::optimal(bad, DT_S, DT_S).unwrap_err().parameter(), "r");
            assert_eq!(Differentiator::optimal(1.0, bad, DT_S).unwrap_err().parameter(), "h0");
            assert_eq!(
                Differentiator::optimal(1.0, DT_S, bad).unwrap_err().parameter(),
                "max_step"
            );
        }
        for width in [1.0, 1.2, 1.249_99] {
            let narrow = Differentiator::optimal(1.0, width * DT_S, DT_S).unwrap_err();
            assert_eq!(narrow, ConfigError::Unstable("h0"));
            assert!(
                narrow.to_string().starts_with("h0: a value below 1.25 times the longest step")
            );
        }
    }

    /// Each was refused: in `f32`, 1.25 times the step is more than the width, by its last bit.
    #[test]
    fn a_width_of_exactly_a_step_and_a_quarter_is_accepted() {
        for (h0_s, step_s) in [(0.001_25, 0.001), (0.002_5, 0.002), (0.000_625, 0.000_5)] {
            assert!(Differentiator::optimal(100.0, h0_s, step_s).is_ok(), "{h0_s}");
        }
        for micros in 1..=100_000_u32 {
            let (h0_s, step_s) = (1.25e-6 * f64::from(micros), 1e-6 * f64::from(micros));
            #[expect(clippy::cast_possible_truncation, reason = "as a user writes it")]
            let follow = Differentiator::optimal(100.0, h0_s as f32, step_s as f32);
            assert!(follow.is_ok(), "{micros} µs");
        }
    }

    #[test]
    fn bad_inputs_and_bad_times_change_nothing() {
        let mut linear = Differentiator::linear(100.0, DT_S).unwrap();
        let mut optimal = Differentiator::optimal(10.0, WIDTH_S, DT_S).unwrap();
        linear.update(1.0, DT_S);
        optimal.update(1.0, DT_S);
        let before = (linear, optimal);
        for bad in BAD {
            linear.update(bad, DT_S);
            linear.update(1.0, bad);
            optimal.update(bad, DT_S);
            optimal.update(1.0, bad);
        }
        for no_time in [0.0, -DT_S] {
            linear.update(1.0, no_time);
            optimal.update(1.0, no_time);
        }
        assert_eq!((linear.rejected(), optimal.rejected()), (8, 8));
        (linear.follower.rejected, optimal.follower.rejected) = (0, 0);
        assert_eq!((linear, optimal), before);
    }

    #[test]
    fn a_long_pause_counts_as_the_longest_step() {
        let (mut paused, mut steady) = (
            Differentiator::linear(900.0, DT_S).unwrap(),
            Differentiator::linear(900.0, DT_S).unwrap(),
        );
        for _ in 0..20 {
            assert_eq!(paused.update(1.0, 10.0), steady.update(1.0, DT_S));
        }
    }

    #[test]
    fn a_long_pause_counts_as_the_longest_step_for_the_optimal_law_too() {
        let new = || Differentiator::optimal(10.0, WIDTH_S, DT_S).unwrap();
        let (mut paused, mut steady) = (new(), new());
        for _ in 0..20 {
            assert_eq!(paused.update(1.0, 10.0), steady.update(1.0, DT_S));
        }
    }

    #[test]
    fn fhan_of_nan_is_no_acceleration() {
        for (x1, x2) in [(f32::NAN, 0.0), (0.0, f32::NAN), (f32::INFINITY, f32::NEG_INFINITY)] {
            assert_eq!(fhan(x1, x2, 2.0, 0.01), 0.0);
        }
        assert_eq!(fhan(f32::INFINITY, 0.0, 2.0, 0.01), -2.0);
    }

    #[test]
    fn the_rate_of_a_ramp_is_its_slope() {
        let mut linear = Differentiator::linear(200.0, DT_S).unwrap();
        let mut optimal = Differentiator::optimal(1000.0, 0.005, DT_S).unwrap();
        for sample in 0..1000_u16 {
            let input = 3.0 * f32::from(sample) * DT_S;
            linear.update(input, DT_S);
            optimal.update(input, DT_S);
        }
        assert!((linear.rate() - 3.0).abs() < 0.01 && (optimal.rate() - 3.0).abs() < 0.05);
    }

    #[test]
    fn reset_to_is_at_rest() {
        let mut linear = Differentiator::linear(200.0, DT_S).unwrap();
        linear.update(1.0, DT_S);
        linear.reset_to(5.0);
        assert_eq!((linear.update(5.0, DT_S), linear.rate()), (5.0, 0.0));
        let mut optimal = Differentiator::optimal(1000.0, 0.005, DT_S).unwrap();
        optimal.reset_to(f32::NAN);
        assert_eq!((optimal.value(), optimal.rate()), (0.0, 0.0));
    }

    /// Follows a step of the input from rest at `start`; reports a violation on the way or at the end.
    fn arrives(
        (r, h0_s): (f32, f32),
        start: f32,
        target: f32,
        times: impl Iterator<Item = f32>,
    ) -> Result<(), String> {
        let mut follow =
            Differentiator::optimal(r, h0_s, DT_S).map_err(|error| error.to_string())?;
        follow.reset_to(start);
        let (mut rate, mut value) = (0.0, start);
        for dt_s in times {
            value = follow.update(target, dt_s);
            if (follow.rate() - rate).abs() > r * DT_S * 1.001 + spacing(rate) {
                return Err(format!("the rate jumps from {rate} to {}", follow.rate()));
            }
            let (lowest, highest) = (start.min(target), start.max(target));
            if !(lowest - spacing(start)..=highest + spacing(start)).contains(&value)
                || (target - value) * (target - start) < 0.0
            {
                return Err(format!("{value} is not on the way from {start} to {target}"));
            }
            rate = follow.rate();
        }
        if value == target { Ok(()) } else { Err(format!("{} are left", target - value)) }
    }

    fn spacing(value: f32) -> f32 {
        f32::from_bits(value.abs().to_bits() + 1) - value.abs()
    }

    /// Each of these once went too far: the first when the law admitted a width of one step; the others by the rounding
    /// of a rate many thousand times its change in a step.
    #[test]
    fn a_far_target_is_reached_without_overshoot_and_one_step_of_width_is_refused() {
        for (r, target, widths, steps) in [
            (85.941_02, -67.173_27, [1.25, 1.5, 2.0, 5.0], 10_000),
            (3.202_421, 704.414_5, [4.730_658_5, 5.0, 1.25, 2.0], 60_000),
            (32.394_04, -6_121.029, [4.444_165_7, 5.0, 1.25, 2.0], 60_000),
        ] {
            for width in widths {
                let times = core::iter::repeat_n(DT_S, steps);
                assert_eq!(arrives((r, width * DT_S), 0.0, target, times), Ok(()), "{width}");
            }
            let refused = Differentiator::optimal(r, DT_S, DT_S).unwrap_err();
            assert_eq!(refused, ConfigError::Unstable("h0"));
        }
    }

    #[test]
    fn far_from_zero_where_a_step_is_less_than_the_spacing_of_f32_both_arrive() {
        // At a million, the spacing is 0.06; in the last 36 units, a step of 1 ms is less than half
        // of the spacing.
        for (start, way) in [(1e6, 90.0), (-1e6, 90.0), (1e5, -1.0)] {
            let times = core::iter::repeat_n(DT_S, 20_000);
            assert_eq!(arrives((10.0, WIDTH_S), start, start + way, times), Ok(()), "{start}");
            let mut linear = Differentiator::linear(2.0, DT_S).unwrap();
            linear.reset_to(start);
            for _ in 0..20_000 {
                linear.update(start + way, DT_S);
            }
            assert_eq!(linear.value(), start + way);
        }
    }

    proptest! {
        #[test]
        fn linear_is_bounded_by_its_inputs_when_they_are_constant(
            r in 1.0_f32..1000.0, target in -1e6_f32..1e6, steps in prop::collection::vec(1_u16..=1000, 1..200),
        ) {
            let mut follow = Differentiator::linear(r, DT_S).unwrap();
            for micros in steps {
                let value = follow.update(target, f32::from(micros) * 1e-6);
                prop_assert!(value * target >= 0.0 && value.abs() <= target.abs() * 1.000_01);
            }
        }

        #[test]
        fn optimal_arrives_without_overshoot_and_within_its_acceleration(
            r in 0.1_f32..1000.0, widths in -3.0_f32..4.0, width in 1.25_f32..5.0, direction in prop::bool::ANY,
            start in prop_oneof![Just(0.0_f32), -1e6_f32..1e6], parts in prop::collection::vec(1e-3_f32..=1.0, 1..8),
        ) {
            let width_s = width * DT_S;
            // From a thousandth to ten thousand times the distance covered in one width of time.
            let way = r * width_s * width_s * 10.0_f32.powf(widths);
            let target = start + if direction { way } else { -way };
            let times = parts.iter().chain(&[1.0, 1.0]).cycle().take(8000);
            let arrived = arrives((r, width_s), start, target, times.map(|part| part * DT_S));
            prop_assert!(arrived.is_ok(), "{:?}", arrived);
        }

        #[test]
        fn a_narrow_width_overshoots_or_is_an_error(width in 0.1_f32..1.5, sizes in 1.0_f32..100.0) {
            if let Ok(mut follow) = Differentiator::optimal(1.0, width * DT_S, DT_S) {
                let target = sizes * (width * DT_S) * (width * DT_S);
                for _ in 0..200 {
                    prop_assert!(follow.update(target, DT_S) <= target * 1.000_01);
                }
            } else {
                prop_assert!(width < 1.2501);
            }
        }

        #[test]
        fn fhan_is_odd_and_bounded(x1 in -1e9_f32..1e9, x2 in -1e6_f32..1e6, r in 1e-3_f32..1e6, h in 1e-5_f32..0.1) {
            let pull = fhan(x1, x2, r, h);
            prop_assert!(pull.abs() <= r * 1.000_001);
            prop_assert_eq!(fhan(-x1, -x2, r, h), -pull);
        }

        #[test]
        fn huge_values_stay_finite(samples in prop::collection::vec(-f32::MAX..f32::MAX, 1..20)) {
            let mut linear = Differentiator::linear(1000.0, DT_S).unwrap();
            let mut optimal = Differentiator::optimal(1e30, WIDTH_S, DT_S).unwrap();
            for input in samples {
                prop_assert!(linear.update(input, DT_S).is_finite() && linear.rate().is_finite());
                prop_assert!(optimal.update(input, DT_S).is_finite() && optimal.rate().is_finite());
            }
        }
    }
}
