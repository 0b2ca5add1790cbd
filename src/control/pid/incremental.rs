use super::gate::UNKNOWN;
use crate::control::differentiator::LinearDifferentiator;
use crate::control::error::{ConfigError, check, gains, output_ends, positive};
use crate::control::number::{finite, limited};
use crate::control::step::TimeStep;

/// What an [`IncrementalPid`] is made from. Units of the gains as for [`PidConfig`](super::PidConfig).
///
/// # Examples
/// ```
/// use drivetrain::control::{IncrementalPid, IncrementalPidConfig};
///
/// let config = IncrementalPidConfig::new(0.1, 0.5, 0.0)
///     .with_output_limit(20.0)
///     .with_max_step(0.005)
///     .with_tracking(200.0);
/// assert!(IncrementalPid::new(config).is_ok());
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct IncrementalPidConfig {
    kp: f32,
    ki: f32,
    kd: f32,
    output_lower: f32,
    output_upper: f32,
    tracking_r: Option<f32>,
    max_step_s: f32,
}

impl IncrementalPidConfig {
    /// Takes the gains: proportional, integral (1/s times the unit of `kp`) and derivative (s times the unit of `kp`).
    ///
    /// Each must be finite and zero or more.
    #[must_use]
    pub const fn new(kp: f32, ki: f32, kd: f32) -> Self {
        Self {
            kp,
            ki,
            kd,
            output_lower: -f32::MAX,
            output_upper: f32::MAX,
            tracking_r: None,
            max_step_s: TimeStep::MAX_S,
        }
    }

    /// Keeps the output in ±`limit`, more than zero. Off by default.
    #[must_use]
    pub const fn with_output_limit(self, limit: f32) -> Self {
        self.with_output_range(-limit, limit)
    }

    /// Keeps the output in `lower..=upper`, `lower` below `upper`. Off by default.
    #[must_use]
    pub const fn with_output_range(self, lower: f32, upper: f32) -> Self {
        Self { output_lower: lower, output_upper: upper, ..self }
    }

    /// Leads the setpoint through a [`LinearDifferentiator`] of speed `r` in 1/s. Off by default.
    ///
    /// It starts from the first measurement. `r` times the longest step must be at most 1.
    #[must_use]
    pub const fn with_tracking(self, r: f32) -> Self {
        Self { tracking_r: Some(r), ..self }
    }

    /// Sets the longest step in seconds that is believed, more than zero; the default is 0.1, and 0.001 would go with a
    /// tracking of up to `r` = 1000.
    #[must_use]
    pub const fn with_max_step(self, max_step_s: f32) -> Self {
        Self { max_step_s, ..self }
    }

    /// Checks every parameter.
    ///
    /// # Errors
    /// Names the first parameter that is NaN, infinite, negative, zero where it must not be, reversed, or too fast for the step.
    pub const fn validate(&self) -> Result<(), ConfigError> {
        check!(gains(self.kp, self.ki, self.kd));
        check!(output_ends(self.output_lower, self.output_upper));
        check!(positive("max_step", self.max_step_s));
        if let Some(r) = self.tracking_r {
            check!(LinearDifferentiator::new(r, self.max_step_s));
        }
        Ok(())
    }
}

