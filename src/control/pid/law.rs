//! The law of the controller, twice: plain and in full.
//!
//! ```text
//! step, step_error        from setpoint and measurement, or from an error and a rate
//!   └─ ErrorPid::plain    gains, integral limit, one output limit; an error for all else
//!        └─ step_in_full  every option, unguarded; if a value is not finite, once more with guards
//! ```

use super::Pid;
use super::config::{
    BACK_CALCULATION, DERIVATIVE_FILTER, DERIVATIVE_ON_ERROR, FEED_FORWARD, GIVEN, OF_SETPOINT,
    PERIOD, REST_DERIVATIVE, SLEW_LIMIT, TRACK_OUTPUT, TRACKING,
};
use super::error_pid::ErrorPid;
use crate::control::number::{finite, limited};
use crate::math;
use crate::time::TimeStep;

impl ErrorPid {
    /// The plain law: gains, integral limit, one output limit.
    ///
    /// # Errors
    /// If the step needs more, nothing changes. The returned value is finite if `valid` and `error` are.
    #[inline(always)]
    pub(crate) fn plain(
        &mut self,
        (error, rate): (f32, f32),
        valid: f32,
        step: &TimeStep,
    ) -> Result<f32, f32> {
        let parameters = &self.parameters;
        let growth = parameters.ki * step.half_dt_s * (error + self.error);
        let integral = self.integral + growth;
        // With options, NaN and infinity nothing passes.
        if !passes(integral, self.integral_gate) {
            return Err(valid);
        }
        let output = parameters.kp * error + integral - parameters.kd * rate;
        if passes(output, self.output_gate) {
            self.keep(output, error, rate, integral);
            return Ok(output);
        }
        if !output.is_finite() {
            return Err(error);
        }
        let limit = limit_of(self.output_gate).copysign(output);
        let integral = if are_alike(output, growth) { self.integral } else { integral };
        self.keep(limit, error, rate, integral);
        Ok(limit)
    }

    #[inline(always)]
    pub(crate) const fn is_limited(&self) -> bool {
        self.parameters.output_upper < f32::MAX
    }

    #[inline(always)]
    const fn keep(&mut self, output: f32, error: f32, rate: f32, integral: f32) {
        self.output = output;
        self.error = error;
        self.rate = rate;
        self.integral = integral;
    }
}

