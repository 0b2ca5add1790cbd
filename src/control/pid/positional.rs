use super::PidConfig;
use super::gate::{CLOSED, UNKNOWN, passes};
use super::settings::{FEED_FORWARD, REST_DERIVATIVE, Settings, TRACK_OUTPUT};
use crate::control::error::{ConfigError, gains};
use crate::control::number::{finite, limited};
use crate::control::step::TimeStep;

/// A positional PID controller.
///
/// ```text
/// e = setpoint - measurement
/// output = kp e + ki integral(e dt) - kd d(measurement)/dt + kS sign(setpoint) + kV setpoint
/// ```
/// The integral is trapezoidal. Options are in [`PidConfig`]; they apply in this order: circle, dead band, derivative
/// filter, integral weights, integral limit, sum, slew limit, output limits, anti-windup.
///
/// # Edge behaviour
/// * The first call gives P and feed-forward only: there is no interval yet to integrate or to differentiate over.
///   It does not matter how long ago the controller was made. [`step_error`](Self::step_error) gives D too: the rate is given.
/// * `dt_s` zero, negative, NaN or infinite: nothing changes, the last output is returned, [`rejected`](Self::rejected) grows.
/// * `dt_s` above the maximum of the [`TimeStep`]: the integral and D stay for this step, P and feed-forward follow.
/// * NaN or infinity in any input: the last output is returned, [`rejected`](Self::rejected) grows, and the integral stays. D rests
///   in the next good step: it keeps its value, since the travel of the time that is missing is not that of one step.
/// * `ki` zero: the integral is zero and stays zero.
/// * Gains or inputs so large that `f32` overflows: the output is the limit (±`f32::MAX` without one), never NaN, and
///   what is stored stays finite.
/// * An increment of the integral smaller than half the spacing of `f32` at it (6e-8 of the integral) is lost: the integral
///   stands still where `ki |e| dt` is less than that. At an integral of 10, 1 kHz and `ki` = 1 those are errors below 6e-4.
/// * At the threshold itself: an error of exactly the dead band's width counts in full, one of exactly the integral's separation
///   is integrated, and the ends of the variable rate are those of the line between them.
///
/// # Examples
/// The gains are those of continuous time: one second of a constant error of 1 integrates to `ki` at any rate, and a
/// measurement that grows by 1 a second gives a D of `-kd`.
/// ```
/// use drivetrain::control::{Pid, PidConfig};
///
/// for rate_hz in [100_u16, 1000] {
///     let dt_s = 1.0 / f32::from(rate_hz);
///     let mut pid = Pid::new(PidConfig::new(0.0, 3.0, 0.0))?;
///     for _ in 0..=rate_hz {
///         pid.update(1.0, 0.0, dt_s);
///     }
///     assert!((pid.output() - 3.0).abs() < 1e-4); // ki times 1 s
///
///     let mut pid = Pid::new(PidConfig::new(0.0, 0.0, 0.2))?;
///     pid.update(0.0, 0.0, dt_s);
///     assert!((pid.update(0.0, dt_s, dt_s) + 0.2).abs() < 1e-6); // kd times 1/s
/// }
/// # Ok::<(), drivetrain::control::ConfigError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
// What a step stores stands first and in the order of the arguments of `saturate`, so that one vstmia stores it.
#[repr(C)]
pub struct Pid {
    pub(super) output: f32,
    pub(super) measurement: f32,
    pub(super) error: f32,
    pub(super) rate: f32,
    pub(super) integral: f32,
    pub(super) settings: Settings,
    pub(super) options: u16,
    pub(super) rejected: u16,
}

#[cfg(target_pointer_width = "32")]
const _: () = assert!(size_of::<Pid>() <= 92, "two for each motor of a bus");

/// The parts of the last output, in its unit.
///
/// Their sum is the output, as long as that is within its limits and its slew limit. Beyond them, `i` is the integral that
/// anti-windup has left for the next step.
#[derive(Debug, Default, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Terms {
    /// Proportional: `kp` times the error; zero in the dead band.
    pub p: f32,
    /// Integral, within its limit.
    pub i: f32,
    /// Derivative: `-kd` times the rate of the measurement, filtered where that was asked for.
    pub d: f32,
    /// Feed-forward: `kS sign(setpoint) + kV setpoint`; on a circle for the setpoint next to the measurement.
    pub feed_forward: f32,
}

impl Pid {
    /// Takes and checks the configuration.
    ///
    /// # Errors
    /// Names the parameter that is NaN, infinite, negative, zero where it must not be, or reversed.
    pub const fn new(config: PidConfig) -> Result<Self, ConfigError> {
        if let Err(error) = config.validate() {
            return Err(error);
        }
        let options = config.options();
        Ok(Self {
            output: 0.0,
            measurement: UNKNOWN,
            error: UNKNOWN,
            rate: 0.0,
            integral: 0.0,
            settings: Settings::new(&config, options),
            options,
            rejected: 0,
        })
    }

    /// Steps by `dt_s` seconds, of which [`TimeStep::MAX_S`] are believed, and returns the output.
    ///
    /// For another maximum, make a [`TimeStep`] and call [`step`](Self::step).
    #[inline]
    pub fn update(&mut self, setpoint: f32, measurement: f32, dt_s: f32) -> f32 {
        self.step(setpoint, measurement, &TimeStep::of(dt_s))
    }

