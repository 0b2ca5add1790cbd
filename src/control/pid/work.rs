//! The arithmetic of the positional controller behind its plain path.
//!
//! ```text
//! step, step_error     gains and symmetric limits: whatever passes both gates is done here
//!   ├─ saturate        gains and symmetric limits, with the output at its limit
//!   └─ *_with_options  every option, without guards; gives up when something is not finite
//!        └─ *_carefully   bad arguments, the first call, a frozen step, overflow: guarded, seldom
//! ```

use super::positional::{Pid, Terms};
use super::settings::{
    CIRCLE, DERIVATIVE_FILTER, DERIVATIVE_ON_ERROR, FEED_FORWARD, REST_DERIVATIVE,
    SEPARATION_INSIDE, SLEW_LIMIT, TRACK_OUTPUT, WIND_UP,
};
use crate::control::number::{finite, limited};
use crate::control::step::TimeStep;
use crate::math;

/// Marks a stored error or measurement as unknown: arithmetic with it never passes a [`gate`].
pub(super) const UNKNOWN: f32 = f32::INFINITY;

/// A gate that nothing passes.
pub(super) const CLOSED: u32 = 0;

/// Encodes a limit so that one integer comparison tells whether a value is within ±`limit`, and neither NaN nor infinite.
pub(super) const fn gate(limit: f32) -> u32 {
    open_gate(limit) + 1
}

/// As [`gate`], but what is just `limit` does not pass. Zero gives [`CLOSED`].
pub(super) const fn open_gate(limit: f32) -> u32 {
    limit.to_bits() << 1
}

/// Returns the limit that a gate encodes.
#[inline]
pub(super) const fn limit_of(gate: u32) -> f32 {
    f32::from_bits(gate >> 1)
}

#[inline]
pub(super) const fn passes(value: f32, gate: u32) -> bool {
    magnitude(value) < gate
}

/// Sizes in an order that one integer comparison tells; NaN is larger than all numbers.
#[inline]
const fn magnitude(value: f32) -> u32 {
    value.to_bits() << 1
}

impl Pid {
    /// A plain controller whose integral passed its gate, so that all but `rate` is finite, and whose output did not.
    #[inline(never)]
    pub(super) fn saturate(
        &mut self,
        wanted: f32,
        measurement: f32,
        error: f32,
        rate: f32,
        integral: f32,
        step: &TimeStep,
    ) -> f32 {
        if !wanted.is_finite() {
            if measurement == UNKNOWN {
                return self.step_error_carefully(error, rate, step);
            }
            let rate = self.rate_at(measurement, error, step);
            return self.work_carefully(measurement, error, rate, step);
        }
        let output = self.settings.output_upper.copysign(wanted);
        let growth = integral - self.integral;
        self.integral = self.without_windup(wanted - output, integral, growth, step);
        self.output = output;
        self.measurement = measurement;
        self.error = error;
        self.rate = rate;
        output
    }

    #[inline(never)]
    pub(super) fn step_with_options(
        &mut self,
        setpoint: f32,
        measurement: f32,
        step: &TimeStep,
    ) -> f32 {
        if self.has(DERIVATIVE_ON_ERROR | REST_DERIVATIVE) {
            return self.step_on_error(setpoint, measurement, step);
        }
        self.step_by(setpoint, measurement, measurement - self.measurement, step)
    }

    #[inline(never)]
    fn step_on_error(&mut self, setpoint: f32, measurement: f32, step: &TimeStep) -> f32 {
        if self.has(REST_DERIVATIVE) {
            return self.step_carefully(setpoint, measurement, step);
        }
        let travel = self.error - (setpoint - measurement);
        self.step_by(setpoint, measurement, travel, step)
    }

    #[inline]
    fn step_by(&mut self, setpoint: f32, measurement: f32, travel: f32, step: &TimeStep) -> f32 {
        let (mut error, mut travel) = (setpoint - measurement, travel);
        if self.has(CIRCLE) && !(self.shorten(&mut error) && self.shorten(&mut travel)) {
            return self.step_by_turns(setpoint, measurement, step);
        }
        self.work_with_options(setpoint, measurement, error, travel * step.per_dt, step)
    }

    /// Takes the shorter way round if that is at most one turn off, and tells whether it was.
    #[inline]
    fn shorten(&self, way: &mut f32) -> bool {
        if self.is_short(*way) {
            return true;
        }
        *way -= self.settings.period_towards(*way); // exact, if the result is short
        self.is_short(*way)
    }

    /// Tells whether a way is less than half a turn. Half a turn itself, and overflow, need another look.
    #[inline]
    const fn is_short(&self, way: f32) -> bool {
        passes(way, self.settings.output_gate)
    }

