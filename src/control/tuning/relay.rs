//! The relay experiment, and the rules from its result to gains.

use crate::control::number::{self, Sum};
use crate::control::pid::PidConfig;
use crate::error::{ConfigError, check, finite, not_negative, positive};
use crate::math;
use crate::time::TimeStep;
use core::f32::consts::PI;

/// Finds the ultimate gain and period of a plant with a relay in place of the controller.
///
/// The output is `bias + amplitude` while the measurement is below the setpoint and `bias - amplitude` while above. The plant
/// swings with the amplitude `a` and the period `Tu`; with the hysteresis `h`, `Ku = 4 amplitude / (pi sqrt(a² - h²))`.
/// Source: Åström and Hägglund, "Automatic tuning of simple regulators with specifications on phase and amplitude
/// margins", Automatica 20 (1984).
///
/// The mechanism moves during the measurement: choose an amplitude within its range, and keep the safety limits on.
///
/// # Edge behaviour
/// If `dt_s` is zero, negative, NaN or infinite, or the setpoint or measurement is NaN or infinite, the last output is returned,
/// nothing changes and [`rejected`](Self::rejected) grows. The first call starts the measurement at any time; a `dt_s` above
/// [`TimeStep::MAX_S`] spoils the measurement, which starts anew. When done or failed, the output is the bias. A swing faster
/// than [`LEAST_SAMPLES`](Self::LEAST_SAMPLES) a half-period, a swing within the hysteresis and a swing beyond `f32` are a
/// [`failure`](Self::failure).
///
/// # Examples
/// ```
/// use drivetrain::control::{RelayTuner, TuningRule};
///
/// // A motor with inertia whose speed is seen 10 ms late.
/// let mut tuner = RelayTuner::new(2.0, 0.05)?;
/// let (mut speed, mut seen) = (0.0_f32, [0.0_f32; 10]);
/// while !tuner.is_complete() {
///     let effort = tuner.update(0.0, seen[9], 0.001);
///     seen.rotate_right(1);
///     seen[0] = speed;
///     speed += 50.0 * effort * 0.001;
/// }
/// let (_, period_s) = tuner.ultimate().ok_or("did not swing")?;
/// assert!((period_s - 0.044).abs() < 0.002); // four times the delay
/// let (kp, ..) = tuner.pid(TuningRule::TyreusLuybenPi).ok_or("did not swing")?.gains();
/// assert!(kp > 0.5 && kp < 1.0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct RelayTuner {
    amplitude: f32,
    hysteresis: f32,
    bias: f32,
    time_limit_s: f32,
    cycles: u8,
    passed: Sum,
    period: Sum,
    lowest: f32,
    highest: f32,
    sum_of_periods_s: f32,
    sum_of_swings: f32,
    last_swing: f32,
    periods: u8,
    /// Samples since the output switched, and of the shorter half of this period; no more than count.
    samples: u8,
    shorter_half: u8,
    rejected: u16,
    up: bool,
    /// One of the summed periods is too short to be measured.
    coarse: bool,
    state: State,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
enum State {
    Idle,
    Swinging,
    Done,
    TooFast,
    OutOfTime,
}

/// The largest relative difference of two neighbouring swings of a steady oscillation.
const STEADY: f32 = 0.1;

impl RelayTuner {
    /// The fewest samples in half a period for amplitude and period: with 8, the period is known to an eighth and the peak of a
    /// sine to 2 %.
    pub const LEAST_SAMPLES: u8 = 8;

