//! The PID controller.

mod config;
mod law;

pub use config::PidConfig;

use crate::control::number::{finite, friction};
use crate::error::{ConfigError, check};
use crate::math::limited;
use config::{
    DERIVATIVE_ON_ERROR, INCREMENTAL, NOT_PLAIN, Parameters, REST_DERIVATIVE, TRACK_OUTPUT,
};

/// A PID controller, positional or incremental, with the options of its [`PidConfig`].
///
/// ```text
/// e = setpoint - measurement
/// output = kp e + ki integral(e dt) - kd d(measurement)/dt + kS sign(setpoint) + kV setpoint
/// ```
/// The integral is trapezoidal. Options apply in this order: circle, tracking, derivative filter, integral weights, dead band,
/// feed-forward, integral limit, sum, slew limit, output limits, anti-windup.
///
/// # Forms
/// Step by step, both forms are one law: the increments of the incremental form add up to the terms of the positional form.
/// The forms differ in the content of the memory, [`Pid::integral`]:
///
/// | | positional | [incremental](PidConfig::with_incremental_form) |
/// |---|---|---|
/// | memory | the integral of the error | the output, less P, D and feed-forward |
/// | `ki` is zero | the memory is zero | the memory stays |
/// | [`reset_to`](Self::reset_to) gives the output first | with `ki` above zero | always |
/// | new gains: the memory takes up the change of | P and feed-forward, if `ki` is above zero | P, D and feed-forward |
///
/// # Edge behaviour
/// * The first call gives P and feed-forward only, regardless of the age of the controller: there is no interval yet to
///   integrate or to differentiate over. [`step_error`](Self::step_error) gives D too: the rate is given.
/// * `dt_s` zero, negative, NaN or infinite: nothing changes, the last output is returned, [`rejected`](Self::rejected) grows.
/// * `dt_s` above the maximum of the [`TimeStep`](crate::time::TimeStep): the integral and D stay for this step, P and
///   feed-forward follow, a tracked setpoint moves on by the maximum, and [`rejected`](Self::rejected) grows, except in a first
///   call. A loop slower than 10 Hz has to set its longest step (`TimeStep::new(dt_s, 0.5)`): with the 0.1 s of
///   [`TimeStep::of`](crate::time::TimeStep::of) such a loop has no integral at 9.9 Hz, and half of it at 100.05 and 99.95 ms
///   in turn.
/// * NaN or infinity in any input: the last output is returned, [`rejected`](Self::rejected) grows, and the integral stays. D
///   rests in the next good step and keeps its value, since the travel of the missing time spans more than one step. D
///   rests too in the first step after steps with a [given error](Self::step_error): the last measurement is unknown.
/// * `ki` zero: the integral is zero and stays zero; the memory of the incremental form stays.
/// * Gains or inputs so large that `f32` overflows: the output is the limit (±`f32::MAX` without a limit), never NaN,
///   and every stored value stays finite.
/// * An increment of the integral smaller than half the spacing of `f32` at it (6e-8 of the integral) is lost: the integral
///   stands still where `ki |e| dt` is less than the half spacing. At an integral of 10, 1 kHz and `ki` = 1 the limit is an
///   error of 6e-4.
/// * At the threshold itself: an error of exactly the dead band's width counts in full, an error of exactly the integral's
///   separation is integrated, and the ends of the variable rate have the rates of the line between them.
///
/// # Examples
/// The gains are those of continuous time: one second of a constant error of 1 integrates to `ki` at any rate, and a
/// measurement growing by 1 a second gives a D of `-kd`.
/// ```
/// use drivetrain::control::{Pid, PidConfig};
/// use drivetrain::time::TimeStep;
///
/// for rate_hz in [100_u16, 1000] {
///     let dt_s = 1.0 / f32::from(rate_hz);
///     let step = TimeStep::of(dt_s);
///     let mut pid = Pid::new(PidConfig::new(0.0, 3.0, 0.0))?;
///     for _ in 0..=rate_hz {
///         pid.step(1.0, 0.0, &step);
///     }
///     assert!((pid.output() - 3.0).abs() < 1e-4); // ki times 1 s
///
///     let mut pid = Pid::new(PidConfig::new(0.0, 0.0, 0.2))?;
///     pid.step(0.0, 0.0, &step);
///     assert!((pid.step(0.0, dt_s, &step) + 0.2).abs() < 1e-6); // kd times 1/s
/// }
/// # Ok::<(), drivetrain::error::ConfigError>(())
/// ```
///
/// Takes 92 bytes on a Cortex-M4F (`docs/figures.md`).
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(C)]
pub struct Pid {
    // Beside the error and the rate of the core: a step stores all three by one instruction.
    pub(crate) measurement: f32,
    /// The part for errors that are formed elsewhere.
    pub(crate) core: ErrorPid,
    /// Half of the period; or the speed of tracking, negative.
    way: f32,
    /// The rate of the tracked setpoint.
    tracking_rate: f32,
    static_gain: f32,
    velocity_gain: f32,
}

const _: () = assert!(size_of::<Pid>() <= 92, "one for each motor of a bus");

impl Pid {
    /// Takes and checks the configuration.
    ///
    /// # Errors
    /// Names the parameter that is NaN, infinite, negative, zero where zero is invalid, or reversed.
    pub const fn new(config: PidConfig) -> Result<Self, ConfigError> {
        check!(config.validate());
        let mut pid = Self::of_error(ErrorPid {
            error: UNKNOWN,
            rate: 0.0,
            output: 0.0,
            integral: 0.0,
            integral_gate: CLOSED,
            output_gate: CLOSED,
            parameters: config.parameters,
            options: 0,
            rejected: 0,
        });
        pid.store(&config);
        Ok(pid)
    }

    /// Adds what a controller knows of its setpoint: nothing yet.
    const fn of_error(core: ErrorPid) -> Self {
        Self {
            measurement: UNKNOWN,
            core,
            way: 0.0,
            tracking_rate: 0.0,
            static_gain: 0.0,
            velocity_gain: 0.0,
        }
    }

    /// Forgets everything but the configuration and the count of rejected steps: the next call is a first call.
    pub const fn reset(&mut self) {
        self.interrupt();
        self.core.integral = 0.0;
        self.core.output = 0.0;
        self.core.options &= !TRACK_OUTPUT;
    }

    /// Keeps the integral, and forgets the values from which the next step would integrate, differentiate and track: for
    /// a gap in the measurements. The next step gives the output of a first step, and the integral as before.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::control::{Pid, PidConfig};
    /// use drivetrain::time::TimeStep;
    ///
    /// let mut pid = Pid::new(PidConfig::new(0.0, 1.0, 0.5))?;
    /// let step = TimeStep::of(0.001);
    /// for _ in 0..=1000 {
    ///     pid.step(1.0, 0.0, &step);
    /// }
    /// pid.interrupt();
    /// assert!((pid.step(1.0, 0.7, &step) - 1.0).abs() < 1e-3); // no kick of D for the step of 0.7
    /// # Ok::<(), drivetrain::error::ConfigError>(())
    /// ```
    pub const fn interrupt(&mut self) {
        self.measurement = UNKNOWN;
        self.tracking_rate = 0.0;
        self.core.error = UNKNOWN;
        self.core.rate = 0.0;
        self.core.set_options(self.core.options & !REST_DERIVATIVE);
    }

    /// Resets, and lets the first call return `output`, within the limits, for any error: to take over from another
    /// controller without a jump.
    ///
    /// The memory carries the difference to P, as far as its limit reaches. In the positional form with `ki` zero there is no
    /// memory, and `output` is only the start of a slew limit. NaN and infinity count as zero.
    pub const fn reset_to(&mut self, output: f32) {
        self.reset();
        let start = if output.is_finite() { output } else { 0.0 };
        self.core.output = self.core.within_output_range(start);
        self.core.options |= TRACK_OUTPUT;
    }

    /// Changes the gains without a jump of P: the memory takes up the difference.
    ///
    /// In the positional form, a new `kd` acts at once, in D, which passes: the integral would keep the change after the shaft
    /// has come to rest. With `ki` zero the integral is dropped, since nothing would ever drain it; then the output moves to P
    /// and D. In the incremental form nothing moves. If the output is at a limit and stays there, the memory takes up nothing.
    ///
    /// # Errors
    /// Names a gain that is NaN, infinite or negative; then nothing changes.
    pub fn set_gains(&mut self, kp: f32, ki: f32, kd: f32) -> Result<(), ConfigError> {
        self.set_config(self.config().with_gains(kp, ki, kd))
    }

    /// Changes the configuration without a jump of P and feed-forward, as [`set_gains`](Self::set_gains) does; new limits hold
    /// from the next step on.
    ///
    /// # Errors
    /// Names the parameter as [`new`](Self::new) does; then nothing changes.
    pub fn set_config(&mut self, config: PidConfig) -> Result<(), ConfigError> {
        config.validate()?;
        let sum = |pid: &Self, d| pid.proportional() + pid.integral() + d + pid.feed_forward();
        let before = self.derivative();
        let last = sum(self, before);
        let held = self.core.within_output_range(last);
        self.store(&config);
        let d = if config.incremental { self.derivative() } else { before };
        let change = finite(held - sum(self, d));
        // Towards the limit, the memory would be wound up.
        let change = if (last - held) * change < 0.0 { 0.0 } else { change };
        let limit = if self.core.has_memory() { config.integral_limit } else { 0.0 };
        self.core.integral = limited(self.core.integral + change, -limit, limit);
        Ok(())
    }

