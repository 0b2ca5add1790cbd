use crate::error::{
    ConfigError, check, gains, not_negative, off_or_positive, ordered, output_ends, positive,
};

/// An option outside of the plain step is on.
pub(super) const NOT_PLAIN: u16 = 1;
pub(super) const DERIVATIVE_ON_ERROR: u16 = 1 << 1;
pub(super) const INCREMENTAL: u16 = 1 << 2;
/// Set by a refused sample until the next good step, beside the options: the travel of the measurement in that time is unknown.
pub(super) const REST_DERIVATIVE: u16 = 1 << 3;
/// Set by `reset_to` until the next step, beside the options.
pub(super) const TRACK_OUTPUT: u16 = 1 << 4;

/// The numbers of a [`PidConfig`] stored by a controller as they are.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[repr(C)]
pub(super) struct Parameters {
    pub(super) kp: f32,
    pub(super) ki: f32,
    pub(super) kd: f32,
    pub(super) output_upper: f32,
    pub(super) output_lower: f32,
    pub(super) full_rate_below: f32,
    /// Equal to the former for an integral separation.
    pub(super) no_rate_above: f32,
    pub(super) dead_band: f32,
    pub(super) slew_per_s: f32,
    pub(super) derivative_time_s: f32,
    /// Of back-calculation. Zero for conditional integration, [`PidConfig::OFF`] without anti-windup: nothing is drained.
    pub(super) drain_time_s: f32,
}

/// Configuration of a [`Pid`](super::Pid): three gains, and options that are off until named.
///
/// With the output in a unit `U` and the measurement in a unit `M`, `kp` is in `U/M`, `ki` in `U/(M s)` and `kd`
/// in `U s/M`: the gains of the continuous-time controller, the same at every loop rate.
///
/// # Examples
/// ```
/// use drivetrain::control::{Pid, PidConfig};
///
/// const SPEED: PidConfig =
///     PidConfig::new(2.0, 2.5, 0.0).with_output_limit(20.0).with_integral_limit(10.0);
/// assert!(SPEED.validate().is_ok());
/// // In a constant, a bad parameter does not compile:
/// const LOOP: Pid = match Pid::new(SPEED) {
///     Ok(pid) => pid,
///     Err(_) => panic!("the speed loop is not valid"),
/// };
/// ```
/// As this does not:
/// ```compile_fail
/// # use drivetrain::control::{Pid, PidConfig};
/// const LOOP: Pid = match Pid::new(PidConfig::new(2.0, 2.5, 0.0).with_output_limit(-20.0)) {
///     Ok(pid) => pid,
///     Err(_) => panic!("the speed loop is not valid"),
/// };
/// # let pid = LOOP;
/// ```
#[must_use]
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct PidConfig {
    pub(super) parameters: Parameters,
    pub(super) integral_limit: f32,
    pub(super) static_gain: f32,
    pub(super) velocity_gain: f32,
    /// Zero without one.
    pub(super) period: f32,
    /// Zero without tracking.
    pub(super) tracking_r: f32,
    pub(super) derivative_on_error: bool,
    pub(super) incremental: bool,
}

impl PidConfig {
    /// An option given as a threshold or a rate, off at first.
    pub(super) const OFF: f32 = f32::MAX;

    /// Takes the gains: proportional, integral (1/s times the unit of `kp`) and derivative (s times the unit of `kp`).
    ///
    /// Each must be finite and zero or more.
    pub const fn new(kp: f32, ki: f32, kd: f32) -> Self {
        Self {
            parameters: Parameters {
                kp,
                ki,
                kd,
                output_upper: Self::OFF,
                output_lower: -Self::OFF,
                full_rate_below: Self::OFF,
                no_rate_above: Self::OFF,
                dead_band: 0.0,
                slew_per_s: Self::OFF,
                derivative_time_s: 0.0,
                drain_time_s: 0.0,
            },
            integral_limit: Self::OFF,
            static_gain: 0.0,
            velocity_gain: 0.0,
            period: 0.0,
            tracking_r: 0.0,
            derivative_on_error: false,
            incremental: false,
        }
    }

