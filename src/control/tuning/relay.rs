use crate::control::error::{ConfigError, check, finite, not_negative, positive};
use crate::control::number;
use crate::control::pid::PidConfig;
use crate::control::step::TimeStep;
use crate::math;
use core::f32::consts::PI;

/// The gains of a PID, in its units: `kp`, `ki` a second, `kd` seconds; and the rule that they follow.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Gains {
    /// Proportional gain.
    pub kp: f32,
    /// Integral gain, 1/s times the unit of `kp`.
    pub ki: f32,
    /// Derivative gain, s times the unit of `kp`.
    pub kd: f32,
    /// What they follow from the ultimate gain and period by.
    pub rule: TuningRule,
}

impl Gains {
    /// Returns a configuration with these gains and no option.
    #[must_use]
    pub const fn config(self) -> PidConfig {
        PidConfig::new(self.kp, self.ki, self.kd)
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

/// What a [`RelayTuner`] found out about the plant.
///
/// # Examples
/// ```
/// use drivetrain::control::{Oscillation, TuningRule};
///
/// let found = Oscillation { ultimate_gain: 10.0, ultimate_period_s: 0.2 };
/// let gains = found.gains(TuningRule::ZieglerNicholsPid);
/// assert_eq!((gains.kp, gains.ki, gains.kd), (6.0, 60.0, 0.15));
/// assert_eq!(gains.rule, TuningRule::ZieglerNicholsPid);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Oscillation {
    /// `Ku`, the proportional gain at which the loop would just keep oscillating, in units of the output over the measurement.
    pub ultimate_gain: f32,
    /// `Tu`, the period of that oscillation in seconds.
    pub ultimate_period_s: f32,
}

impl Oscillation {
    /// Returns the gains by `rule`.
    #[must_use]
    pub const fn gains(&self, rule: TuningRule) -> Gains {
        let (ku, tu) = (self.ultimate_gain, self.ultimate_period_s);
        let (kp, ki, kd) = match rule {
            TuningRule::ZieglerNicholsP => (0.5 * ku, 0.0, 0.0),
            TuningRule::ZieglerNicholsPi => (0.45 * ku, 0.54 * ku / tu, 0.0),
            TuningRule::ZieglerNicholsPid => (0.6 * ku, 1.2 * ku / tu, 0.075 * ku * tu),
            TuningRule::TyreusLuybenPi => (ku / 3.2, ku / (3.2 * 2.2 * tu), 0.0),
            TuningRule::TyreusLuybenPid => (ku / 2.2, ku / (2.2 * 2.2 * tu), ku * tu / (2.2 * 6.3)),
        };
        Gains { kp, ki, kd, rule }
    }
}

/// What a [`RelayTuner`] is made from.
///
/// # Examples
/// ```
/// use drivetrain::control::{RelayTuner, RelayTunerConfig};
///
/// let config = RelayTunerConfig::new(3.0, 0.5).with_cycles(6).with_bias(0.4);
/// assert!(RelayTuner::new(config).is_ok());
/// assert_eq!(RelayTuner::new(RelayTunerConfig::new(0.0, 0.5)).unwrap_err().parameter(), "amplitude");
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct RelayTunerConfig {
    amplitude: f32,
    hysteresis: f32,
    bias: f32,
    cycles: u8,
    time_limit_s: f32,
}

impl RelayTunerConfig {
    /// Takes the output to either side, more than zero, and how far the measurement must pass the setpoint before the output
    /// switches: more than the noise, zero or more.
    #[must_use]
    pub const fn new(amplitude: f32, hysteresis: f32) -> Self {
        Self { amplitude, hysteresis, bias: 0.0, cycles: 4, time_limit_s: 10.0 }
    }

    /// Adds a constant to the output, such as what holds the weight or the speed; zero by default.
    #[must_use]
    pub const fn with_bias(self, bias: f32) -> Self {
        Self { bias, ..self }
    }