    /// Returns the proportional term of the last output: `kp` times the error; zero in the dead band.
    ///
    /// The sum of the four terms is the output, within its limits and its slew limit.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::control::{Pid, PidConfig};
    /// use drivetrain::time::TimeStep;
    ///
    /// let mut pid = Pid::new(PidConfig::new(2.0, 10.0, 0.0).with_feed_forward(0.0, 0.5))?;
    /// assert_eq!(pid.step(4.0, 3.0, &TimeStep::of(0.01)), 4.0); // the first step has no integral
    /// assert_eq!(pid.step(4.0, 3.0, &TimeStep::of(0.01)), 4.1);
    /// assert_eq!(pid.proportional(), 2.0); // 2 * 1
    /// assert!((pid.integral() - 0.1).abs() < 1e-6); // 10 * 1 * 0.01
    /// assert_eq!((pid.derivative(), pid.feed_forward()), (0.0, 2.0)); // 0.5 * 4
    /// # Ok::<(), drivetrain::error::ConfigError>(())
    /// ```
    #[must_use]
    pub fn proportional(&self) -> f32 {
        let (error, p) = (self.core.error, &self.core.parameters);
        if error != UNKNOWN && error.abs() >= p.dead_band { p.kp * error } else { 0.0 }
    }

    /// Returns the integral term of the last output, within its limit; the memory of the incremental form.
    ///
    /// Beyond the limits of the output, the term is the integral left by anti-windup for the next step.
    #[must_use]
    pub const fn integral(&self) -> f32 {
        self.core.integral
    }

    /// Returns the derivative term of the last output: `-kd` times the rate of the measurement, filtered if configured.
    #[must_use]
    pub fn derivative(&self) -> f32 {
        -(self.core.parameters.kd * self.core.rate)
    }

    /// Returns the feed-forward term of the last output: `kS sign(setpoint) + kV setpoint`; on a circle for the setpoint next to the
    /// measurement.
    #[must_use]
    pub fn feed_forward(&self) -> f32 {
        let is_measured = self.measurement != UNKNOWN;
        self.feed_forward_of(if is_measured { self.measurement + self.core.error } else { 0.0 })
    }

    /// Returns the last output; before the first call zero, or the value given to [`reset_to`](Self::reset_to).
    #[must_use]
    pub const fn output(&self) -> f32 {
        self.core.output
    }

    /// Returns the configuration.
    pub const fn config(&self) -> PidConfig {
        PidConfig {
            parameters: self.core.parameters,
            integral_limit: limit_of(self.core.integral_limit_gate()),
            static_gain: self.static_gain,
            velocity_gain: self.velocity_gain,
            period: if self.way > 0.0 { self.way + self.way } else { 0.0 },
            tracking_r: if self.way < 0.0 { -self.way } else { 0.0 },
            derivative_on_error: self.core.options & DERIVATIVE_ON_ERROR != 0,
            incremental: self.core.options & INCREMENTAL != 0,
        }
    }

    /// Returns the number of steps refused for their time or for a NaN or infinite input, and of steps too long to be
    /// integrated; stays at 65535.
    #[must_use]
    pub const fn rejected(&self) -> u16 {
        self.core.rejected
    }

    /// Returns the feed-forward, as far as [`feed_forward`](Self::feed_forward) knows the setpoint too: as `measurement + error`.
    const fn feed_forward_of(&self, setpoint: f32) -> f32 {
        self.velocity_gain * setpoint + friction(self.static_gain, setpoint)
    }

    pub(in crate::control) const fn rest_derivative(&mut self) {
        self.core.set_options(self.core.options | REST_DERIVATIVE);
    }

    /// Stores a validated configuration.
    const fn store(&mut self, config: &PidConfig) {
        self.way = 0.5 * config.period - config.tracking_r;
        (self.static_gain, self.velocity_gain) = (config.static_gain, config.velocity_gain);
        self.core.parameters = config.parameters;
        (self.core.integral_gate, self.core.output_gate) = (CLOSED, gate(config.integral_limit));
        let state = self.core.options & (REST_DERIVATIVE | TRACK_OUTPUT);
        self.core.set_options(config.options() | state);
    }
}

/// A controller whose error is formed elsewhere: the part of a [`Pid`] that knows neither setpoint nor measurement.
///
/// Options of the setpoint (feed-forward, period, tracking, derivative of the error) do not apply and need no storage.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
// What each step stores stands first, and what it reads next to it.
#[repr(C)]
pub(crate) struct ErrorPid {
    error: f32,
    rate: f32,
    output: f32,
    integral: f32,
    /// Of the integral; closed unless the controller is plain.
    integral_gate: u32,
    /// Of the output; equal to the gate of the integral unless the controller is plain.
    output_gate: u32,
    parameters: Parameters,
    options: u16,
    rejected: u16,
}

const _: () = assert!(size_of::<ErrorPid>() <= 72, "one for each motor of a bus");

impl ErrorPid {
    /// Makes a change, or a step with a given error, as the whole controller does.
    pub(crate) fn as_pid<T>(&mut self, change: impl FnOnce(&mut Pid) -> T) -> T {
        let mut whole = Pid::of_error(*self);
        let done = change(&mut whole);
        *self = whole.core;
        done
    }

    /// Tells whether the memory may hold a value.
    const fn has_memory(&self) -> bool {
        self.parameters.ki > 0.0 || self.options & INCREMENTAL != 0
    }

    /// Tells whether the plain law knows all options that are on: gains, integral limit, one output limit.
    pub(crate) const fn is_plain(&self) -> bool {
        self.options & NOT_PLAIN == 0
    }

    /// Tells whether the output has limits.
    pub(crate) const fn is_limited(&self) -> bool {
        self.parameters.output_upper < f32::MAX
    }

    /// Returns what the output limits leave of `value`.
    pub(in crate::control) const fn within_output_range(&self, value: f32) -> f32 {
        limited(value, self.parameters.output_lower, self.parameters.output_upper)
    }

    const fn integral_limit_gate(&self) -> u32 {
        if self.integral_gate != CLOSED { self.integral_gate } else { self.output_gate }
    }

    /// Opens the plain law, or closes it.
    const fn set_options(&mut self, options: u16) {
        let limit = self.integral_limit_gate();
        let is_plain = options & (NOT_PLAIN | REST_DERIVATIVE) == 0;
        self.integral_gate = if is_plain { limit } else { CLOSED };
        self.output_gate = if is_plain { gate(self.parameters.output_upper) } else { limit };
        self.options = options;
    }
}

/// Marks a stored error or measurement as unknown: arithmetic with it never passes a [`gate`].
const UNKNOWN: f32 = f32::INFINITY;

/// A gate passed by no value.
const CLOSED: u32 = 0;

/// Encodes a limit for one integer comparison: the value is within ±`limit`, and neither NaN nor infinite.
const fn gate(limit: f32) -> u32 {
    (limit.to_bits() << 1) + 1
}

/// Returns the limit encoded by a gate.
const fn limit_of(gate: u32) -> f32 {
    f32::from_bits(gate >> 1)
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "exact results are the rule under test")]
mod tests {
    use super::*;
    use crate::time::TimeStep;

    /// The terms of the last output.
    #[derive(Debug, Default, Clone, Copy, PartialEq)]
    pub(crate) struct Terms {
        pub(crate) p: f32,
        pub(crate) i: f32,
        pub(crate) d: f32,
        pub(crate) feed_forward: f32,
    }

    impl Pid {
        pub(crate) fn terms(&self) -> Terms {
            Terms {
                p: self.proportional(),
                i: self.integral(),
                d: self.derivative(),
                feed_forward: self.feed_forward(),
            }
        }
    }
    use proptest::prelude::*;

