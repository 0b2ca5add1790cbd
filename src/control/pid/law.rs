//! The law of the controller.
//!
//! ```text
//! step, step_error   error and rate of a sample
//!   ├─ plain         gains, integral limit, one output limit; refuses all else
//!   └─ full          every option
//! ```

use super::config::{DERIVATIVE_ON_ERROR, REST_DERIVATIVE, TRACK_OUTPUT};
use super::{ErrorPid, Pid, UNKNOWN, limit_of};
use crate::control::number::finite;
use crate::math::{self, limited};
use crate::time::TimeStep;

impl Pid {
    /// Steps by a validated time step, and returns the output.
    ///
    /// Costs 30 instructions on a Cortex-M4F, with limits, while the output is free (`docs/figures.md`).
    ///
    /// # Examples
    /// ```
    /// use drivetrain::control::{Pid, PidConfig};
    /// use drivetrain::time::TimeStep;
    ///
    /// let mut pid = Pid::new(PidConfig::new(2.0, 10.0, 0.0))?;
    /// assert_eq!(pid.step(1.0, 0.0, &TimeStep::of(0.01)), 2.0); // P
    /// assert_eq!(pid.step(1.0, 0.0, &TimeStep::of(0.01)), 2.1); // and 10/s for 10 ms
    /// # Ok::<(), drivetrain::error::ConfigError>(())
    /// ```
    #[inline]
    pub fn step(&mut self, setpoint: f32, measurement: f32, step: &TimeStep) -> f32 {
        let sample = self.sample(setpoint, measurement, step);
        match self.core.plain(sample, step) {
            Ok(output) => {
                self.measurement = measurement;
                output
            }
            Err(true) => self.full(step, sample.0, Some(measurement), sample),
            Err(false) => self.full(step, setpoint, Some(measurement), sample),
        }
    }

    /// Steps with a given error (from integers, on a circle) and the measured rate of change.
    ///
    /// D is `-kd * rate`, on the first call too. Period, tracking, feed-forward and the derivative of the error do not apply.
    /// Everything else is as for [`step`](Self::step), whose tracking begins at the measurement after this.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::control::{Pid, PidConfig};
    /// use drivetrain::time::TimeStep;
    ///
    /// let mut pid = Pid::new(PidConfig::new(10.0, 0.0, 0.5))?;
    /// assert_eq!(pid.step_error(0.3, 2.0, &TimeStep::of(0.001)), 2.0); // 10 times 0.3, less 0.5 times 2
    /// # Ok::<(), drivetrain::error::ConfigError>(())
    /// ```
    #[inline]
    pub fn step_error(&mut self, error: f32, rate: f32, step: &TimeStep) -> f32 {
        if let Ok(output) = self.core.plain((error, rate), step) {
            self.measurement = UNKNOWN;
            return output;
        }
        self.full(step, error, None, (error, rate))
    }

    /// The sample without the options of the setpoint.
    #[inline(always)]
    pub(crate) fn sample(&self, setpoint: f32, measured: f32, step: &TimeStep) -> Sample {
        (setpoint - measured, (measured - self.measurement) * step.per_dt)
    }

    /// The law with all options, for a sample as the plain law takes it. Without a measurement the sample is given, and the options of
    /// the setpoint do not apply. `valid` is finite if the setpoint is.
    #[inline(never)]
    fn full(&mut self, step: &TimeStep, valid: f32, measured: Option<f32>, sample: Sample) -> f32 {
        let ((mut error, mut rate), mut feed_forward) = (sample, 0.0);
        if let Some(measured) = measured {
            // Bad arguments, an unknown measurement, a step that is not normal, overflow.
            if !(error + rate).is_finite() {
                if step.is_hold() || !valid.is_finite() || !measured.is_finite() {
                    return self.refuse(!step.is_hold());
                }
                let rests = self.measurement == UNKNOWN || step.is_frozen();
                self.core.options |= if rests { REST_DERIVATIVE } else { 0 };
                // The rate of a circle that overflows is left to the limits.
                (error, rate) = (finite(error), if self.way > 0.0 { rate } else { finite(rate) });
            }
            (error, rate) = self.shaped(measured, (error, rate), step);
            feed_forward = self.feed_forward_of(measured + error);
            self.measurement = measured;
        } else {
            if step.is_hold() || !error.is_finite() || !rate.is_finite() {
                return self.refuse(false);
            }
            (self.measurement, self.tracking_rate) = (UNKNOWN, 0.0);
            self.core.set_options(self.core.options & !REST_DERIVATIVE);
            rate = if step.is_frozen() { self.core.rate } else { rate };
        }
        let (core, p) = (&self.core, &self.core.parameters);
        if p.derivative_time_s > 0.0 {
            rate = core.rate + step.dt_s / (step.dt_s + p.derivative_time_s) * (rate - core.rate);
        }
        let (proportional, growth) = core.weighted(error, step);
        let (integral, pushed) = (core.integral + growth, proportional + feed_forward);
        let wanted = pushed - p.kd * rate + integral;
        let way = (wanted - core.output).abs();
        let is_slow = way <= p.slew_per_s * step.dt_s || p.slew_per_s >= f32::MAX;
        let is_within = wanted <= p.output_upper && wanted >= p.output_lower;
        if is_slow && is_within && passes(integral, core.integral_limit_gate()) {
            return self.core.keep(wanted, error, rate, integral);
        }
        let (output, rate, integral) = self.core.limit(pushed, rate, growth, step);
        self.core.keep(output, error, rate, integral)
    }