/// An incremental (velocity-form) PID controller: every step adds to a sum.
///
/// ```text
/// sum += kp (e - e1) + ki dt (e + e1) / 2 - kd (rate - rate1),   rate = (measurement - measurement1) / dt
/// output = sum within its limits
/// ```
/// D is the second difference of the measurement. While the sum is beyond a limit, what I would add towards that side is left
/// out: the controller cannot wind up. P and D are never left out, so the output leaves the limit when P says so, as that of
/// [`Pid`](super::Pid) with conditional integration does: the two give the same, to rounding, with limits and without.
///
/// # Edge behaviour
/// * The first call gives P only, or after [`reset_to`](Self::reset_to) the given output, however long ago the controller was made.
/// * `dt_s` zero, negative, NaN or infinite, and NaN or infinity in an input: the last output is returned, and
///   [`rejected`](Self::rejected) grows. After a bad input, D rests in the next good step, as that of [`Pid`](super::Pid) does.
/// * `dt_s` above the maximum of the [`TimeStep`]: only the change of P is added. With tracking, the target moves on by
///   [`with_max_step`](IncrementalPidConfig::with_max_step).
/// * `ki` zero: the output is that of P and D, within the limits. What rounding takes from the sum is not given back.
/// * Overflow of `f32`: the sum stays at ±`f32::MAX` and the output at its limit, never NaN. What was cut off the sum is lost.
/// * A change smaller than half the spacing of `f32` at the sum (6e-8 of it) is lost: it stands still where `ki dt e` is less.
///
/// # Examples
/// ```
/// use drivetrain::control::{IncrementalPid, IncrementalPidConfig};
///
/// let mut pid = IncrementalPid::new(IncrementalPidConfig::new(2.0, 10.0, 0.0))?;
/// assert_eq!(pid.update(1.0, 0.0, 0.01), 2.0); // P
/// assert_eq!(pid.update(1.0, 0.0, 0.01), 2.1); // and 10/s for 10 ms
/// # Ok::<(), drivetrain::control::ConfigError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct IncrementalPid {
    config: IncrementalPidConfig,
    tracking: Option<LinearDifferentiator>,
    error: f32,
    measurement: f32,
    rate: f32,
    /// The output without its limits.
    sum: f32,
    output: f32,
    rejected: u16,
    track_output: bool,
    rest_derivative: bool,
}

impl IncrementalPid {
    /// Takes and checks the configuration.
    ///
    /// # Errors
    /// Names the parameter as [`IncrementalPidConfig::validate`] does.
    pub const fn new(config: IncrementalPidConfig) -> Result<Self, ConfigError> {
        check!(config.validate());
        let tracking = match config.tracking_r {
            Some(r) => match LinearDifferentiator::new(r, config.max_step_s) {
                Ok(tracking) => Some(tracking),
                Err(error) => return Err(error),
            },
            None => None,
        };
        Ok(Self {
            config,
            tracking,
            error: UNKNOWN,
            measurement: UNKNOWN,
            rate: 0.0,
            sum: 0.0,
            output: 0.0,
            rejected: 0,
            track_output: false,
            rest_derivative: false,
        })
    }

    /// Steps by `dt_s` seconds and returns the output.
    pub fn update(&mut self, setpoint: f32, measurement: f32, dt_s: f32) -> f32 {
        self.step(setpoint, measurement, &TimeStep::new(dt_s, self.config.max_step_s))
    }

    /// Steps by a time that was validated before, and returns the output.
    pub fn step(&mut self, setpoint: f32, measurement: f32, step: &TimeStep) -> f32 {
        if !step.admits(setpoint.is_finite() && measurement.is_finite(), &mut self.rejected) {
            self.rest_derivative |= !step.is_hold();
            return self.output;
        }
        let first = self.measurement == UNKNOWN;
        let target = match &mut self.tracking {
            Some(tracking) => {
                if first {
                    tracking.reset_to(measurement);
                }
                tracking.step(setpoint, step)
            }
            None => setpoint,
        };
        let error = finite(target - measurement);
        let before = match (first, self.track_output) {
            (false, _) => self.error,
            (true, false) => 0.0,
            (true, true) => error,
        };
        let (mut rate, mut half_dt_s) = (self.rate, 0.0);
        if !(first || step.is_frozen()) {
            half_dt_s = step.half_dt_s;
            if !self.rest_derivative {
                rate = (measurement - self.measurement) * step.per_dt;
            }
        }
        let (mut growth, mut sum) = self.add::<false>(error, before, rate, half_dt_s);
        if !(sum + growth + rate).is_finite() {
            rate = finite(rate);
            (growth, sum) = self.add::<true>(error, before, rate, half_dt_s);
        }
        let wanted = finite(sum + growth);
        self.output = limited(wanted, self.config.output_lower, self.config.output_upper);
        let outward = (wanted - self.output) * growth > 0.0;
        self.sum = if outward { sum } else { wanted };
        self.error = error;
        self.measurement = measurement;
        self.rate = rate;
        (self.track_output, self.rest_derivative) = (false, false);
        self.output
    }