    /// Setpoint and measurement, or two measurements, are turns apart.
    #[inline(never)]
    fn step_by_turns(&mut self, setpoint: f32, measurement: f32, step: &TimeStep) -> f32 {
        let (way, period) = (setpoint - measurement, self.settings.period());
        let travel = if self.has(DERIVATIVE_ON_ERROR) {
            self.error - way
        } else {
            measurement - self.measurement
        };
        let (error, travel) = (math::rest(way, period), math::rest(travel, period));
        if !(self.is_short(error) && self.is_short(travel)) {
            return self.step_carefully(setpoint, measurement, step);
        }
        self.work_with_options(setpoint, measurement, error, travel * step.per_dt, step)
    }

    /// Works on an error that was formed elsewhere when the measurement is [`UNKNOWN`].
    #[inline(never)]
    pub(super) fn work_with_options(
        &mut self,
        setpoint: f32,
        measurement: f32,
        error: f32,
        rate: f32,
        step: &TimeStep,
    ) -> f32 {
        match self.work::<false>(measurement, error, rate, step) {
            Some(output) => output,
            None if measurement == UNKNOWN => self.step_error_carefully(error, rate, step),
            None => self.step_carefully(setpoint, measurement, step),
        }
    }

    /// What happens seldom: bad arguments, the first call, a step that is frozen, half a turn, values that overflow.
    #[cold]
    #[inline(never)]
    fn step_carefully(&mut self, setpoint: f32, measurement: f32, step: &TimeStep) -> f32 {
        if step.is_hold() || !setpoint.is_finite() || !measurement.is_finite() {
            return self.refuse(step);
        }
        let error = self.shortest(setpoint - measurement);
        let rate = if self.has(REST_DERIVATIVE) {
            self.rate
        } else {
            self.rate_at(measurement, error, step)
        };
        self.work_carefully(measurement, error, rate, step)
    }

    #[cold]
    #[inline(never)]
    fn step_error_carefully(&mut self, error: f32, rate: f32, step: &TimeStep) -> f32 {
        if step.is_hold() || !error.is_finite() || !rate.is_finite() {
            return self.refuse(&TimeStep::of(0.0)); // the rate is given: no travel is missed
        }
        self.work_carefully(UNKNOWN, error, rate, step)
    }

    pub(in crate::control) const fn refuse(&mut self, step: &TimeStep) -> f32 {
        self.rejected = self.rejected.saturating_add(1);
        if !step.is_hold() {
            self.rest_derivative();
        }
        self.output
    }

    /// Keeps D as it is for the next good step: time passed, and the travel in it is not known.
    pub(in crate::control) const fn rest_derivative(&mut self) {
        self.options |= REST_DERIVATIVE;
        self.settings.integral_gate = CLOSED;
    }

    pub(super) const fn end_rest(&mut self) {
        if self.has(REST_DERIVATIVE) {
            self.options &= !REST_DERIVATIVE;
            self.settings.reopen(self.options);
        }
    }

    #[cold]
    #[inline(never)]
    fn work_carefully(&mut self, measurement: f32, error: f32, rate: f32, step: &TimeStep) -> f32 {
        self.end_rest();
        let (mut rate, mut step) = (rate, *step);
        if step.is_frozen() {
            (rate, step.half_dt_s) = (self.rate, 0.0);
        }
        if self.has(TRACK_OUTPUT) {
            self.take_over(measurement, error, self.filtered(rate, &step));
        }
        if self.error == UNKNOWN {
            self.error = -error; // no interval yet: a mean of zero
        }
        self.work::<true>(measurement, error, rate, &step).unwrap_or(self.output)
    }

    /// A way on the circle, exact and finite.
    fn shortest(&self, way: f32) -> f32 {
        finite(if self.has(CIRCLE) { math::wrap(way, self.settings.period()) } else { way })
    }

    /// The rate by way of sums that are finite.
    fn rate_at(&self, measurement: f32, error: f32, step: &TimeStep) -> f32 {
        let (known, travel) = if self.has(DERIVATIVE_ON_ERROR) {
            (self.error, self.error - error)
        } else {
            (self.measurement, measurement - self.measurement)
        };
        if known == UNKNOWN { 0.0 } else { finite(self.shortest(travel) * step.per_dt) }
    }

    /// Lets the integral make up what the other terms lack to the output that was set.
    fn take_over(&mut self, measurement: f32, error: f32, rate: f32) {
        let next = Self { measurement, error, rate, ..*self };
        let Terms { p, d, feed_forward, .. } = next.terms();
        self.options &= !TRACK_OUTPUT;
        if self.settings.ki > 0.0 {
            self.integral = finite(self.output - finite(p + d + feed_forward));
        }
    }