impl Pid {
    /// Tells whether the output has limits.
    #[inline(always)]
    pub(crate) const fn is_limited(&self) -> bool {
        self.core.is_limited()
    }

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
        let (error, travel) = (setpoint - measurement, measurement - self.measurement);
        let rate = travel * step.per_dt;
        match self.step_plain(setpoint, measurement, step) {
            Ok(output) => output,
            Err(valid) => self.step_in_full::<false>(
                (valid, measurement),
                (error, rate),
                travel,
                step,
                self.core.options,
            ),
        }
    }

    /// Steps with a given error (from integers, on a circle) and the measured rate of change.
    ///
    /// D is `-kd * rate`, on the first call too. Period, tracking, feed-forward and the derivative of the error do not apply.
    /// Everything else is as for [`step`](Self::step).
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
        match self.core.plain((error, rate), error, step) {
            Ok(output) => {
                self.measurement = UNKNOWN;
                output
            }
            Err(valid) => {
                let options = self.core.options & !OF_SETPOINT | GIVEN;
                self.step_in_full::<false>((valid, UNKNOWN), (error, rate), 0.0, step, options)
            }
        }
    }

    /// The step of a [plain](Self::is_plain) controller.
    ///
    /// # Errors
    /// As [`ErrorPid::plain`]. The value returned is finite if setpoint and measurement are.
    #[inline(always)]
    pub(crate) fn step_plain(
        &mut self,
        setpoint: f32,
        measurement: f32,
        step: &TimeStep,
    ) -> Result<f32, f32> {
        let (error, travel) = (setpoint - measurement, measurement - self.measurement);
        let output = self.core.plain((error, travel * step.per_dt), setpoint, step)?;
        self.measurement = measurement;
        Ok(output)
    }

    /// The step of any controller, with error and rate as the plain step takes them.
    ///
    /// Unless `GUARDED`, a value that is not finite shows before anything has changed, and the guarded step takes over. Bad
    /// arguments, a step that is not normal and the first call, whose unknown values are not finite, show in the same way.
    #[inline(never)]
    fn step_in_full<const GUARDED: bool>(
        &mut self,
        (valid, measurement): (f32, f32),
        (error, rate): (f32, f32),
        travel: f32,
        step: &TimeStep,
        options: u16,
    ) -> f32 {
        let finite = |value| if GUARDED { finite(value) } else { value };
        let on = |option| options & option != 0;
        if GUARDED {
            let other = if on(GIVEN) { rate } else { measurement };
            if step.is_hold() || !valid.is_finite() || !other.is_finite() {
                return self.refuse(!on(GIVEN) && !step.is_hold());
            }
        }
        'finite: {
            let differences = (error, rate, travel);
            let (error, rate, tracking_rate) =
                self.differences::<GUARDED>(differences, step, options);
            let (proportional, growth) = self.proportional_and_growth::<GUARDED>(error, step);
            let mut others = finite(proportional - finite(self.core.parameters.kd * rate));
            if on(FEED_FORWARD) {
                others = finite(others + self.feed_forward(measurement, error));
            }
            let mut memory = self.core.integral;
            if GUARDED && on(TRACK_OUTPUT) && self.has_memory() {
                memory = finite(self.core.output - others);
            }
            let mut integral = finite(memory + growth);
            let gate = self.core.integral_limit_gate();
            if !passes(integral, gate) {
                if !integral.is_finite() {
                    break 'finite;
                }
                integral = limit_of(gate).copysign(integral);
            }
            let wanted = finite(others + integral);
            let (mut bounded, mut is_free) = (wanted, true);
            if on(SLEW_LIMIT) {
                let way = wanted - self.core.output;
                let reach = self.core.parameters.slew_per_s * step.dt_s;
                if way.abs() > reach {
                    (bounded, is_free) = (self.core.output + reach.copysign(way), false);
                }
            }
            if GUARDED {
                if step.is_frozen() && self.core.error != UNKNOWN {
                    self.core.rejected = self.core.rejected.saturating_add(1);
                }
                self.core.set_options(self.core.options & !(REST_DERIVATIVE | TRACK_OUTPUT));
            }
            let (lower, upper) =
                (self.core.parameters.output_lower, self.core.parameters.output_upper);
            if is_free && wanted <= upper && wanted >= lower {
                self.tracking_rate = tracking_rate;
                self.keep(wanted, measurement, error, rate, integral);
                return wanted;
            }
            if !wanted.is_finite() {
                break 'finite;
            }
            let output = limited(bounded, lower, upper);
            integral = self.without_windup(wanted - output, memory, integral, step);
            self.tracking_rate = tracking_rate;
            self.keep(output, measurement, error, rate, integral);
            return output;
        }
        if GUARDED {
            return self.core.output; // never: all of it is finite
        }
        self.step_in_full::<true>((valid, measurement), (error, rate), travel, step, options)
    }

    /// Returns the effective error, the filtered rate of change, and the rate of a tracked setpoint. Unless `GUARDED`, an unknown
    /// error or rate is not finite.
    #[inline(always)]
    fn differences<const GUARDED: bool>(
        &self,
        (mut error, mut rate, travel): (f32, f32, f32),
        step: &TimeStep,
        options: u16,
    ) -> (f32, f32, f32) {
        let finite = |value| if GUARDED { finite(value) } else { value };
        let on = |option| options & option != 0;
        let mut tracking_rate = self.tracking_rate;
        if on(PERIOD) {
            error = self.shortest::<GUARDED>(error);
            if !self.is_short(travel) {
                rate = finite(self.shortest::<GUARDED>(travel)) * step.per_dt;
            }
        }
        (error, rate) = (finite(error), finite(rate));
        if on(TRACKING | DERIVATIVE_ON_ERROR | REST_DERIVATIVE) {
            if on(TRACKING) {
                (error, tracking_rate) = self.follow::<GUARDED>(error, travel, step);
            }
            if on(DERIVATIVE_ON_ERROR) {
                let travel = self.core.error - error;
                let travel = if on(PERIOD) { self.shortest::<GUARDED>(travel) } else { travel };
                rate = finite(finite(travel) * step.per_dt);
            }
            if !GUARDED && (on(REST_DERIVATIVE) || !tracking_rate.is_finite()) {
                rate = f32::NAN;
            }
        }
        if GUARDED {
            let of_error = on(DERIVATIVE_ON_ERROR) && self.core.error != UNKNOWN;
            if step.is_frozen() || on(REST_DERIVATIVE) && !on(GIVEN) {
                rate = self.core.rate;
            } else if self.measurement == UNKNOWN && !of_error && !on(GIVEN) {
                rate = 0.0;
            }
        }
        if on(DERIVATIVE_FILTER) {
            let gain = step.dt_s / (step.dt_s + self.core.parameters.derivative_time_s);
            rate = finite(self.core.rate + gain * (rate - self.core.rate));
        }
        (error, rate, tracking_rate)
    }

    /// Returns P, and the increment of I.
    #[inline(always)]
    fn proportional_and_growth<const GUARDED: bool>(
        &self,
        error: f32,
        step: &TimeStep,
    ) -> (f32, f32) {
        let finite = |value| if GUARDED { finite(value) } else { value };
        let parameters = &self.core.parameters;
        let (mut before, mut half_dt_s) = (self.core.error, step.half_dt_s);
        if GUARDED && before == UNKNOWN {
            before = -error; // no interval yet: a mean of zero
        }
        if GUARDED && step.is_frozen() {
            half_dt_s = 0.0;
        }
        let mut proportional = finite(parameters.kp * error);
        let mut growth = finite(parameters.ki * half_dt_s * (error + before));
        let is_near = error.abs() <= parameters.full_rate_below;
        if !is_near {
            growth *= self.weight(error);
        }
        if error.abs() < parameters.dead_band {
            proportional = 0.0;
            let shrinks = growth * self.core.integral < 0.0;
            if !shrinks {
                growth *= 0.0; // and not simply zero: what is not finite must show
            }
        }
        (proportional, growth)
    }

    #[inline(always)]
    const fn keep(&mut self, output: f32, measurement: f32, error: f32, rate: f32, integral: f32) {
        self.measurement = measurement;
        self.core.keep(output, error, rate, integral);
    }

    /// Returns whether a way is less than half a turn. Half a turn itself, and overflow, need another look.
    #[inline]
    const fn is_short(&self, way: f32) -> bool {
        passes(way, self.way_gate)
    }

    /// Returns the shortest of the ways that differ by whole periods. Unless `GUARDED`, NaN for half a turn and overflow.
    #[inline]
    fn shortest<const GUARDED: bool>(&self, way: f32) -> f32 {
        if self.is_short(way) {
            return way;
        }
        if GUARDED {
            return math::wrap(way, self.period());
        }
        let rest = math::rest(way, self.period());
        if self.is_short(rest) { rest } else { f32::NAN }
    }

    /// Returns the share of its rate at which the integral works at an error beyond the full rate.
    #[inline]
    fn weight(&self, error: f32) -> f32 {
        let (size, none) = (error.abs(), self.core.parameters.no_rate_above);
        if size >= none {
            0.0
        } else {
            (none - size) / (none - self.core.parameters.full_rate_below)
        }
    }

    /// Returns the integral after anti-windup, for an `excess` cut off the output by the limits.
    #[inline]
    fn without_windup(&self, excess: f32, before: f32, integral: f32, step: &TimeStep) -> f32 {
        if self.core.options & BACK_CALCULATION == 0 {
            let is_outward = are_alike(excess, integral - before);
            return if is_outward { before } else { integral };
        }
        let part = step.dt_s / self.core.parameters.drain_time_s;
        let drained = integral - excess * if part < 1.0 { part } else { 1.0 };
        let gate = self.core.integral_limit_gate();
        if passes(drained, gate) {
            drained
        } else if drained.is_nan() {
            integral // an excess beyond f32, of which no part is drained
        } else {
            limit_of(gate).copysign(drained)
        }
    }
}