    /// Keeps the output in ±`limit`, more than zero. Off by default.
    ///
    /// While the output is at its limit, the integral does not grow in that direction (conditional integration).
    pub const fn with_output_limit(self, limit: f32) -> Self {
        self.with_output_range(-limit, limit)
    }

    /// Keeps the output from `output_lower` to `output_upper`, which is above `output_lower`; otherwise as [`with_output_limit`](Self::with_output_limit).
    pub const fn with_output_range(self, output_lower: f32, output_upper: f32) -> Self {
        Self { parameters: Parameters { output_lower, output_upper, ..self.parameters }, ..self }
    }

    /// Keeps the integral term (in units of the output) in ±`limit`, more than zero. Off by default.
    pub const fn with_integral_limit(self, limit: f32) -> Self {
        Self { integral_limit: limit, ..self }
    }

    /// Lets the integral rest while the error is beyond ±`threshold`, more than zero. Off by default: the integral always works.
    ///
    /// Of this and [`with_variable_integral`](Self::with_variable_integral), the later call counts.
    pub const fn with_integral_separation(mut self, threshold: f32) -> Self {
        self.parameters.full_rate_below = threshold;
        self.parameters.no_rate_above = threshold;
        self
    }

    /// Integrates at full rate for an error up to `full_below`, not at all from `none_above` on, and in proportion between.
    ///
    /// `full_below` must be zero or more and lie below `none_above`. Off by default.
    pub const fn with_variable_integral(mut self, full_below: f32, none_above: f32) -> Self {
        self.parameters.full_rate_below = full_below;
        let is_step = full_below.to_bits() == none_above.to_bits();
        self.parameters.no_rate_above = if is_step { f32::NAN } else { none_above };
        self
    }

    /// Uses back-calculation instead of conditional integration: the part of the output beyond the limits drains the
    /// integral with the time constant `time_s`, more than zero.
    pub const fn with_back_calculation(self, time_s: f32) -> Self {
        Self { parameters: Parameters { drain_time_s: not_off(time_s), ..self.parameters }, ..self }
    }

    /// Lets the integral grow while the output is at its limit, as far as its own limit.
    pub const fn without_anti_windup(self) -> Self {
        Self { parameters: Parameters { drain_time_s: Self::OFF, ..self.parameters }, ..self }
    }

    /// Counts an error smaller than `width` as zero; an error of exactly `width` counts in full. Zero or more; zero, the default,
    /// is off.
    ///
    /// Inside the band P is zero and the integral moves towards zero only: the integral does not grow, and a wound-up
    /// integral is not frozen either.
    pub const fn with_dead_band(self, width: f32) -> Self {
        Self { parameters: Parameters { dead_band: width, ..self.parameters }, ..self }
    }

    /// Adds `static_gain * sign(setpoint) + velocity_gain * setpoint` to the output. Zero or more; zero by default.
    ///
    /// For speed loops: the effort to overcome dry friction (in units of the output), and the effort for a unit of speed. The
    /// setpoint is taken as `measurement + e`: on a circle, the setpoint next to the measurement, in any turn. A setpoint
    /// removed from the error by rounding counts as zero. A step with a given error has no feed-forward.
    pub const fn with_feed_forward(self, static_gain: f32, velocity_gain: f32) -> Self {
        Self { static_gain, velocity_gain, ..self }
    }

    /// Lets the output change by at most `per_s` a second, more than zero. Off by default.
    ///
    /// The output starts from zero, or from the value given to [`Pid::reset_to`](super::Pid::reset_to). The part cut off counts
    /// as saturation. A change in a step of less than half the spacing of `f32` at the output is lost: 4e-3 a second at an output
    /// of 100 and 1 kHz.
    pub const fn with_slew_limit(self, per_s: f32) -> Self {
        Self { parameters: Parameters { slew_per_s: per_s, ..self.parameters }, ..self }
    }

