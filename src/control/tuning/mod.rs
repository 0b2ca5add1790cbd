//! Finding gains and judging them.
//!
//! 1. [`RelayTuner`] swings the plant between two output values and measures the response: [`RelayTuner::ultimate`].
//! 2. [`RelayTuner::pid`] calculates gains from the response by a [`TuningRule`] with a name and a source.
//! 3. [`StepResponse`] measures the loop with these gains.
//!
//! Where mass and wheels of a robot are known, [`WheelTuning`] reckons gains to begin with. Where the mechanism may be swung
//! through its range, an [`Identification`](crate::control::Identification) finds the plant, and with it gains of a stated margin.

mod relay;

pub use relay::{RelayTuner, TuningRule};

use crate::control::number::{Sum, finite};
use crate::control::pid::PidConfig;
use crate::error::{self, ConfigError, check, positive};
use crate::time::TimeStep;

/// A driven wheel of a robot, for the gains of its speed loop.
///
/// A wheel carries the inertia `J = mass_kg wheel_radius_m² / driven_wheels` of the robot driving straight ahead. With the
/// torque `k` at the shaft for 1 A, a PI loop over `J` crosses over at [`BANDWIDTH_RAD_PER_S`](Self::BANDWIDTH_RAD_PER_S)
/// `= w`, and is damped by [`DAMPING`](Self::DAMPING) `= d`:
///
/// ```text
/// kp = w J / k               in A per rad/s
/// ki = kp w / (4 d²)         in A per rad
/// ```
///
/// A step of the speed then overshoots by 5 %. `J` leaves out wheel, gearbox and rotor, whose inertia is seldom known. The
/// damping makes room for these: on three times the inertia a step overshoots by 12 % without friction, and by less with
/// friction.
///
/// A loop at 1 kHz acts about 3 ms after the measurement, at a cost of 3 degrees of phase at `w`. A lifted or slipping wheel
/// carries its own inertia alone, and the crossover rises by the ratio of both inertias. The loop stays stable up to a ratio
/// of 20: 400 rad/s and 69 degrees.
///
/// A [`RelayTuner`] measures the motor, and finds faster gains.
///
/// # Examples
/// A robot of 20 kg on four mecanum wheels, each on an M3508:
/// ```
/// use drivetrain::control::{PidConfig, WheelTuning};
///
/// const WHEEL: WheelTuning = WheelTuning {
///     mass_kg: 20.0,
///     wheel_radius_m: 0.076,
///     driven_wheels: 4.0,
///     torque_constant_nm_per_a: 0.3, // that of the model is in `dji::Facts`
///     current_limit_a: 10.0,
/// };
/// // In a constant, a bad parameter does not compile.
/// const SPEED: PidConfig = match WHEEL.speed_loop() {
///     Ok(speed) => speed,
///     Err(_) => panic!("not a wheel"),
/// };
/// let (kp, ki, kd) = SPEED.gains();
/// assert!((kp - 1.925).abs() < 1e-3); // 20 rad/s * 0.02888 kg m² / 0.3 Nm/A
/// assert!((ki - 2.407).abs() < 1e-3); // 1.925 A per rad/s * 20 rad/s / 16
/// assert_eq!((kd, SPEED.output_range()), (0.0, (-10.0, 10.0)));
///
/// let weightless = WheelTuning { mass_kg: 0.0, ..WHEEL };
/// assert_eq!(weightless.speed_loop().unwrap_err().to_string(), "mass_kg: must be more than zero, and finite");
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct WheelTuning {
    /// Mass of the whole robot in kg.
    pub mass_kg: f32,
    /// Radius of the wheels in m.
    pub wheel_radius_m: f32,
    /// Number of wheels that share the mass.
    ///
    /// Mecanum, steered and plain wheels with a motor count 1 each: 4.0 for a mecanum chassis, 2.0 for a differential drive. Omni
    /// wheels pull in one direction only and count one half each: 1.5 for three.
    pub driven_wheels: f32,
    /// Torque at the wheel, gearbox included, in Nm for each ampere.
    pub torque_constant_nm_per_a: f32,
    /// Largest current in A: the output limit of the loop.
    pub current_limit_a: f32,
}

impl WheelTuning {
    /// The angular frequency in rad/s of the loop's crossover: `w`.
    pub const BANDWIDTH_RAD_PER_S: f32 = 20.0;

    /// The damping ratio of the loop: `d`. A PI loop over an inertia overshoots by 13.5 % at 1, and by 4.8 % at 2.
    pub const DAMPING: f32 = 2.0;