    /// Sets the number of periods to average over, more than zero; 4 by default.
    ///
    /// They must follow one another with swings that differ by 10 % at most.
    #[must_use]
    pub const fn with_cycles(self, cycles: u8) -> Self {
        Self { cycles, ..self }
    }

    /// Sets the time in seconds after which it gives up, more than zero; 10 by default.
    #[must_use]
    pub const fn with_time_limit(self, time_limit_s: f32) -> Self {
        Self { time_limit_s, ..self }
    }

    /// Checks every parameter.
    ///
    /// # Errors
    /// Names `amplitude`, `time_limit` or `cycles` when not more than zero, `hysteresis` when negative, `bias`
    /// when it, or the output with it, is not finite.
    pub const fn validate(&self) -> Result<(), ConfigError> {
        check!(positive("amplitude", self.amplitude));
        check!(not_negative("hysteresis", self.hysteresis));
        check!(finite("bias", self.bias.abs() + self.amplitude));
        check!(positive("cycles", self.cycles as f32));
        positive("time_limit", self.time_limit_s)
    }
}

/// Finds the ultimate gain and period of a plant with a relay in place of the controller.
///
/// The output is `bias + amplitude` while the measurement is below the setpoint and `bias - amplitude` while above. The plant
/// swings with the amplitude `a` and the period `Tu`; with the hysteresis `h`, `Ku = 4 amplitude / (pi sqrt(a² - h²))`.
/// Source: Åström and Hägglund, "Automatic tuning of simple regulators with specifications on phase and amplitude
/// margins", Automatica 20 (1984).
///
/// The mechanism moves while this runs: choose the amplitude so that it may, and keep the safety limits on.
///
/// # Edge behaviour
/// `dt_s` zero, negative, NaN or infinite, and a setpoint or measurement that is NaN or infinite: the last output is returned,
/// nothing changes and [`rejected`](Self::rejected) grows. The first call starts the measurement, whenever it comes; a `dt_s` above
/// [`TimeStep::MAX_S`] spoils it: it starts anew. When done or out of time, the output is the bias. A swing beyond `f32` gives no result.
///
/// # Examples
/// ```
/// use drivetrain::control::{RelayTuner, RelayTunerConfig, TuningRule};
///
/// // A motor with inertia whose speed is seen 10 ms late.
/// let mut tuner = RelayTuner::new(RelayTunerConfig::new(2.0, 0.05))?;
/// let (mut speed, mut seen) = (0.0_f32, [0.0_f32; 10]);
/// while !tuner.is_complete() {
///     let effort = tuner.update(0.0, seen[9], 0.001);
///     seen.rotate_right(1);
///     seen[0] = speed;
///     speed += 50.0 * effort * 0.001;
/// }
/// let found = tuner.oscillation().ok_or("did not swing")?;
/// assert!((found.ultimate_period_s - 0.044).abs() < 0.002); // four times the delay
/// let gains = found.gains(TuningRule::TyreusLuybenPi);
/// assert!(gains.kp > 0.5 && gains.kp < 1.0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct RelayTuner {
    config: RelayTunerConfig,
    passed_s: f32,
    period_s: f32,
    lowest: f32,
    highest: f32,
    sum_of_periods_s: f32,
    sum_of_swings: f32,
    last_swing: f32,
    periods: u8,
    rejected: u16,
    up: bool,
    state: State,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
enum State {
    Idle,
    Swinging,
    Done,
    OutOfTime,
}

/// The part by which two neighbouring swings may differ for the oscillation to count as steady.
const STEADY: f32 = 0.1;

impl RelayTuner {
    /// Takes and checks the configuration.
    ///
    /// # Errors
    /// Names the parameter as [`RelayTunerConfig::validate`] does.
    pub const fn new(config: RelayTunerConfig) -> Result<Self, ConfigError> {
        check!(config.validate());
        Ok(Self {
            config,
            passed_s: 0.0,
            period_s: 0.0,
            lowest: f32::MAX,
            highest: f32::MIN,
            sum_of_periods_s: 0.0,
            sum_of_swings: 0.0,
            last_swing: 0.0,
            periods: 0,
            rejected: 0,
            up: true,
            state: State::Idle,
        })
    }

