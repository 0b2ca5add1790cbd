//! Identification: the plant of a motor on its mechanism from a run, and gains from that plant.
//!
//! 1. [`Excitation`] swings the mechanism within limits of effort, speed and way.
//! 2. [`Identification`] takes effort and speed of each tick, and returns a [`Plant`] or an [`IdentificationError`].
//! 3. [`Plant::speed_loop`] and [`Plant::position_loop`] calculate gains from a bandwidth and a phase margin.
//!
//! The power model of a chassis is identified by [`PowerFit`](crate::chassis::PowerFit).

mod excitation;
mod plant;
mod regression;

pub use excitation::Excitation;
pub use plant::Plant;

use crate::control::number::Sum;
use crate::error::{ConfigError, check, not_negative, positive};
use crate::math;
use crate::time::TimeStep;
use core::fmt;
use regression::{Common, Lag};

/// Estimates a [`Plant`] from efforts and speeds, one pair a tick, without storage of the run.
///
/// The model is a mechanism with inertia and friction that obeys the effort `u` after a delay `d`:
///
/// ```text
/// kA v' + kV v + kS sign(v) + bias = u(t - d)
/// ```
///
/// No speed is differentiated. Over each tick the model is integrated: the change of the speed is `1/kA` times the integral of
/// `u - kV v - kS sign(v) - bias`. The changes are summed by a leaky integral of [`MEMORY_S`](Self::MEMORY_S), each term in the
/// same way, so that the equation stays exact and the noise of the speed stands on one side. The least squares of these sums give
/// the parameters for each delay of 0 to [`LAGS`](Self::LAGS) ticks, with the effort of two neighbouring ticks weighted for the
/// fraction of a tick; the best delay is that with the smallest rest.
///
/// | quantity | unit, for an effort in `U` and a speed in `M`/s |
/// |---|---|
/// | `kS`, `bias` | `U` |
/// | `kV` | `U s/M` |
/// | `kA` | `U s²/M` |
///
/// # What spoils a run
/// A shaft at rest (8 samples below the standstill speed) obeys another law and is left out, as are the samples after an
/// effort beyond the limit of the drive, after a rejected sample, and after a pause of more than [`TimeStep::MAX_S`]. Drive and command have
/// to agree: a limit of the drive that is not known here, such as the supply at high speed, reads as resistance, and an output that
/// still opens after arming as friction (`with_opening`). Backlash is a disturbance of some milliseconds at a reversal, and widens the deviations.
///
/// # Accuracy
/// The judge (`tests/identification.rs`) are 200 random motors with a delay of 0 to 6 ms, noise of up to 0.5 % of the largest speed and
/// backlash of up to 0.01 rad, swung for 10 s at 1 kHz: `kS` and `kV` within 3 %, `kA` within 0.5 %, the delay within 0.45 ticks. Of a simulated
/// M3508, whose `kV` takes 2 % of the effort, 20 s give `kV` within 4 % for noise of 3 rpm of the rotor, and within 10 % for 10 rpm.
///
/// # Edge behaviour
/// If `dt_s` is zero, negative, NaN or infinite, or a value is NaN or infinite, the sample is left out and
/// [`rejected`](Self::rejected) grows.
///
/// # Examples
/// A wheel with `kS` 0.4 A, `kV` 0.02 A s/rad, `kA` 0.03 A s²/rad and a delay of 3 ms:
/// ```
/// use drivetrain::control::{Excitation, Identification};
///
/// let mut excitation = Excitation::new(5.0, 30.0, 100.0)?; // A, rad/s, rad
/// let mut identification = Identification::new(20.0, 0.05)?;
/// let (mut speed, mut late) = (0.0_f32, [0.0_f32; 4]);
/// while !excitation.is_complete() {
///     let effort = excitation.update(speed, 0.001);
///     identification.sample(effort, speed, 0.001);
///     late.rotate_right(1);
///     late[0] = effort;
///     let push = late[3] - 0.02 * speed;
///     let friction = push.clamp(-0.4, 0.4); // at rest, as large as the push
///     let friction = if speed == 0.0 { friction } else { 0.4 * speed.signum() };
///     speed += (push - friction) / 0.03 * 0.001;
/// }
/// let wheel = identification.result()?;
/// assert!((wheel.ks - 0.4).abs() < 0.01 && (wheel.kv - 0.02).abs() < 0.001);
/// assert!((wheel.ka - 0.03).abs() < 0.0003 && (wheel.delay_s - 0.003).abs() < 0.0002);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// Sources: L. Ljung, *System Identification* (1999), 7.3 (least squares) and 3 (delay); P. Young, "Parameter estimation for
/// continuous-time models", Automatica 17 (1981) (the same filter on each term).
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Identification {
    effort_limit: f32,
    standstill: f32,
    lags: [Lag; Self::LAGS + 1],
    common: Common,
    /// Leaky integrals of speed, direction and one, and of the change of the speed.
    integrals: [f32; 3],
    change: f32,
    velocity: f32,
    /// Time in s since the effort jumped.
    settled_s: f32,
    time: Sum,
    samples: u32,
    saturated: u32,
    /// Samples to leave out, until all delayed efforts are known.
    blind: u8,
    still: u8,
    rejected: u16,
}