    /// Returns the speed loop: rad/s of the wheel in, A out, with the current limit as its output limit.
    ///
    /// # Errors
    /// Names the first field that is not more than zero, or not finite; `kp` or `ki` if the gain lies outside of `f32`.
    pub const fn speed_loop(&self) -> Result<PidConfig, ConfigError> {
        check!(positive("mass_kg", self.mass_kg));
        check!(positive("wheel_radius_m", self.wheel_radius_m));
        check!(positive("driven_wheels", self.driven_wheels));
        check!(positive("torque_constant_nm_per_a", self.torque_constant_nm_per_a));
        check!(positive("current_limit_a", self.current_limit_a));
        let radius_m = self.wheel_radius_m;
        let inertia_kg_m2 = self.mass_kg * radius_m * radius_m / self.driven_wheels;
        let kp = Self::BANDWIDTH_RAD_PER_S * inertia_kg_m2 / self.torque_constant_nm_per_a;
        let ki = kp * Self::BANDWIDTH_RAD_PER_S / (4.0 * Self::DAMPING * Self::DAMPING);
        check!(positive("kp", kp));
        check!(positive("ki", ki));
        Ok(PidConfig::new(kp, ki, 0.0).with_output_limit(self.current_limit_a))
    }
}

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
    use crate::control::Pid;
    use crate::time::TimeStep;
    use std::string::ToString;

    const WHEEL: WheelTuning = WheelTuning {
        mass_kg: 20.0,
        wheel_radius_m: 0.076,
        driven_wheels: 4.0,
        torque_constant_nm_per_a: 0.3,
        current_limit_a: 20.0,
    };

    /// Steps the loop of `WHEEL` to 1 rad/s on an inertia of so many times its own, `late` milliseconds behind.
    fn highest(inertias: f32, late: usize) -> f32 {
        let inertia = inertias * WHEEL.mass_kg * WHEEL.wheel_radius_m.powi(2) / WHEEL.driven_wheels;
        let mut pid = Pid::new(WHEEL.speed_loop().unwrap()).unwrap();
        let step = TimeStep::of(0.001);
        let (mut speed, mut highest) = (0.0, 0.0_f32);
        let mut waiting = std::collections::VecDeque::from(std::vec![0.0; late]);
        for _ in 0..10_000 {
            waiting.push_back(pid.step(1.0, speed, &step));
            let amperes = waiting.pop_front().unwrap();
            speed += amperes * WHEEL.torque_constant_nm_per_a / inertia * 0.001;
            highest = highest.max(speed);
        }
        assert!((speed - 1.0).abs() < 0.01, "{inertias}, {late} ms: it ends at {speed}");
        highest
    }

    #[test]
    fn a_step_overshoots_as_the_damping_predicts_and_little_more_at_three_times_the_inertia() {
        for (inertias, expected) in [(1.0, 1.048), (3.0, 1.12), (0.5, 1.03)] {
            let highest = highest(inertias, 0);
            assert!((highest - expected).abs() < 0.01, "{inertias}: {highest}");
        }
    }

    #[test]
    fn a_loop_three_milliseconds_late_is_stable_on_a_twentieth_of_the_inertia() {
        // Another half of a millisecond is in the step itself.
        for inertias in [1.0, 0.2, 0.05] {
            assert!(highest(inertias, 3) < 2.0, "{inertias}");
        }
    }

    #[test]
    fn the_first_invalid_field_is_named() {
        for bad in [0.0, -1.0, f32::NAN, f32::INFINITY] {
            for (wheel, name) in [
                (WheelTuning { mass_kg: bad, ..WHEEL }, "mass_kg"),
                (WheelTuning { wheel_radius_m: bad, ..WHEEL }, "wheel_radius_m"),
                (WheelTuning { driven_wheels: bad, ..WHEEL }, "driven_wheels"),
                (
                    WheelTuning { torque_constant_nm_per_a: bad, ..WHEEL },
                    "torque_constant_nm_per_a",
                ),
                (WheelTuning { current_limit_a: bad, ..WHEEL }, "current_limit_a"),
            ] {
                let error = wheel.speed_loop().unwrap_err();
                assert_eq!(error, ConfigError::NotPositive(name));
            }
        }
        for wheel in [
            WheelTuning { wheel_radius_m: 1e-30, ..WHEEL },
            WheelTuning { wheel_radius_m: 1e30, ..WHEEL },
        ] {
            assert_eq!(wheel.speed_loop().unwrap_err().parameter(), "kp");
        }
    }

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