    /// Steps by `dt_s` seconds and returns the output for the plant.
    pub fn update(&mut self, setpoint: f32, measurement: f32, dt_s: f32) -> f32 {
        let step = TimeStep::of(dt_s);
        let error = number::finite(setpoint - measurement);
        let finite = setpoint.is_finite() && measurement.is_finite();
        if !step.admits(finite, &mut self.rejected) || self.is_complete() {
            return self.output();
        }
        self.passed_s += step.dt_s();
        if self.passed_s >= self.config.time_limit_s {
            self.state = State::OutOfTime;
            return self.output();
        }
        if step.is_frozen() || self.state == State::Idle {
            self.begin(error);
            return self.output();
        }
        self.period_s += step.dt_s();
        self.lowest = if error < self.lowest { error } else { self.lowest };
        self.highest = if error > self.highest { error } else { self.highest };
        if self.up && error < -self.config.hysteresis {
            self.up = false;
        } else if !self.up && error > self.config.hysteresis {
            self.up = true;
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
        (self.period_s, self.lowest, self.highest) = (0.0, f32::MAX, f32::MIN);
    }

    fn end_period(&mut self) {
        let swing = 0.5 * self.highest - 0.5 * self.lowest;
        if (swing - self.last_swing).abs() <= STEADY * swing {
            self.sum_of_periods_s += self.period_s;
            self.sum_of_swings += swing;
            self.periods += 1;
        } else {
            self.start_sums();
        }
        self.last_swing = swing;
        if self.periods >= self.config.cycles {
            self.state = State::Done;
        }
        self.next_period();
    }

    const fn start_sums(&mut self) {
        (self.periods, self.sum_of_periods_s, self.sum_of_swings) = (0, 0.0, 0.0);
    }

    /// Returns the output for the plant: the bias, plus or minus the amplitude while it runs.
    #[must_use]
    pub fn output(&self) -> f32 {
        match self.state {
            State::Swinging if self.up => self.config.bias + self.config.amplitude,
            State::Swinging => self.config.bias - self.config.amplitude,
            State::Idle | State::Done | State::OutOfTime => self.config.bias,
        }
    }

    /// Tells whether it has finished, with a result or out of time.
    #[must_use]
    pub fn is_complete(&self) -> bool {
        matches!(self.state, State::Done | State::OutOfTime)
    }

    /// Returns the number of steps that were refused; stays at 65535.
    #[must_use]
    pub const fn rejected(&self) -> u16 {
        self.rejected
    }

    /// Returns the result: `None` while it runs, when it ran out of time, and when the swing was not larger than the hysteresis.
    #[must_use]
    pub fn oscillation(&self) -> Option<Oscillation> {
        if self.state != State::Done {
            return None;
        }
        let cycles = f32::from(self.config.cycles);
        let swing = self.sum_of_swings / cycles;
        let hysteresis = self.config.hysteresis;
        let effective = math::sqrt((swing - hysteresis) * (swing + hysteresis));
        let ultimate_gain = 4.0 * self.config.amplitude / (PI * effective);
        if ultimate_gain.is_finite() && ultimate_gain > 0.0 {
            Some(Oscillation { ultimate_gain, ultimate_period_s: self.sum_of_periods_s / cycles })
        } else {
            None
        }
    }
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "exact results are the rule under test")]
mod tests {
    use super::*;
    use crate::control::{Pid, StepResponse};
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

    fn swing(config: RelayTunerConfig, plant: &mut ThreeLags) -> RelayTuner {
        let mut tuner = RelayTuner::new(config).unwrap();
        let mut measurement = 0.0;
        while !tuner.is_complete() {
            measurement = plant.step(tuner.update(0.0, measurement, DT_S));
        }
        tuner
    }

