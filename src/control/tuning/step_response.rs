use crate::control::error::{self, check, positive};
use crate::control::number::{Sum, finite};
use crate::error::ConfigError;
use crate::time::TimeStep;

/// Measures the response of a loop to a step, sample by sample, without storing it.
///
/// # Edge behaviour
/// A sample that is NaN or infinite, or whose `dt_s` is zero, negative, NaN or infinite, is left out and counted. A long `dt_s`
/// counts in full, the first too: no time is lost, but the value in between is unknown. Samples after the end are left out. A
/// measure beyond `f32` counts as `f32::MAX`.
///
/// # Examples
/// A first-order lag of 0.1 s rises in `0.1 ln 9` = 0.22 s and settles to 2 % in `0.1 ln 50` = 0.39 s.
/// ```
/// use drivetrain::control::StepResponse;
///
/// let mut response = StepResponse::new(0.0, 5.0, 1.0, 0.02)?;
/// let mut value = 0.0;
/// while !response.is_complete() {
///     value += (5.0 - value) * 0.001 / 0.1;
///     response.record(value, 0.001);
/// }
/// assert!((response.rise_time_s().unwrap_or(0.0) - 0.22).abs() < 0.002);
/// assert!((response.settling_time_s().unwrap_or(0.0) - 0.39).abs() < 0.003);
/// assert_eq!(response.overshoot(), 0.0);
/// # Ok::<(), drivetrain::error::ConfigError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct StepResponse {
    start: f32,
    target: f32,
    duration_s: f32,
    tolerance: f32,
    passed: Sum,
    tenth_at_s: Option<f32>,
    nine_tenths_at_s: Option<f32>,
    outside_until_s: f32,
    inside: bool,
    peak: f32,
    late_error: f32,
    late_samples: u32,
    rejected: u16,
}

impl StepResponse {
    /// Takes the value before the step, the new setpoint, how long to measure, and the tolerance as a part of the step (0.02 is the custom).
    ///
    /// # Errors
    /// Names `target` when equal to the start, or when either is NaN or infinite; `duration` or `tolerance` when NaN, infinite,
    /// zero or negative.
    pub const fn new(
        start: f32,
        target: f32,
        duration_s: f32,
        tolerance: f32,
    ) -> Result<Self, ConfigError> {
        check!(error::finite("target", target - start));
        if target - start == 0.0 {
            return Err(ConfigError::NoChange("target"));
        }
        check!(positive("duration", duration_s));
        check!(positive("tolerance", tolerance));
        Ok(Self {
            start,
            target,
            duration_s,
            tolerance,
            passed: Sum::ZERO,
            tenth_at_s: None,
            nine_tenths_at_s: None,
            outside_until_s: 0.0,
            inside: false,
            peak: 0.0,
            late_error: 0.0,
            late_samples: 0,
            rejected: 0,
        })
    }

    /// Takes the value `dt_s` seconds after the last value; the first, `dt_s` after the step.
    ///
    /// Costs 68 instructions on a Cortex-M4F (`docs/figures.md`).
    pub fn record(&mut self, value: f32, dt_s: f32) {
        if self.is_complete() {
            return;
        }
        if !TimeStep::new(dt_s, f32::MAX).admits(value.is_finite(), &mut self.rejected) {
            return;
        }
        self.passed.add(dt_s);
        let passed_s = self.passed.value();
        let part = finite((value - self.start) / (self.target - self.start));
        if part >= 0.1 && self.tenth_at_s.is_none() {
            self.tenth_at_s = Some(passed_s);
        }
        if part >= 0.9 && self.nine_tenths_at_s.is_none() {
            self.nine_tenths_at_s = Some(passed_s);
        }
        if part > self.peak {
            self.peak = part;
        }
        self.inside = (part - 1.0).abs() <= self.tolerance;
        if !self.inside {
            self.outside_until_s = passed_s;
        }
        if passed_s >= 0.9 * self.duration_s {
            self.late_samples = self.late_samples.saturating_add(1);
            let weight = 1.0 / self.late_samples as f32;
            let error = finite(self.target - value);
            self.late_error = finite(self.late_error + weight * finite(error - self.late_error));
        }
    }

    /// Returns whether the time is over.
    #[must_use]
    pub const fn is_complete(&self) -> bool {
        self.passed.value() >= self.duration_s
    }

    /// Returns the seconds from 10 % to 90 % of the step so far; `None` while 90 % is not reached.
    #[must_use]
    pub fn rise_time_s(&self) -> Option<f32> {
        match (self.tenth_at_s, self.nine_tenths_at_s) {
            (Some(tenth), Some(nine_tenths)) => Some(nine_tenths - tenth),
            _ => None,
        }
    }