    /// Takes the output to either side, more than zero, and how far the measurement must pass the setpoint before the output
    /// switches: more than the noise, zero or more.
    ///
    /// # Errors
    /// Names `amplitude` when not more than zero, `hysteresis` when negative.
    pub const fn new(amplitude: f32, hysteresis: f32) -> Result<Self, ConfigError> {
        check!(positive("amplitude", amplitude));
        check!(not_negative("hysteresis", hysteresis));
        Ok(Self {
            amplitude,
            hysteresis,
            bias: 0.0,
            time_limit_s: 10.0,
            cycles: 4,
            passed: Sum::ZERO,
            period: Sum::ZERO,
            lowest: f32::MAX,
            highest: f32::MIN,
            sum_of_periods_s: 0.0,
            sum_of_swings: 0.0,
            last_swing: 0.0,
            periods: 0,
            samples: 0,
            shorter_half: u8::MAX,
            rejected: 0,
            up: true,
            coarse: false,
            state: State::Idle,
        })
    }

    /// Adds a constant to the output, for example the output to hold the weight or the speed; zero by default.
    ///
    /// # Errors
    /// Names `bias` when `bias` or the output with it is not finite.
    pub const fn with_bias(self, bias: f32) -> Result<Self, ConfigError> {
        check!(finite("bias", bias.abs() + self.amplitude));
        Ok(Self { bias, ..self })
    }

    /// Sets the number of periods to average over, more than zero; 4 by default.
    ///
    /// The periods must follow each other with swings that differ by 10 % at most.
    ///
    /// # Errors
    /// Names `cycles` when zero.
    pub const fn with_cycles(self, cycles: u8) -> Result<Self, ConfigError> {
        check!(positive("cycles", cycles as f32));
        Ok(Self { cycles, ..self })
    }

    /// Sets the time limit in seconds, more than zero; 10 by default.
    ///
    /// # Errors
    /// Names `time_limit` when not more than zero.
    pub const fn with_time_limit(self, time_limit_s: f32) -> Result<Self, ConfigError> {
        check!(positive("time_limit", time_limit_s));
        Ok(Self { time_limit_s, ..self })
    }

    /// Steps by `dt_s` seconds and returns the output for the plant.
    ///
    /// Costs 125 instructions on a Cortex-M4F (`docs/figures.md`).
    pub fn update(&mut self, setpoint: f32, measurement: f32, dt_s: f32) -> f32 {
        let step = TimeStep::of(dt_s);
        let error = number::finite(setpoint - measurement);
        let finite = setpoint.is_finite() && measurement.is_finite();
        if !step.admits(finite, &mut self.rejected) || self.is_complete() {
            return self.output();
        }
        self.passed.add(step.dt_s());
        if self.passed.value() >= self.time_limit_s {
            self.state = State::OutOfTime;
            return self.output();
        }
        if step.is_frozen() || self.state == State::Idle {
            self.begin(error);
            return self.output();
        }
        self.period.add(step.dt_s());
        self.samples = self.samples.saturating_add(1);
        self.lowest = if error < self.lowest { error } else { self.lowest };
        self.highest = if error > self.highest { error } else { self.highest };
        if self.up && error < -self.hysteresis {
            self.up = false;
            self.end_half();
        } else if !self.up && error > self.hysteresis {
            self.up = true;
            self.end_half();
            self.end_period();
        }
        self.output()
    }

    fn begin(&mut self, error: f32) {
        self.state = State::Swinging;
        self.up = error >= 0.0;
        self.last_swing = 0.0;
        self.start_sums();
        self.next_period();
    }

    const fn next_period(&mut self) {
        (self.period, self.lowest, self.highest) = (Sum::ZERO, f32::MAX, f32::MIN);
        (self.samples, self.shorter_half) = (0, u8::MAX);
    }

    const fn end_half(&mut self) {
        if self.samples < self.shorter_half {
            self.shorter_half = self.samples;
        }
        self.samples = 0;
    }

    fn end_period(&mut self) {
        let swing = 0.5 * self.highest - 0.5 * self.lowest;
        if (swing - self.last_swing).abs() <= STEADY * swing {
            self.coarse |= self.shorter_half < Self::LEAST_SAMPLES;
            self.sum_of_periods_s += self.period.value();
            self.sum_of_swings += swing;
            self.periods += 1;
        } else {
            self.start_sums();
        }
        self.last_swing = swing;
        if self.periods >= self.cycles {
            self.state = if self.coarse { State::TooFast } else { State::Done };
        }
        self.next_period();
    }

