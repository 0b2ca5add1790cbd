//! The arithmetic of the positional controller behind its plain path.
//!
//! ```text
//! step, step_error   gains and symmetric limits; whatever passes the gates is done here
//!   └─ try_work      every option, without guards; gives up when something is not finite
//!        └─ work_carefully   bad arguments, the first call, a frozen step, overflow: guarded, seldom
//! ```

use super::config::{
    CIRCLE, DEAD_BAND, DERIVATIVE_FILTER, DERIVATIVE_ON_ERROR, FEED_FORWARD, INTEGRAL_WEIGHT,
    SLEW_LIMIT,
};
use super::positional::{Pid, Terms};
use crate::control::number::{finite, limited};
use crate::control::step::TimeStep;
use crate::math;

/// Marks a stored error or measurement as unknown: arithmetic with it never passes a [`gate`].
pub(super) const UNKNOWN: f32 = f32::INFINITY;

/// A gate that nothing passes.
pub(super) const CLOSED: u32 = 0;

/// Encodes a limit so that one integer comparison tells whether a value is within ±`limit`, and neither NaN nor infinite.
pub(super) const fn gate(limit: f32) -> u32 {
    (limit.to_bits() << 1) + 1
}

#[inline]
pub(super) const fn passes(value: f32, gate: u32) -> bool {
    value.to_bits() << 1 < gate
}

impl Pid {
    #[inline(never)]
    pub(super) fn step_with_options(
        &mut self,
        setpoint: f32,
        measurement: f32,
        step: &TimeStep,
    ) -> f32 {
        let mut error = setpoint - measurement;
        let mut travel = if self.has(DERIVATIVE_ON_ERROR) {
            self.error - error
        } else {
            measurement - self.measurement
        };
        if self.has(CIRCLE) {
            let period = self.config.period;
            (error, travel) = (math::near(error, period), math::near(travel, period));
        }
        let growth = self.growth(error, step);
        self.try_work(setpoint, measurement, error, travel * step.per_dt, growth, step)
    }

    #[inline(never)]
    pub(super) fn try_work(
        &mut self,
        setpoint: f32,
        measurement: f32,
        error: f32,
        rate: f32,
        growth: f32,
        step: &TimeStep,
    ) -> f32 {
        match self.work::<false>(setpoint, error, rate, growth, step) {
            Some(output) => {
                self.measurement = measurement;
                output
            }
            None => self.work_carefully(setpoint, measurement, error, rate, step),
        }
    }

    /// What happens seldom: bad arguments, the first call, a step that is frozen, half a turn, values that overflow.
    #[cold]
    #[inline(never)]
    fn work_carefully(
        &mut self,
        setpoint: f32,
        measurement: f32,
        error: f32,
        rate: f32,
        step: &TimeStep,
    ) -> f32 {
        // `step_error` passes no measurement, and an error and a rate that may be used as they are.
        let formed = measurement == UNKNOWN;
        let usable = if formed {
            error.is_finite() && rate.is_finite()
        } else {
            setpoint.is_finite() && measurement.is_finite()
        };
        if step.is_hold() || !usable {
            self.rejected = self.rejected.saturating_add(1);
            return self.output;
        }
        let (mut error, mut rate, mut step) = (error, rate, *step);
        if !formed {
            (error, rate) = self.error_and_rate(setpoint, measurement, &step);
        }
        self.measurement = measurement;
        if step.is_frozen() {
            (rate, step.half_dt_s) = (self.rate, 0.0);
        }
        if self.track_output {
            self.take_over(error, self.filtered(rate, &step));
        }
        if self.error == UNKNOWN {
            self.error = -error; // no interval yet: a mean of zero
        }
        let growth = self.growth(error, &step);
        self.work::<true>(setpoint, error, rate, growth, &step).unwrap_or(self.output)
    }

    /// Error and rate by way of sums that are finite and angles that are exact.
    fn error_and_rate(&self, setpoint: f32, measurement: f32, step: &TimeStep) -> (f32, f32) {
        let shortest = |way: f32| {
            finite(if self.has(CIRCLE) { math::wrap(way, self.config.period) } else { way })
        };
        let error = shortest(setpoint - measurement);
        let (known, travel) = if self.has(DERIVATIVE_ON_ERROR) {
            (self.error, self.error - error)
        } else {
            (self.measurement, measurement - self.measurement)
        };
        let rate = if known == UNKNOWN { 0.0 } else { finite(shortest(travel) * step.per_dt) };
        (error, rate)
    }

