//! The plain path of the positional controller, on its own.

use super::Pid;
use super::settings::NOT_PLAIN;
use super::work::{UNKNOWN, passes};
use crate::control::step::TimeStep;

/// What the plain path makes of a step.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Plain {
    /// Done: the output.
    Within(f32),
    /// The output would be beyond its limit; nothing has changed yet.
    Beyond(Wanted),
    /// It takes more than the plain path: options, bad arguments, the first call. Nothing has changed yet.
    Otherwise,
}

/// What a step without limits would store.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Wanted {
    pub(crate) output: f32,
    pub(crate) measurement: f32,
    pub(crate) error: f32,
    pub(crate) rate: f32,
    pub(crate) integral: f32,
}

impl Wanted {
    /// What a step with an error that was formed elsewhere would store.
    pub(crate) const fn by_error(output: f32, error: f32, rate: f32, integral: f32) -> Self {
        Self { output, measurement: UNKNOWN, error, rate, integral }
    }
}

impl Pid {
    /// Tells whether no option is on that the plain path does not know.
    pub(crate) const fn is_plain(&self) -> bool {
        self.options & NOT_PLAIN == 0
    }

    /// As [`step`](Self::step), as far as the plain path goes.
    #[inline]
    pub(crate) fn try_step(&mut self, setpoint: f32, measurement: f32, step: &TimeStep) -> Plain {
        let error = setpoint - measurement;
        let integral = self.integral + self.growth(error, step);
        // The first call, a step that is not normal, NaN and overflow: none of them passes.
        if !passes(integral, self.settings.integral_gate) {
            return Plain::Otherwise;
        }
        let rate = (measurement - self.measurement) * step.per_dt;
        self.finish(measurement, error, rate, integral)
    }

    /// As [`step_error`](Self::step_error), as far as the plain path goes.
    #[inline]
    pub(crate) fn try_step_error(&mut self, error: f32, rate: f32, step: &TimeStep) -> Plain {
        let integral = self.integral + self.growth(error, step);
        if !passes(integral, self.settings.integral_gate) {
            return Plain::Otherwise;
        }
        self.finish(UNKNOWN, error, rate, integral)
    }

    #[inline]
    fn finish(&mut self, measurement: f32, error: f32, rate: f32, integral: f32) -> Plain {
        let output = self.settings.kp * error + integral - self.settings.kd * rate;
        if !passes(output, self.settings.output_gate) {
            return Plain::Beyond(Wanted { output, measurement, error, rate, integral });
        }
        self.output = output;
        self.measurement = measurement;
        self.error = error;
        self.rate = rate;
        self.integral = integral;
        Plain::Within(output)
    }

    /// Ends a step whose output did not pass its gate; out of line, and with its arguments in registers.
    #[inline(never)]
    pub(super) fn saturate_apart(
        &mut self,
        output: f32,
        measurement: f32,
        error: f32,
        rate: f32,
        integral: f32,
        step: &TimeStep,
    ) -> f32 {
        match self.saturate(&Wanted { output, measurement, error, rate, integral }, step) {
            Some(output) => output,
            None => self.overflow(measurement, error, rate, step),
        }
    }
}