/// Samples below the standstill speed after which the shaft rests. A reversal passes faster.
const RESTS: u8 = 8;
/// A change of the effort within a tick that is a jump, of the limit.
const JUMP: f32 = 0.2;
/// The fewest samples in motion.
const LEAST_SAMPLES: u32 = 100;
/// The largest relative standard deviation of `kA`.
const MOST_DEVIATION: f32 = 0.05;

impl Identification {
    /// The largest delay in ticks.
    pub const LAGS: usize = 12;

    /// The time constant of the leaky integrals in s.
    pub const MEMORY_S: f32 = 0.1;

    /// The time in s after a jump of the effort in which the shaft crosses its backlash: these samples are summed and not fitted.
    pub const SETTLES_S: f32 = 0.03;

    /// Samples between the end of a rest and the first sample of the sums.
    const STARTS: u8 = 4;

    /// All delayed efforts are known, and one sample more.
    const BLIND: u8 = 14;

    /// Takes the largest effort that the drive gives, above zero, and the speed in `M`/s below which the shaft may be at rest: the
    /// noise of the speed, zero or more.
    ///
    /// # Errors
    /// Names `effort_limit` or `standstill` when it is negative, NaN or infinite, or a limit of zero.
    pub const fn new(effort_limit: f32, standstill: f32) -> Result<Self, ConfigError> {
        check!(positive("effort_limit", effort_limit));
        check!(not_negative("standstill", standstill));
        Ok(Self {
            effort_limit,
            standstill,
            lags: [Lag::ZERO; Self::LAGS + 1],
            common: Common::ZERO,
            integrals: [0.0; 3],
            change: 0.0,
            velocity: 0.0,
            settled_s: 0.0,
            time: Sum::ZERO,
            samples: 0,
            saturated: 0,
            blind: 1,
            still: 0,
            rejected: 0,
        })
    }

    /// Takes one tick: the effort that is sent now, the speed in `M`/s that is measured now, and the seconds since the tick before.
    ///
    /// Costs 1523 instructions on a Cortex-M4F, in motion (`docs/figures.md`).
    pub fn sample(&mut self, effort: f32, velocity: f32, dt_s: f32) {
        let step = TimeStep::of(dt_s);
        if !step.admits(effort.is_finite() && velocity.is_finite(), &mut self.rejected) {
            self.blind = Self::BLIND;
            return;
        }
        let before = core::mem::replace(&mut self.velocity, velocity);
        let dt_s = step.dt_s();
        let keep = 1.0 / (1.0 + dt_s / Self::MEMORY_S);
        let [Lag { effort: last, .. }, ..] = self.lags;
        let jumps = (effort - last).abs() > JUMP * self.effort_limit;
        self.settled_s = if jumps { 0.0 } else { self.settled_s + dt_s };
        let mut newest = effort;
        for lag in &mut self.lags {
            lag.integral = keep * lag.integral + lag.effort * dt_s;
            core::mem::swap(&mut newest, &mut lag.effort);
        }
        let was_resting = self.still >= RESTS;
        let is_still = velocity.abs() <= self.standstill;
        self.still = if is_still { self.still.saturating_add(1) } else { 0 };
        if effort.abs() > self.effort_limit {
            self.saturated = self.saturated.saturating_add(1);
            self.blind = Self::BLIND;
        } else if step.is_frozen() {
            self.blind = Self::BLIND;
        }
        if was_resting && !is_still {
            // The sample that ends the rest is one with more noise than others.
            self.blind = self.blind.max(Self::STARTS);
        }
        if self.blind > 0 || was_resting {
            self.blind = self.blind.saturating_sub(1);
            self.restart();
            return;
        }
        let [speed, direction, one] = &mut self.integrals;
        *speed = keep * *speed + 0.5 * (before + velocity) * dt_s;
        *direction = keep * *direction + mean_direction(before, velocity) * dt_s;
        *one = keep * *one + dt_s;
        self.change = keep * self.change + (velocity - before);
        if self.settled_s < Self::SETTLES_S {
            return;
        }
        self.time.add(dt_s);
        self.samples = self.samples.saturating_add(1);
        self.common.add(self.integrals, self.change);
        let mut former = 0.0;
        for lag in &mut self.lags {
            lag.add(former, self.integrals, self.change);
            former = lag.integral;
        }
    }