    /// Takes setpoint and measurement as points on a circle of `period` (360.0, 2 pi, 8192.0), more than zero.
    ///
    /// The error and the derivative go by the shortest way. Off by default. Beyond 4 million periods `f32` holds no angle any more,
    /// and the way is any of at most half a period.
    pub const fn with_period(self, period: f32) -> Self {
        Self { period: not_off(period), ..self }
    }

    /// Filters the derivative with a first-order low-pass of this cut-off frequency, more than zero. Off by default.
    pub const fn with_derivative_filter(self, cutoff_hz: f32) -> Self {
        let derivative_time_s = not_off(1.0 / (core::f32::consts::TAU * cutoff_hz));
        Self { parameters: Parameters { derivative_time_s, ..self.parameters }, ..self }
    }

    /// Takes the derivative of the error, so D also responds to changes of the setpoint.
    ///
    /// The default is the derivative of the measurement, without a kick when the setpoint jumps.
    pub const fn with_derivative_on_error(self) -> Self {
        Self { derivative_on_error: true, ..self }
    }

    /// Leads the setpoint through a linear tracking differentiator of speed `r` in 1/s, more than zero. Off by default.
    ///
    /// A step of the setpoint is followed to 4 % after `5 / r` seconds, without overshoot, from the first measurement on: see
    /// [`Differentiator::linear`](crate::control::Differentiator::linear). A time step longer than `1 / r` counts as `1 / r`, the
    /// fastest tracking without overshoot. With a given error there is no setpoint to follow. Excludes a period: a
    /// [`Differentiator::optimal`](crate::control::Differentiator::optimal) in front of the controller follows an angle.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::control::{Pid, PidConfig};
    /// use drivetrain::time::TimeStep;
    ///
    /// let mut pid = Pid::new(PidConfig::new(1.0, 0.0, 0.0).with_tracking(100.0))?;
    /// let step = TimeStep::of(0.001);
    /// assert_eq!(pid.step(1.0, 0.0, &step), 0.0); // the setpoint starts where the shaft is
    /// for _ in 0..50 {
    ///     pid.step(1.0, 0.0, &step);
    /// }
    /// assert!((pid.output() - 0.96).abs() < 0.01);
    /// # Ok::<(), drivetrain::error::ConfigError>(())
    /// ```
    pub const fn with_tracking(self, r: f32) -> Self {
        Self { tracking_r: not_off(r), ..self }
    }

    /// Takes the incremental form: the output is the memory. Off by default.
    ///
    /// Each step gives the output of the positional form. New gains never move the output, and
    /// [`Pid::reset_to`](super::Pid::reset_to) starts from any output, with `ki` zero too: see [`Pid`](super::Pid).
    ///
    /// # Examples
    /// ```
    /// use drivetrain::control::{Pid, PidConfig};
    /// use drivetrain::time::TimeStep;
    ///
    /// let mut pid = Pid::new(PidConfig::new(2.0, 0.0, 0.0).with_incremental_form())?;
    /// let step = TimeStep::of(0.001);
    /// pid.reset_to(5.0);
    /// assert_eq!(pid.step(1.0, 0.0, &step), 5.0);
    /// assert_eq!(pid.step(1.5, 0.0, &step), 6.0); // 2 times the change of the error
    /// pid.set_gains(8.0, 0.0, 0.0)?;
    /// assert_eq!(pid.step(1.5, 0.0, &step), 6.0);
    /// # Ok::<(), drivetrain::error::ConfigError>(())
    /// ```
    pub const fn with_incremental_form(self) -> Self {
        Self { incremental: true, ..self }
    }

    /// Replaces the three gains.
    pub const fn with_gains(self, kp: f32, ki: f32, kd: f32) -> Self {
        Self { parameters: Parameters { kp, ki, kd, ..self.parameters }, ..self }
    }

    /// Returns `(kp, ki, kd)`.
    #[must_use]
    pub const fn gains(&self) -> (f32, f32, f32) {
        (self.parameters.kp, self.parameters.ki, self.parameters.kd)
    }

