//! Whole loops for one motor: filters and controllers in their order of use.
//!
//! ```text
//! SpeedActuator      speed -> low-pass -> PID -> low-pass -> output
//!
//! PositionActuator   angle -> low-pass -> PID (every n-th step) -> speed setpoint
//!                                                                     |
//!                    speed -> low-pass ------------------------> PID -+-> low-pass -> output
//! ```

mod position;

pub use position::PositionActuator;

use super::filter::LowPass;
use crate::control::pid::{Pid, PidConfig};
use crate::error::{ConfigError, positive};
use crate::time::TimeStep;

/// A speed loop with its filters.
///
/// ```text
/// output = low-pass(PID(setpoint, low-pass(speed)))
/// ```
/// With the speed in a unit `M` and the output in a unit `U`, the gains are those of [`PidConfig`]; cut-offs are in Hz.
///
/// # Edge behaviour
/// As the [`Pid`]. The first speed is the first output of its filter, and the first call gives P and feed-forward, regardless of
/// the age of the actuator. If `dt_s` is zero, negative, NaN or infinite, or a setpoint or speed is NaN or infinite, the last
/// output is returned and [`rejected`](Self::rejected) grows; after a bad input, the next speed passes its filter as a first
/// value, and D rests once. A `dt_s` above the maximum of the [`TimeStep`] freezes the integral and D, and counts as the maximum
/// for the filters. Without `ki` the integral stays zero. Huge gains end at the output limits, which hold behind the filter too.
///
/// # Examples
/// ```
/// use drivetrain::control::{PidConfig, SpeedActuator};
/// use drivetrain::time::TimeStep;
///
/// let mut wheel = SpeedActuator::new(PidConfig::new(2.0, 2.5, 0.0))?;
/// assert_eq!(wheel.step(14.0, 10.0, &TimeStep::of(0.001)), 8.0);
/// let error = wheel.with_feedback_filter(100.0)?.with_output_filter(0.0).unwrap_err();
/// assert_eq!(error.parameter(), "output_filter");
/// # Ok::<(), drivetrain::error::ConfigError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct SpeedActuator {
    pid: Pid,
    filters: SpeedFilters,
}

/// The filters around a speed loop, and the filtered output.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
struct SpeedFilters {
    feedback: OptionalFilter,
    output: OptionalFilter,
    value: f32,
}

impl SpeedFilters {
    const NONE: Self =
        Self { feedback: OptionalFilter(None), output: OptionalFilter(None), value: 0.0 };

    /// Runs the loop on the filtered speed, and returns its output, filtered and within its limits: a filter may pass
    /// its input by a rounding step, and limits may have been narrowed since the last step.
    #[inline]
    fn around(&mut self, pid: &mut Pid, setpoint: f32, speed: f32, step: &TimeStep) -> f32 {
        let wanted = pid.step(setpoint, self.feedback.pass(speed, step), step);
        self.value = match &mut self.output.0 {
            Some(filter) => pid.core.within_output_range(filter.pass(wanted, step)),
            None => wanted,
        };
        self.value
    }

    /// Passes the next speed as a first value: the last speed is too old.
    const fn miss(&mut self, step: &TimeStep) {
        if !step.is_hold() {
            self.interrupt();
        }
    }

    const fn reset(&mut self) {
        self.reset_to(0.0);
    }

    const fn reset_to(&mut self, output: f32) {
        self.feedback.reset();
        self.output.reset();
        self.value = output;
    }

    /// Passes the next speed as a first value, and keeps the output.
    const fn interrupt(&mut self) {
        self.feedback.reset();
    }

    const fn value(&self) -> f32 {
        self.value
    }
}

impl SpeedActuator {
    /// Takes and checks the speed loop, without filters.
    ///
    /// # Errors
    /// Names the parameter of the loop as [`Pid::new`] does.
    pub const fn new(pid: PidConfig) -> Result<Self, ConfigError> {
        match Pid::new(pid) {
            Ok(pid) => Ok(Self { pid, filters: SpeedFilters::NONE }),
            Err(error) => Err(error),
        }
    }

    /// Filters the measured speed with a first-order low-pass of this cut-off, more than zero. Off by default.
    ///
    /// # Errors
    /// Names `feedback_filter` when the cut-off is NaN, infinite, zero or negative.
    pub const fn with_feedback_filter(mut self, cutoff_hz: f32) -> Result<Self, ConfigError> {
        match OptionalFilter::new("feedback_filter", cutoff_hz) {
            Ok(filter) => self.filters.feedback = filter,
            Err(error) => return Err(error),
        }
        Ok(self)
    }