    /// Steps by a time that was validated before, and returns the output.
    ///
    /// The same as [`update`](Self::update) for several loops that share a tick.
    #[inline]
    pub fn step(&mut self, setpoint: f32, measurement: f32, step: &TimeStep) -> f32 {
        let error = setpoint - measurement;
        'options: {
            if self.settings.integral_gate == CLOSED {
                break 'options;
            }
            let integral = self.integral + self.growth(error, step);
            // The first call, a step that is not normal, NaN and overflow: none of them passes.
            if !passes(integral, self.settings.integral_gate) {
                break 'options;
            }
            let rate = (measurement - self.measurement) * step.per_dt;
            return self.finish(measurement, error, rate, integral, step);
        }
        let travel = measurement - self.measurement;
        self.step_with_options(setpoint, measurement, error, travel, step, self.options.into())
    }

    /// Steps with an error that was formed elsewhere (from integers, on a circle) and the measured rate of change.
    ///
    /// D is `-kd * rate`, on the first call too, so a positive `kd` damps; there is no feed-forward. Options on the circle and on the
    /// derivative of the error do not apply. Everything else is as for [`step`](Self::step), which may be mixed with it.
    #[inline]
    pub fn step_error(&mut self, error: f32, rate: f32, step: &TimeStep) -> f32 {
        let integral = self.integral + self.growth(error, step);
        if !passes(integral, self.settings.integral_gate) {
            if !error.is_finite() {
                return self.step_error_carefully(error, rate, step);
            }
            let options = self.options & !FEED_FORWARD;
            return self.step_given(rate, UNKNOWN, error, rate, step, options.into());
        }
        self.finish(UNKNOWN, error, rate, integral, step)
    }

    #[inline]
    fn finish(
        &mut self,
        measurement: f32,
        error: f32,
        rate: f32,
        integral: f32,
        step: &TimeStep,
    ) -> f32 {
        let output = self.settings.kp * error + integral - self.settings.kd * rate;
        if !passes(output, self.settings.output_gate) {
            return self.saturate(output, measurement, error, rate, integral, step);
        }
        self.keep(output, measurement, error, rate, integral);
        output
    }

    /// Forgets everything but the configuration and the count of rejected steps: the next call is a first call.
    pub const fn reset(&mut self) {
        self.integral = 0.0;
        self.error = UNKNOWN;
        self.measurement = UNKNOWN;
        self.rate = 0.0;
        self.output = 0.0;
        self.options &= !TRACK_OUTPUT;
        self.end_rest();
    }

    /// Keeps the integral, and forgets what the next step would integrate and differentiate over: for a gap in the
    /// measurements. The next step gives what a first one does, and the integral as it was.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::control::{Pid, PidConfig};
    ///
    /// let mut pid = Pid::new(PidConfig::new(0.0, 1.0, 0.5))?;
    /// for _ in 0..=1000 {
    ///     pid.update(1.0, 0.0, 0.001);
    /// }
    /// pid.interrupt();
    /// assert!((pid.update(1.0, 0.7, 0.001) - 1.0).abs() < 1e-3); // no kick of D for the step of 0.7
    /// # Ok::<(), drivetrain::control::ConfigError>(())
    /// ```
    pub const fn interrupt(&mut self) {
        self.error = UNKNOWN;
        self.measurement = UNKNOWN;
        self.rate = 0.0;
        self.end_rest();
    }

    /// Resets, and lets the first call return `output`, within the limits, whatever its error: for taking over from
    /// another controller without a jump.
    ///
    /// The integral carries the difference to P, as far as its limit reaches. Without an integral (`ki` zero) nothing can carry
    /// it, and `output` is only where a slew limit starts from. NaN and infinity count as zero.
    pub const fn reset_to(&mut self, output: f32) {
        self.reset();
        self.output = self.within_output_range(if output.is_finite() { output } else { 0.0 });
        self.options |= TRACK_OUTPUT;
    }

    /// Changes the gains without a jump of P: the integral takes up the difference. A new `kd` shows at once, in D, which passes;
    /// the integral would keep it after the shaft has come to rest.
    ///
    /// With `ki` zero the integral is dropped, since nothing would ever drain it; then the output moves to P and D.
    ///
    /// # Errors
    /// Names the gain that is NaN, infinite or negative; then nothing changes.
    pub fn set_gains(&mut self, kp: f32, ki: f32, kd: f32) -> Result<(), ConfigError> {
        gains(kp, ki, kd)?;
        self.change(self.config().with_gains(kp, ki, kd));
        Ok(())
    }

    /// Changes the configuration without a jump of P and feed-forward, as [`set_gains`](Self::set_gains) does; new limits hold
    /// from the next step on.
    ///
    /// # Errors
    /// Names the parameter as [`new`](Self::new) does; then nothing changes.
    pub fn set_config(&mut self, config: PidConfig) -> Result<(), ConfigError> {
        config.validate()?;
        self.change(config);
        Ok(())
    }

    /// Returns the parts of the last output.
    #[must_use]
    pub fn terms(&self) -> Terms {
        let settings = &self.settings;
        let error = if self.error == UNKNOWN || passes(self.error, settings.dead_band_gate) {
            0.0
        } else {
            self.error
        };
        Terms {
            p: settings.kp * error,
            i: self.integral,
            d: -(settings.kd * self.rate),
            // There is none when the error was formed elsewhere.
            feed_forward: if self.measurement == UNKNOWN || self.error == UNKNOWN {
                0.0
            } else {
                self.feed_forward(self.measurement, self.error)
            },
        }
    }

    /// Returns the last output; before the first call zero, or what was given to [`reset_to`](Self::reset_to).
    #[must_use]
    pub const fn output(&self) -> f32 {
        self.output
    }

    /// Returns the configuration.
    #[must_use]
    pub const fn config(&self) -> PidConfig {
        self.settings.config(self.options)
    }

    /// Returns the number of steps that were refused for their time or for an input that was NaN or infinite; stays at 65535.
    #[must_use]
    pub const fn rejected(&self) -> u16 {
        self.rejected
    }

    /// Returns what the output limits leave of `value`.
    pub(in crate::control) const fn within_output_range(&self, value: f32) -> f32 {
        limited(value, self.settings.output_lower, self.settings.output_upper)
    }

    fn change(&mut self, config: PidConfig) {
        let before = self.terms();
        let options = config.options();
        self.settings = Settings::new(&config, options);
        let rests = self.has(REST_DERIVATIVE);
        self.options = options | self.options & TRACK_OUTPUT;
        if rests {
            self.rest_derivative();
        }
        let after = self.terms();
        let carried = before.i + (before.p - after.p) + (before.feed_forward - after.feed_forward);
        self.integral = if config.ki > 0.0 {
            limited(finite(carried), -config.integral_limit, config.integral_limit)
        } else {
            0.0
        };
    }

    /// For the setpoint as a later call can know it too.
    #[inline]
    pub(super) const fn feed_forward(&self, measurement: f32, error: f32) -> f32 {
        let setpoint = measurement + error;
        let moving = self.settings.velocity_gain * setpoint;
        if setpoint > 0.0 {
            moving + self.settings.static_gain
        } else if setpoint < 0.0 {
            moving - self.settings.static_gain
        } else {
            moving
        }
    }
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "exact results are the rule under test")]
mod tests {
    use super::*;
    use crate::control::ConfigFault;
    use proptest::prelude::*;

