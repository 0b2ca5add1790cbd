use super::error::{ConfigError, ConfigFault, check, positive};
use super::number::finite;
use super::step::TimeStep;
use crate::math;

/// The linear tracking differentiator: follows a signal as a critically damped system would and gives its rate of change.
///
/// ```text
/// value' = rate,   rate' = -r^2 (value - input) - 2 r rate
/// ```
/// Stepped by Euler's rule, which does not overshoot a constant input as long as `r dt <= 1`: a configuration beyond is refused.
/// A step of the input is followed to 4 % after `5 / r` seconds.
///
/// # Edge behaviour
/// `dt_s` zero, negative, NaN or infinite, and an input that is NaN or infinite: nothing changes. `dt_s` above the
/// maximum: counts as the maximum. Starts from zero at rest; see [`reset_to`](Self::reset_to).
///
/// # Examples
/// ```
/// use drivetrain::control::LinearDifferentiator;
///
/// let mut follow = LinearDifferentiator::new(100.0, 0.001)?;
/// for _ in 0..50 {
///     follow.update(1.0, 0.001);
/// }
/// assert!((follow.value() - 0.96).abs() < 0.01 && follow.rate() > 0.0);
/// assert!(LinearDifferentiator::new(100.0, 0.02).is_err()); // r dt = 2: would oscillate
/// # Ok::<(), drivetrain::control::ConfigError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct LinearDifferentiator {
    r: f32,
    max_step_s: f32,
    value: f32,
    rate: f32,
}

impl LinearDifferentiator {
    /// Takes `r`, the speed of following in 1/s, and the longest step in seconds.
    ///
    /// # Errors
    /// Names `r` or `max_step` when NaN, infinite, zero or negative; `r` when `r * max_step_s` is above 1.
    pub const fn new(r: f32, max_step_s: f32) -> Result<Self, ConfigError> {
        check!(positive("r", r));
        check!(positive("max_step", max_step_s));
        if r * max_step_s > 1.0 {
            return Err(ConfigError::new("r", ConfigFault::Unstable));
        }
        Ok(Self { r, max_step_s, value: 0.0, rate: 0.0 })
    }

    /// Steps by `dt_s` seconds towards `input` and returns the new value.
    pub const fn update(&mut self, input: f32, dt_s: f32) -> f32 {
        self.step(input, &TimeStep::new(dt_s, self.max_step_s))
    }

    /// Steps by a time that was validated before.
    pub(super) const fn step(&mut self, input: f32, step: &TimeStep) -> f32 {
        let dt_s = if step.dt_s > self.max_step_s { self.max_step_s } else { step.dt_s };
        if dt_s > 0.0 && input.is_finite() {
            let error = finite(self.value - input);
            let pull = finite(self.r * finite(self.r * error + 2.0 * self.rate));
            self.value = finite(self.value + dt_s * self.rate);
            self.rate = finite(self.rate - dt_s * pull);
        }
        self.value
    }

    /// Puts the value at `value`, at rest. NaN and infinity count as zero.
    pub const fn reset_to(&mut self, value: f32) {
        self.value = if value.is_finite() { value } else { 0.0 };
        self.rate = 0.0;
    }

    /// Returns the value that follows the input.
    #[must_use]
    pub const fn value(&self) -> f32 {
        self.value
    }

    /// Returns its rate of change a second.
    #[must_use]
    pub const fn rate(&self) -> f32 {
        self.rate
    }
}

/// Han's time-optimal tracking differentiator: follows a signal with a bounded acceleration `r`, in the shortest time.
///
/// ```text
/// value' = rate,   rate' = fhan(value - input, rate, r, h0)
/// ```
/// `h0`, at least the time step, is the width over which the switching is smoothed: larger filters more noise.
/// Source: Han, "From PID to Active Disturbance Rejection Control", IEEE Transactions on Industrial Electronics 56 (2009), section IV.A.
///
/// # Edge behaviour
/// As for [`LinearDifferentiator`].
///
/// # Examples
/// ```
/// use drivetrain::control::OptimalDifferentiator;
///
/// // 1 m at no more than 4 m/s²: half a second up, half a second down.
/// let mut follow = OptimalDifferentiator::new(4.0, 0.002, 0.001)?;
/// for _ in 0..500 {
///     follow.update(1.0, 0.001);
/// }
/// assert!((follow.value() - 0.5).abs() < 0.01 && (follow.rate() - 2.0).abs() < 0.02);
/// # Ok::<(), drivetrain::control::ConfigError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct OptimalDifferentiator {
    r: f32,
    h0_s: f32,
    max_step_s: f32,
    value: f32,
    rate: f32,
}

impl OptimalDifferentiator {
    /// Takes the acceleration `r` (units of the input per s²), the smoothing width `h0_s` and the longest step, both in seconds.
    ///
    /// # Errors
    /// Names the parameter that is NaN, infinite, zero or negative; `h0` when it is below `max_step_s`, where the result
    /// would swing about the input.
    pub const fn new(r: f32, h0_s: f32, max_step_s: f32) -> Result<Self, ConfigError> {
        check!(positive("r", r));
        check!(positive("h0", h0_s));
        check!(positive("max_step", max_step_s));
        if h0_s < max_step_s {
            return Err(ConfigError::new("h0", ConfigFault::Unstable));
        }
        Ok(Self { r, h0_s, max_step_s, value: 0.0, rate: 0.0 })
    }

    /// Steps by `dt_s` seconds towards `input` and returns the new value.
    pub fn update(&mut self, input: f32, dt_s: f32) -> f32 {
        let step = TimeStep::new(dt_s, self.max_step_s);
        if !step.is_hold() && input.is_finite() {
            let acceleration = fhan(finite(self.value - input), self.rate, self.r, self.h0_s);
            self.value = finite(self.value + step.dt_s * self.rate);
            self.rate = finite(self.rate + step.dt_s * acceleration);
        }
        self.value
    }

    /// Puts the value at `value`, at rest. NaN and infinity count as zero.
    pub const fn reset_to(&mut self, value: f32) {
        self.value = if value.is_finite() { value } else { 0.0 };
        self.rate = 0.0;
    }

    /// Returns the value that follows the input.
    #[must_use]
    pub const fn value(&self) -> f32 {
        self.value
    }

    /// Returns its rate of change a second.
    #[must_use]
    pub const fn rate(&self) -> f32 {
        self.rate
    }
}

/// Returns Han's time-optimal acceleration, in ±`r`, that brings the discrete double integrator (`x1`, `x2`) to rest at zero.
///
/// `r` is the largest acceleration and `h` the step in seconds, both more than zero.
///
/// # Examples
/// ```
/// use drivetrain::control::fhan;
///
/// assert_eq!(fhan(1.0, 0.0, 2.0, 0.01), -2.0); // far off: full acceleration
/// assert_eq!(fhan(0.0, 0.0, 2.0, 0.01), 0.0);
/// ```
#[must_use]
pub fn fhan(x1: f32, x2: f32, r: f32, h: f32) -> f32 {
    let d = r * h * h;
    let drift = h * x2;
    let y = x1 + drift;
    let a = if y.abs() < d {
        // Within reach in two steps.
        drift + y
    } else {
        let root = math::sqrt(d) * math::sqrt(d + 8.0 * y.abs());
        drift + (0.5 * (root - d)).copysign(y)
    };
    if a.abs() < d { -r * (a / d) } else { -r.copysign(a) }
}
