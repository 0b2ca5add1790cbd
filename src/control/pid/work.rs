//! The arithmetic of the positional controller behind its plain path.
//!
//! ```text
//! step, step_error     gains and symmetric limits: whatever passes both gates is done here
//!   ├─ saturate           gains and symmetric limits, with the output at its limit
//!   └─ step_with_options, step_given
//!        │               every option, without guards; gives up when something is not finite
//!        └─ *_carefully   bad arguments, the first call, a frozen step, overflow: guarded, seldom
//! ```

use super::gate::{CLOSED, UNKNOWN, limit_of, passes};
use super::positional::{Pid, Terms};
use super::settings::{
    BACK_CALCULATION, CIRCLE, DERIVATIVE_FILTER, DERIVATIVE_ON_ERROR, FEED_FORWARD,
    REST_DERIVATIVE, SLEW_LIMIT, TRACK_OUTPUT, WIND_UP,
};
use crate::control::number::finite;
use crate::control::step::TimeStep;
use crate::math;

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
        let integral = self.without_windup(wanted - output, integral, step);
        self.keep(output, measurement, error, rate, integral);
        output
    }

    /// The same with any option, of which the slew limit has left `bounded` of what is wanted. Pairs travel in registers, and
    /// stand in the order of [`keep`](Self::keep).
    #[inline(never)]
    fn bound<const CAREFUL: bool>(
        &mut self,
        (wanted, measurement): (f32, f32),
        (error, rate): (f32, f32),
        (integral, bounded): (f32, f32),
        setpoint: f32,
        step: &TimeStep,
    ) -> f32 {
        if !CAREFUL && !wanted.is_finite() {
            return self.give_up(setpoint, measurement, error, step);
        }
        let output = self.within_output_range(bounded);
        let integral = self.without_windup(wanted - output, integral, step);
        self.keep(output, measurement, error, rate, integral);
        output
    }

    /// Steps with what `options` say, which are words for the sake of speed.
    #[inline(never)]
    pub(super) fn step_with_options(
        &mut self,
        setpoint: f32,
        measurement: f32,
        error: f32,
        travel: f32,
        step: &TimeStep,
        options: u32,
    ) -> f32 {
        let on = |option: u16| options & u32::from(option) != 0;
        if on(DERIVATIVE_ON_ERROR | REST_DERIVATIVE) {
            return self.step_on_error(setpoint, measurement, step);
        }
        let (mut error, mut travel) = (error, travel);
        if on(CIRCLE) && !(self.shorten(&mut error) && self.shorten(&mut travel)) {
            return self.step_by_turns(setpoint, measurement, step);
        }
        self.work::<false>(setpoint, measurement, error, travel * step.per_dt, step, options)
    }

    /// The same with an error and a rate that were formed elsewhere. The measurement may be [`UNKNOWN`]; then `setpoint` is the
    /// rate too.
    #[inline(never)]
    pub(super) fn step_given(
        &mut self,
        setpoint: f32,
        measurement: f32,
        error: f32,
        rate: f32,
        step: &TimeStep,
        options: u32,
    ) -> f32 {
        self.work::<false>(setpoint, measurement, error, rate, step, options)
    }

    #[inline(never)]
    fn step_on_error(&mut self, setpoint: f32, measurement: f32, step: &TimeStep) -> f32 {
        if self.has(REST_DERIVATIVE) {
            return self.step_carefully(setpoint, measurement, step);
        }
        let mut error = setpoint - measurement;
        let mut travel = self.error - error;
        if self.has(CIRCLE) && !(self.shorten(&mut error) && self.shorten(&mut travel)) {
            return self.step_by_turns(setpoint, measurement, step);
        }
        let rate = travel * step.per_dt;
        self.step_given(setpoint, measurement, error, rate, step, self.options.into())
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
        let rate = travel * step.per_dt;
        self.step_given(setpoint, measurement, error, rate, step, self.options.into())
    }

    /// Something was not finite, and nothing has changed.
    #[cold]
    #[inline(never)]
    fn give_up(&mut self, setpoint: f32, measurement: f32, error: f32, step: &TimeStep) -> f32 {
        // A measurement of infinity looks unknown, but leaves no error.
        if measurement == UNKNOWN && error.is_finite() {
            self.step_error_carefully(error, setpoint, step)
        } else {
            self.step_carefully(setpoint, measurement, step)
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
    pub(super) fn step_error_carefully(&mut self, error: f32, rate: f32, step: &TimeStep) -> f32 {
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
            self.take_over(measurement, error, self.filtered(rate, &step, self.options.into()));
        }
        if self.error == UNKNOWN {
            self.error = -error; // no interval yet: a mean of zero
        }
        let unused = if measurement == UNKNOWN { FEED_FORWARD } else { 0 };
        let options = self.options & !unused;
        self.work::<true>(0.0, measurement, error, rate, &step, options.into())
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

    /// The whole controller. Unless `CAREFUL`, it gives up before anything has changed when something is not finite.
    // It stands in each of its callers: a call moves what is in registers.
    #[inline(always)]
    fn work<const CAREFUL: bool>(
        &mut self,
        setpoint: f32,
        measurement: f32,
        error: f32,
        rate: f32,
        step: &TimeStep,
        options: u32,
    ) -> f32 {
        let on = |option: u16| options & u32::from(option) != 0;
        let finite = |value| if CAREFUL { finite(value) } else { value };
        let settings = &self.settings;
        let rate = finite(self.filtered(rate, step, options));
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
        if on(FEED_FORWARD) {
            others = finite(others + self.feed_forward(measurement, error));
        }
        let mut integral = finite(self.integral + growth);
        if !passes(integral, settings.integral_limit_gate) {
            if !CAREFUL && !integral.is_finite() {
                return self.give_up(setpoint, measurement, error, step);
            }
            integral = limit_of(settings.integral_limit_gate).copysign(integral);
        }
        let wanted = finite(others + integral);
        let (first, second) = ((wanted, measurement), (error, rate));
        if on(SLEW_LIMIT) {
            let (way, reach) = (wanted - self.output, settings.slew_per_s * step.dt_s);
            if way.abs() > reach {
                let bounded = self.output + reach.copysign(way);
                return self.bound::<CAREFUL>(first, second, (integral, bounded), setpoint, step);
            }
        }
        // Written so that NaN is not within.
        if !(wanted <= settings.output_upper && wanted >= settings.output_lower) {
            return self.bound::<CAREFUL>(first, second, (integral, wanted), setpoint, step);
        }
        self.keep(wanted, measurement, error, rate, integral);
        wanted
    }

    #[inline]
    pub(super) const fn keep(
        &mut self,
        output: f32,
        measurement: f32,
        error: f32,
        rate: f32,
        integral: f32,
    ) {
        self.output = output;
        self.measurement = measurement;
        self.error = error;
        self.rate = rate;
        self.integral = integral;
    }

    /// The integral after anti-windup, for an `excess` that the limits cut off the output.
    #[inline]
    fn without_windup(&self, excess: f32, integral: f32, step: &TimeStep) -> f32 {
        if !self.has(BACK_CALCULATION) {
            let outward = excess * (integral - self.integral) > 0.0;
            return if outward && !self.has(WIND_UP) { self.integral } else { integral };
        }
        let part = step.dt_s / self.settings.tracking_time_s;
        let drained = integral - excess * if part < 1.0 { part } else { 1.0 };
        let gate = self.settings.integral_limit_gate;
        if passes(drained, gate) {
            drained
        } else if drained.is_nan() {
            integral // an excess beyond f32, of which no part is drained
        } else {
            limit_of(gate).copysign(drained)
        }
    }

    #[inline]
    pub(super) fn growth(&self, error: f32, step: &TimeStep) -> f32 {
        self.settings.ki * step.half_dt_s * (error + self.error)
    }

    #[inline]
    fn filtered(&self, rate: f32, step: &TimeStep, options: u32) -> f32 {
        if options & u32::from(DERIVATIVE_FILTER) != 0 {
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
        if size > settings.other_edge || size >= settings.no_rate_above {
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