    const DT_S: f32 = 0.001;
    const BAD: [f32; 3] = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY];

    fn pid(config: PidConfig) -> Pid {
        Pid::new(config).unwrap()
    }

    fn with_core(mut pid: Pid, change: impl FnOnce(&mut ErrorPid)) -> Pid {
        change(&mut pid.core);
        pid
    }

    fn every_option() -> PidConfig {
        PidConfig::new(2.0, 10.0, 0.05)
            .with_output_range(-8.0, 10.0)
            .with_integral_limit(4.0)
            .with_integral_separation(100.0)
            .with_variable_integral(20.0, 80.0)
            .with_dead_band(0.01)
            .with_feed_forward(0.5, 0.01)
            .with_slew_limit(4000.0)
            .with_period(360.0)
            .with_derivative_filter(100.0)
            .with_back_calculation(0.05)
    }

    #[test]
    fn first_call_after_a_long_time_is_proportional_only() {
        for dt_s in [DT_S, 0.09, 10.0] {
            let mut pid = pid(PidConfig::new(2.0, 100.0, 100.0));
            assert_eq!(pid.step(3.0, 1.0, &TimeStep::of(dt_s)), 4.0);
            assert_eq!(pid.terms(), Terms { p: 4.0, ..Terms::default() });
        }
    }

    #[test]
    fn an_invalid_dt_holds_the_output_and_is_counted() {
        for config in [PidConfig::new(2.0, 10.0, 0.1), every_option()] {
            let mut pid = pid(config);
            pid.step(3.0, 1.0, &TimeStep::of(DT_S));
            pid.step(3.0, 1.1, &TimeStep::of(DT_S));
            let before = pid;
            for (refused, dt_s) in
                [0.0, -0.0, -DT_S, BAD[0], BAD[1], BAD[2]].into_iter().enumerate()
            {
                assert_eq!(pid.step(9.0, 2.0, &TimeStep::of(dt_s)), before.output());
                assert_eq!(usize::from(pid.rejected()), refused + 1);
                assert_eq!(with_core(pid, |core| core.rejected = 0), before);
            }
        }
    }

    #[test]
    fn a_dt_above_the_maximum_freezes_integral_and_derivative() {
        let mut pid = pid(PidConfig::new(2.0, 10.0, 0.01));
        pid.step(1.0, 0.0, &TimeStep::of(DT_S));
        pid.step(1.0, 0.001, &TimeStep::of(DT_S));
        let before = pid.terms();
        assert_eq!(pid.step(5.0, 0.0, &TimeStep::of(10.0)), 10.0 + before.i + before.d);
        assert_eq!(pid.terms(), Terms { p: 10.0, ..before });
        assert_eq!(pid.rejected(), 1);
        // The step after it works with its own interval only.
        pid.step(5.0, 0.0, &TimeStep::of(DT_S));
        assert_eq!(pid.terms().d, 0.0);
        assert!((pid.terms().i - before.i - 10.0 * 5.0 * DT_S).abs() < 1e-6);
    }

    /// A loop of 9.9 Hz had no integral, and nothing said so.
    #[test]
    fn a_loop_slower_than_its_longest_step_counts_the_steps_left_out() {
        for config in [
            PidConfig::new(0.0, 1.0, 0.0),
            every_option(),
            every_option().with_gains(1.0, 0.0, 0.0),
        ] {
            let (mut slow, mut jitters, mut configured) = (pid(config), pid(config), pid(config));
            for step in 0..=100_u16 {
                slow.step(1.0, 0.0, &TimeStep::of(0.101));
                jitters.step(
                    1.0,
                    0.0,
                    &TimeStep::of(if step % 2 == 0 { 0.099_95 } else { 0.100_05 }),
                );
                configured.step(1.0, 0.0, &TimeStep::new(0.101, 0.5));
            }
            assert_eq!((slow.rejected(), jitters.rejected(), configured.rejected()), (100, 50, 0));
            if config == PidConfig::new(0.0, 1.0, 0.0) {
                assert_eq!(slow.output(), 0.0);
                assert!((jitters.output() - 4.9975).abs() < 1e-3, "{}", jitters.output());
                assert!((configured.output() - 10.1).abs() < 1e-3, "{}", configured.output());
            }
        }
        // A given error too. A first step leaves nothing out, however long.
        let mut given = pid(PidConfig::new(1.0, 1.0, 1.0));
        given.step_error(1.0, 0.0, &TimeStep::of(10.0));
        assert_eq!(given.rejected(), 0);
        given.step_error(1.0, 0.0, &TimeStep::of(10.0));
        assert_eq!(given.rejected(), 1);
    }

    #[test]
    fn a_bad_sample_holds_the_output_and_leaves_no_trace_but_in_d() {
        for config in [
            PidConfig::new(2.0, 10.0, 0.0),
            PidConfig::new(0.0, 0.0, 0.0),
            every_option().with_gains(2.0, 10.0, 0.0),
        ] {
            for bad in BAD {
                let (mut clean, mut hit) = (pid(config), pid(config));
                for sample in 0..20_u8 {
                    let measurement = f32::from(sample) * 0.01;
                    let expected = clean.step(1.0, measurement, &TimeStep::of(DT_S));
                    let held = hit.output();
                    assert_eq!(hit.step(1.0, bad, &TimeStep::of(DT_S)), held);
                    assert_eq!(hit.step(bad, measurement, &TimeStep::of(DT_S)), held);
                    assert_eq!(hit.step(1.0, measurement, &TimeStep::of(DT_S)), expected);
                }
                assert_eq!(hit.rejected(), 40);
                assert_eq!(
                    with_core(hit, |core| (core.rejected, core.rate) = (0, clean.core.rate)),
                    clean
                );
            }
        }
    }

    #[test]
    fn a_burst_of_bad_samples_of_a_moving_shaft_does_not_kick() {
        let damper = PidConfig::new(0.0, 1.0, 0.05);
        for config in [
            damper,
            damper.with_derivative_on_error(),
            damper.with_derivative_filter(1e4),
            damper.with_period(360.0).with_slew_limit(1e9),
        ] {
            let mut pid = pid(config);
            let mut at = 0.0;
            for sample in 0..100_u8 {
                at += 10.0 * DT_S;
                let bad = (20..70).contains(&sample);
                pid.step(
                    0.0,
                    if bad { BAD[usize::from(sample) % 3] } else { at },
                    &TimeStep::of(DT_S),
                );
                assert!(sample < 19 || (pid.terms().d + 0.5).abs() < 0.01, "{:?}", pid.terms());
            }
            assert_eq!(pid.rejected(), 50);
            assert_eq!(pid.config(), config);
            let fresh = Pid::new(config).unwrap();
            assert_eq!(
                (pid.core.integral_gate, pid.core.output_gate),
                (fresh.core.integral_gate, fresh.core.output_gate)
            ); // back on the plain path
        }
    }

    #[test]
    fn a_bad_error_or_rate_holds_the_output_and_leaves_no_trace() {
        let step = TimeStep::new(DT_S, 0.1);
        let mut pid = pid(PidConfig::new(2.0, 10.0, 0.1));
        pid.step_error(1.0, 0.5, &step);
        let before = pid;
        for bad in BAD {
            assert_eq!(pid.step_error(bad, 0.0, &step), before.output());
            assert_eq!(pid.step_error(1.0, bad, &step), before.output());
        }
        assert_eq!(pid.step_error(1.0, 0.5, &TimeStep::new(0.0, 0.1)), before.output());
        assert_eq!((pid.rejected(), with_core(pid, |core| core.rejected = 0)), (7, before));
    }

    #[test]
    fn a_limit_that_is_zero_or_reversed_is_named() {
        let new = PidConfig::new(1.0, 1.0, 1.0);
        let cases = [
            (PidConfig::new(-1.0, 0.0, 0.0), ConfigError::Negative("kp")),
            (PidConfig::new(0.0, f32::NAN, 0.0), ConfigError::Negative("ki")),
            (PidConfig::new(0.0, 0.0, f32::INFINITY), ConfigError::Negative("kd")),
            (new.with_output_limit(0.0), ConfigError::NotPositive("output_limit")),
            (new.with_output_limit(-1.0), ConfigError::NotPositive("output_limit")),
            (new.with_output_limit(f32::NAN), ConfigError::NotPositive("output_limit")),
            (new.with_output_limit(f32::INFINITY), ConfigError::NotPositive("output_limit")),
            (new.with_output_range(1.0, f32::NAN), ConfigError::Reversed("output_range")),
            (new.with_output_range(2.0, 1.0), ConfigError::Reversed("output_range")),
            (new.with_integral_limit(0.0), ConfigError::NotPositive("integral_limit")),
            (new.with_integral_separation(-1.0), ConfigError::NotPositive("integral_separation")),
            (new.with_variable_integral(2.0, 1.0), ConfigError::Reversed("variable_integral")),
            (new.with_variable_integral(-1.0, 1.0), ConfigError::Negative("variable_integral")),
            (new.with_variable_integral(1.0, f32::NAN), ConfigError::Reversed("variable_integral")),
            (new.with_back_calculation(0.0), ConfigError::NotPositive("back_calculation")),
            (new.with_back_calculation(f32::NAN), ConfigError::NotPositive("back_calculation")),
            (new.with_dead_band(-1.0), ConfigError::Negative("dead_band")),
            (new.with_feed_forward(-1.0, 0.0), ConfigError::Negative("static_gain")),
            (new.with_feed_forward(0.0, f32::NAN), ConfigError::Negative("velocity_gain")),
            (new.with_slew_limit(0.0), ConfigError::NotPositive("slew_limit")),
            (new.with_period(0.0), ConfigError::NotPositive("period")),
            (new.with_period(-360.0), ConfigError::NotPositive("period")),
            (new.with_period(f32::INFINITY), ConfigError::NotPositive("period")),
            (new.with_derivative_filter(0.0), ConfigError::NotPositive("derivative_filter")),
            (new.with_derivative_filter(-5.0), ConfigError::NotPositive("derivative_filter")),
            (new.with_derivative_filter(BAD[0]), ConfigError::NotPositive("derivative_filter")),
            (new.with_derivative_filter(BAD[1]), ConfigError::NotPositive("derivative_filter")),
            (new.with_back_calculation(BAD[1]), ConfigError::NotPositive("back_calculation")),
            (new.with_period(1e-40), ConfigError::NotPositive("period")),
        ];
        for (config, error) in cases {
            assert_eq!(Pid::new(config), Err(error));
            let mut running = pid(new);
            assert!(running.set_config(config).is_err());
            assert_eq!(running, pid(new));
        }
        assert!(Pid::new(every_option()).is_ok());
    }

    #[test]
    fn without_ki_the_integral_is_zero_and_stays_zero() {
        let mut pid = pid(PidConfig::new(1.0, 0.0, 0.0).with_output_limit(5.0));
        for _ in 0..1000 {
            pid.step(100.0, 0.0, &TimeStep::of(DT_S));
        }
        assert_eq!((pid.terms().i, pid.step(0.0, 0.0, &TimeStep::of(DT_S))), (0.0, 0.0));
    }

    #[test]
    fn without_ki_back_calculation_has_nothing_to_drain() {
        let config =
            PidConfig::new(1.0, 0.0, 0.0).with_output_limit(5.0).with_back_calculation(0.1);
        for config in [config, config.with_slew_limit(1e6)] {
            let mut pid = pid(config);
            for _ in 0..1000 {
                pid.step(100.0, 0.0, &TimeStep::of(DT_S));
            }
            assert_eq!((pid.terms().i, pid.step(1.0, 0.0, &TimeStep::of(DT_S))), (0.0, 1.0));
        }
    }

    #[test]
    fn huge_gains_end_at_the_limit_and_never_in_nan() {
        let huge = PidConfig::new(1e30, 1e30, 1e30);
        for config in [
            huge.with_output_limit(20.0),
            huge,
            huge.with_period(1e30),
            huge.with_derivative_filter(1.0),
        ] {
            let mut pid = pid(config);
            for measurement in [0.0, 1e30, -1e30, f32::MAX, f32::MIN, 3.0, f32::MIN_POSITIVE] {
                for setpoint in [1.0, f32::MAX, f32::MIN] {
                    let output = pid.step(setpoint, measurement, &TimeStep::of(1e-6));
                    assert!(
                        output.abs() <= config.parameters.output_upper
                            && pid.core.integral.is_finite()
                    );
                    assert!(pid.core.rate.is_finite() && pid.core.error.is_finite());
                }
            }
            assert_eq!(pid.rejected(), 0);
        }
    }

    #[test]
    fn positive_kd_damps_in_every_entry_point() {
        for config in [
            PidConfig::new(0.0, 0.0, 0.5),
            PidConfig::new(0.0, 0.0, 0.5).with_derivative_on_error(),
        ] {
            for direction in [1.0, -1.0] {
                let mut pid = pid(config);
                let step = TimeStep::new(DT_S, 0.1);
                pid.step(0.0, 0.0, &TimeStep::of(DT_S));
                assert!(pid.step(0.0, direction * 0.1, &TimeStep::of(DT_S)) * direction < 0.0);
                assert!(pid.step(0.0, direction * 0.2, &step) * direction < 0.0);
                assert!(pid.step_error(0.0, direction * 3.0, &step) * direction < 0.0);
            }
        }
    }

    #[test]
    fn derivative_on_measurement_ignores_the_setpoint_and_on_error_answers_it() {
        let config = PidConfig::new(0.0, 0.0, 1.0);
        let (mut quiet, mut kicked) = (pid(config), pid(config.with_derivative_on_error()));
        quiet.step(0.0, 0.0, &TimeStep::of(DT_S));
        kicked.step(0.0, 0.0, &TimeStep::of(DT_S));
        assert_eq!(quiet.step(1.0, 0.0, &TimeStep::of(DT_S)), 0.0);
        assert!((kicked.step(1.0, 0.0, &TimeStep::of(DT_S)) - 1000.0).abs() < 0.01);
    }

    #[test]
    fn integral_separation_off_means_integral_on() {
        let mut pid = pid(PidConfig::new(0.0, 10.0, 0.0));
        pid.step(1000.0, 0.0, &TimeStep::of(DT_S));
        pid.step(1000.0, 0.0, &TimeStep::of(DT_S));
        assert!((pid.terms().i - 10.0).abs() < 1e-5);
    }

    #[test]
    fn integral_separation_rests_beyond_the_threshold_in_both_directions() {
        let mut pid = pid(PidConfig::new(0.0, 10.0, 0.0).with_integral_separation(5.0));
        for far in [6.0, -6.0] {
            pid.step(far, 0.0, &TimeStep::of(DT_S));
            pid.step(far, 0.0, &TimeStep::of(DT_S));
            assert_eq!(pid.terms().i, 0.0);
        }
        pid.step(5.0, 0.0, &TimeStep::of(DT_S));
        pid.step(5.0, 0.0, &TimeStep::of(DT_S));
        assert!(pid.terms().i > 0.0);
    }

    #[test]
    fn separation_holds_within_the_full_rate_of_a_variable_integral_too() {
        for (error, rests) in [(4.0, false), (5.0, false), (6.0, true), (15.0, true), (30.0, true)]
        {
            for error in [error, -error] {
                let variable = PidConfig::new(0.0, 10.0, 0.0).with_variable_integral(10.0, 20.0);
                let mut pid = pid(variable.with_integral_separation(5.0));
                pid.step(error, 0.0, &TimeStep::of(DT_S));
                pid.step(error, 0.0, &TimeStep::of(DT_S));
                assert_eq!(pid.terms().i == 0.0, rests, "{error}");
            }
        }
    }

    #[test]
    fn variable_integral_works_at_half_rate_half_way() {
        for (error, part) in [(10.0, 1.0), (15.0, 0.5), (-15.0, 0.5), (20.0, 0.0), (30.0, 0.0)] {
            let mut pid = pid(PidConfig::new(0.0, 1.0, 0.0).with_variable_integral(10.0, 20.0));
            pid.step(error, 0.0, &TimeStep::of(DT_S));
            pid.step(error, 0.0, &TimeStep::of(DT_S));
            assert!((pid.terms().i - part * error * DT_S).abs() < 1e-8, "{error}");
        }
    }

    #[test]
    fn dead_band_does_not_freeze_a_wound_up_integral() {
        for direction in [1.0, -1.0] {
            let mut pid = pid(PidConfig::new(0.0, 100.0, 0.0).with_dead_band(1.0));
            for _ in 0..100 {
                pid.step(direction * 5.0, 0.0, &TimeStep::of(DT_S));
            }
            let wound_up = pid.terms().i.abs();
            // Past the target but inside the band: the integral goes back ...
            for _ in 0..100 {
                pid.step(direction * -0.9, 0.0, &TimeStep::of(DT_S));
            }
            assert!(pid.terms().i.abs() < wound_up - 5.0);
            // ... and short of it, inside the band, the integral does not grow.
            let before = pid.terms().i;
            pid.step(direction * 0.9, 0.0, &TimeStep::of(DT_S));
            pid.step(direction * 0.9, 0.0, &TimeStep::of(DT_S));
            assert_eq!(pid.terms().i, before);
        }
    }

    #[test]
    fn dead_band_takes_p_to_zero() {
        let mut pid = pid(PidConfig::new(10.0, 0.0, 0.0).with_dead_band(1.0));
        assert_eq!(pid.step(0.99, 0.0, &TimeStep::of(DT_S)), 0.0);
        assert_eq!(pid.terms().p, 0.0);
        assert_eq!(pid.step(-1.5, 0.0, &TimeStep::of(DT_S)), -15.0);
    }

    #[test]
    fn an_error_at_the_very_edge_of_a_threshold() {
        let below = f32::from_bits(1.0_f32.to_bits() - 1);
        let above = f32::from_bits(1.0_f32.to_bits() + 1);
        let p = |error| {
            pid(PidConfig::new(10.0, 0.0, 0.0).with_dead_band(1.0)).step(
                error,
                0.0,
                &TimeStep::of(DT_S),
            )
        };
        assert_eq!((p(below), p(-below)), (0.0, 0.0));
        assert_eq!((p(1.0), p(-1.0)), (10.0, -10.0)); // the edge itself counts in full
        let integral = |config: PidConfig, error| {
            let mut pid = pid(config);
            pid.step(error, 0.0, &TimeStep::of(DT_S));
            pid.step(error, 0.0, &TimeStep::of(DT_S));
            pid.terms().i
        };
        let only_i = PidConfig::new(0.0, 1.0, 0.0);
        for sign in [1.0, -1.0] {
            let in_band = only_i.with_dead_band(1.0);
            assert_eq!(integral(in_band, sign * below), 0.0);
            assert_eq!(integral(in_band, sign), sign * DT_S);
            let separated = only_i.with_integral_separation(1.0);
            assert_eq!(
                (integral(separated, sign), integral(separated, sign * above)),
                (sign * DT_S, 0.0)
            );
            let variable = only_i.with_variable_integral(1.0, 2.0);
            assert_eq!(
                (integral(variable, sign), integral(variable, sign * 2.0)),
                (sign * DT_S, 0.0)
            );
        }
    }

    #[test]
    fn an_increment_below_half_a_spacing_is_lost_and_a_larger_increment_is_kept() {
        // At 10, the spacing is 9.5e-7; with ki = 1 at 1 kHz, half of it is an error of 4.8e-4.
        for (error, moves) in [(4.7e-4, false), (4.9e-4, true)] {
            let mut pid = pid(PidConfig::new(0.0, 1.0, 0.0));
            pid.reset_to(10.0);
            for _ in 0..1_000 {
                pid.step(error, 0.0, &TimeStep::of(DT_S));
            }
            assert_eq!(pid.terms().i > 10.0, moves, "{error}");
        }
    }

    #[test]
    fn by_error_d_is_there_from_the_first_call_on_and_after_a_reset() {
        let step = TimeStep::of(DT_S);
        let config = PidConfig::new(2.0, 5.0, 0.5);
        for config in [config, config.with_slew_limit(1e9)] {
            let mut pid = pid(config);
            let first = Terms { p: 2.0, d: -1.5, ..Terms::default() };
            pid.step_error(1.0, 3.0, &step);
            assert_eq!(pid.terms(), first);
            pid.reset();
            pid.step_error(1.0, 3.0, &step);
            assert_eq!(pid.terms(), first);
            pid.interrupt();
            pid.step_error(1.0, 3.0, &step);
            assert_eq!(pid.terms(), first);
            // From a measurement, there is nothing yet to differentiate over.
            pid.reset();
            pid.step(1.0, 0.0, &step);
            assert_eq!(pid.terms(), Terms { p: 2.0, ..Terms::default() });
        }
    }

    #[test]
    fn circular_goes_the_short_way_in_both_directions() {
        let circle = PidConfig::new(1.0, 0.0, 0.0).with_period(360.0);
        assert_eq!(pid(circle).step(10.0, 350.0, &TimeStep::of(DT_S)), 20.0);
        assert_eq!(pid(circle).step(350.0, 10.0, &TimeStep::of(DT_S)), -20.0);
    }

    #[test]
    fn circular_derivative_has_no_spike_at_the_wrap() {
        let damper = PidConfig::new(0.0, 0.0, 1.0).with_period(360.0);
        for config in [damper, damper.with_derivative_on_error()] {
            let mut pid = pid(config);
            pid.step(0.0, 359.5, &TimeStep::of(DT_S));
            assert!((pid.step(0.0, 0.5, &TimeStep::of(DT_S)) + 1000.0).abs() < 0.1);
            assert!((pid.step(0.0, 359.5, &TimeStep::of(DT_S)) - 1000.0).abs() < 0.1);
        }
    }

    #[test]
    fn feed_forward_is_static_and_proportional_to_the_setpoint() {
        let config = PidConfig::new(0.0, 0.0, 0.0).with_feed_forward(0.5, 0.1);
        assert_eq!(pid(config).step(10.0, 3.0, &TimeStep::of(DT_S)), 1.5);
        assert_eq!(pid(config).step(-10.0, 3.0, &TimeStep::of(DT_S)), -1.5);
        assert_eq!(pid(config).step(0.0, 3.0, &TimeStep::of(DT_S)), 0.0);
    }

    #[test]
    fn feed_forward_on_a_circle_takes_over_and_changes_without_a_jump() {
        let config = PidConfig::new(1.0, 1.0, 0.0).with_period(360.0).with_feed_forward(0.5, 0.1);
        let mut pid = pid(config);
        pid.reset_to(7.0);
        assert!((pid.step(10.0, 350.0, &TimeStep::of(DT_S)) - 7.0).abs() < 1e-4);
        assert_eq!(pid.terms().feed_forward, 37.5); // for 370, the 10 next to 350
        pid.set_config(config.with_feed_forward(0.5, 0.0)).unwrap();
        assert!((pid.step(10.0, 350.0, &TimeStep::of(DT_S)) - 7.0).abs() < 0.03);
    }

    #[test]
    fn feed_forward_that_is_too_small_to_see_is_not_in_the_terms_either() {
        let mut pid = pid(PidConfig::new(1.0, 0.0, 0.0).with_feed_forward(0.5, 0.0));
        let output = pid.step(1e-6, 100.0, &TimeStep::of(DT_S));
        assert_eq!(pid.terms().p + pid.terms().feed_forward, output);
    }

    #[test]
    fn slew_limit_holds_up_and_down_and_from_the_start() {
        let mut pid = pid(PidConfig::new(1.0, 0.0, 0.0).with_slew_limit(1000.0));
        assert_eq!(pid.step(5.0, 0.0, &TimeStep::of(DT_S)), 1.0);
        assert_eq!(pid.step(5.0, 0.0, &TimeStep::of(DT_S)), 2.0);
        assert_eq!(pid.step(-5.0, 0.0, &TimeStep::of(DT_S)), 1.0);
    }

    #[test]
    fn a_slew_limit_of_less_than_half_a_spacing_a_step_stands_still() {
        // At 100, the spacing is 7.6e-6: half of it a step of 1 ms is 3.8e-3 a second.
        for (per_s, moves) in [(3.7e-3, false), (4e-3, true)] {
            let mut pid = pid(PidConfig::new(1.0, 0.0, 0.0).with_slew_limit(per_s));
            pid.reset_to(100.0);
            for _ in 0..1_000 {
                pid.step(200.0, 0.0, &TimeStep::of(DT_S));
            }
            assert_eq!(pid.output() > 100.0, moves, "{per_s}");
        }
    }

    #[test]
    fn derivative_filter_reaches_63_percent_after_its_time_constant() {
        let cutoff_hz = 1.0 / (core::f32::consts::TAU * 0.1); // 0.1 s
        let mut pid = pid(PidConfig::new(0.0, 0.0, 1.0).with_derivative_filter(cutoff_hz));
        for sample in 0..=100_u8 {
            pid.step(0.0, f32::from(sample) * DT_S, &TimeStep::of(DT_S));
        }
        assert!((pid.output() + 0.632).abs() < 0.005, "{}", pid.output());
    }

    #[test]
    fn conditional_integration_leaves_the_limit_at_once() {
        let config = PidConfig::new(1.0, 100.0, 0.0).with_output_limit(10.0);
        let (mut guarded, mut winding) = (pid(config), pid(config.without_anti_windup()));
        for _ in 0..1000 {
            guarded.step(9.0, 0.0, &TimeStep::of(DT_S));
            winding.step(9.0, 0.0, &TimeStep::of(DT_S));
        }
        assert_eq!((guarded.output(), winding.output()), (10.0, 10.0));
        assert!(guarded.terms().i <= 2.0 && winding.terms().i > 500.0);
        assert!(guarded.step(-1.0, 0.0, &TimeStep::of(DT_S)) < 1.0);
    }

    #[test]
    fn back_calculation_drains_the_part_cut_off_by_the_limit() {
        let config =
            PidConfig::new(1.0, 100.0, 0.0).with_output_limit(10.0).with_back_calculation(0.01);
        let mut pid = pid(config);
        for _ in 0..1000 {
            pid.step(9.0, 0.0, &TimeStep::of(DT_S));
        }
        // In balance, the inflow ki e equals the outflow excess / Tt: excess = 100 * 9 * 0.01 = 9.
        assert!((pid.terms().p + pid.terms().i - 10.0 - 9.0).abs() < 1.5, "{:?}", pid.terms());
    }

    #[test]
    fn reset_forgets_all_but_the_configuration() {
        let tracking = PidConfig { period: 0.0, ..every_option() }.with_tracking(50.0);
        for config in [every_option(), tracking, tracking.with_incremental_form()] {
            let mut pid = pid(config);
            for sample in 0..10_u8 {
                pid.step(50.0, f32::from(sample), &TimeStep::of(DT_S));
            }
            pid.reset();
            assert_eq!(pid, Pid::new(config).unwrap());
        }
    }

    #[test]
    fn reset_to_takes_over_without_a_jump() {
        let config = PidConfig::new(2.0, 10.0, 0.5).with_output_limit(10.0);
        let mut pid = pid(config);
        pid.reset_to(7.0);
        assert_eq!(pid.output(), 7.0);
        assert!((pid.step(100.0, 99.0, &TimeStep::of(DT_S)) - 7.0).abs() < 1e-5);
        assert!((pid.step(100.0, 99.0, &TimeStep::of(DT_S)) - 7.01).abs() < 1e-4);
        pid.reset_to(70.0);
        assert_eq!(pid.step(0.0, 0.0, &TimeStep::of(DT_S)), 10.0);
        pid.reset_to(f32::NAN);
        assert_eq!(pid.output(), 0.0);
    }

    #[test]
    fn new_gains_do_not_move_the_output() {
        for config in [PidConfig::new(2.0, 10.0, 0.02), every_option().with_slew_limit(1e9)] {
            let mut pid = pid(config);
            for sample in 0..10_u8 {
                pid.step(1.0, f32::from(sample) * 0.001, &TimeStep::of(DT_S));
            }
            let (before, terms) = (pid.output(), pid.terms());
            let kd = pid.config().gains().2;
            pid.set_gains(3.0, 5.0, kd).unwrap();
            let now = pid.terms();
            assert!(
                (now.p + now.i + now.d + now.feed_forward - before).abs() < 1e-4,
                "{terms:?} {now:?}"
            );
            assert!((pid.step(1.0, 0.010, &TimeStep::of(DT_S)) - before).abs() < 0.02);
        }
    }

    #[test]
    fn a_new_kd_is_not_kept_by_the_integral() {
        let mut pid = pid(PidConfig::new(1.0, 1.0, 0.0));
        for sample in 0..100_u8 {
            pid.step(0.99, f32::from(sample) * 0.01, &TimeStep::of(DT_S));
        }
        let integral = pid.terms().i;
        pid.set_gains(1.0, 1.0, 0.5).unwrap();
        pid.step(0.99, 0.99, &TimeStep::of(DT_S));
        assert!((pid.step(0.99, 0.99, &TimeStep::of(DT_S)) - integral).abs() < 1e-6); // at rest, on target
    }

    #[test]
    fn a_new_configuration_does_not_move_the_output_even_from_the_plain_path() {
        let config = PidConfig::new(2.0, 10.0, 0.02).with_output_limit(10.0);
        let mut pid = pid(config);
        pid.step(1.0, 0.1, &TimeStep::of(DT_S));
        let before = pid.step(1.0, 0.1, &TimeStep::of(DT_S));
        pid.set_config(config.with_feed_forward(0.5, 0.2)).unwrap();
        assert!((pid.step(1.0, 0.1, &TimeStep::of(DT_S)) - before).abs() < 0.02);
    }

    #[test]
    fn dropping_the_integral_gain_drops_the_integral() {
        let mut pid = pid(PidConfig::new(1.0, 10.0, 0.0));
        pid.step(1.0, 0.0, &TimeStep::of(DT_S));
        pid.step(1.0, 0.0, &TimeStep::of(DT_S));
        pid.set_gains(1.0, 0.0, 0.0).unwrap();
        assert_eq!(pid.step(1.0, 0.0, &TimeStep::of(DT_S)), 1.0);
        assert!(pid.set_gains(1.0, -1.0, 0.0).is_err_and(|error| error.parameter() == "ki"));
    }

    fn any_value() -> impl Strategy<Value = f32> {
        prop_oneof![
            -100.0_f32..100.0,
            any::<f32>().prop_filter("finite", |value| value.is_finite())
        ]
    }

    fn any_config() -> impl Strategy<Value = PidConfig> {
        let gains = (0.0_f32..1e3, 0.0_f32..1e3, 0.0_f32..10.0);
        let limits = (-50.0_f32..0.0, 0.1_f32..50.0, 0.1_f32..50.0);
        (gains, limits, 0_u16..4096).prop_map(
            |((kp, ki, kd), (lower, upper, integral), options)| {
                let mut config = PidConfig::new(kp, ki, kd)
                    .with_output_range(lower, upper)
                    .with_integral_limit(integral);
                let on = |bit: u16| options >> bit & 1 == 1;
                if on(0) {
                    config = config.with_output_limit(upper);
                }
                if on(1) {
                    config = config.with_integral_separation(30.0);
                }
                if on(2) {
                    config = config.with_variable_integral(10.0, 40.0);
                }
                if on(3) {
                    config = config.with_dead_band(1.0);
                }
                if on(4) {
                    config = config.with_feed_forward(1.0, 0.1);
                }
                if on(5) {
                    config = config.with_slew_limit(500.0);
                }
                if on(6) {
                    config = config.with_period(360.0);
                }
                if on(7) {
                    config = config.with_derivative_filter(50.0);
                }
                if on(8) {
                    config = config.with_back_calculation(0.01);
                }
                if on(9) {
                    config = config.with_derivative_on_error();
                }
                if on(10) {
                    config = config.with_incremental_form();
                }
                if on(11) && !on(6) {
                    config = config.with_tracking(200.0);
                }
                config
            },
        )
    }

    proptest! {
        #[test]
        fn the_configuration_is_returned_unchanged(
            config in any_config(), separation in 0.1_f32..100.0, edges in (0.0_f32..40.0, 41.0_f32..100.0),
        ) {
            let rates = config.with_integral_separation(separation).with_variable_integral(edges.0, edges.1);
            let tracking = PidConfig { period: 0.0, ..config }.with_tracking(separation).with_incremental_form();
            for config in [config, rates, rates.without_anti_windup(), tracking] {
                prop_assert_eq!(pid(config).config(), config);
            }
        }

        #[test]
        fn output_and_integral_are_within_limits_for_any_finite_input(
            config in any_config(),
            samples in prop::collection::vec((any_value(), any_value(), 0.0_f32..0.2), 1..40),
        ) {
            let mut pid = pid(config);
            for (setpoint, measurement, dt_s) in samples {
                let output = pid.step(setpoint, measurement, &TimeStep::of(dt_s));
                // Before the first good sample the output is zero.
                prop_assert!(output == 0.0 || (config.parameters.output_lower..=config.parameters.output_upper).contains(&output));
                prop_assert!(pid.terms().i.abs() <= config.integral_limit);
            }
        }

        #[test]
        fn within_the_limits_the_terms_add_up_to_the_output(
            config in any_config(),
            samples in prop::collection::vec((-360.0_f32..720.0, -360.0_f32..720.0), 1..40),
        ) {
            let mut pid = pid(config);
            for (setpoint, measurement) in samples {
                let output = pid.step(setpoint, measurement, &TimeStep::of(DT_S));
                let Terms { p, i, d, feed_forward } = pid.terms();
                let sum = p + i + d + feed_forward;
                let (lower, upper) = config.output_range();
                let free = lower < output && output < upper && config.parameters.slew_per_s == PidConfig::OFF;
                let largest = p.abs().max(d.abs()).max(feed_forward.abs()).max(1.0);
                prop_assert!(!free || (sum - output).abs() < 1e-5 * largest, "{} {}", sum, output);
            }
        }

        #[test]
        fn a_reset_to_an_output_gives_that_output_first(
            config in any_config(),
            output in -50.0_f32..50.0,
            sample in (-360.0_f32..720.0, -360.0_f32..720.0),
        ) {
            let config = PidConfig { integral_limit: PidConfig::OFF, ..config };
            let (kp, ki, kd) = config.gains();
            let config = config.with_gains(kp, ki + 0.1, kd);
            let mut pid = pid(config);
            pid.reset_to(output);
            let expected = pid.output();
            let first = pid.step(sample.0, sample.1, &TimeStep::of(DT_S));
            let largest = pid.terms().p.abs().max(pid.terms().feed_forward.abs()).max(expected.abs()).max(1.0);
            prop_assert!((first - expected).abs() <= 1e-6 * largest, "{} {}", first, expected);
        }

        #[test]
        fn damping_never_feeds_energy_in(
            gains in (0.0_f32..100.0, 0.0_f32..100.0, 0.001_f32..10.0), on_error in prop::bool::ANY,
            setpoint in any_value(), path in prop::collection::vec((any_value(), 1_u16..1000), 2..50),
        ) {
            let config = PidConfig::new(gains.0, gains.1, gains.2);
            let mut pid = pid(if on_error { config.with_derivative_on_error() } else { config });
            let mut last = None;
            for (measurement, steps) in path {
                pid.step(setpoint, measurement, &TimeStep::of(f32::from(steps) * 1e-4));
                if let Some(last) = last {
                    let work = f64::from(pid.terms().d) * (f64::from(measurement) - f64::from(last));
                    prop_assert!(work <= 0.0, "{work}"); // in each step, so in their sum too
                }
                last = Some(measurement);
            }
        }

        #[test]
        fn damping_by_a_given_rate_never_feeds_energy_in(
            kd in 0.001_f32..10.0, path in prop::collection::vec((any_value(), any_value()), 1..50),
        ) {
            let mut pid = pid(PidConfig::new(1.0, 1.0, kd));
            for (error, rate) in path {
                pid.step_error(error, rate, &TimeStep::of(DT_S));
                prop_assert!(pid.terms().d * rate <= 0.0);
            }
        }

        #[test]
        fn whole_periods_change_nothing(
            config in any_config(), period in prop::sample::select(&[360.0_f32, 8192.0, 7.5, 1.0]),
            samples in prop::collection::vec((0_u16..5760, 0_u16..5760, -50_i8..50, -50_i8..50), 1..30),
        ) {
            // Feed-forward is for the setpoint next to the measurement, and changes with the turns
            // of the measurement. Sixteenths are exact in f32.
            let config = PidConfig { tracking_r: 0.0, ..config.with_period(period) };
            let turning = config.static_gain == 0.0 && config.velocity_gain == 0.0;
            let (mut here, mut turned) = (pid(config), pid(config));
            for (setpoint, measurement, turns, others) in samples {
                let others = if turning { others } else { 0 };
                let (setpoint, measurement) = (f32::from(setpoint) / 16.0, f32::from(measurement) / 16.0);
                let expected = here.step(setpoint, measurement, &TimeStep::of(DT_S));
                let shifted = turned.step(
                    setpoint + period * f32::from(turns),
                    measurement + period * f32::from(others),
                    &TimeStep::of(DT_S));
                prop_assert_eq!(shifted, expected);
            }
        }

        #[test]
        fn the_plain_path_and_the_careful_one_agree(
            config in any_config(),
            samples in prop::collection::vec((-50.0_f32..50.0, -50.0_f32..50.0), 1..30),
        ) {
            let plain = PidConfig::new(config.parameters.kp, config.parameters.ki, config.parameters.kd).with_output_limit(1e6);
            let (mut fast, mut slow) = (pid(plain), pid(plain.with_slew_limit(1e12)));
            for (setpoint, measurement) in samples {
                let (fast, slow) = (fast.step(setpoint, measurement, &TimeStep::of(DT_S)), slow.step(setpoint, measurement, &TimeStep::of(DT_S)));
                prop_assert!((fast - slow).abs() <= 1e-5 * fast.abs().max(1e3) || fast.abs() >= 1e6);
            }
        }

        #[test]
        fn at_the_limit_a_plain_controller_equals_a_controller_with_options(
            gains in (0.0_f32..10.0, 0.0_f32..100.0, 0.0_f32..0.01),
            windup in 0_u8..3,
            samples in prop::collection::vec((-50.0_f32..50.0, -50.0_f32..50.0), 2..60),
        ) {
            let limited = PidConfig::new(gains.0, gains.1, gains.2)
                .with_output_limit(10.0)
                .with_integral_limit(8.0);
            let limited = match windup {
                0 => limited,
                1 => limited.without_anti_windup(),
                _ => limited.with_back_calculation(0.05),
            };
            let (mut plain, mut optional) = (pid(limited), pid(limited.with_slew_limit(1e30)));
            for (setpoint, measurement) in samples {
                let plain_output = plain.step(setpoint, measurement, &TimeStep::of(DT_S));
                prop_assert!((plain_output - optional.step(setpoint, measurement, &TimeStep::of(DT_S))).abs() < 1e-3);
                prop_assert!((plain.terms().i - optional.terms().i).abs() < 1e-3);
            }
        }

        #[test]
        fn an_error_formed_elsewhere_gives_the_same(
            config in any_config(),
            samples in prop::collection::vec((-50.0_f32..50.0, -50.0_f32..50.0), 2..30),
        ) {
            let plain = PidConfig::new(config.parameters.kp, config.parameters.ki, config.parameters.kd).with_output_limit(config.parameters.output_upper);
            let (mut whole, mut parts) = (pid(plain), pid(plain));
            let step = TimeStep::new(DT_S, 0.1);
            let mut last = samples[0].1;
            for (setpoint, measurement) in samples {
                let expected = whole.step(setpoint, measurement, &step);
                let rate = (measurement - last) * step.per_dt;
                prop_assert_eq!(parts.step_error(setpoint - measurement, rate, &step), expected);
                last = measurement;
            }
        }
    }
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "exact results are the rule under test")]
mod incremental {
    use super::*;
    use crate::control::Differentiator;
    use crate::time::TimeStep;
    use proptest::prelude::*;

