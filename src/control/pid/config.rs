use crate::control::error::{
    ConfigError, check, gains, not_negative, off_or_positive, ordered, output_ends, positive,
};

/// What a [`Pid`](super::Pid) is made from: three gains, and options that are off until named.
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
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct PidConfig {
    pub(super) kp: f32,
    pub(super) ki: f32,
    pub(super) kd: f32,
    pub(super) output_lower: f32,
    pub(super) output_upper: f32,
    pub(super) integral_limit: f32,
    pub(super) integral_separation: f32,
    pub(super) full_rate_below: f32,
    pub(super) no_rate_above: f32,
    pub(super) dead_band: f32,
    pub(super) static_gain: f32,
    pub(super) velocity_gain: f32,
    pub(super) slew_per_s: f32,
    pub(super) period: f32,
    pub(super) derivative_time_s: f32,
    pub(super) tracking_time_s: f32,
    pub(super) derivative_on_error: bool,
    pub(super) wind_up: bool,
}

impl PidConfig {
    /// An option that is a threshold or a rate, and off.
    pub(super) const OFF: f32 = f32::MAX;

    /// Takes the gains: proportional, integral (1/s times the unit of `kp`) and derivative (s times the unit of `kp`).
    ///
    /// Each must be finite and zero or more.
    #[must_use]
    pub const fn new(kp: f32, ki: f32, kd: f32) -> Self {
        Self {
            kp,
            ki,
            kd,
            output_lower: -Self::OFF,
            output_upper: Self::OFF,
            integral_limit: Self::OFF,
            integral_separation: Self::OFF,
            full_rate_below: Self::OFF,
            no_rate_above: Self::OFF,
            dead_band: 0.0,
            static_gain: 0.0,
            velocity_gain: 0.0,
            slew_per_s: Self::OFF,
            period: 0.0,
            derivative_time_s: 0.0,
            tracking_time_s: 0.0,
            derivative_on_error: false,
            wind_up: false,
        }
    }

    /// Keeps the output in ±`limit`, more than zero. Off by default.
    ///
    /// While the output is at its limit, the integral does not grow in that direction (conditional integration).
    #[must_use]
    pub const fn with_output_limit(self, limit: f32) -> Self {
        self.with_output_range(-limit, limit)
    }

    /// Keeps the output in `lower..=upper`, `lower` below `upper`; otherwise as [`with_output_limit`](Self::with_output_limit).
    #[must_use]
    pub const fn with_output_range(self, lower: f32, upper: f32) -> Self {
        Self { output_lower: lower, output_upper: upper, ..self }
    }

    /// Keeps the integral term (in units of the output) in ±`limit`, more than zero. Off by default.
    #[must_use]
    pub const fn with_integral_limit(self, limit: f32) -> Self {
        Self { integral_limit: limit, ..self }
    }

    /// Lets the integral rest while the error is beyond ±`threshold`, more than zero. Off by default: the integral always works.
    #[must_use]
    pub const fn with_integral_separation(self, threshold: f32) -> Self {
        Self { integral_separation: threshold, ..self }
    }

    /// Integrates at full rate for an error up to `full_below`, not at all from `none_above` on, and in proportion between.
    ///
    /// `full_below` must be zero or more and lie below `none_above`. Off by default.
    #[must_use]
    pub const fn with_variable_integral(self, full_below: f32, none_above: f32) -> Self {
        Self { full_rate_below: full_below, no_rate_above: none_above, ..self }
    }

    /// Uses back-calculation instead of conditional integration: what the limits cut off the output drains the
    /// integral with the time constant `tracking_time_s`, more than zero.
    #[must_use]
    pub const fn with_back_calculation(self, tracking_time_s: f32) -> Self {
        Self { tracking_time_s: not_off(tracking_time_s), wind_up: false, ..self }
    }

    /// Lets the integral grow while the output is at its limit, as far as its own limit.
    #[must_use]
    pub const fn without_anti_windup(self) -> Self {
        Self { tracking_time_s: 0.0, wind_up: true, ..self }
    }

    /// Counts an error smaller than `width` as none; one of exactly `width` counts in full. Zero or more; zero, the default, is off.
    ///
    /// Inside the band P is zero and the integral moves towards zero only: it does not grow, but one that is wound up
    /// is not frozen either.
    #[must_use]
    pub const fn with_dead_band(self, width: f32) -> Self {
        Self { dead_band: width, ..self }
    }