    /// Lets the integral make up what the other terms lack to the output that was set.
    fn take_over(&mut self, error: f32, rate: f32) {
        let next = Self { error, rate, ..*self };
        let Terms { p, d, feed_forward, .. } = next.terms();
        self.track_output = false;
        if self.config.ki > 0.0 {
            self.integral = finite(self.output - finite(p + d + feed_forward));
        }
    }

    /// The whole controller. Unless `CAREFUL`, `None` says that something was not finite, and nothing has changed.
    #[inline]
    fn work<const CAREFUL: bool>(
        &mut self,
        setpoint: f32,
        error: f32,
        rate: f32,
        growth: f32,
        step: &TimeStep,
    ) -> Option<f32> {
        let finite = |value| if CAREFUL { finite(value) } else { value };
        let config = &self.config;
        let rate = finite(self.filtered(rate, step));
        let mut proportional = finite(config.kp * error);
        let mut growth = finite(growth);
        if self.has(INTEGRAL_WEIGHT) && error.abs() > self.full_weight_to {
            growth *= self.weight(error);
        }
        if self.has(DEAD_BAND) && error.abs() < config.dead_band {
            proportional = 0.0;
            let shrinks = growth * self.integral < 0.0;
            if !shrinks {
                growth *= 0.0; // and not simply zero: what is not finite must show below
            }
        }
        let mut others = finite(proportional - finite(config.kd * rate));
        if self.has(FEED_FORWARD) {
            others = finite(others + self.feed_forward(setpoint));
        }
        let mut integral = finite(self.integral + growth);
        let mut wanted = others + integral;
        if integral.abs() > config.integral_limit {
            if !CAREFUL && !integral.is_finite() {
                return None;
            }
            integral = config.integral_limit.copysign(integral);
            wanted = others + integral;
        }
        let mut output = wanted;
        // Written so that NaN is not free, nor is what is infinite.
        let free = wanted <= config.output_upper
            && wanted >= config.output_lower
            && !(self.has(SLEW_LIMIT)
                && (wanted - self.output).abs() > config.slew_per_s * step.dt_s);
        if !free {
            if !CAREFUL && !wanted.is_finite() {
                return None;
            }
            (output, integral) = self.saturated(wanted, integral, growth, step);
        }
        self.error = error;
        self.rate = rate;
        self.integral = integral;
        self.output = output;
        Some(output)
    }

    /// The output within its limits, and the integral after anti-windup.
    #[inline]
    fn saturated(&self, wanted: f32, integral: f32, growth: f32, step: &TimeStep) -> (f32, f32) {
        let config = &self.config;
        let mut output = wanted;
        if self.has(SLEW_LIMIT) {
            let reach = config.slew_per_s * step.dt_s;
            output = limited(output, self.output - reach, self.output + reach);
        }
        output = limited(output, config.output_lower, config.output_upper);
        let excess = wanted - output;
        if config.tracking_time_s > 0.0 {
            let part = limited(step.dt_s / config.tracking_time_s, 0.0, 1.0);
            let drained = finite(integral - finite(excess) * part);
            return (output, limited(drained, -config.integral_limit, config.integral_limit));
        }
        let outward = excess * growth > 0.0;
        (output, if outward && !config.wind_up { self.integral } else { integral })
    }

    #[inline]
    pub(super) fn growth(&self, error: f32, step: &TimeStep) -> f32 {
        self.config.ki * step.half_dt_s * (error + self.error)
    }

    #[inline]
    fn filtered(&self, rate: f32, step: &TimeStep) -> f32 {
        if self.has(DERIVATIVE_FILTER) {
            let gain = step.dt_s / (step.dt_s + self.config.derivative_time_s);
            self.rate + gain * (rate - self.rate)
        } else {
            rate
        }
    }

    /// The part of its rate at which the integral works at this error.
    #[inline]
    fn weight(&self, error: f32) -> f32 {
        let config = &self.config;
        let size = error.abs();
        if size > config.integral_separation || size >= config.no_rate_above {
            0.0
        } else if size > config.full_rate_below {
            (config.no_rate_above - size) / (config.no_rate_above - config.full_rate_below)
        } else {
            1.0
        }
    }

    #[inline]
    pub(super) const fn has(&self, option: u8) -> bool {
        self.options & option != 0
    }
}
