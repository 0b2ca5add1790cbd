use super::Pid;
use super::config::{NOT_PLAIN, OF_SETPOINT, Parameters, PidConfig, REST_DERIVATIVE, TRACK_OUTPUT};
use super::law::{CLOSED, UNKNOWN, gate};
use crate::control::number::limited;
use crate::error::ConfigError;
use crate::time::TimeStep;

/// A controller whose error is formed elsewhere: the part of a [`Pid`] that knows neither setpoint nor measurement.
///
/// Options of the setpoint (feed-forward, period, tracking, derivative of the error) do not apply and need no storage.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
// What each step stores stands first, and what it reads next to it.
#[repr(C)]
pub(crate) struct ErrorPid {
    pub(super) error: f32,
    pub(super) rate: f32,
    pub(super) output: f32,
    pub(super) integral: f32,
    /// Of the integral; closed unless the controller is plain.
    pub(super) integral_gate: u32,
    /// Of the output; equal to the gate of the integral unless the controller is plain.
    pub(super) output_gate: u32,
    pub(super) parameters: Parameters,
    pub(super) options: u16,
    pub(super) rejected: u16,
}

#[cfg(target_pointer_width = "32")]
const _: () = assert!(size_of::<ErrorPid>() <= 72, "one for each motor of a bus");

impl ErrorPid {
    /// Makes one of numbers that were checked. Without options, it refuses every plain step.
    pub(super) const fn new(parameters: Parameters) -> Self {
        Self {
            error: UNKNOWN,
            rate: 0.0,
            output: 0.0,
            integral: 0.0,
            integral_gate: CLOSED,
            output_gate: CLOSED,
            parameters,
            options: 0,
            rejected: 0,
        }
    }

    /// Tells whether no option of the configuration needs a setpoint.
    pub(crate) const fn fits(config: &PidConfig) -> bool {
        config.options() & OF_SETPOINT == 0
    }

    /// Steps as [`Pid::step_error`], with any options and any arguments.
    pub(crate) fn advance(&mut self, error: f32, rate: f32, step: &TimeStep) -> f32 {
        let mut whole = Pid::of_error(*self);
        let output = whole.step_error(error, rate, step);
        *self = *whole.core();
        output
    }

    /// Changes the configuration as [`Pid::set_config`].
    ///
    /// # Errors
    /// Names the parameter as [`Pid::new`] does; then nothing changes.
    pub(crate) fn set_config(&mut self, config: PidConfig) -> Result<(), ConfigError> {
        let mut whole = Pid::of_error(*self);
        whole.set_config(config)?;
        *self = *whole.core();
        Ok(())
    }

    /// As [`Pid::reset`].
    pub(crate) const fn reset(&mut self) {
        self.interrupt();
        self.integral = 0.0;
        self.output = 0.0;
        self.options &= !TRACK_OUTPUT;
    }

    /// As [`Pid::interrupt`].
    pub(crate) const fn interrupt(&mut self) {
        self.error = UNKNOWN;
        self.rate = 0.0;
        self.set_options(self.options & !REST_DERIVATIVE);
    }

    /// As [`Pid::reset_to`].
    pub(crate) const fn reset_to(&mut self, output: f32) {
        self.reset();
        self.output = self.within_output_range(if output.is_finite() { output } else { 0.0 });
        self.options |= TRACK_OUTPUT;
    }

    /// Tells whether the plain law knows all options that are on: gains, integral limit, one output limit.
    pub(crate) const fn is_plain(&self) -> bool {
        self.options & NOT_PLAIN == 0
    }

    /// Returns what the output limits leave of `value`.
    pub(super) const fn within_output_range(&self, value: f32) -> f32 {
        limited(value, self.parameters.output_lower, self.parameters.output_upper)
    }

    #[inline]
    pub(super) const fn integral_limit_gate(&self) -> u32 {
        if self.integral_gate != CLOSED { self.integral_gate } else { self.output_gate }
    }

    /// Opens the plain law, or closes it.
    pub(super) const fn set_options(&mut self, options: u16) {
        let limit = self.integral_limit_gate();
        let is_plain = options & (NOT_PLAIN | REST_DERIVATIVE) == 0;
        let upper = gate(self.parameters.output_upper);
        (self.integral_gate, self.output_gate) =
            if is_plain { (limit, upper) } else { (CLOSED, limit) };
        self.options = options;
    }
}