    const DT_S: f32 = 0.001;
    const BAD: [f32; 3] = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY];

    fn pid(config: PidConfig) -> Pid {
        Pid::new(config).unwrap()
    }

    fn with_core(mut pid: Pid, change: impl FnOnce(&mut ErrorPid)) -> Pid {
        change(&mut pid.core);
        pid
    }

    fn incremental(kp: f32, ki: f32, kd: f32) -> PidConfig {
        PidConfig::new(kp, ki, kd).with_incremental_form()
    }

    #[test]
    fn first_call_after_a_long_time_is_proportional_only() {
        for dt_s in [DT_S, 10.0] {
            assert_eq!(
                pid(incremental(2.0, 100.0, 100.0)).step(3.0, 1.0, &TimeStep::of(dt_s)),
                4.0
            );
        }
    }

    #[test]
    fn bad_time_and_bad_samples_hold_the_output_and_leave_no_trace() {
        let config = incremental(2.0, 10.0, 0.0).with_tracking(50.0);
        let (mut clean, mut hit) = (pid(config), pid(config));
        for sample in 0..20_u8 {
            let measurement = f32::from(sample) * 0.01;
            let expected = clean.step(1.0, measurement, &TimeStep::of(DT_S));
            let held = hit.output();
            for bad in BAD {
                assert_eq!(hit.step(1.0, bad, &TimeStep::of(DT_S)), held);
                assert_eq!(hit.step(bad, measurement, &TimeStep::of(DT_S)), held);
                assert_eq!(hit.step(1.0, measurement, &TimeStep::of(bad)), held);
            }
            assert_eq!(hit.step(1.0, measurement, &TimeStep::of(0.0)), held);
            assert_eq!(hit.step(1.0, measurement, &TimeStep::of(-DT_S)), held);
            assert_eq!(hit.step(1.0, measurement, &TimeStep::of(DT_S)), expected);
        }
        assert_eq!(hit.rejected(), 220);
        assert_eq!(with_core(hit, |core| (core.rejected, core.rate) = (0, clean.core.rate)), clean);
    }

    #[test]
    fn a_burst_of_bad_samples_of_a_moving_shaft_does_not_kick() {
        let mut pid = pid(incremental(0.0, 0.0, 0.05));
        let mut at = 0.0;
        for sample in 0..100_u8 {
            at += 10.0 * DT_S;
            let bad = (20..70).contains(&sample);
            let output = pid.step(0.0, if bad { f32::NAN } else { at }, &TimeStep::of(DT_S));
            assert!(sample < 1 || (output + 0.5).abs() < 1e-3, "{output}");
        }
    }

    #[test]
    fn a_dt_above_the_maximum_adds_the_change_of_p_only() {
        let mut pid = pid(incremental(2.0, 10.0, 0.1));
        pid.step(1.0, 0.0, &TimeStep::of(DT_S));
        let before = pid.step(1.0, 0.0, &TimeStep::of(DT_S));
        assert_eq!(pid.step(3.0, 0.5, &TimeStep::of(10.0)), before + 3.0);
    }

    #[test]
    fn a_limit_that_is_zero_or_reversed_is_named() {
        let new = incremental(1.0, 1.0, 1.0);
        for (config, error) in [
            (incremental(f32::NAN, 0.0, 0.0), ConfigError::Negative("kp")),
            (incremental(0.0, -1.0, 0.0), ConfigError::Negative("ki")),
            (incremental(0.0, 0.0, f32::INFINITY), ConfigError::Negative("kd")),
            (new.with_output_limit(0.0), ConfigError::NotPositive("output_limit")),
            (new.with_output_range(2.0, 1.0), ConfigError::Reversed("output_range")),
            (new.with_tracking(0.0), ConfigError::NotPositive("r")),
            (new.with_tracking(20.0).with_period(360.0), ConfigError::Conflict("r")),
        ] {
            assert_eq!(Pid::new(config), Err(error));
        }
    }

    #[test]
    fn the_incremental_form_leaves_the_limit_at_once() {
        let mut pid = pid(incremental(0.0, 100.0, 0.0).with_output_limit(10.0));
        for _ in 0..10_000 {
            pid.step(9.0, 0.0, &TimeStep::of(DT_S));
        }
        assert_eq!(pid.output(), 10.0);
        pid.step(-1.0, 0.0, &TimeStep::of(DT_S));
        assert!(pid.step(-1.0, 0.0, &TimeStep::of(DT_S)) < 10.0);
    }

    #[test]
    fn huge_gains_end_at_the_limit_and_never_in_nan() {
        let mut pid = pid(incremental(1e30, 1e30, 1e30));
        for measurement in [0.0, 1e30, f32::MIN, f32::MAX, 1.0] {
            assert!(pid.step(f32::MAX, measurement, &TimeStep::of(1e-6)).is_finite());
        }
    }

    #[test]
    fn tracking_smooths_a_step_of_the_setpoint_from_the_first_measurement() {
        let config = incremental(1.0, 0.0, 0.0);
        let mut smooth = pid(config.with_tracking(50.0));
        assert_eq!(smooth.step(11.0, 10.0, &TimeStep::of(DT_S)), 0.0);
        let mut last = 0.0;
        for _ in 0..300 {
            let output = smooth.step(11.0, 10.0, &TimeStep::of(DT_S));
            assert!(output >= last && output - last < 0.05);
            last = output;
        }
        assert!((last - 1.0).abs() < 1e-3);
    }

    #[test]
    fn with_tracking_a_long_pause_moves_the_target_on_by_the_longest_step() {
        let config = incremental(1.0, 5.0, 0.5);
        let mut pid = pid(config.with_tracking(50.0));
        let mut follow = Differentiator::linear(50.0, 0.01).unwrap();
        follow.reset_to(10.0);
        for _ in 0..5 {
            follow.update(11.0, DT_S);
            pid.step(11.0, 10.0, &TimeStep::of(DT_S));
        }
        let (before, target) = (pid.output(), follow.value());
        let change = follow.update(11.0, 0.01) - target;
        assert!(
            (pid.step(11.0, 10.0, &TimeStep::new(1000.0, 0.01)) - before - change).abs() < 1e-6
        );
    }

    #[test]
    fn an_increment_below_half_a_spacing_is_lost_and_a_larger_increment_is_kept() {
        // At 10, the spacing is 9.5e-7; with ki = 1 at 1 kHz, half of it is an error of 4.8e-4.
        for (error, moves) in [(4.7e-4, false), (4.9e-4, true)] {
            let mut pid = pid(incremental(0.0, 1.0, 0.0));
            pid.reset_to(10.0);
            for _ in 0..1_000 {
                pid.step(error, 0.0, &TimeStep::of(DT_S));
            }
            assert_eq!(pid.output() > 10.0, moves, "{error}");
        }
    }

    #[test]
    fn reset_to_takes_over_without_a_jump() {
        let mut pid = pid(incremental(2.0, 10.0, 0.5).with_output_limit(10.0));
        pid.reset_to(7.0);
        assert_eq!(pid.step(100.0, 99.0, &TimeStep::of(DT_S)), 7.0);
        assert!((pid.step(100.0, 99.0, &TimeStep::of(DT_S)) - 7.01).abs() < 1e-5);
        pid.reset();
        assert_eq!(pid.step(1.0, 0.0, &TimeStep::of(DT_S)), 2.0);
    }

    #[test]
    fn new_gains_do_not_move_the_output() {
        let mut pid = pid(incremental(2.0, 10.0, 0.0));
        pid.step(1.0, 0.0, &TimeStep::of(DT_S));
        let before = pid.step(1.0, 0.0, &TimeStep::of(DT_S));
        pid.set_gains(20.0, 5.0, 1.0).unwrap();
        assert!((pid.step(1.0, 0.0, &TimeStep::of(DT_S)) - before).abs() < 0.01);
        assert!(pid.set_gains(1.0, f32::NAN, 0.0).is_err());
    }

    #[test]
    fn a_setpoint_that_comes_back_leaves_no_trace_of_the_limit() {
        // P of 200 and of 180 are both cut to 50; the next output is P again, and not 50 less the
        // difference.
        for ki in [0.0, 5.0] {
            let config = incremental(2.0, ki, 0.0).with_output_limit(50.0);
            let mut pid = pid(config);
            assert_eq!(
                (
                    pid.step(100.0, 0.0, &TimeStep::of(DT_S)),
                    pid.step(90.0, 0.0, &TimeStep::of(DT_S))
                ),
                (50.0, 50.0)
            );
            let back = pid.step(1.0, 0.0, &TimeStep::of(DT_S));
            assert!((back - 2.0 - ki * 45.5 * DT_S).abs() < 1e-4, "{back}");
        }
    }

    #[test]
    fn new_gains_at_the_limit_do_not_move_the_output_and_wind_nothing_up() {
        for config in [PidConfig::new(2.0, 1.0, 0.0), incremental(2.0, 1.0, 0.0)] {
            let mut pid = pid(config.with_output_limit(50.0));
            let step = TimeStep::of(DT_S);
            pid.step(100.0, 0.0, &step);
            assert_eq!(pid.step(100.0, 0.0, &step), 50.0);
            pid.set_gains(1.0, 1.0, 0.0).unwrap();
            assert_eq!(pid.output(), 50.0);
            assert_eq!(pid.step(100.0, 0.0, &step), 50.0);
            assert!(pid.step(1.0, 0.0, &step).abs() < 1.1); // P of 1, and a step's growth
            pid.set_gains(f32::MAX, 1.0, 0.0).unwrap();
            assert!(pid.step(-100.0, 0.0, &step).abs() <= 50.0);
        }
    }

    #[test]
    fn new_gains_that_leave_the_limit_keep_the_output_at_it() {
        for config in [PidConfig::new(2.0, 1.0, 0.0), incremental(2.0, 1.0, 0.0)] {
            for sign in [1.0, -1.0] {
                let mut pid = pid(config.with_output_limit(50.0));
                pid.step(sign * 100.0, 0.0, &TimeStep::of(DT_S));
                pid.set_gains(0.25, 1.0, 0.0).unwrap();
                assert_eq!(pid.step(sign * 100.0, 0.0, &TimeStep::of(DT_S)), sign * 50.0);
                assert!((pid.terms().i - sign * 25.0).abs() < 1e-4, "{:?}", pid.terms());
            }
        }
    }

    #[test]
    fn without_ki_the_incremental_form_keeps_its_memory_and_the_positional_form_has_no_memory() {
        let step = TimeStep::of(DT_S);
        for (config, kept) in
            [(PidConfig::new(2.0, 0.0, 0.1), 0.0), (incremental(2.0, 0.0, 0.1), 1.0)]
        {
            let mut pid = pid(config);
            pid.reset_to(7.0);
            let first = pid.step(1.0, 0.0, &step);
            assert_eq!(first, 2.0 + 5.0 * kept);
            pid.step(1.0, 0.001, &step);
            let before = pid.step(1.0, 0.002, &step); // D is at work
            pid.set_gains(8.0, 0.0, 0.3).unwrap();
            let after = pid.step(1.0, 0.003, &step);
            assert_eq!((after - before).abs() < 0.02, kept > 0.0, "{before} {after}");
            pid.reset();
            assert_eq!(pid.step(1.0, 0.0, &step), 8.0);
        }
    }

    #[test]
    fn the_form_may_change_on_the_way() {
        let (positional, step) = (PidConfig::new(2.0, 10.0, 0.0), TimeStep::of(DT_S));
        let mut pid = pid(positional);
        let mut before = 0.0;
        for sample in 0..6_u8 {
            before = pid.step(1.0, 0.0, &step);
            let config = if sample % 2 == 0 { incremental(2.0, 10.0, 0.0) } else { positional };
            pid.set_config(config).unwrap();
            assert_eq!((pid.config(), pid.output()), (config, before));
        }
        assert!((pid.step(1.0, 0.0, &step) - before - 0.01).abs() < 1e-6); // and no step but that of I
    }

    #[test]
    fn only_the_options_that_need_it_leave_the_plain_step() {
        let plain = incremental(1.0, 1.0, 0.1).with_output_limit(5.0).with_integral_limit(1.0);
        assert!(pid(plain).core.is_plain());
        for config in [
            plain.with_tracking(10.0),
            plain.with_back_calculation(0.1),
            plain.without_anti_windup(),
            plain.with_output_range(-1.0, 2.0),
            plain.with_period(1.0),
        ] {
            assert!(!pid(config).core.is_plain(), "{config:?}");
        }
    }

    #[test]
    fn with_tracking_the_setpoint_arrives_however_far_from_zero() {
        // At a million, the spacing is 0.06: a differentiator in front of the controller would have to add up steps of less.
        for at in [0.0_f32, 1e6, -1e6] {
            for way in [90.0, -90.0] {
                let mut pid = pid(PidConfig::new(1.0, 0.0, 0.0).with_tracking(50.0));
                pid.step(at, at, &TimeStep::of(DT_S));
                for _ in 0..1_000 {
                    pid.step(at + way, at, &TimeStep::of(DT_S));
                }
                assert!((pid.output() - way).abs() < 1e-3, "{}", pid.output());
                for _ in 0..1_000 {
                    pid.step(at + way, at + way, &TimeStep::of(DT_S));
                }
                assert!(pid.output().abs() < 1e-5, "{}", pid.output());
            }
        }
    }

    #[test]
    fn tracking_starts_from_the_measurement_again_after_a_gap_and_after_a_given_error() {
        let step = TimeStep::of(DT_S);
        let mut pid = pid(PidConfig::new(1.0, 0.0, 0.0).with_tracking(50.0));
        for gap in [Pid::interrupt, Pid::reset, |pid: &mut Pid| {
            _ = pid.step_error(3.0, 0.0, &TimeStep::of(DT_S))
        }] {
            for _ in 0..50 {
                pid.step(1.0, 0.0, &step);
            }
            gap(&mut pid);
            assert_eq!(pid.step(1.0, 0.4, &step), 0.0);
            assert!(pid.step(1.0, 0.4, &step).abs() < 2e-3);
        }
        // An error formed elsewhere has no setpoint to follow.
        assert_eq!(pid.step_error(3.0, 0.0, &step), 3.0);
    }

    proptest! {
        #[test]
        fn tracking_equals_a_differentiator_in_front_of_the_controller(
            r in 1.0_f32..500.0, gains in (0.0_f32..10.0, 0.0_f32..10.0, 0.0_f32..0.1), incremental in any::<bool>(),
            samples in prop::collection::vec((-50.0_f32..50.0, -1.0_f32..1.0, 1_u16..2000), 1..80),
        ) {
            let config = PidConfig { incremental, ..PidConfig::new(gains.0, gains.1, gains.2) };
            let (mut led, mut plain) = (pid(config.with_tracking(r)), pid(config));
            let mut follow = Differentiator::linear(r, 1.0 / r * 0.999_999).unwrap();
            follow.reset_to(samples[0].1);
            for (setpoint, measurement, micros) in samples {
                let dt_s = f32::from(micros) * 1e-6;
                let expected = plain.step(follow.update(setpoint, dt_s), measurement, &TimeStep::of(dt_s));
                let output = led.step(setpoint, measurement, &TimeStep::of(dt_s));
                prop_assert!((output - expected).abs() <= 2e-3 * expected.abs().max(1.0), "{} {}", output, expected);
            }
        }

        #[test]
        fn a_tracked_setpoint_never_overshoots_at_any_speed_and_time_step(
            r in 1e-3_f32..1e6, target in -1e6_f32..1e6, steps in prop::collection::vec(1_u32..=200_000, 1..200),
        ) {
            let mut pid = pid(PidConfig::new(1.0, 0.0, 0.0).with_tracking(r));
            for micros in steps {
                let output = pid.step(target, 0.0, &TimeStep::of(micros as f32 * 1e-6));
                prop_assert!(output * target >= 0.0 && output.abs() <= target.abs() * 1.000_01, "{output}");
            }
        }

        #[test]
        fn the_incremental_form_with_limits_equals_the_positional_form_with_conditional_integration(
            kp in 0_u8..16, ki in 0_u8..64, kd in 0_u8..8, limit in 1_u8..60,
            samples in prop::collection::vec((-50_i8..50, -50_i8..50), 1..80),
        ) {
            // All values are exact in f32: quarters, a step of 2^-6 s, and a derivative in whole
            // numbers.
            let step = TimeStep::of(1.0 / 64.0);
            let gains = (f32::from(kp) / 4.0, f32::from(ki), f32::from(kd) / 64.0);
            let limit = f32::from(limit);
            let positional = PidConfig::new(gains.0, gains.1, gains.2).with_output_limit(limit);
            let mut positional = Pid::new(positional).unwrap();
            let config = incremental(gains.0, gains.1, gains.2);
            let mut incremental = pid(config.with_output_limit(limit));
            for (setpoint, measurement) in samples {
                let (setpoint, measurement) = (f32::from(setpoint), f32::from(measurement));
                let expected = positional.step(setpoint, measurement, &step);
                prop_assert_eq!(incremental.step(setpoint, measurement, &step), expected);
            }
        }

        #[test]
        fn the_incremental_form_without_limits_equals_the_positional_form(
            kp in 0.0_f32..10.0, ki in 0.0_f32..10.0, kd in 0.0_f32..0.1,
            samples in prop::collection::vec((-50.0_f32..50.0, -50.0_f32..50.0, 1_u8..10), 1..50),
        ) {
            let mut positional = Pid::new(PidConfig::new(kp, ki, kd)).unwrap();
            let mut incremental = pid(incremental(kp, ki, kd));
            let mut largest = 1.0_f32;
            for (setpoint, measurement, millis) in samples {
                let dt_s = f32::from(millis) * DT_S;
                let expected = positional.step(setpoint, measurement, &TimeStep::of(dt_s));
                let output = incremental.step(setpoint, measurement, &TimeStep::of(dt_s));
                largest = largest.max(expected.abs());
                prop_assert!((output - expected).abs() <= 2e-5 * largest, "{} {}", output, expected);
            }
        }

        #[test]
        fn output_is_within_limits_for_any_finite_input(
            gains in (0.0_f32..1e6, 0.0_f32..1e6, 0.0_f32..1e6), limit in 0.001_f32..1e6,
            samples in prop::collection::vec((-f32::MAX..f32::MAX, -f32::MAX..f32::MAX, 0.0_f32..0.2), 1..50),
        ) {
            let config = incremental(gains.0, gains.1, gains.2).with_output_limit(limit);
            let mut pid = pid(config);
            for (setpoint, measurement, dt_s) in samples {
                prop_assert!(pid.step(setpoint, measurement, &TimeStep::of(dt_s)).abs() <= limit);
            }
        }
    }
}