    const fn start_sums(&mut self) {
        (self.periods, self.sum_of_periods_s, self.sum_of_swings) = (0, 0.0, 0.0);
        self.coarse = false;
    }

    /// Returns the output for the plant: the bias, during the measurement plus or minus the amplitude.
    #[must_use]
    pub fn output(&self) -> f32 {
        match self.state {
            State::Swinging if self.up => self.bias + self.amplitude,
            State::Swinging => self.bias - self.amplitude,
            State::Idle | State::Done | State::TooFast | State::OutOfTime => self.bias,
        }
    }

    /// Returns whether the measurement has finished, with a result or a failure.
    #[must_use]
    pub const fn is_complete(&self) -> bool {
        matches!(self.state, State::Done | State::TooFast | State::OutOfTime)
    }

    /// Returns the reason for the missing result, with the parameter to change; `None` during the measurement, and with
    /// a result.
    ///
    /// [`ConfigError::OutOfTime`], [`ConfigError::TooFewSamples`] or [`ConfigError::NoGain`].
    ///
    /// # Examples
    /// ```
    /// use drivetrain::error::ConfigError;
    /// use drivetrain::control::RelayTuner;
    ///
    /// // A speed that follows at once: it swings from one sample to the next.
    /// let mut tuner = RelayTuner::new(1.0, 0.0)?;
    /// let mut speed = 0.0;
    /// while !tuner.is_complete() {
    ///     speed = tuner.update(0.0, speed, 0.001);
    /// }
    /// let failure = tuner.failure().ok_or("it swung")?;
    /// assert_eq!((tuner.ultimate(), failure), (None, ConfigError::TooFewSamples("hysteresis")));
    /// assert_eq!(failure.to_string(), "hysteresis: fewer than 8 samples in half a period of the swing");
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn failure(&self) -> Option<ConfigError> {
        match self.state {
            State::Idle | State::Swinging => None,
            State::Done if self.ultimate().is_some() => None,
            State::Done => Some(ConfigError::NoGain("hysteresis")),
            State::TooFast => Some(ConfigError::TooFewSamples("hysteresis")),
            State::OutOfTime => Some(ConfigError::OutOfTime("time_limit")),
        }
    }

    /// Returns the number of refused steps; stays at 65535.
    #[must_use]
    pub const fn rejected(&self) -> u16 {
        self.rejected
    }

    /// Returns the ultimate gain and period of the plant: `None` during the measurement, and after a
    /// [`failure`](Self::failure).
    ///
    /// At the proportional gain `Ku`, in units of the output over the measurement, the loop would just keep oscillating;
    /// the period `Tu` is that of the oscillation in seconds.
    #[must_use]
    pub fn ultimate(&self) -> Option<(f32, f32)> {
        if self.state != State::Done {
            return None;
        }
        let cycles = f32::from(self.cycles);
        let swing = self.sum_of_swings / cycles;
        let hysteresis = self.hysteresis;
        let effective = math::sqrt((swing - hysteresis) * (swing + hysteresis));
        let ultimate_gain = 4.0 * self.amplitude / (PI * effective);
        if ultimate_gain.is_finite() && ultimate_gain > 0.0 {
            Some((ultimate_gain, self.sum_of_periods_s / cycles))
        } else {
            None
        }
    }

    /// Returns a configuration with the gains by `rule`, and no option; `None` as [`ultimate`](Self::ultimate).
    #[must_use]
    pub fn pid(&self, rule: TuningRule) -> Option<PidConfig> {
        let (gain, period_s) = self.ultimate()?;
        Some(rule.pid(gain, period_s))
    }
}