    /// Adds `static_gain * sign(setpoint) + velocity_gain * setpoint` to the output. Zero or more; zero by default.
    ///
    /// For speed loops: the effort that overcomes dry friction (in units of the output), and the effort a unit of speed takes.
    /// The setpoint is taken as `measurement + e`: on a circle it is the one next to the measurement, whatever its turn, and
    /// one that is lost in the rounding of the error counts as zero. With an error formed elsewhere there is none.
    #[must_use]
    pub const fn with_feed_forward(self, static_gain: f32, velocity_gain: f32) -> Self {
        Self { static_gain, velocity_gain, ..self }
    }

    /// Lets the output change by at most `per_s` a second, more than zero. Off by default.
    ///
    /// The output starts from zero, or from the value given to [`Pid::reset_to`](super::Pid::reset_to). What it cuts off
    /// counts as saturation. A change in a step of less than half the spacing of `f32` at the output is none: 4e-3 a second at an
    /// output of 100 and 1 kHz.
    #[must_use]
    pub const fn with_slew_limit(self, per_s: f32) -> Self {
        Self { slew_per_s: per_s, ..self }
    }

    /// Takes setpoint and measurement as points on a circle of `period` (360.0, 2 pi, 8192.0), more than zero.
    ///
    /// The error and the derivative go by the shortest way. Off by default.
    #[must_use]
    pub const fn with_period(self, period: f32) -> Self {
        Self { period: not_off(period), ..self }
    }

    /// Filters the derivative with a first-order low-pass of this cut-off frequency, more than zero. Off by default.
    #[must_use]
    pub const fn with_derivative_filter(self, cutoff_hz: f32) -> Self {
        Self { derivative_time_s: not_off(1.0 / (core::f32::consts::TAU * cutoff_hz)), ..self }
    }

    /// Takes the derivative of the error, so that D answers changes of the setpoint too.
    ///
    /// The default is the derivative of the measurement, without a kick when the setpoint jumps.
    #[must_use]
    pub const fn with_derivative_on_error(self) -> Self {
        Self { derivative_on_error: true, ..self }
    }

    /// Replaces the three gains.
    #[must_use]
    pub const fn with_gains(self, kp: f32, ki: f32, kd: f32) -> Self {
        Self { kp, ki, kd, ..self }
    }

    /// Returns `(kp, ki, kd)`.
    #[must_use]
    pub const fn gains(&self) -> (f32, f32, f32) {
        (self.kp, self.ki, self.kd)
    }

    /// Returns the ends of the output; ±`f32::MAX` without a limit.
    #[must_use]
    pub const fn output_range(&self) -> (f32, f32) {
        (self.output_lower, self.output_upper)
    }

    /// Returns the period of the circle; zero without one.
    #[must_use]
    pub const fn period(&self) -> f32 {
        self.period
    }

    /// Checks every parameter.
    ///
    /// # Errors
    /// Names the first parameter that is NaN, infinite, negative, zero where it must not be, or reversed.
    pub const fn validate(&self) -> Result<(), ConfigError> {
        check!(gains(self.kp, self.ki, self.kd));
        check!(output_ends(self.output_lower, self.output_upper));
        check!(positive("integral_limit", self.integral_limit));
        check!(positive("integral_separation", self.integral_separation));
        check!(not_negative("variable_integral", self.full_rate_below));
        if self.no_rate_above < Self::OFF || self.full_rate_below < Self::OFF {
            check!(ordered("variable_integral", self.full_rate_below, self.no_rate_above));
        } else {
            check!(positive("variable_integral", self.no_rate_above));
        }
        check!(not_negative("dead_band", self.dead_band));
        check!(not_negative("static_gain", self.static_gain));
        check!(not_negative("velocity_gain", self.velocity_gain));
        check!(positive("slew_limit", self.slew_per_s));
        check!(off_or_positive("period", self.period));
        check!(off_or_positive("derivative_filter", self.derivative_time_s));
        off_or_positive("back_calculation", self.tracking_time_s)
    }
}

/// Zero means off: what is no more than that, but was given, is kept as the NaN that is refused.
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