/// Tells whether two numbers have the same sign.
#[inline(always)]
const fn are_alike(one: f32, other: f32) -> bool {
    (one.to_bits() ^ other.to_bits()).cast_signed() >= 0
}

/// Marks a stored error or measurement as unknown: arithmetic with it never passes a [`gate`].
pub(super) const UNKNOWN: f32 = f32::INFINITY;

/// A gate passed by no value.
pub(super) const CLOSED: u32 = 0;

/// Encodes a limit for one integer comparison: the value is within ±`limit`, and neither NaN nor infinite.
pub(super) const fn gate(limit: f32) -> u32 {
    open_gate(limit) + 1
}

/// As [`gate`], but exactly `limit` does not pass. Zero gives [`CLOSED`].
pub(super) const fn open_gate(limit: f32) -> u32 {
    limit.to_bits() << 1
}

/// Returns the limit encoded by a gate.
#[inline(always)]
pub(super) const fn limit_of(gate: u32) -> f32 {
    f32::from_bits(gate >> 1)
}

#[inline(always)]
pub(super) const fn passes(value: f32, gate: u32) -> bool {
    magnitude(value) < gate
}

/// Sizes in an order for one integer comparison; NaN is larger than all numbers.
#[inline(always)]
const fn magnitude(value: f32) -> u32 {
    value.to_bits() << 1
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "exact results are the rule under test")]
mod tests {
    use super::*;
    use crate::control::PidConfig;
    use proptest::prelude::*;

    fn stepped(pid: &mut Pid, setpoint: f32, measurement: f32, step: &TimeStep) -> f32 {
        let plain =
            if pid.is_plain() { pid.step_plain(setpoint, measurement, step).ok() } else { None };
        plain.unwrap_or_else(|| pid.step(setpoint, measurement, step))
    }

    fn stepped_by(pid: &mut Pid, error: f32, rate: f32, step: &TimeStep) -> f32 {
        let mut part = *pid.core();
        let plain = part.plain((error, rate), error, step);
        let output = plain.unwrap_or_else(|_| part.advance(error, rate, step));
        let whole = pid.step_error(error, rate, step);
        assert_eq!((output, &part), (whole, pid.core()));
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
            prop_assert_eq!(one.is_plain(), option > 2);
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