/// How gains follow from the ultimate gain `Ku` and period `Tu` of a plant.
///
/// | rule | kp | integral time | derivative time | character |
/// |---|---|---|---|---|
/// | `ZieglerNicholsP` | 0.5 Ku | | | steady error |
/// | `ZieglerNicholsPi` | 0.45 Ku | Tu / 1.2 | | quick, overshoots |
/// | `ZieglerNicholsPid` | 0.6 Ku | Tu / 2 | Tu / 8 | quick, overshoots by a quarter and more |
/// | `TyreusLuybenPi` | Ku / 3.2 | 2.2 Tu | | calm; for speed loops start here |
/// | `TyreusLuybenPid` | Ku / 2.2 | 2.2 Tu | Tu / 6.3 | calm |
///
/// Sources: Ziegler and Nichols, "Optimum Settings for Automatic Controllers", Transactions of the ASME 64 (1942);
/// Tyreus and Luyben, "Tuning PI Controllers for Integrator/Dead Time Processes", Industrial and Engineering Chemistry
/// Research 31 (1992), its PID as in Luyben and Luyben, "Essentials of Process Control" (1997).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum TuningRule {
    /// Proportional only.
    ZieglerNicholsP,
    /// Proportional and integral.
    ZieglerNicholsPi,
    /// All three terms.
    ZieglerNicholsPid,
    /// Proportional and integral, with large margins.
    TyreusLuybenPi,
    /// All three terms, with large margins.
    TyreusLuybenPid,
}

impl TuningRule {
    /// Returns a configuration with the gains for an ultimate gain `Ku` and a period `Tu` in seconds, and no option.
    ///
    /// [`RelayTuner::pid`](super::RelayTuner::pid) measures both.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::control::TuningRule;
    ///
    /// let speed = TuningRule::ZieglerNicholsPid.pid(10.0, 0.2).with_output_limit(20.0);
    /// assert_eq!(speed.gains(), (6.0, 60.0, 0.15)); // kp, ki, kd
    /// ```
    pub const fn pid(self, ultimate_gain: f32, ultimate_period_s: f32) -> PidConfig {
        let (ku, tu) = (ultimate_gain, ultimate_period_s);
        let (kp, ki, kd) = match self {
            Self::ZieglerNicholsP => (0.5 * ku, 0.0, 0.0),
            Self::ZieglerNicholsPi => (0.45 * ku, 0.54 * ku / tu, 0.0),
            Self::ZieglerNicholsPid => (0.6 * ku, 1.2 * ku / tu, 0.075 * ku * tu),
            Self::TyreusLuybenPi => (ku / 3.2, ku / (3.2 * 2.2 * tu), 0.0),
            Self::TyreusLuybenPid => (ku / 2.2, ku / (2.2 * 2.2 * tu), ku * tu / (2.2 * 6.3)),
        };
        PidConfig::new(kp, ki, kd)
    }
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "exact results are the rule under test")]
mod tests {
    use super::*;
    use crate::control::{Pid, StepResponse, TuningRule};
    use std::collections::VecDeque;

    const DT_S: f32 = 0.001;

    /// Three equal lags in a row: Ku = 8 / gain, Tu = 2 pi T / sqrt(3).
    struct ThreeLags {
        states: [f32; 3],
        gain: f32,
        lag_s: f32,
    }

    impl ThreeLags {
        fn step(&mut self, input: f32) -> f32 {
            let mut input = input * self.gain;
            for state in &mut self.states {
                *state += (input - *state) * DT_S / self.lag_s;
                input = *state;
            }
            input
        }
    }

    fn relay(amplitude: f32, hysteresis: f32) -> RelayTuner {
        RelayTuner::new(amplitude, hysteresis).unwrap()
    }

    fn swing(mut tuner: RelayTuner, plant: &mut ThreeLags) -> RelayTuner {
        let mut measurement = 0.0;
        while !tuner.is_complete() {
            measurement = plant.step(tuner.update(0.0, measurement, DT_S));
        }
        tuner
    }