    /// The sample as circle, tracking and the derivative of the error make it.
    #[inline(always)]
    fn shaped(&mut self, measured: f32, (mut error, mut rate): Sample, step: &TimeStep) -> Sample {
        if self.way > 0.0 {
            error = math::shortest(error, self.way);
            let travel = measured - self.measurement;
            if travel.abs() >= self.way {
                rate = math::shortest(travel, self.way) * step.per_dt;
            }
        } else if self.way < 0.0 {
            // The tracked setpoint moves on: the linear tracking differentiator by Euler's rule. The setpoint of the last step is
            // `measurement + error`, so only its rate has to be stored.
            let (r, pace) = (-self.way, self.tracking_rate);
            let is_known = self.measurement != UNKNOWN;
            let last = if is_known { self.core.error - (measured - self.measurement) } else { 0.0 };
            let (longest_s, pull) = (1.0 / r, r * (last - error) + 2.0 * pace);
            let dt_s = if step.dt_s > longest_s { longest_s } else { step.dt_s };
            self.tracking_rate = finite(pace - dt_s * (r * pull));
            error = finite(last + dt_s * pace);
        }
        if self.core.options & REST_DERIVATIVE != 0 {
            rate = self.core.rate;
            self.core.set_options(self.core.options & !REST_DERIVATIVE);
        } else if self.core.options & DERIVATIVE_ON_ERROR != 0 {
            let (way, half) = (self.core.error - error, self.way);
            rate = step.per_dt * if half > 0.0 { math::shortest(way, half) } else { way };
        }
        (error, rate)
    }

    /// Holds the output and counts the step. If time passed without a measurement, D rests in the next good step: the travel
    /// spans more than one step.
    fn refuse(&mut self, rests: bool) -> f32 {
        self.core.rejected = self.core.rejected.saturating_add(1);
        self.core.set_options(self.core.options | if rests { REST_DERIVATIVE } else { 0 });
        self.core.output
    }

    /// Keeps the integral within a range of the output around zero: the part passed by a limit beyond this loop, since a larger
    /// integral would be wound up.
    pub(crate) const fn keep_integral_between(&mut self, lowest: f32, highest: f32) {
        self.core.integral = limited(self.core.integral, lowest, highest);
    }
}

impl ErrorPid {
    /// The plain law: gains, integral limit, one output limit.
    ///
    /// # Errors
    /// If the step needs more, nothing changes; the value tells whether the sample is known to be finite.
    #[inline(always)]
    pub(crate) fn plain(&mut self, (error, rate): Sample, step: &TimeStep) -> Result<f32, bool> {
        let growth = self.parameters.ki * step.half_dt_s * (error + self.error);
        let mut integral = self.integral + growth;
        // With options, NaN and infinity nothing passes.
        if !passes(integral, self.integral_gate) {
            return Err(false);
        }
        let mut output = self.parameters.kp * error + integral - self.parameters.kd * rate;
        if !passes(output, self.output_gate) {
            if !output.is_finite() {
                return Err(true);
            }
            let is_outward = (output.to_bits() ^ growth.to_bits()).cast_signed() >= 0;
            integral = if is_outward { self.integral } else { integral };
            output = limit_of(self.output_gate).copysign(output);
        }
        Ok(self.keep(output, error, rate, integral))
    }

    /// P and the growth of the integral, as weights and dead band leave them. No weight makes the growth of a first call or of a frozen step
    /// finite.
    #[inline(always)]
    fn weighted(&self, error: f32, step: &TimeStep) -> (f32, f32) {
        let p = &self.parameters;
        let (size, mut proportional) = (error.abs(), p.kp * error);
        let mut growth = p.ki * step.half_dt_s * (error + self.error);
        if size > p.full_rate_below {
            let weight = (p.no_rate_above - size) / (p.no_rate_above - p.full_rate_below);
            // Below zero the bits are negative too.
            growth *= f32::from_bits(weight.to_bits().cast_signed().max(0).cast_unsigned());
        }
        if size < p.dead_band {
            proportional = 0.0;
            let shrinks = growth * self.integral < 0.0;
            // Not simply zero: what is not finite must show.
            growth = if shrinks { growth } else { growth * 0.0 };
        }
        (proportional, growth)
    }