    /// Returns what I adds to the sum, and the sum with what P and D add.
    #[inline]
    fn add<const CAREFUL: bool>(
        &self,
        error: f32,
        before: f32,
        rate: f32,
        half_dt_s: f32,
    ) -> (f32, f32) {
        let finite = |value| if CAREFUL { finite(value) } else { value };
        let config = &self.config;
        let proportional = finite(config.kp * finite(error - before));
        let growth = finite(config.ki * half_dt_s * finite(error + before));
        let derivative = finite(config.kd * finite(rate - self.rate));
        (growth, finite(self.sum + finite(proportional - derivative)))
    }

    /// Forgets everything but the configuration and the count of rejected steps: the next call is a first call.
    pub const fn reset(&mut self) {
        self.error = UNKNOWN;
        self.measurement = UNKNOWN;
        self.rate = 0.0;
        self.sum = 0.0;
        self.output = 0.0;
        self.track_output = false;
        self.rest_derivative = false;
    }

    /// Resets, and lets the first call return `output`, within the limits, whatever its error.
    ///
    /// NaN and infinity count as zero.
    pub const fn reset_to(&mut self, output: f32) {
        self.reset();
        self.output = limited(
            if output.is_finite() { output } else { 0.0 },
            self.config.output_lower,
            self.config.output_upper,
        );
        self.sum = self.output;
        self.track_output = true;
    }

    /// Changes the gains; the output does not jump, because the sum is the memory.
    ///
    /// At a limit, the sum follows the new P as far as the output stays there, so that the integral does not take up what was cut off.
    ///
    /// # Errors
    /// Names the gain that is NaN, infinite or negative; then nothing changes.
    pub const fn set_gains(&mut self, kp: f32, ki: f32, kd: f32) -> Result<(), ConfigError> {
        check!(gains(kp, ki, kd));
        if self.error != UNKNOWN {
            let (lower, upper) = (self.config.output_lower, self.config.output_upper);
            let follows = finite(self.sum + finite((kp - self.config.kp) * self.error));
            if self.sum > upper {
                self.sum = limited(follows, upper, f32::MAX);
            } else if self.sum < lower {
                self.sum = limited(follows, -f32::MAX, lower);
            }
        }
        self.config.kp = kp;
        self.config.ki = ki;
        self.config.kd = kd;
        Ok(())
    }

    /// Returns the last output; before the first call zero, or what was given to [`reset_to`](Self::reset_to).
    #[must_use]
    pub const fn output(&self) -> f32 {
        self.output
    }

    /// Returns the configuration.
    #[must_use]
    pub const fn config(&self) -> &IncrementalPidConfig {
        &self.config
    }

    /// Returns the number of steps that were refused for their time or for an input that was NaN or infinite; stays at 65535.
    #[must_use]
    pub const fn rejected(&self) -> u16 {
        self.rejected
    }
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "exact results are the rule under test")]
mod tests {
    use super::*;
    use crate::control::{ConfigFault, Pid, PidConfig};
    use proptest::prelude::*;