    #[test]
    fn relay_tuning_finds_the_ultimate_gain_and_period_of_three_lags() {
        let mut plant = ThreeLags { states: [0.0; 3], gain: 2.0, lag_s: 0.1 };
        let (gain, period_s) = swing(relay(1.0, 0.0), &mut plant).ultimate().unwrap();
        // The describing function is good to some percent.
        assert!((gain - 4.0).abs() < 0.4, "{gain}");
        assert!((period_s - 0.3628).abs() < 0.02, "{period_s}");
    }

    #[test]
    fn its_gains_close_the_loop_without_steady_error() {
        let lags = || ThreeLags { states: [0.0; 3], gain: 2.0, lag_s: 0.1 };
        let found = swing(relay(1.0, 0.01), &mut lags());
        for (rule, most) in [
            (TuningRule::ZieglerNicholsPi, 0.6),
            (TuningRule::ZieglerNicholsPid, 0.7),
            (TuningRule::TyreusLuybenPi, 0.15),
            (TuningRule::TyreusLuybenPid, 0.35),
        ] {
            let mut pid = Pid::new(found.pid(rule).unwrap()).unwrap();
            let mut plant = lags();
            let mut response = StepResponse::new(0.0, 1.0, 10.0, 0.05).unwrap();
            let mut measurement = 0.0;
            while !response.is_complete() {
                measurement = plant.step(pid.step(1.0, measurement, &TimeStep::of(DT_S)));
                response.record(measurement, DT_S);
            }
            let measures = response;
            assert!(measures.overshoot() < most, "{rule:?} {measures:?}");
            assert!(
                measures.steady_error().abs() < 0.01 && measures.settling_time_s().is_some(),
                "{rule:?} {measures:?}"
            );
        }
    }

    #[test]
    fn hysteresis_keeps_noise_from_switching() {
        let mut tuner = RelayTuner::new(1.0, 0.1).unwrap();
        for sample in 0..100_u8 {
            let noise: f32 = if sample % 2 == 0 { 0.09 } else { -0.09 };
            assert_eq!(tuner.update(0.0, -noise.max(0.0), DT_S), 1.0);
        }
    }

    #[test]
    fn a_plant_that_does_not_swing_runs_out_of_time() {
        let mut tuner =
            RelayTuner::new(1.0, 0.1).and_then(|tuner| tuner.with_time_limit(0.5)).unwrap();
        let mut steps = 0;
        while !tuner.is_complete() {
            tuner.update(1.0, 0.0, DT_S);
            steps += 1;
        }
        assert!((499..=501).contains(&steps));
        assert_eq!((tuner.ultimate(), tuner.output()), (None, 0.0));
        assert_eq!(tuner.failure(), Some(ConfigError::OutOfTime("time_limit")));
    }

    /// An integrator seen `delay` samples late, swung to the end.
    fn integrator(delay: usize, mut tuner: RelayTuner) -> RelayTuner {
        let (mut speed, mut seen) =
            (0.0, VecDeque::from_iter(core::iter::repeat_n(0.0_f32, delay)));
        while !tuner.is_complete() {
            seen.push_back(speed);
            let output = tuner.update(0.0, seen.pop_front().unwrap(), DT_S);
            speed += 50.0 * output * DT_S;
        }
        tuner
    }

    #[test]
    fn a_swing_of_a_few_samples_is_a_failure_and_one_of_eight_a_half_period_is_a_result() {
        let mut results = 0;
        for delay in 0..10 {
            let tuner = integrator(delay, relay(1.0, 0.01));
            match tuner.ultimate() {
                Some((_, period_s)) => {
                    assert!(period_s >= 0.016, "{delay}: {period_s}");
                    assert_eq!(tuner.failure(), None);
                    results += 1;
                }
                None => {
                    assert_eq!(
                        tuner.failure(),
                        Some(ConfigError::TooFewSamples("hysteresis")),
                        "{delay}"
                    );
                    assert!(delay < 5, "{delay}");
                }
            }
        }
        assert!(results >= 5, "{results}");
    }

