//! The plain path of the positional controller, for a caller that sees to all else out of its line.

use super::Pid;
use super::gate::{UNKNOWN, passes};
use super::settings::{NOT_PLAIN, WIND_UP};
use crate::control::step::TimeStep;

impl Pid {
    /// Tells whether the plain path knows all options that are on: gains, symmetric limits, conditional integration.
    pub(crate) const fn is_plain(&self) -> bool {
        self.options & (NOT_PLAIN | WIND_UP) == 0 && self.settings.tracking_time_s <= 0.0
    }

    /// As [`step`](Self::step), as far as the plain path goes, for a [plain](Self::is_plain) controller. `None` says that it
    /// takes more, as in the first call or for bad arguments; then nothing has changed.
    #[inline]
    pub(crate) fn try_step(
        &mut self,
        setpoint: f32,
        measurement: f32,
        step: &TimeStep,
    ) -> Option<f32> {
        let error = setpoint - measurement;
        let rate = (measurement - self.measurement) * step.per_dt;
        self.try_plain(measurement, error, rate, step)
    }

    /// As [`step_error`](Self::step_error); otherwise as [`try_step`](Self::try_step).
    #[inline]
    pub(crate) fn try_step_error(&mut self, error: f32, rate: f32, step: &TimeStep) -> Option<f32> {
        self.try_plain(UNKNOWN, error, rate, step)
    }

    #[inline]
    fn try_plain(
        &mut self,
        measurement: f32,
        error: f32,
        rate: f32,
        step: &TimeStep,
    ) -> Option<f32> {
        let mut integral = self.integral + self.growth(error, step);
        if !passes(integral, self.settings.integral_gate) {
            return None;
        }
        let mut output = self.settings.kp * error + integral - self.settings.kd * rate;
        if !passes(output, self.settings.output_gate) {
            if !output.is_finite() {
                return None;
            }
            let limit = self.settings.output_upper.copysign(output);
            if (output - limit) * (integral - self.integral) > 0.0 {
                integral = self.integral;
            }
            output = limit;
        }
        self.output = output;
        self.measurement = measurement;
        self.error = error;
        self.rate = rate;
        self.integral = integral;
        Some(output)
    }
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "exact results are the rule under test")]
mod tests {
    use super::*;
    use crate::control::PidConfig;
    use proptest::prelude::*;

    fn stepped(pid: &mut Pid, setpoint: f32, measurement: f32, step: &TimeStep) -> f32 {
        let plain = if pid.is_plain() { pid.try_step(setpoint, measurement, step) } else { None };
        plain.unwrap_or_else(|| pid.step(setpoint, measurement, step))
    }

    fn stepped_by(pid: &mut Pid, error: f32, rate: f32, step: &TimeStep) -> f32 {
        let plain = if pid.is_plain() { pid.try_step_error(error, rate, step) } else { None };
        plain.unwrap_or_else(|| pid.step_error(error, rate, step))
    }

    proptest! {
        /// Law: the plain path is the controller, bit by bit, whatever the options, the arguments and the time.
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