    const DT_S: f32 = 0.001;
    const BAD: [f32; 3] = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY];

    fn pid(config: IncrementalPidConfig) -> IncrementalPid {
        IncrementalPid::new(config).unwrap()
    }

    #[test]
    fn first_call_after_a_long_time_is_proportional_only() {
        for dt_s in [DT_S, 10.0] {
            assert_eq!(
                pid(IncrementalPidConfig::new(2.0, 100.0, 100.0)).update(3.0, 1.0, dt_s),
                4.0
            );
        }
    }

    #[test]
    fn bad_time_and_bad_samples_hold_the_output_and_leave_no_trace() {
        let config =
            IncrementalPidConfig::new(2.0, 10.0, 0.0).with_max_step(0.01).with_tracking(50.0);
        let (mut clean, mut hit) = (pid(config), pid(config));
        for sample in 0..20_u8 {
            let measurement = f32::from(sample) * 0.01;
            let expected = clean.update(1.0, measurement, DT_S);
            let held = hit.output();
            for bad in BAD {
                assert_eq!(hit.update(1.0, bad, DT_S), held);
                assert_eq!(hit.update(bad, measurement, DT_S), held);
                assert_eq!(hit.update(1.0, measurement, bad), held);
            }
            assert_eq!(hit.update(1.0, measurement, 0.0), held);
            assert_eq!(hit.update(1.0, measurement, -DT_S), held);
            assert_eq!(hit.update(1.0, measurement, DT_S), expected);
        }
        assert_eq!(hit.rejected(), 220);
        assert_eq!(IncrementalPid { rejected: 0, rate: clean.rate, ..hit }, clean);
    }

    #[test]
    fn a_burst_of_bad_samples_of_a_moving_shaft_does_not_kick() {
        let mut pid = pid(IncrementalPidConfig::new(0.0, 0.0, 0.05));
        let mut at = 0.0;
        for sample in 0..100_u8 {
            at += 10.0 * DT_S;
            let bad = (20..70).contains(&sample);
            let output = pid.update(0.0, if bad { f32::NAN } else { at }, DT_S);
            assert!(sample < 1 || (output + 0.5).abs() < 1e-3, "{output}");
        }
    }

    #[test]
    fn a_dt_above_the_maximum_adds_the_change_of_p_only() {
        let mut pid = pid(IncrementalPidConfig::new(2.0, 10.0, 0.1));
        pid.update(1.0, 0.0, DT_S);
        let before = pid.update(1.0, 0.0, DT_S);
        assert_eq!(pid.update(3.0, 0.5, 10.0), before + 3.0);
    }

    #[test]
    fn a_limit_that_is_zero_or_reversed_is_named() {
        let new = IncrementalPidConfig::new(1.0, 1.0, 1.0);
        for (config, parameter, fault) in [
            (IncrementalPidConfig::new(f32::NAN, 0.0, 0.0), "kp", ConfigFault::Negative),
            (IncrementalPidConfig::new(0.0, -1.0, 0.0), "ki", ConfigFault::Negative),
            (IncrementalPidConfig::new(0.0, 0.0, f32::INFINITY), "kd", ConfigFault::Negative),
            (new.with_output_limit(0.0), "output_limit", ConfigFault::NotPositive),
            (new.with_output_range(2.0, 1.0), "output_range", ConfigFault::Reversed),
            (new.with_max_step(-0.1), "max_step", ConfigFault::NotPositive),
            (new.with_tracking(0.0), "r", ConfigFault::NotPositive),
            (new.with_tracking(20.0), "r", ConfigFault::Unstable),
        ] {
            assert_eq!(IncrementalPid::new(config), Err(ConfigError::new(parameter, fault)));
        }
    }

    #[test]
    fn it_leaves_the_limit_at_once() {
        let mut pid = pid(IncrementalPidConfig::new(0.0, 100.0, 0.0).with_output_limit(10.0));
        for _ in 0..10_000 {
            pid.update(9.0, 0.0, DT_S);
        }
        assert_eq!(pid.output(), 10.0);
        pid.update(-1.0, 0.0, DT_S);
        assert!(pid.update(-1.0, 0.0, DT_S) < 10.0);
    }

    #[test]
    fn huge_gains_end_at_the_limit_and_never_in_nan() {
        let mut pid = pid(IncrementalPidConfig::new(1e30, 1e30, 1e30));
        for measurement in [0.0, 1e30, f32::MIN, f32::MAX, 1.0] {
            assert!(pid.update(f32::MAX, measurement, 1e-6).is_finite());
        }
    }

    #[test]
    fn tracking_smooths_a_step_of_the_setpoint_from_the_first_measurement() {
        let config = IncrementalPidConfig::new(1.0, 0.0, 0.0).with_max_step(0.01);
        let mut smooth = pid(config.with_tracking(50.0));
        assert_eq!(smooth.update(11.0, 10.0, DT_S), 0.0);
        let mut last = 0.0;
        for _ in 0..300 {
            let output = smooth.update(11.0, 10.0, DT_S);
            assert!(output >= last && output - last < 0.05);
            last = output;
        }
        assert!((last - 1.0).abs() < 1e-3);
    }

    #[test]
    fn with_tracking_a_long_pause_moves_the_target_on_by_the_longest_step() {
        let config = IncrementalPidConfig::new(1.0, 5.0, 0.5).with_max_step(0.01);
        let mut pid = pid(config.with_tracking(50.0));
        let mut follow = LinearDifferentiator::new(50.0, 0.01).unwrap();
        follow.reset_to(10.0);
        for _ in 0..5 {
            follow.update(11.0, DT_S);
            pid.update(11.0, 10.0, DT_S);
        }
        let (before, target) = (pid.output(), follow.value());
        let change = follow.update(11.0, 0.01) - target;
        assert!((pid.update(11.0, 10.0, 1000.0) - before - change).abs() < 1e-6);
    }

    #[test]
    fn an_increment_of_less_than_half_a_spacing_is_lost_and_one_of_more_is_not() {
        // At 10, the spacing is 9.5e-7; with ki = 1 at 1 kHz, half of it is an error of 4.8e-4.
        for (error, moves) in [(4.7e-4, false), (4.9e-4, true)] {
            let mut pid = pid(IncrementalPidConfig::new(0.0, 1.0, 0.0));
            pid.reset_to(10.0);
            for _ in 0..1_000 {
                pid.update(error, 0.0, DT_S);
            }
            assert_eq!(pid.output() > 10.0, moves, "{error}");
        }
    }

    #[test]
    fn reset_to_takes_over_without_a_jump() {
        let mut pid = pid(IncrementalPidConfig::new(2.0, 10.0, 0.5).with_output_limit(10.0));
        pid.reset_to(7.0);
        assert_eq!(pid.update(100.0, 99.0, DT_S), 7.0);
        assert!((pid.update(100.0, 99.0, DT_S) - 7.01).abs() < 1e-5);
        pid.reset();
        assert_eq!(pid.update(1.0, 0.0, DT_S), 2.0);
    }

    #[test]
    fn new_gains_do_not_move_the_output() {
        let mut pid = pid(IncrementalPidConfig::new(2.0, 10.0, 0.0));
        pid.update(1.0, 0.0, DT_S);
        let before = pid.update(1.0, 0.0, DT_S);
        pid.set_gains(20.0, 5.0, 1.0).unwrap();
        assert!((pid.update(1.0, 0.0, DT_S) - before).abs() < 0.01);
        assert!(pid.set_gains(1.0, f32::NAN, 0.0).is_err());
    }

    #[test]
    fn a_setpoint_that_comes_back_leaves_no_trace_of_the_limit() {
        // P of 200 and of 180 are both cut to 50; what comes next is P again, and not 50 less the difference.
        for ki in [0.0, 5.0] {
            let config = IncrementalPidConfig::new(2.0, ki, 0.0).with_output_limit(50.0);
            let mut pid = pid(config);
            assert_eq!((pid.update(100.0, 0.0, DT_S), pid.update(90.0, 0.0, DT_S)), (50.0, 50.0));
            let back = pid.update(1.0, 0.0, DT_S);
            assert!((back - 2.0 - ki * 45.5 * DT_S).abs() < 1e-4, "{back}");
        }
    }

    #[test]
    fn new_gains_at_the_limit_do_not_move_the_output_and_wind_nothing_up() {
        let mut pid = pid(IncrementalPidConfig::new(2.0, 1.0, 0.0).with_output_limit(50.0));
        pid.update(100.0, 0.0, DT_S);
        assert_eq!(pid.update(100.0, 0.0, DT_S), 50.0);
        pid.set_gains(1.0, 1.0, 0.0).unwrap();
        assert_eq!(pid.output(), 50.0);
        assert_eq!(pid.update(100.0, 0.0, DT_S), 50.0);
        assert!(pid.update(1.0, 0.0, DT_S).abs() < 1.1); // P of 1, and a step's growth
        pid.set_gains(f32::MAX, 1.0, 0.0).unwrap();
        assert!(pid.update(-100.0, 0.0, DT_S).abs() <= 50.0);
    }

    proptest! {
        #[test]
        fn with_limits_it_equals_the_positional_form_with_conditional_integration(
            kp in 0_u8..16, ki in 0_u8..64, kd in 0_u8..8, limit in 1_u8..60,
            samples in prop::collection::vec((-50_i8..50, -50_i8..50), 1..80),
        ) {
            // All of it is exact in f32: quarters, a step of 2^-6 s, and a derivative in whole numbers.
            let step = TimeStep::of(1.0 / 64.0);
            let gains = (f32::from(kp) / 4.0, f32::from(ki), f32::from(kd) / 64.0);
            let limit = f32::from(limit);
            let positional = PidConfig::new(gains.0, gains.1, gains.2).with_output_limit(limit);
            let mut positional = Pid::new(positional).unwrap();
            let incremental = IncrementalPidConfig::new(gains.0, gains.1, gains.2);
            let mut incremental = pid(incremental.with_output_limit(limit));
            for (setpoint, measurement) in samples {
                let (setpoint, measurement) = (f32::from(setpoint), f32::from(measurement));
                let expected = positional.step(setpoint, measurement, &step);
                prop_assert_eq!(incremental.step(setpoint, measurement, &step), expected);
            }
        }

        #[test]
        fn without_limits_it_equals_the_positional_form(
            kp in 0.0_f32..10.0, ki in 0.0_f32..10.0, kd in 0.0_f32..0.1,
            samples in prop::collection::vec((-50.0_f32..50.0, -50.0_f32..50.0, 1_u8..10), 1..50),
        ) {
            let mut positional = Pid::new(PidConfig::new(kp, ki, kd)).unwrap();
            let mut incremental = pid(IncrementalPidConfig::new(kp, ki, kd));
            let mut largest = 1.0_f32;
            for (setpoint, measurement, millis) in samples {
                let dt_s = f32::from(millis) * DT_S;
                let expected = positional.update(setpoint, measurement, dt_s);
                let output = incremental.update(setpoint, measurement, dt_s);
                largest = largest.max(expected.abs());
                prop_assert!((output - expected).abs() <= 2e-5 * largest, "{} {}", output, expected);
            }
        }

        #[test]
        fn output_is_within_limits_for_any_finite_input(
            gains in (0.0_f32..1e6, 0.0_f32..1e6, 0.0_f32..1e6), limit in 0.001_f32..1e6,
            samples in prop::collection::vec((-f32::MAX..f32::MAX, -f32::MAX..f32::MAX, 0.0_f32..0.2), 1..50),
        ) {
            let config = IncrementalPidConfig::new(gains.0, gains.1, gains.2).with_output_limit(limit);
            let mut pid = pid(config);
            for (setpoint, measurement, dt_s) in samples {
                prop_assert!(pid.update(setpoint, measurement, dt_s).abs() <= limit);
            }
        }
    }
}