    const DT_S: f32 = 0.001;
    const BAD: [f32; 3] = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY];

    fn pid(config: PidConfig) -> Pid {
        Pid::new(config).unwrap()
    }

    fn every_option() -> PidConfig {
        PidConfig::new(2.0, 10.0, 0.05)
            .with_output_range(-8.0, 10.0)
            .with_integral_limit(4.0)
            .with_integral_separation(100.0)
            .with_variable_integral(20.0, 80.0)
            .with_dead_band(0.01)
            .with_feed_forward(0.5, 0.01)
            .with_slew_limit(4000.0)
            .with_period(360.0)
            .with_derivative_filter(100.0)
            .with_back_calculation(0.05)
    }

    #[test]
    fn first_call_after_a_long_time_is_proportional_only() {
        for dt_s in [DT_S, 0.09, 10.0] {
            let mut pid = pid(PidConfig::new(2.0, 100.0, 100.0));
            assert_eq!(pid.update(3.0, 1.0, dt_s), 4.0);
            assert_eq!(pid.terms(), Terms { p: 4.0, ..Terms::default() });
        }
    }

    #[test]
    fn a_dt_that_is_no_time_holds_the_output_and_is_counted() {
        for config in [PidConfig::new(2.0, 10.0, 0.1), every_option()] {
            let mut pid = pid(config);
            pid.update(3.0, 1.0, DT_S);
            pid.update(3.0, 1.1, DT_S);
            let before = pid;
            for (refused, dt_s) in
                [0.0, -0.0, -DT_S, BAD[0], BAD[1], BAD[2]].into_iter().enumerate()
            {
                assert_eq!(pid.update(9.0, 2.0, dt_s), before.output());
                assert_eq!(usize::from(pid.rejected()), refused + 1);
                assert_eq!(Pid { rejected: 0, ..pid }, before);
            }
        }
    }

    #[test]
    fn a_dt_above_the_maximum_freezes_integral_and_derivative() {
        let mut pid = pid(PidConfig::new(2.0, 10.0, 0.01));
        pid.update(1.0, 0.0, DT_S);
        pid.update(1.0, 0.001, DT_S);
        let before = pid.terms();
        assert_eq!(pid.update(5.0, 0.0, 10.0), 10.0 + before.i + before.d);
        assert_eq!(pid.terms(), Terms { p: 10.0, ..before });
        assert_eq!(pid.rejected(), 0);
        // The step after it works with its own interval only.
        pid.update(5.0, 0.0, DT_S);
        assert_eq!(pid.terms().d, 0.0);
        assert!((pid.terms().i - before.i - 10.0 * 5.0 * DT_S).abs() < 1e-6);
    }

    #[test]
    fn a_bad_sample_holds_the_output_and_leaves_no_trace_but_in_d() {
        for config in [
            PidConfig::new(2.0, 10.0, 0.0),
            PidConfig::new(0.0, 0.0, 0.0),
            every_option().with_gains(2.0, 10.0, 0.0),
        ] {
            for bad in BAD {
                let (mut clean, mut hit) = (pid(config), pid(config));
                for sample in 0..20_u8 {
                    let measurement = f32::from(sample) * 0.01;
                    let expected = clean.update(1.0, measurement, DT_S);
                    let held = hit.output();
                    assert_eq!(hit.update(1.0, bad, DT_S), held);
                    assert_eq!(hit.update(bad, measurement, DT_S), held);
                    assert_eq!(hit.update(1.0, measurement, DT_S), expected);
                }
                assert_eq!(hit.rejected(), 40);
                assert_eq!(Pid { rejected: 0, rate: clean.rate, ..hit }, clean);
            }
        }
    }

    #[test]
    fn a_burst_of_bad_samples_of_a_moving_shaft_does_not_kick() {
        let damper = PidConfig::new(0.0, 1.0, 0.05);
        for config in [
            damper,
            damper.with_derivative_on_error(),
            damper.with_derivative_filter(1e4),
            damper.with_period(360.0).with_slew_limit(1e9),
        ] {
            let mut pid = pid(config);
            let mut at = 0.0;
            for sample in 0..100_u8 {
                at += 10.0 * DT_S;
                let bad = (20..70).contains(&sample);
                pid.update(0.0, if bad { BAD[usize::from(sample) % 3] } else { at }, DT_S);
                assert!(sample < 19 || (pid.terms().d + 0.5).abs() < 0.01, "{:?}", pid.terms());
            }
            assert_eq!(pid.rejected(), 50);
            assert_eq!(pid.config(), config);
            let gate = Pid::new(config).unwrap().settings;
            assert_eq!(pid.settings, gate); // back on the plain path
        }
    }

    #[test]
    fn a_bad_error_or_rate_holds_the_output_and_leaves_no_trace() {
        let step = TimeStep::new(DT_S, 0.1);
        let mut pid = pid(PidConfig::new(2.0, 10.0, 0.1));
        pid.step_error(1.0, 0.5, &step);
        let before = pid;
        for bad in BAD {
            assert_eq!(pid.step_error(bad, 0.0, &step), before.output());
            assert_eq!(pid.step_error(1.0, bad, &step), before.output());
        }
        assert_eq!(pid.step_error(1.0, 0.5, &TimeStep::new(0.0, 0.1)), before.output());
        assert_eq!((pid.rejected(), Pid { rejected: 0, ..pid }), (7, before));
    }

    #[test]
    fn a_limit_that_is_zero_or_reversed_is_named() {
        let new = PidConfig::new(1.0, 1.0, 1.0);
        let cases = [
            (PidConfig::new(-1.0, 0.0, 0.0), "kp", ConfigFault::Negative),
            (PidConfig::new(0.0, f32::NAN, 0.0), "ki", ConfigFault::Negative),
            (PidConfig::new(0.0, 0.0, f32::INFINITY), "kd", ConfigFault::Negative),
            (new.with_output_limit(0.0), "output_limit", ConfigFault::NotPositive),
            (new.with_output_limit(-1.0), "output_limit", ConfigFault::NotPositive),
            (new.with_output_limit(f32::NAN), "output_limit", ConfigFault::NotPositive),
            (new.with_output_limit(f32::INFINITY), "output_limit", ConfigFault::NotPositive),
            (new.with_output_range(1.0, f32::NAN), "output_range", ConfigFault::Reversed),
            (new.with_output_range(2.0, 1.0), "output_range", ConfigFault::Reversed),
            (new.with_integral_limit(0.0), "integral_limit", ConfigFault::NotPositive),
            (new.with_integral_separation(-1.0), "integral_separation", ConfigFault::NotPositive),
            (new.with_variable_integral(2.0, 1.0), "variable_integral", ConfigFault::Reversed),
            (new.with_variable_integral(-1.0, 1.0), "variable_integral", ConfigFault::Negative),
            (new.with_variable_integral(1.0, f32::NAN), "variable_integral", ConfigFault::Reversed),
            (new.with_back_calculation(0.0), "back_calculation", ConfigFault::NotPositive),
            (new.with_back_calculation(f32::NAN), "back_calculation", ConfigFault::NotPositive),
            (new.with_dead_band(-1.0), "dead_band", ConfigFault::Negative),
            (new.with_feed_forward(-1.0, 0.0), "static_gain", ConfigFault::Negative),
            (new.with_feed_forward(0.0, f32::NAN), "velocity_gain", ConfigFault::Negative),
            (new.with_slew_limit(0.0), "slew_limit", ConfigFault::NotPositive),
            (new.with_period(0.0), "period", ConfigFault::NotPositive),
            (new.with_period(-360.0), "period", ConfigFault::NotPositive),
            (new.with_period(f32::INFINITY), "period", ConfigFault::NotPositive),
            (new.with_derivative_filter(0.0), "derivative_filter", ConfigFault::NotPositive),
            (new.with_derivative_filter(-5.0), "derivative_filter", ConfigFault::NotPositive),
            (new.with_derivative_filter(BAD[0]), "derivative_filter", ConfigFault::NotPositive),
            (new.with_derivative_filter(BAD[1]), "derivative_filter", ConfigFault::NotPositive),
            (new.with_back_calculation(BAD[1]), "back_calculation", ConfigFault::NotPositive),
            (new.with_period(1e-40), "period", ConfigFault::NotPositive),
        ];
        for (config, parameter, fault) in cases {
            assert_eq!(Pid::new(config), Err(ConfigError::new(parameter, fault)));
            let mut running = pid(new);
            assert!(running.set_config(config).is_err());
            assert_eq!(running, pid(new));
        }
        assert!(Pid::new(every_option()).is_ok());
    }

    #[test]
    fn without_ki_the_integral_is_zero_and_stays_zero() {
        let mut pid = pid(PidConfig::new(1.0, 0.0, 0.0).with_output_limit(5.0));
        for _ in 0..1000 {
            pid.update(100.0, 0.0, DT_S);
        }
        assert_eq!((pid.terms().i, pid.update(0.0, 0.0, DT_S)), (0.0, 0.0));
    }

    #[test]
    fn without_ki_back_calculation_has_nothing_to_drain() {
        let config =
            PidConfig::new(1.0, 0.0, 0.0).with_output_limit(5.0).with_back_calculation(0.1);
        for config in [config, config.with_slew_limit(1e6)] {
            let mut pid = pid(config);
            for _ in 0..1000 {
                pid.update(100.0, 0.0, DT_S);
            }
            assert_eq!((pid.terms().i, pid.update(1.0, 0.0, DT_S)), (0.0, 1.0));
        }
    }

    #[test]
    fn huge_gains_end_at_the_limit_and_never_in_nan() {
        let huge = PidConfig::new(1e30, 1e30, 1e30);
        for config in [
            huge.with_output_limit(20.0),
            huge,
            huge.with_period(1e30),
            huge.with_derivative_filter(1.0),
        ] {
            let mut pid = pid(config);
            for measurement in [0.0, 1e30, -1e30, f32::MAX, f32::MIN, 3.0, f32::MIN_POSITIVE] {
                for setpoint in [1.0, f32::MAX, f32::MIN] {
                    let output = pid.update(setpoint, measurement, 1e-6);
                    assert!(output.abs() <= config.output_upper && pid.integral.is_finite());
                    assert!(pid.rate.is_finite() && pid.error.is_finite());
                }
            }
            assert_eq!(pid.rejected(), 0);
        }
    }

    #[test]
    fn positive_kd_damps_in_every_entry_point() {
        for config in [
            PidConfig::new(0.0, 0.0, 0.5),
            PidConfig::new(0.0, 0.0, 0.5).with_derivative_on_error(),
        ] {
            for direction in [1.0, -1.0] {
                let mut pid = pid(config);
                let step = TimeStep::new(DT_S, 0.1);
                pid.update(0.0, 0.0, DT_S);
                assert!(pid.update(0.0, direction * 0.1, DT_S) * direction < 0.0);
                assert!(pid.step(0.0, direction * 0.2, &step) * direction < 0.0);
                assert!(pid.step_error(0.0, direction * 3.0, &step) * direction < 0.0);
            }
        }
    }

    #[test]
    fn derivative_on_measurement_ignores_the_setpoint_and_on_error_answers_it() {
        let config = PidConfig::new(0.0, 0.0, 1.0);
        let (mut quiet, mut kicked) = (pid(config), pid(config.with_derivative_on_error()));
        quiet.update(0.0, 0.0, DT_S);
        kicked.update(0.0, 0.0, DT_S);
        assert_eq!(quiet.update(1.0, 0.0, DT_S), 0.0);
        assert!((kicked.update(1.0, 0.0, DT_S) - 1000.0).abs() < 0.01);
    }

    #[test]
    fn integral_separation_off_means_integral_on() {
        let mut pid = pid(PidConfig::new(0.0, 10.0, 0.0));
        pid.update(1000.0, 0.0, DT_S);
        pid.update(1000.0, 0.0, DT_S);
        assert!((pid.terms().i - 10.0).abs() < 1e-5);
    }

    #[test]
    fn integral_separation_rests_beyond_the_threshold_in_both_directions() {
        let mut pid = pid(PidConfig::new(0.0, 10.0, 0.0).with_integral_separation(5.0));
        for far in [6.0, -6.0] {
            pid.update(far, 0.0, DT_S);
            pid.update(far, 0.0, DT_S);
            assert_eq!(pid.terms().i, 0.0);
        }
        pid.update(5.0, 0.0, DT_S);
        pid.update(5.0, 0.0, DT_S);
        assert!(pid.terms().i > 0.0);
    }

    #[test]
    fn separation_holds_within_the_full_rate_of_a_variable_integral_too() {
        for (error, rests) in [(4.0, false), (5.0, false), (6.0, true), (15.0, true), (30.0, true)]
        {
            for error in [error, -error] {
                let variable = PidConfig::new(0.0, 10.0, 0.0).with_variable_integral(10.0, 20.0);
                let mut pid = pid(variable.with_integral_separation(5.0));
                pid.update(error, 0.0, DT_S);
                pid.update(error, 0.0, DT_S);
                assert_eq!(pid.terms().i == 0.0, rests, "{error}");
            }
        }
    }

    #[test]
    fn variable_integral_works_at_half_rate_half_way() {
        for (error, part) in [(10.0, 1.0), (15.0, 0.5), (-15.0, 0.5), (20.0, 0.0), (30.0, 0.0)] {
            let mut pid = pid(PidConfig::new(0.0, 1.0, 0.0).with_variable_integral(10.0, 20.0));
            pid.update(error, 0.0, DT_S);
            pid.update(error, 0.0, DT_S);
            assert!((pid.terms().i - part * error * DT_S).abs() < 1e-8, "{error}");
        }
    }

    #[test]
    fn dead_band_does_not_freeze_a_wound_up_integral() {
        for direction in [1.0, -1.0] {
            let mut pid = pid(PidConfig::new(0.0, 100.0, 0.0).with_dead_band(1.0));
            for _ in 0..100 {
                pid.update(direction * 5.0, 0.0, DT_S);
            }
            let wound_up = pid.terms().i.abs();
            // Past the target but inside the band: the integral goes back ...
            for _ in 0..100 {
                pid.update(direction * -0.9, 0.0, DT_S);
            }
            assert!(pid.terms().i.abs() < wound_up - 5.0);
            // ... and short of it, inside the band, it does not grow.
            let before = pid.terms().i;
            pid.update(direction * 0.9, 0.0, DT_S);
            pid.update(direction * 0.9, 0.0, DT_S);
            assert_eq!(pid.terms().i, before);
        }
    }

    #[test]
    fn dead_band_takes_p_to_zero() {
        let mut pid = pid(PidConfig::new(10.0, 0.0, 0.0).with_dead_band(1.0));
        assert_eq!(pid.update(0.99, 0.0, DT_S), 0.0);
        assert_eq!(pid.terms().p, 0.0);
        assert_eq!(pid.update(-1.5, 0.0, DT_S), -15.0);
    }

    #[test]
    fn an_error_at_the_very_edge_of_a_threshold() {
        let below = f32::from_bits(1.0_f32.to_bits() - 1);
        let above = f32::from_bits(1.0_f32.to_bits() + 1);
        let p = |error| {
            pid(PidConfig::new(10.0, 0.0, 0.0).with_dead_band(1.0)).update(error, 0.0, DT_S)
        };
        assert_eq!((p(below), p(-below)), (0.0, 0.0));
        assert_eq!((p(1.0), p(-1.0)), (10.0, -10.0)); // the edge itself counts in full
        let integral = |config: PidConfig, error| {
            let mut pid = pid(config);
            pid.update(error, 0.0, DT_S);
            pid.update(error, 0.0, DT_S);
            pid.terms().i
        };
        let only_i = PidConfig::new(0.0, 1.0, 0.0);
        for sign in [1.0, -1.0] {
            let in_band = only_i.with_dead_band(1.0);
            assert_eq!(integral(in_band, sign * below), 0.0);
            assert_eq!(integral(in_band, sign), sign * DT_S);
            let separated = only_i.with_integral_separation(1.0);
            assert_eq!(
                (integral(separated, sign), integral(separated, sign * above)),
                (sign * DT_S, 0.0)
            );
            let variable = only_i.with_variable_integral(1.0, 2.0);
            assert_eq!(
                (integral(variable, sign), integral(variable, sign * 2.0)),
                (sign * DT_S, 0.0)
            );
        }
    }

    #[test]
    fn an_increment_of_less_than_half_a_spacing_is_lost_and_one_of_more_is_not() {
        // At 10, the spacing is 9.5e-7; with ki = 1 at 1 kHz, half of it is an error of 4.8e-4.
        for (error, moves) in [(4.7e-4, false), (4.9e-4, true)] {
            let mut pid = pid(PidConfig::new(0.0, 1.0, 0.0));
            pid.reset_to(10.0);
            for _ in 0..1_000 {
                pid.update(error, 0.0, DT_S);
            }
            assert_eq!(pid.terms().i > 10.0, moves, "{error}");
        }
    }

    #[test]
    fn by_error_d_is_there_from_the_first_call_on_and_after_a_reset() {
        let step = TimeStep::of(DT_S);
        let config = PidConfig::new(2.0, 5.0, 0.5);
        for config in [config, config.with_slew_limit(1e9)] {
            let mut pid = pid(config);
            let first = Terms { p: 2.0, d: -1.5, ..Terms::default() };
            pid.step_error(1.0, 3.0, &step);
            assert_eq!(pid.terms(), first);
            pid.reset();
            pid.step_error(1.0, 3.0, &step);
            assert_eq!(pid.terms(), first);
            pid.interrupt();
            pid.step_error(1.0, 3.0, &step);
            assert_eq!(pid.terms(), first);
            // From a measurement, there is nothing yet to differentiate over.
            pid.reset();
            pid.step(1.0, 0.0, &step);
            assert_eq!(pid.terms(), Terms { p: 2.0, ..Terms::default() });
        }
    }

    #[test]
    fn circular_goes_the_short_way_in_both_directions() {
        let circle = PidConfig::new(1.0, 0.0, 0.0).with_period(360.0);
        assert_eq!(pid(circle).update(10.0, 350.0, DT_S), 20.0);
        assert_eq!(pid(circle).update(350.0, 10.0, DT_S), -20.0);
    }

    #[test]
    fn circular_derivative_has_no_spike_at_the_wrap() {
        let damper = PidConfig::new(0.0, 0.0, 1.0).with_period(360.0);
        for config in [damper, damper.with_derivative_on_error()] {
            let mut pid = pid(config);
            pid.update(0.0, 359.5, DT_S);
            assert!((pid.update(0.0, 0.5, DT_S) + 1000.0).abs() < 0.1);
            assert!((pid.update(0.0, 359.5, DT_S) - 1000.0).abs() < 0.1);
        }
    }

    #[test]
    fn feed_forward_is_static_and_proportional_to_the_setpoint() {
        let config = PidConfig::new(0.0, 0.0, 0.0).with_feed_forward(0.5, 0.1);
        assert_eq!(pid(config).update(10.0, 3.0, DT_S), 1.5);
        assert_eq!(pid(config).update(-10.0, 3.0, DT_S), -1.5);
        assert_eq!(pid(config).update(0.0, 3.0, DT_S), 0.0);
    }

    #[test]
    fn feed_forward_on_a_circle_takes_over_and_changes_without_a_jump() {
        let config = PidConfig::new(1.0, 1.0, 0.0).with_period(360.0).with_feed_forward(0.5, 0.1);
        let mut pid = pid(config);
        pid.reset_to(7.0);
        assert!((pid.update(10.0, 350.0, DT_S) - 7.0).abs() < 1e-4);
        assert_eq!(pid.terms().feed_forward, 37.5); // for 370, the 10 next to 350
        pid.set_config(config.with_feed_forward(0.5, 0.0)).unwrap();
        assert!((pid.update(10.0, 350.0, DT_S) - 7.0).abs() < 0.03);
    }

    #[test]
    fn feed_forward_that_is_too_small_to_see_is_not_in_the_terms_either() {
        let mut pid = pid(PidConfig::new(1.0, 0.0, 0.0).with_feed_forward(0.5, 0.0));
        let output = pid.update(1e-6, 100.0, DT_S);
        assert_eq!(pid.terms().p + pid.terms().feed_forward, output);
    }

    #[test]
    fn slew_limit_holds_up_and_down_and_from_the_start() {
        let mut pid = pid(PidConfig::new(1.0, 0.0, 0.0).with_slew_limit(1000.0));
        assert_eq!(pid.update(5.0, 0.0, DT_S), 1.0);
        assert_eq!(pid.update(5.0, 0.0, DT_S), 2.0);
        assert_eq!(pid.update(-5.0, 0.0, DT_S), 1.0);
    }

    #[test]
    fn a_slew_limit_of_less_than_half_a_spacing_a_step_stands_still() {
        // At 100, the spacing is 7.6e-6: half of it a step of 1 ms is 3.8e-3 a second.
        for (per_s, moves) in [(3.7e-3, false), (4e-3, true)] {
            let mut pid = pid(PidConfig::new(1.0, 0.0, 0.0).with_slew_limit(per_s));
            pid.reset_to(100.0);
            for _ in 0..1_000 {
                pid.update(200.0, 0.0, DT_S);
            }
            assert_eq!(pid.output() > 100.0, moves, "{per_s}");
        }
    }

    #[test]
    fn derivative_filter_reaches_63_percent_after_its_time_constant() {
        let cutoff_hz = 1.0 / (core::f32::consts::TAU * 0.1); // 0.1 s
        let mut pid = pid(PidConfig::new(0.0, 0.0, 1.0).with_derivative_filter(cutoff_hz));
        for sample in 0..=100_u8 {
            pid.update(0.0, f32::from(sample) * DT_S, DT_S);
        }
        assert!((pid.output() + 0.632).abs() < 0.005, "{}", pid.output());
    }

    #[test]
    fn conditional_integration_leaves_the_limit_at_once() {
        let config = PidConfig::new(1.0, 100.0, 0.0).with_output_limit(10.0);
        let (mut guarded, mut winding) = (pid(config), pid(config.without_anti_windup()));
        for _ in 0..1000 {
            guarded.update(9.0, 0.0, DT_S);
            winding.update(9.0, 0.0, DT_S);
        }
        assert_eq!((guarded.output(), winding.output()), (10.0, 10.0));
        assert!(guarded.terms().i <= 2.0 && winding.terms().i > 500.0);
        assert!(guarded.update(-1.0, 0.0, DT_S) < 1.0);
    }

    #[test]
    fn back_calculation_drains_what_the_limit_cuts_off() {
        let config =
            PidConfig::new(1.0, 100.0, 0.0).with_output_limit(10.0).with_back_calculation(0.01);
        let mut pid = pid(config);
        for _ in 0..1000 {
            pid.update(9.0, 0.0, DT_S);
        }
        // In balance, the inflow ki e equals the outflow excess / Tt: excess = 100 * 9 * 0.01 = 9.
        assert!((pid.terms().p + pid.terms().i - 10.0 - 9.0).abs() < 1.5, "{:?}", pid.terms());
    }

    #[test]
    fn reset_forgets_all_but_the_configuration() {
        let mut pid = pid(every_option());
        for sample in 0..10_u8 {
            pid.update(50.0, f32::from(sample), DT_S);
        }
        pid.reset();
        assert_eq!(pid, Pid::new(every_option()).unwrap());
    }

    #[test]
    fn reset_to_takes_over_without_a_jump() {
        let config = PidConfig::new(2.0, 10.0, 0.5).with_output_limit(10.0);
        let mut pid = pid(config);
        pid.reset_to(7.0);
        assert_eq!(pid.output(), 7.0);
        assert!((pid.update(100.0, 99.0, DT_S) - 7.0).abs() < 1e-5);
        assert!((pid.update(100.0, 99.0, DT_S) - 7.01).abs() < 1e-4);
        pid.reset_to(70.0);
        assert_eq!(pid.update(0.0, 0.0, DT_S), 10.0);
        pid.reset_to(f32::NAN);
        assert_eq!(pid.output(), 0.0);
    }

    #[test]
    fn new_gains_do_not_move_the_output() {
        for config in [PidConfig::new(2.0, 10.0, 0.02), every_option().with_slew_limit(1e9)] {
            let mut pid = pid(config);
            for sample in 0..10_u8 {
                pid.update(1.0, f32::from(sample) * 0.001, DT_S);
            }
            let (before, terms) = (pid.output(), pid.terms());
            let kd = pid.config().gains().2;
            pid.set_gains(3.0, 5.0, kd).unwrap();
            let now = pid.terms();
            assert!(
                (now.p + now.i + now.d + now.feed_forward - before).abs() < 1e-4,
                "{terms:?} {now:?}"
            );
            assert!((pid.update(1.0, 0.010, DT_S) - before).abs() < 0.02);
        }
    }

    #[test]
    fn a_new_kd_is_not_kept_by_the_integral() {
        let mut pid = pid(PidConfig::new(1.0, 1.0, 0.0));
        for sample in 0..100_u8 {
            pid.update(0.99, f32::from(sample) * 0.01, DT_S);
        }
        let integral = pid.terms().i;
        pid.set_gains(1.0, 1.0, 0.5).unwrap();
        pid.update(0.99, 0.99, DT_S);
        assert!((pid.update(0.99, 0.99, DT_S) - integral).abs() < 1e-6); // at rest, on target
    }

    #[test]
    fn a_new_configuration_does_not_move_the_output_even_from_the_plain_path() {
        let config = PidConfig::new(2.0, 10.0, 0.02).with_output_limit(10.0);
        let mut pid = pid(config);
        pid.update(1.0, 0.1, DT_S);
        let before = pid.update(1.0, 0.1, DT_S);
        pid.set_config(config.with_feed_forward(0.5, 0.2)).unwrap();
        assert!((pid.update(1.0, 0.1, DT_S) - before).abs() < 0.02);
    }

    #[test]
    fn dropping_the_integral_gain_drops_the_integral() {
        let mut pid = pid(PidConfig::new(1.0, 10.0, 0.0));
        pid.update(1.0, 0.0, DT_S);
        pid.update(1.0, 0.0, DT_S);
        pid.set_gains(1.0, 0.0, 0.0).unwrap();
        assert_eq!(pid.update(1.0, 0.0, DT_S), 1.0);
        assert!(pid.set_gains(1.0, -1.0, 0.0).is_err_and(|error| error.parameter() == "ki"));
    }

    fn any_value() -> impl Strategy<Value = f32> {
        prop_oneof![
            -100.0_f32..100.0,
            any::<f32>().prop_filter("finite", |value| value.is_finite())
        ]
    }

    fn any_config() -> impl Strategy<Value = PidConfig> {
        let gains = (0.0_f32..1e3, 0.0_f32..1e3, 0.0_f32..10.0);
        let limits = (-50.0_f32..0.0, 0.1_f32..50.0, 0.1_f32..50.0);
        (gains, limits, 0_u16..1024).prop_map(
            |((kp, ki, kd), (lower, upper, integral), options)| {
                let mut config = PidConfig::new(kp, ki, kd)
                    .with_output_range(lower, upper)
                    .with_integral_limit(integral);
                let on = |bit: u16| options >> bit & 1 == 1;
                if on(0) {
                    config = config.with_output_limit(upper);
                }
                if on(1) {
                    config = config.with_integral_separation(30.0);
                }
                if on(2) {
                    config = config.with_variable_integral(10.0, 40.0);
                }
                if on(3) {
                    config = config.with_dead_band(1.0);
                }
                if on(4) {
                    config = config.with_feed_forward(1.0, 0.1);
                }
                if on(5) {
                    config = config.with_slew_limit(500.0);
                }
                if on(6) {
                    config = config.with_period(360.0);
                }
                if on(7) {
                    config = config.with_derivative_filter(50.0);
                }
                if on(8) {
                    config = config.with_back_calculation(0.01);
                }
                if on(9) {
                    config = config.with_derivative_on_error();
                }
                config
            },
        )
    }

    proptest! {
        #[test]
        fn the_configuration_comes_back_as_it_was_given(
            config in any_config(), separation in 0.1_f32..100.0, edges in (0.0_f32..40.0, 41.0_f32..100.0),
        ) {
            let rates = config.with_integral_separation(separation).with_variable_integral(edges.0, edges.1);
            for config in [config, rates, rates.without_anti_windup()] {
                prop_assert_eq!(pid(config).config(), config);
            }
        }

        #[test]
        fn output_and_integral_are_within_limits_for_any_finite_input(
            config in any_config(),
            samples in prop::collection::vec((any_value(), any_value(), 0.0_f32..0.2), 1..40),
        ) {
            let mut pid = pid(config);
            for (setpoint, measurement, dt_s) in samples {
                let output = pid.update(setpoint, measurement, dt_s);
                // Before the first good sample the output is zero.
                prop_assert!(output == 0.0 || (config.output_lower..=config.output_upper).contains(&output));
                prop_assert!(pid.terms().i.abs() <= config.integral_limit);
            }
        }

        #[test]
        fn within_the_limits_the_terms_add_up_to_the_output(
            config in any_config(),
            samples in prop::collection::vec((-360.0_f32..720.0, -360.0_f32..720.0), 1..40),
        ) {
            let mut pid = pid(config);
            for (setpoint, measurement) in samples {
                let output = pid.update(setpoint, measurement, DT_S);
                let Terms { p, i, d, feed_forward } = pid.terms();
                let sum = p + i + d + feed_forward;
                let (lower, upper) = config.output_range();
                let free = lower < output && output < upper && config.slew_per_s == PidConfig::OFF;
                let largest = p.abs().max(d.abs()).max(feed_forward.abs()).max(1.0);
                prop_assert!(!free || (sum - output).abs() < 1e-5 * largest, "{} {}", sum, output);
            }
        }

        #[test]
        fn a_reset_to_an_output_gives_that_output_first(
            config in any_config(),
            output in -50.0_f32..50.0,
            sample in (-360.0_f32..720.0, -360.0_f32..720.0),
        ) {
            let config = PidConfig { integral_limit: PidConfig::OFF, ki: config.ki + 0.1, ..config };
            let mut pid = pid(config);
            pid.reset_to(output);
            let expected = pid.output();
            let first = pid.update(sample.0, sample.1, DT_S);
            let largest = pid.terms().p.abs().max(pid.terms().feed_forward.abs()).max(1.0);
            prop_assert!((first - expected).abs() <= 1e-6 * largest, "{} {}", first, expected);
        }

        #[test]
        fn damping_never_feeds_energy_in(
            gains in (0.0_f32..100.0, 0.0_f32..100.0, 0.001_f32..10.0), on_error in prop::bool::ANY,
            setpoint in any_value(), path in prop::collection::vec((any_value(), 1_u16..1000), 2..50),
        ) {
            let config = PidConfig::new(gains.0, gains.1, gains.2);
            let mut pid = pid(if on_error { config.with_derivative_on_error() } else { config });
            let mut last = None;
            for (measurement, steps) in path {
                pid.update(setpoint, measurement, f32::from(steps) * 1e-4);
                if let Some(last) = last {
                    let work = f64::from(pid.terms().d) * (f64::from(measurement) - f64::from(last));
                    prop_assert!(work <= 0.0, "{work}"); // in each step, so in their sum too
                }
                last = Some(measurement);
            }
        }

        #[test]
        fn damping_by_a_given_rate_never_feeds_energy_in(
            kd in 0.001_f32..10.0, path in prop::collection::vec((any_value(), any_value()), 1..50),
        ) {
            let mut pid = pid(PidConfig::new(1.0, 1.0, kd));
            for (error, rate) in path {
                pid.step_error(error, rate, &TimeStep::of(DT_S));
                prop_assert!(pid.terms().d * rate <= 0.0);
            }
        }

        #[test]
        fn whole_periods_change_nothing(
            config in any_config(), period in prop::sample::select(&[360.0_f32, 8192.0, 7.5, 1.0]),
            samples in prop::collection::vec((0_u16..5760, 0_u16..5760, -50_i8..50, -50_i8..50), 1..30),
        ) {
            // Feed-forward is for the setpoint next to the measurement: it sees turns of that. Sixteenths are exact in f32.
            let config = config.with_period(period);
            let turning = config.options() & FEED_FORWARD == 0;
            let (mut here, mut turned) = (pid(config), pid(config));
            for (setpoint, measurement, turns, others) in samples {
                let others = if turning { others } else { 0 };
                let (setpoint, measurement) = (f32::from(setpoint) / 16.0, f32::from(measurement) / 16.0);
                let expected = here.update(setpoint, measurement, DT_S);
                let shifted = turned.update(
                    setpoint + period * f32::from(turns),
                    measurement + period * f32::from(others),
                    DT_S,
                );
                prop_assert_eq!(shifted, expected);
            }
        }

        #[test]
        fn the_plain_path_and_the_careful_one_agree(
            config in any_config(),
            samples in prop::collection::vec((-50.0_f32..50.0, -50.0_f32..50.0), 1..30),
        ) {
            let plain = PidConfig::new(config.kp, config.ki, config.kd).with_output_limit(1e6);
            let (mut fast, mut slow) = (pid(plain), pid(plain.with_slew_limit(1e12)));
            for (setpoint, measurement) in samples {
                let (fast, slow) = (fast.update(setpoint, measurement, DT_S), slow.update(setpoint, measurement, DT_S));
                prop_assert!((fast - slow).abs() <= 1e-5 * fast.abs().max(1e3) || fast.abs() >= 1e6);
            }
        }

        #[test]
        fn at_the_limit_a_plain_controller_does_what_one_with_options_does(
            gains in (0.0_f32..10.0, 0.0_f32..100.0, 0.0_f32..0.01),
            windup in 0_u8..3,
            samples in prop::collection::vec((-50.0_f32..50.0, -50.0_f32..50.0), 2..60),
        ) {
            let limited = PidConfig::new(gains.0, gains.1, gains.2)
                .with_output_limit(10.0)
                .with_integral_limit(8.0);
            let limited = match windup {
                0 => limited,
                1 => limited.without_anti_windup(),
                _ => limited.with_back_calculation(0.05),
            };
            let (mut plain, mut optional) = (pid(limited), pid(limited.with_slew_limit(1e30)));
            for (setpoint, measurement) in samples {
                let plain_output = plain.update(setpoint, measurement, DT_S);
                prop_assert!((plain_output - optional.update(setpoint, measurement, DT_S)).abs() < 1e-3);
                prop_assert!((plain.terms().i - optional.terms().i).abs() < 1e-3);
            }
        }

        #[test]
        fn an_error_formed_elsewhere_gives_the_same(
            config in any_config(),
            samples in prop::collection::vec((-50.0_f32..50.0, -50.0_f32..50.0), 2..30),
        ) {
            let plain = PidConfig::new(config.kp, config.ki, config.kd).with_output_limit(config.output_upper);
            let (mut whole, mut parts) = (pid(plain), pid(plain));
            let step = TimeStep::new(DT_S, 0.1);
            let mut last = samples[0].1;
            for (setpoint, measurement) in samples {
                let expected = whole.step(setpoint, measurement, &step);
                let rate = (measurement - last) * step.per_dt;
                prop_assert_eq!(parts.step_error(setpoint - measurement, rate, &step), expected);
                last = measurement;
            }
        }
    }
}