    /// The whole controller. Unless `CAREFUL`, `None` says that something was not finite, and nothing has changed.
    #[inline]
    fn work<const CAREFUL: bool>(
        &mut self,
        measurement: f32,
        error: f32,
        rate: f32,
        step: &TimeStep,
    ) -> Option<f32> {
        let finite = |value| if CAREFUL { finite(value) } else { value };
        let settings = &self.settings;
        let rate = finite(self.filtered(rate, step));
        let mut proportional = finite(settings.kp * error);
        let mut growth = finite(self.growth(error, step));
        if !passes(error, settings.full_weight_gate) {
            growth *= self.weight(error);
        }
        if passes(error, settings.dead_band_gate) {
            proportional = 0.0;
            let shrinks = growth * self.integral < 0.0;
            if !shrinks {
                growth *= 0.0; // and not simply zero: what is not finite must show below
            }
        }
        let mut others = finite(proportional - finite(settings.kd * rate));
        if self.has(FEED_FORWARD) {
            others = finite(others + self.feed_forward(measurement, error));
        }
        let mut integral = finite(self.integral + growth);
        let mut wanted = others + integral;
        if !passes(integral, settings.integral_limit_gate) {
            if !CAREFUL && !integral.is_finite() {
                return None;
            }
            integral = limit_of(settings.integral_limit_gate).copysign(integral);
            wanted = others + integral;
        }
        let mut output = wanted;
        // Written so that NaN is not free, nor is what is infinite.
        let free = wanted <= settings.output_upper
            && wanted >= settings.output_lower
            && !(self.has(SLEW_LIMIT)
                && (wanted - self.output).abs() > settings.slew_per_s * step.dt_s);
        if !free {
            if !CAREFUL && !wanted.is_finite() {
                return None;
            }
            (output, integral) = self.saturated(wanted, integral, growth, step);
        }
        self.output = output;
        self.measurement = measurement;
        self.error = error;
        self.rate = rate;
        self.integral = integral;
        Some(output)
    }

    /// The output within its limits, and the integral after anti-windup.
    #[inline]
    fn saturated(&self, wanted: f32, integral: f32, growth: f32, step: &TimeStep) -> (f32, f32) {
        let settings = &self.settings;
        let mut output = wanted;
        if self.has(SLEW_LIMIT) {
            let reach = settings.slew_per_s * step.dt_s;
            output = limited(output, self.output - reach, self.output + reach);
        }
        output = limited(output, settings.output_lower, settings.output_upper);
        (output, self.without_windup(wanted - output, integral, growth, step))
    }

    /// The integral after anti-windup, for an `excess` that the limits cut off the output.
    #[inline]
    fn without_windup(&self, excess: f32, integral: f32, growth: f32, step: &TimeStep) -> f32 {
        let settings = &self.settings;
        if settings.tracking_time_s > 0.0 && settings.ki > 0.0 {
            let part = limited(step.dt_s / settings.tracking_time_s, 0.0, 1.0);
            let drained = finite(integral - finite(excess) * part);
            let limit = limit_of(settings.integral_limit_gate);
            return limited(drained, -limit, limit);
        }
        let outward = excess * growth > 0.0;
        if outward && !self.has(WIND_UP) { self.integral } else { integral }
    }

    #[inline]
    pub(super) fn growth(&self, error: f32, step: &TimeStep) -> f32 {
        self.settings.ki * step.half_dt_s * (error + self.error)
    }

    #[inline]
    fn filtered(&self, rate: f32, step: &TimeStep) -> f32 {
        if self.has(DERIVATIVE_FILTER) {
            let gain = step.dt_s / (step.dt_s + self.settings.derivative_time_s);
            self.rate + gain * (rate - self.rate)
        } else {
            rate
        }
    }

    /// The part of its rate at which the integral works at an error beyond the first edge.
    #[inline]
    fn weight(&self, error: f32) -> f32 {
        let settings = &self.settings;
        let size = error.abs();
        if self.has(SEPARATION_INSIDE)
            || size > settings.other_edge
            || size >= settings.no_rate_above
        {
            0.0
        } else {
            let full_rate_below = limit_of(settings.full_weight_gate);
            (settings.no_rate_above - size) / (settings.no_rate_above - full_rate_below)
        }
    }

    #[inline]
    pub(super) const fn has(&self, option: u16) -> bool {
        self.options & option != 0
    }
}