#[cfg(test)]
mod limited_beyond {
    use crate::control::{Pid, PidConfig};
    use crate::time::TimeStep;

    /// A second at an error of 1 with only half of the output let through, and the first output after it.
    fn after_a_second(tells: bool) -> f32 {
        let mut pid = Pid::new(PidConfig::new(1.0, 100.0, 0.0)).unwrap();
        for _ in 0..1_000 {
            let output = pid.step(1.0, 0.0, &TimeStep::of(0.001));
            if tells {
                pid.keep_integral_between(0.0, output.min(2.0));
            }
        }
        pid.step(1.0, 0.0, &TimeStep::of(0.001))
    }

    #[test]
    fn a_loop_told_the_passed_output_does_not_wind_up() {
        assert!(after_a_second(false) > 100.0);
        assert!((after_a_second(true) - 3.1).abs() < 1e-4); // P and the 2 that passed, and a step's growth
    }

    #[test]
    fn an_integral_within_the_range_stays_as_it_is() {
        let mut pid = Pid::new(PidConfig::new(0.0, 100.0, 0.0)).unwrap();
        for _ in 0..=100 {
            pid.step(-1.0, 0.0, &TimeStep::of(0.001));
        }
        for (lowest, highest, kept) in [(-4.0, 4.0, -4.0), (-100.0, 100.0, -4.0), (0.0, 4.0, 0.0)] {
            pid.keep_integral_between(lowest, highest);
            assert!((pid.terms().i - kept).abs() < 1e-6);
        }
    }
}