    /// The output, the rate and the integral of a step of which a part is not finite or at a limit; `pushed` is P and feed-forward.
    #[inline(always)]
    fn limit(&mut self, pushed: f32, rate: f32, growth: f32, step: &TimeStep) -> (f32, f32, f32) {
        let p = &self.parameters;
        let limit = limit_of(self.integral_limit_gate());
        let (mut memory, mut rate, mut growth) = (self.integral, rate, growth);
        let mut others = pushed - p.kd * rate;
        if !(others + growth).is_finite() {
            let is_first = self.error == UNKNOWN;
            // No interval yet, or too long an interval.
            if is_first || step.is_frozen() {
                self.rejected = self.rejected.saturating_add(u16::from(!is_first));
                growth = 0.0;
            }
            (rate, growth) = (finite(rate), finite(growth));
            others = finite(finite(pushed) - finite(p.kd * rate));
            if self.options & TRACK_OUTPUT != 0 && self.has_memory() {
                memory = finite(self.output - others);
            }
            self.options &= !TRACK_OUTPUT;
        }
        let mut integral = limited(memory + growth, -limit, limit);
        let wanted = others + integral;
        let reach = if p.slew_per_s < f32::MAX { p.slew_per_s * step.dt_s } else { f32::INFINITY };
        let near = limited(wanted, self.output - reach, self.output + reach);
        let output = self.within_output_range(near);
        let excess = wanted - output;
        if p.drain_time_s > 0.0 && p.ki > 0.0 {
            let part = limited(step.dt_s / p.drain_time_s, 0.0, 1.0);
            integral = limited(integral - finite(excess) * part, -limit, limit);
        } else if excess * (integral - memory) > 0.0 {
            integral = memory;
        }
        (output, rate, integral)
    }

    /// Ends a step, and returns its output.
    const fn keep(&mut self, output: f32, error: f32, rate: f32, integral: f32) -> f32 {
        (self.output, self.error) = (output, error);
        (self.rate, self.integral) = (rate, integral);
        output
    }
}

/// The error and its measured rate.
pub(crate) type Sample = (f32, f32);

/// Tells whether a value is within the limit of a [`gate`](super::gate): one integer comparison.
const fn passes(value: f32, gate: u32) -> bool {
    value.to_bits() << 1 < gate
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "exact results are the rule under test")]
mod tests {
    use super::*;
    use crate::control::PidConfig;
    use proptest::prelude::*;

    fn stepped(pid: &mut Pid, setpoint: f32, measurement: f32, step: &TimeStep) -> f32 {
        let sample = pid.sample(setpoint, measurement, step);
        let plain = if pid.core.is_plain() { pid.core.plain(sample, step).ok() } else { None };
        if plain.is_some() {
            pid.measurement = measurement;
        }
        plain.unwrap_or_else(|| pid.step(setpoint, measurement, step))
    }

    fn stepped_by(pid: &mut Pid, error: f32, rate: f32, step: &TimeStep) -> f32 {
        let mut part = pid.core;
        let plain = part.plain((error, rate), step).ok();
        let output =
            plain.unwrap_or_else(|| part.as_pid(|whole| whole.step_error(error, rate, step)));
        let whole = pid.step_error(error, rate, step);
        assert_eq!((output, part), (whole, pid.core));
        whole
    }

    proptest! {
        /// Law: the plain path is the controller, bit by bit, for all options, arguments and times.
        #[test]
        fn a_step_that_was_tried_is_a_step(
            limit in prop::option::of(0.1_f32..100.0),
            integral in prop::option::of(0.1_f32..10.0),
            option in 0_u8..6,
            steps in prop::collection::vec((any::<bool>(), -200.0_f32..200.0, -20.0_f32..20.0, 0_u8..10), 1..50),
        ) {
            let mut config = PidConfig::new(0.8, 40.0, 0.01);
            config = limit.map_or(config, |limit| config.with_output_limit(limit));
            config = integral.map_or(config, |limit| config.with_integral_limit(limit));
            config = match option {
                0 => config.with_dead_band(1.0),
                1 => config.without_anti_windup(),
                2 => config.with_back_calculation(0.1),
                _ => config,
            };
            let (mut one, mut other) = (Pid::new(config).unwrap(), Pid::new(config).unwrap());
            prop_assert_eq!(one.core.is_plain(), option > 2);
            for (given, first, second, kind) in steps {
                let step = TimeStep::of(match kind { 0 => 1.0, 1 => f32::NAN, _ => 0.001 });
                let first = match kind { 2 => f32::NAN, 3 => f32::MAX, _ => first };
                let (a, b) = if given {
                    (stepped_by(&mut one, first, second, &step), other.step_error(first, second, &step))
                } else {
                    (stepped(&mut one, first, second, &step), other.step(first, second, &step))
                };
                prop_assert_eq!(a, b);
                prop_assert_eq!(&one, &other);
            }
        }
    }
}