    /// Returns the ends of the output; ±`f32::MAX` without a limit.
    #[must_use]
    pub const fn output_range(&self) -> (f32, f32) {
        (self.parameters.output_lower, self.parameters.output_upper)
    }

    /// Returns the period of the circle; zero without a circle.
    #[must_use]
    pub const fn period(&self) -> f32 {
        self.period
    }

    /// Checks every parameter.
    ///
    /// # Errors
    /// Names the first parameter that is NaN, infinite, negative, zero where zero is invalid, or reversed; `r` with a
    /// period.
    pub const fn validate(&self) -> Result<(), ConfigError> {
        let p = &self.parameters;
        check!(gains(p.kp, p.ki, p.kd));
        check!(output_ends(p.output_lower, p.output_upper));
        check!(positive("integral_limit", self.integral_limit));
        if p.full_rate_below.to_bits() == p.no_rate_above.to_bits() {
            check!(positive("integral_separation", p.full_rate_below));
        } else {
            check!(not_negative("variable_integral", p.full_rate_below));
            check!(ordered("variable_integral", p.full_rate_below, p.no_rate_above));
        }
        check!(not_negative("dead_band", p.dead_band));
        check!(not_negative("static_gain", self.static_gain));
        check!(not_negative("velocity_gain", self.velocity_gain));
        check!(positive("slew_limit", p.slew_per_s));
        check!(off_or_positive("period", self.period));
        check!(off_or_positive("derivative_filter", p.derivative_time_s));
        check!(off_or_positive("back_calculation", p.drain_time_s));
        check!(ConfigError::check_conflict(self.tracking_r > 0.0 && self.period > 0.0, "r"));
        off_or_positive("r", self.tracking_r)
    }

    /// Tells whether an option works on the setpoint: feed-forward, period, tracking, derivative of the error.
    pub(crate) const fn needs_setpoint(&self) -> bool {
        let has_feed_forward = self.static_gain > 0.0 || self.velocity_gain > 0.0;
        let has_way = self.period > 0.0 || self.tracking_r > 0.0;
        has_feed_forward || has_way || self.derivative_on_error
    }

    /// Returns the options in use.
    pub(super) const fn options(&self) -> u16 {
        let p = &self.parameters;
        let is_even = p.output_lower + p.output_upper == 0.0 && p.no_rate_above >= Self::OFF;
        let is_direct = p.dead_band + p.derivative_time_s == 0.0 && p.slew_per_s >= Self::OFF;
        let is_plain = is_even && is_direct && p.drain_time_s == 0.0 && !self.needs_setpoint();
        let shape = if is_plain { 0 } else { NOT_PLAIN };
        let derivative = if self.derivative_on_error { DERIVATIVE_ON_ERROR } else { 0 };
        let form = if self.incremental { INCREMENTAL } else { 0 };
        shape | derivative | form
    }
}

/// Zero means off: a given value of zero or less is stored as NaN, which is refused.
const fn not_off(value: f32) -> f32 {
    // Half a period must be a normal number too.
    if value >= 2.0 * f32::MIN_POSITIVE { value } else { f32::NAN }
}

#[cfg(all(test, feature = "serde"))]
mod tests {
    use super::*;

    #[test]
    fn a_configuration_survives_a_file_and_is_checked_when_used() {
        let config = PidConfig::new(2.0, 0.5, 0.01).with_output_limit(20.0).with_period(360.0);
        let text = serde_json::to_string(&config).unwrap();
        assert_eq!(serde_json::from_str::<PidConfig>(&text).unwrap(), config);
        let plain = serde_json::to_string(&PidConfig::new(1.0, 0.0, 0.0)).unwrap();
        assert_eq!(
            serde_json::from_str::<PidConfig>(&plain).unwrap(),
            PidConfig::new(1.0, 0.0, 0.0)
        );
        let spoiled = text.replace("\"kp\":2.0", "\"kp\":-2.0");
        let spoiled: PidConfig = serde_json::from_str(&spoiled).unwrap();
        assert_eq!(spoiled.validate().unwrap_err().parameter(), "kp");
    }
}