    /// Filters the output with a first-order low-pass of this cut-off, more than zero. Off by default.
    ///
    /// # Errors
    /// Names `output_filter` when the cut-off is NaN, infinite, zero or negative.
    pub const fn with_output_filter(mut self, cutoff_hz: f32) -> Result<Self, ConfigError> {
        match OptionalFilter::new("output_filter", cutoff_hz) {
            Ok(filter) => self.filters.output = filter,
            Err(error) => return Err(error),
        }
        Ok(self)
    }

    /// Steps by a validated time step, and returns the output.
    ///
    /// Costs 80 instructions on a Cortex-M4F, without filters (`docs/figures.md`).
    pub fn step(&mut self, setpoint: f32, speed: f32, step: &TimeStep) -> f32 {
        if step.is_hold() || !setpoint.is_finite() || !speed.is_finite() {
            self.pid.step(setpoint, speed, step); // refuses and counts
            self.filters.miss(step);
            return self.output();
        }
        self.filters.around(&mut self.pid, setpoint, speed, step)
    }

    /// Forgets everything but the configuration and the count of rejected steps.
    pub const fn reset(&mut self) {
        self.filters.reset();
        self.pid.reset();
    }

    /// Resets, and lets the first call return `output` as [`Pid::reset_to`] does.
    pub const fn reset_to(&mut self, output: f32) {
        self.pid.reset_to(output);
        self.filters.reset_to(self.pid.output());
    }

    /// Keeps the integral over a gap in the measurements, as [`Pid::interrupt`] does; the next speed passes its filter as a first
    /// value.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::control::{PidConfig, SpeedActuator};
    /// use drivetrain::time::TimeStep;
    ///
    /// let loop_ = PidConfig::new(0.0, 1.0, 0.5);
    /// let mut wheel = SpeedActuator::new(loop_)?.with_feedback_filter(10.0)?;
    /// for _ in 0..=1000 {
    ///     wheel.step(1.0, 0.0, &TimeStep::of(0.001));
    /// }
    /// wheel.interrupt();
    /// assert!((wheel.step(1.0, 0.7, &TimeStep::of(0.001)) - 1.0).abs() < 1e-3); // no kick of D for the step of 0.7
    /// # Ok::<(), drivetrain::error::ConfigError>(())
    /// ```
    pub const fn interrupt(&mut self) {
        self.filters.interrupt();
        self.pid.interrupt();
    }

    /// Returns the last output.
    #[must_use]
    pub const fn output(&self) -> f32 {
        self.filters.value
    }

    /// Returns the loop, for its terms and its configuration.
    #[must_use]
    pub const fn pid(&self) -> &Pid {
        &self.pid
    }

    /// Returns the loop, for changing its gains.
    pub const fn pid_mut(&mut self) -> &mut Pid {
        &mut self.pid
    }

    /// Returns the number of refused steps, and of steps too long to be integrated; stays at 65535.
    #[must_use]
    pub const fn rejected(&self) -> u16 {
        self.pid.rejected()
    }
}

/// An optional low-pass.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
struct OptionalFilter(Option<LowPass>);

impl OptionalFilter {
    /// Makes the filter, and names its cut-off in errors as this actuator does.
    const fn new(name: &'static str, cutoff_hz: f32) -> Result<Self, ConfigError> {
        match (positive(name, cutoff_hz), LowPass::new(cutoff_hz)) {
            (Ok(()), Ok(filter)) => Ok(Self(Some(filter))),
            (Err(error), _) | (_, Err(error)) => Err(error),
        }
    }

    /// Filters a finite value, by a time step that is not on hold.
    const fn pass(&mut self, value: f32, step: &TimeStep) -> f32 {
        match &mut self.0 {
            Some(filter) => filter.pass(value, step),
            None => value,
        }
    }

    /// Passes the next value as a first value.
    const fn reset(&mut self) {
        if let Some(filter) = &mut self.0 {
            filter.reset();
        }
    }
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "exact results are the rule under test")]
mod tests {
    use super::*;

    const DT_S: f32 = 0.001;