    /// Returns how far the value went past the target so far, as a part of the step: 0.2 is 20 %. Never negative.
    #[must_use]
    pub fn overshoot(&self) -> f32 {
        if self.peak > 1.0 { self.peak - 1.0 } else { 0.0 }
    }

    /// Returns the seconds after which the value stayed within the tolerance; `None` while the value is outside.
    #[must_use]
    pub const fn settling_time_s(&self) -> Option<f32> {
        if self.inside { Some(self.outside_until_s) } else { None }
    }

    /// Returns target minus value, averaged over the samples of the last tenth of the time, in units of the value; zero before
    /// the last tenth.
    #[must_use]
    pub const fn steady_error(&self) -> f32 {
        self.late_error
    }

    /// Returns the number of samples left out; stays at 65535.
    #[must_use]
    pub const fn rejected(&self) -> u16 {
        self.rejected
    }
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "exact results are the rule under test")]
mod tests {
    use super::*;
    use std::string::ToString;

    /// The step response of `w² / (s² + 2 z w s + w²)` with w = 10 rad/s, scaled.
    fn second_order(damping: f32, start: f32, target: f32) -> StepResponse {
        let mut response = StepResponse::new(start, target, 5.0, 0.02).unwrap();
        let (mut position, mut rate) = (0.0_f32, 0.0_f32);
        while !response.is_complete() {
            rate += (100.0 * (1.0 - position) - 20.0 * damping * rate) * 1e-4;
            position += rate * 1e-4;
            response.record(start + (target - start) * position, 1e-4);
        }
        response
    }

    #[test]
    fn overshoot_is_that_of_the_textbook_up_and_down() {
        // exp(-pi z / sqrt(1 - z²)): 16.3 % for z = 0.5.
        for (start, target) in [(0.0, 1.0), (3.0, -2.0)] {
            let measures = second_order(0.5, start, target);
            assert!((measures.overshoot() - 0.163).abs() < 0.003, "{measures:?}");
            assert!((measures.settling_time_s().unwrap() - 0.81).abs() < 0.03, "{measures:?}");
            assert!(measures.steady_error().abs() < 1e-3);
        }
        assert_eq!(second_order(1.0, 0.0, 1.0).overshoot(), 0.0);
    }

    #[test]
    fn a_loop_that_stays_short_neither_rises_nor_settles() {
        let mut response = StepResponse::new(0.0, 10.0, 1.0, 0.02).unwrap();
        for _ in 0..1001 {
            response.record(8.0, 0.001);
        }
        let measures = response;
        assert_eq!((measures.rise_time_s(), measures.settling_time_s()), (None, None));
        assert!(response.is_complete() && (measures.steady_error() - 2.0).abs() < 1e-6);
    }

    #[test]
    fn the_last_of_many_hours_ends_at_short_steps_too() {
        let mut response = StepResponse::new(0.0, 1.0, 20_000.0, 0.02).unwrap();
        response.passed = Sum::from(19_999.0);
        let mut samples = 0_u32;
        while !response.is_complete() && samples < 3_000 {
            response.record(1.0, 0.000_5);
            samples += 1;
        }
        assert!(samples.abs_diff(2_000) < 10, "{samples}");
    }

    #[test]
    fn bad_samples_are_left_out_and_counted() {
        let mut response = StepResponse::new(0.0, 1.0, 1.0, 0.02).unwrap();
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            response.record(bad, 0.001);
            response.record(1.0, bad);
        }
        response.record(1.0, 0.0);
        let untouched = StepResponse::new(0.0, 1.0, 1.0, 0.02).unwrap();
        assert_eq!((response.rejected(), StepResponse { rejected: 0, ..response }), (7, untouched));
    }

    #[test]
    fn an_invalid_step_response_is_named() {
        let none = StepResponse::new(1.0, 1.0, 1.0, 0.02).unwrap_err();
        assert_eq!(none.to_string(), "target: must differ from the start");
        assert_eq!(StepResponse::new(f32::NAN, 1.0, 1.0, 0.02).unwrap_err().parameter(), "target");
        assert_eq!(StepResponse::new(0.0, 1.0, 0.0, 0.02).unwrap_err().parameter(), "duration");
        assert_eq!(StepResponse::new(0.0, 1.0, 1.0, -1.0).unwrap_err().parameter(), "tolerance");
    }
}