    fn restart(&mut self) {
        (self.integrals, self.change) = ([0.0; 3], 0.0);
        for lag in &mut self.lags {
            lag.integral = 0.0;
        }
    }

    /// Returns the plant of all samples until now: some ten thousand instructions, for one call after the run.
    ///
    /// # Errors
    /// [`IdentificationError::Saturated`], [`NotExcited`](IdentificationError::NotExcited),
    /// [`DelayTooLong`](IdentificationError::DelayTooLong) or [`TooNoisy`](IdentificationError::TooNoisy).
    pub fn result(&self) -> Result<Plant, IdentificationError> {
        if self.saturated > self.samples {
            return Err(IdentificationError::Saturated);
        }
        if self.samples < LEAST_SAMPLES {
            return Err(IdentificationError::NotExcited);
        }
        let fit = self.common.fit(&self.lags).ok_or(IdentificationError::NotExcited)?;
        let samples = self.samples as f32;
        let ka = 1.0 / fit.gain;
        let variance = fit.rest.max(0.0) / samples;
        let (of_gain, [of_kv, of_ks, _]) = fit.variances();
        let deviation = |spread: f32| math::sqrt(variance * spread);
        let relative = deviation(of_gain) * ka;
        // Not written the other way round: NaN is noise too.
        if !(relative <= MOST_DEVIATION && ka.is_finite()) {
            return Err(IdentificationError::TooNoisy);
        }
        if fit.delay_ticks >= Self::LAGS as f32 {
            return Err(IdentificationError::DelayTooLong);
        }
        let tick_s = self.time.value() / samples;
        let [kv, ks, bias] = fit.common.map(|coefficient| -coefficient * ka);
        Ok(Plant {
            ks: ks.max(0.0),
            kv: kv.max(0.0),
            ka,
            bias,
            delay_s: fit.delay_ticks * tick_s,
            tick_s,
            ks_deviation: deviation(of_ks),
            kv_deviation: deviation(of_kv),
            ka_deviation: relative * ka,
            noise: math::sqrt(variance),
        })
    }

    /// Returns the number of samples in the estimate.
    #[must_use]
    pub const fn samples(&self) -> u32 {
        self.samples
    }

    /// Returns the number of samples left out because a value was not finite or the time step not valid.
    #[must_use]
    pub const fn rejected(&self) -> u16 {
        self.rejected
    }
}

/// Returns the mean of the sign of a speed that changes evenly from one value to the other.
fn mean_direction(from: f32, to: f32) -> f32 {
    let sum = from.abs() + to.abs();
    if sum > 0.0 { (from + to) / sum } else { 0.0 }
}

/// The reason for a run without a plant.
///
/// # Examples
/// ```
/// use drivetrain::control::{Identification, IdentificationError};
///
/// let still = Identification::new(10.0, 0.1)?;
/// let error = still.result().unwrap_err();
/// assert_eq!(error, IdentificationError::NotExcited);
/// assert_eq!(error.to_string(), "not excited: both directions, several speeds and reversals of the effort are necessary");
/// # Ok::<(), drivetrain::error::ConfigError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum IdentificationError {
    /// Too few samples in motion, or a motion that does not separate friction, resistance and inertia: one direction, one speed,
    /// no reversal of the effort; a shaft that the effort does not move.
    NotExcited,
    /// The standard deviation of `kA` is above 5 %: more time, more effort, or less noise of the speed is necessary.
    TooNoisy,
    /// More samples had an effort beyond the limit of the drive than within.
    Saturated,
    /// The response is later than the largest delay that is searched, [`Identification::LAGS`](Identification::LAGS) ticks.
    DelayTooLong,
    /// The speed exceeded the limit of the excitation.
    TooFast,
    /// The way exceeded the limit of the excitation.
    TooFar,
    /// The feedback was NaN or infinite, or missing for more than 0.1 s, while the excitation drove the motor.
    NoFeedback,
}

impl fmt::Display for IdentificationError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NotExcited => {
                "not excited: both directions, several speeds and reversals of the effort are necessary"
            }
            Self::TooNoisy => "too noisy: the inertia is uncertain by more than 5 %",
            Self::Saturated => "saturated: most efforts are beyond the limit of the drive",
            Self::DelayTooLong => "the delay is longer than 12 ticks",
            Self::TooFast => "stopped: the speed is beyond its limit",
            Self::TooFar => "stopped: the way is beyond its limit",
            Self::NoFeedback => "stopped: no valid feedback",
        })
    }
}

impl core::error::Error for IdentificationError {}