    #[test]
    fn more_hysteresis_makes_a_swing_of_a_few_samples_one_that_counts() {
        let (_, period_s) = integrator(1, relay(1.0, 0.4)).ultimate().unwrap();
        assert!(period_s >= 0.016, "{period_s}");
    }

    #[test]
    fn one_switch_of_noise_does_not_end_a_slow_swing() {
        let mut tuner = RelayTuner::new(1.0, 0.05).unwrap();
        let (mut speed, mut seen, mut step) = (0.0, VecDeque::from([0.0_f32; 12]), 0);
        while !tuner.is_complete() {
            step += 1;
            seen.push_back(speed);
            let late = seen.pop_front().unwrap();
            let noise = if step == 90 || step == 91 { -late.signum() } else { 0.0 };
            speed += 50.0 * tuner.update(0.0, late + noise, DT_S) * DT_S;
        }
        assert!(tuner.ultimate().is_some() && tuner.failure().is_none(), "{tuner:?}");
    }

    #[test]
    fn a_swing_within_the_hysteresis_has_no_gain() {
        let mut tuner = RelayTuner::new(1.0, f32::MAX).unwrap();
        tuner.state = State::Done;
        assert_eq!(
            (tuner.ultimate(), tuner.failure()),
            (None, Some(ConfigError::NoGain("hysteresis")))
        );
    }

    #[test]
    fn a_time_limit_of_hours_ends_at_short_steps_too() {
        let mut tuner = relay(1.0, 0.1).with_time_limit(20_000.0).unwrap();
        tuner.passed = Sum::from(19_999.0);
        let mut steps = 0_u32;
        while !tuner.is_complete() && steps < 3_000 {
            tuner.update(1.0, 0.0, 0.000_5);
            steps += 1;
        }
        assert!(steps.abs_diff(2_000) < 10, "{steps}");
    }

    #[test]
    fn bad_samples_and_bad_times_change_nothing() {
        let mut tuner = RelayTuner::new(1.0, 0.1).and_then(|tuner| tuner.with_bias(0.5)).unwrap();
        assert_eq!(tuner.output(), 0.5);
        tuner.update(1.0, 0.0, DT_S);
        let before = tuner;
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            assert_eq!(tuner.update(bad, 0.0, DT_S), 1.5);
            assert_eq!(tuner.update(1.0, bad, DT_S), 1.5);
            assert_eq!(tuner.update(1.0, 0.0, bad), 1.5);
        }
        assert_eq!(tuner.update(1.0, 0.0, 0.0), 1.5);
        assert_eq!((tuner.rejected(), RelayTuner { rejected: 0, ..tuner }), (10, before));
    }

    #[test]
    fn a_long_pause_starts_the_measurement_anew() {
        let mut tuner = RelayTuner::new(1.0, 0.02).unwrap();
        let mut seen: VecDeque<f32> = [0.0; 10].into();
        let mut speed = 0.0;
        for step in 0..100_000_u32 {
            let dt_s = if step == 150 { 5.0 } else { DT_S };
            let late = seen.pop_front().unwrap();
            seen.push_back(speed);
            speed += 50.0 * tuner.update(0.0, late, dt_s) * DT_S;
            if tuner.is_complete() {
                break;
            }
        }
        assert!((tuner.ultimate().unwrap().1 - 0.044).abs() < 0.002);
    }

    #[test]
    fn a_parameter_that_cannot_be_is_named() {
        let new = relay(1.0, 0.1);
        for (made, name) in [
            (RelayTuner::new(-1.0, 0.1), "amplitude"),
            (RelayTuner::new(1.0, f32::NAN), "hysteresis"),
            (new.with_bias(f32::INFINITY), "bias"),
            (relay(f32::MAX, 0.1).with_bias(f32::MIN), "bias"),
            (new.with_cycles(0), "cycles"),
            (new.with_time_limit(0.0), "time_limit"),
        ] {
            assert_eq!(made.unwrap_err().parameter(), name);
        }
    }
}