    #[test]
    fn it_finds_the_ultimate_gain_and_period_of_three_lags() {
        let mut plant = ThreeLags { states: [0.0; 3], gain: 2.0, lag_s: 0.1 };
        let found = swing(RelayTunerConfig::new(1.0, 0.0), &mut plant).oscillation().unwrap();
        // The describing function is good to some percent.
        assert!((found.ultimate_gain - 4.0).abs() < 0.4, "{found:?}");
        assert!((found.ultimate_period_s - 0.3628).abs() < 0.02, "{found:?}");
    }

    #[test]
    fn its_gains_close_the_loop_without_steady_error() {
        let lags = || ThreeLags { states: [0.0; 3], gain: 2.0, lag_s: 0.1 };
        let found = swing(RelayTunerConfig::new(1.0, 0.01), &mut lags()).oscillation().unwrap();
        for (rule, most) in [
            (TuningRule::ZieglerNicholsPi, 0.6),
            (TuningRule::ZieglerNicholsPid, 0.7),
            (TuningRule::TyreusLuybenPi, 0.15),
            (TuningRule::TyreusLuybenPid, 0.35),
        ] {
            let mut pid = Pid::new(found.gains(rule).config()).unwrap();
            let mut plant = lags();
            let mut response = StepResponse::new(0.0, 1.0, 10.0, 0.05).unwrap();
            let mut measurement = 0.0;
            while !response.is_complete() {
                measurement = plant.step(pid.update(1.0, measurement, DT_S));
                response.record(measurement, DT_S);
            }
            let measures = response.measures();
            assert!(measures.overshoot < most, "{rule:?} {measures:?}");
            assert!(
                measures.steady_error.abs() < 0.01 && measures.settling_time_s.is_some(),
                "{rule:?} {measures:?}"
            );
        }
    }

    #[test]
    fn hysteresis_keeps_noise_from_switching() {
        let mut tuner = RelayTuner::new(RelayTunerConfig::new(1.0, 0.1)).unwrap();
        for sample in 0..100_u8 {
            let noise: f32 = if sample % 2 == 0 { 0.09 } else { -0.09 };
            assert_eq!(tuner.update(0.0, -noise.max(0.0), DT_S), 1.0);
        }
    }

    #[test]
    fn a_plant_that_does_not_swing_runs_out_of_time() {
        let mut tuner =
            RelayTuner::new(RelayTunerConfig::new(1.0, 0.1).with_time_limit(0.5)).unwrap();
        let mut steps = 0;
        while !tuner.is_complete() {
            tuner.update(1.0, 0.0, DT_S);
            steps += 1;
        }
        assert!((499..=501).contains(&steps));
        assert_eq!((tuner.oscillation(), tuner.output()), (None, 0.0));
    }

    #[test]
    fn bad_samples_and_bad_times_change_nothing() {
        let mut tuner = RelayTuner::new(RelayTunerConfig::new(1.0, 0.1).with_bias(0.5)).unwrap();
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
        let mut tuner = RelayTuner::new(RelayTunerConfig::new(1.0, 0.02)).unwrap();
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
        assert!((tuner.oscillation().unwrap().ultimate_period_s - 0.044).abs() < 0.002);
    }

    #[test]
    fn a_parameter_that_cannot_be_is_named() {
        let new = RelayTunerConfig::new(1.0, 0.1);
        for (config, name) in [
            (RelayTunerConfig::new(-1.0, 0.1), "amplitude"),
            (RelayTunerConfig::new(1.0, f32::NAN), "hysteresis"),
            (new.with_bias(f32::INFINITY), "bias"),
            (RelayTunerConfig::new(f32::MAX, 0.1).with_bias(f32::MIN), "bias"),
            (new.with_cycles(0), "cycles"),
            (new.with_time_limit(0.0), "time_limit"),
        ] {
            assert_eq!(RelayTuner::new(config).unwrap_err().parameter(), name);
        }
    }
}