    fn filtered() -> SpeedActuator {
        SpeedActuator::new(PidConfig::new(1.0, 2.0, 0.0).with_output_limit(5.0))
            .unwrap()
            .with_feedback_filter(50.0)
            .unwrap()
            .with_output_filter(50.0)
            .unwrap()
    }

    #[test]
    fn a_speed_actuator_without_filters_equals_its_pid() {
        let config = PidConfig::new(1.0, 2.0, 0.01).with_output_limit(5.0);
        let mut actuator = SpeedActuator::new(config).unwrap();
        let mut pid = Pid::new(config).unwrap();
        for sample in 0..50_u8 {
            let speed = f32::from(sample) * 0.1;
            assert_eq!(
                actuator.step(3.0, speed, &TimeStep::of(DT_S)),
                pid.step(3.0, speed, &TimeStep::of(DT_S))
            );
        }
    }

    #[test]
    fn both_filters_smooth() {
        let mut actuator = filtered();
        assert_eq!(actuator.step(0.0, 0.0, &TimeStep::of(DT_S)), 0.0);
        let first = actuator.step(4.0, 0.0, &TimeStep::of(DT_S));
        assert!(first > 0.5 && first < 1.5, "{first}"); // a quarter of the step after dt / (dt + T)
        let before = actuator.output();
        assert!((actuator.step(4.0, 1.0, &TimeStep::of(DT_S)) - before).abs() < 1.0);
    }

    #[test]
    fn bad_samples_and_bad_times_leave_no_trace() {
        let (mut clean, mut hit) = (filtered(), filtered());
        for sample in 0..20_u8 {
            let speed = f32::from(sample) * 0.1;
            let expected = clean.step(3.0, speed, &TimeStep::of(DT_S));
            let before = hit;
            for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
                let held = hit.output();
                assert_eq!(hit.step(3.0, bad, &TimeStep::of(DT_S)), held);
                assert_eq!(hit.step(bad, speed, &TimeStep::of(DT_S)), held);
                assert_eq!(hit.step(3.0, speed, &TimeStep::of(bad)), held);
            }
            hit = before;
            for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 0.0, -DT_S] {
                assert_eq!(hit.step(3.0, speed, &TimeStep::of(bad)), before.output());
            }
            assert_eq!(hit.step(3.0, speed, &TimeStep::of(DT_S)), expected);
        }
        assert_eq!(hit.rejected(), 100);
    }

    #[test]
    fn reset_to_takes_over_without_a_jump() {
        let mut actuator = filtered();
        actuator.step(1.0, 0.0, &TimeStep::of(DT_S));
        actuator.reset_to(2.0);
        assert_eq!(actuator.output(), 2.0);
        assert!((actuator.step(9.0, 8.0, &TimeStep::of(DT_S)) - 2.0).abs() < 1e-5);
        actuator.reset();
        assert_eq!(actuator.output(), 0.0);
    }

    #[test]
    fn the_limit_holds_behind_the_output_filter_to_the_last_bit() {
        // From one end to the other, a filter with a high cut-off may come out a spacing of f32
        // beyond the end.
        for parts in 1..2_000_u16 {
            let pid =
                PidConfig::new(1.0, 0.0, 0.0).with_output_range(-0.37 * f32::from(parts), 1.1);
            let mut actuator = SpeedActuator::new(pid).unwrap().with_output_filter(1e12).unwrap();
            actuator.step(-1e4, 0.0, &TimeStep::of(DT_S));
            let output = actuator.step(1e4, 0.0, &TimeStep::of(DT_S));
            assert!(output <= 1.1, "{output}");
        }
    }

    #[test]
    fn a_limit_that_was_narrowed_holds_behind_the_filter_at_once() {
        let mut actuator = filtered();
        for _ in 0..100 {
            actuator.step(100.0, 0.0, &TimeStep::of(DT_S));
        }
        actuator
            .pid_mut()
            .set_config(PidConfig::new(1.0, 2.0, 0.0).with_output_limit(1.0))
            .unwrap();
        assert_eq!(actuator.step(100.0, 0.0, &TimeStep::of(DT_S)), 1.0);
    }

    #[test]
    fn a_cut_off_that_cannot_be_is_named() {
        for bad in [0.0, -1.0, f32::NAN, f32::INFINITY] {
            let new = SpeedActuator::new(PidConfig::new(1.0, 0.0, 0.0)).unwrap();
            let feedback = new.with_feedback_filter(bad).unwrap_err();
            assert_eq!(feedback.parameter(), "feedback_filter");
        }
    }
}
