use crate::control::number::{finite, friction};
use crate::control::pid::PidConfig;
use crate::error::{ConfigError, check, not_negative, positive};
use crate::math;
use crate::units::Angle;
use core::f32::consts::{FRAC_PI_2, PI};

/// A motor on its mechanism: friction, resistance, inertia and delay; and gains for it by bandwidth and phase margin.
///
/// ```text
/// kA v' + kV v + kS sign(v) + bias = u(t - delay)      P(s) = exp(-s delay) / (kA s + kV)
/// ```
/// With an effort `u` in `U` (A, V, Nm) and a speed `v` in `M`/s, the results of an
/// [`Identification`](super::Identification) or of [`new`](Self::new).
///
/// # Gains
/// Dead time and hold of a tick turn the phase by `w (delay + tick/2)` at the angular frequency `w`. A speed loop crosses over at the
/// bandwidth `w` with the phase margin `m`, so the controller has to have the inverse gain of the plant there and the phase `p` that
/// is left:
///
/// ```text
/// p  = m - 180° + atan(w kA / kV) + w (delay + tick/2)      has to lie in -75° to 0°
/// kp = |kA jw + kV| cos p
/// ki = -|kA jw + kV| w sin p
/// ```
/// A phase above zero is out of the reach of a PI controller: an error names the largest margin. Below -75°, the loop takes -75° and
/// its margin is larger than required. `kS` and `kV` become the feed-forward of the loop.
///
/// Source: K. J. Åström and T. Hägglund, *Advanced PID Control* (2006), 5.4 (phase margin at a given crossover) and 3.5
/// (delay as an exact phase).
///
/// # Examples
/// ```
/// use drivetrain::control::Plant;
/// use drivetrain::units::Angle;
///
/// let wheel = Plant::new(0.4, 0.0, 0.03, 0.003, 0.001)?; // A, A s/rad, A s²/rad, s, s
/// let margin = Angle::from_degrees(60.0);
/// let (kp, ki, _) = wheel.speed_loop(50.0, margin)?.gains();
/// // p = 60° - 180° + 90° + 50 rad/s * 3.5 ms = -30° + 10.03° = -19.97°
/// assert!((kp - 1.4098).abs() < 1e-3); // 0.03 * 50 * cos p
/// assert!((ki - 25.62).abs() < 1e-2); // 0.03 * 50 * 50 * sin 19.97°
///
/// let error = wheel.speed_loop(200.0, margin).unwrap_err();
/// assert_eq!(error.parameter(), "phase margin in degrees"); // at most 49.9
/// # Ok::<(), drivetrain::error::ConfigError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Plant {
    /// Dry friction in `U`, zero or more.
    pub ks: f32,
    /// Resistance that grows with the speed (viscous friction, back-EMF), in `U s/M`, zero or more.
    pub kv: f32,
    /// Inertia in `U s²/M`, above zero.
    pub ka: f32,
    /// Constant effort for a standing or moving shaft, in `U`: positive for a weight that pulls backwards.
    pub bias: f32,
    /// Time in s from an effort to its effect in the measured speed, beyond the tick that holds the effort; zero or more.
    pub delay_s: f32,
    /// Time step of the loop in s, above zero.
    pub tick_s: f32,
    /// Standard deviation of `ks` in `U`, for noise that is white.
    pub ks_deviation: f32,
    /// Standard deviation of `kv` in `U s/M`, for noise that is white.
    pub kv_deviation: f32,
    /// Standard deviation of `ka` in `U s²/M`, for noise that is white.
    pub ka_deviation: f32,
    /// The part of the speed that the model leaves, in `M`/s: root of the mean square of the noise.
    pub noise: f32,
}

/// The largest lag of the controller at the crossover: 75 degrees.
const MOST_LAG: f32 = 75.0 * PI / 180.0;
/// The lag for which [`Plant::bandwidth`] leaves room: 15 degrees.
const USUAL_LAG: f32 = 15.0 * PI / 180.0;
/// Crossover of the speed loop under a position loop, over that of the position loop.
const INNER: f32 = 4.0;

impl Plant {
    /// Takes `kS`, `kV` and `kA`, the delay and the time step of the loop in s. The bias and the deviations are zero.
    ///
    /// # Errors
    /// Names `ks`, `kv` or `delay` when negative, NaN or infinite; `ka` or `tick` when not above zero and finite.
    pub const fn new(
        ks: f32,
        kv: f32,
        ka: f32,
        delay_s: f32,
        tick_s: f32,
    ) -> Result<Self, ConfigError> {
        let plant = Self {
            ks,
            kv,
            ka,
            bias: 0.0,
            delay_s,
            tick_s,
            ks_deviation: 0.0,
            kv_deviation: 0.0,
            ka_deviation: 0.0,
            noise: 0.0,
        };
        check!(plant.validate());
        Ok(plant)
    }

    /// Takes `kS`, `kV` and `kA` alone, for [`effort`](Self::effort). Each may be zero. Without a time step no loop is calculated.
    ///
    /// # Errors
    /// Names `ks`, `kv` or `ka` when NaN, infinite or negative.
    pub const fn of_gains(ks: f32, kv: f32, ka: f32) -> Result<Self, ConfigError> {
        check!(not_negative("ks", ks));
        check!(not_negative("kv", kv));
        check!(not_negative("ka", ka));
        Ok(Self {
            ks,
            kv,
            ka,
            bias: 0.0,
            delay_s: 0.0,
            tick_s: 0.0,
            ks_deviation: 0.0,
            kv_deviation: 0.0,
            ka_deviation: 0.0,
            noise: 0.0,
        })
    }

    const fn validate(&self) -> Result<(), ConfigError> {
        check!(not_negative("ks", self.ks));
        check!(not_negative("kv", self.kv));
        check!(positive("ka", self.ka));
        check!(not_negative("delay", self.delay_s));
        positive("tick", self.tick_s)
    }

    /// Returns the gain of the plant at an angular frequency in rad/s, inverted, and its lag in rad.
    fn inverse(&self, frequency: f32) -> (f32, f32) {
        let reactance = frequency * self.ka;
        let lag = math::atan2(reactance, self.kv);
        // sqrt(kv² + reactance²) without a square beyond `f32`.
        let (sine, cosine) = math::sin_cos(lag);
        let gain = if sine > cosine { reactance / sine } else { self.kv / cosine };
        (gain, lag + frequency * (self.delay_s + 0.5 * self.tick_s))
    }

    /// Returns a PI speed loop that crosses over at `bandwidth_rad_per_s`, above zero, with this phase margin: speed in `M`/s in,
    /// effort out, without limits. Set the output limit of the drive with [`PidConfig::with_output_limit`].
    ///
    /// # Errors
    /// `bandwidth` when not above zero and finite; the range of the phase margin that can be reached at this bandwidth, in
    /// degrees; a field of the plant, or a gain, outside of its range.
    pub fn speed_loop(
        &self,
        bandwidth_rad_per_s: f32,
        phase_margin: Angle,
    ) -> Result<PidConfig, ConfigError> {
        self.validate()?;
        positive("bandwidth", bandwidth_rad_per_s)?;
        let (gain, lag) = self.inverse(bandwidth_rad_per_s);
        let margin = phase_margin.as_radians();
        let most = PI - lag;
        if !(margin > 0.0 && margin <= most) {
            return Err(out_of_reach(phase_margin, most));
        }
        let of_controller = (most - margin).min(MOST_LAG);
        let (sine, cosine) = math::sin_cos(of_controller);
        let config = PidConfig::new(gain * cosine, gain * bandwidth_rad_per_s * sine, 0.0)
            .with_feed_forward(self.ks, self.kv);
        config.validate()?;
        Ok(config)
    }

    /// Returns the largest bandwidth in rad/s at which a [`speed_loop`](Self::speed_loop) has this phase margin and 15 degrees of
    /// lag for its integral.
    ///
    /// # Errors
    /// The range of the phase margin that any bandwidth can reach, in degrees; a field of the plant outside of its range.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::control::Plant;
    /// use drivetrain::units::Angle;
    ///
    /// let wheel = Plant::new(0.4, 0.0, 0.03, 0.003, 0.001)?;
    /// let bandwidth = wheel.bandwidth(Angle::from_degrees(60.0))?;
    /// assert!((bandwidth - 74.8).abs() < 0.1); // 15° in 3.5 ms
    /// # Ok::<(), drivetrain::error::ConfigError>(())
    /// ```
    pub fn bandwidth(&self, phase_margin: Angle) -> Result<f32, ConfigError> {
        self.validate()?;
        let margin = phase_margin.as_radians();
        let left = PI - USUAL_LAG - margin;
        let at_rest = if self.kv > 0.0 { 0.0 } else { FRAC_PI_2 };
        if !(margin > 0.0 && left > at_rest) {
            return Err(out_of_reach(phase_margin, PI - USUAL_LAG - at_rest));
        }
        // The lag grows with the frequency, and reaches what is left at the latest by the delay alone.
        let (mut low, mut high) = (0.0, left / (self.delay_s + 0.5 * self.tick_s));
        for _ in 0..40 {
            let middle = 0.5 * (low + high);
            let (_, lag) = self.inverse(middle);
            if lag < left {
                low = middle;
            } else {
                high = middle;
            }
        }
        Ok(low)
    }

    /// Returns a P position loop over a PI speed loop, `(position, speed)`: position in `M`, speed in `M`/s.
    ///
    /// The speed loop crosses over at four times the bandwidth, with the same phase margin. The gain of the position loop is the
    /// inverse of that of the closed speed loop and its integral at `bandwidth_rad_per_s`. Set the speed limit as the output
    /// limit of the position loop.
    ///
    /// # Errors
    /// As [`speed_loop`](Self::speed_loop) at four times the bandwidth; the largest phase margin of the position loop, in degrees.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::control::Plant;
    /// use drivetrain::units::Angle;
    ///
    /// let wheel = Plant::new(0.4, 0.0, 0.03, 0.003, 0.001)?;
    /// let (position, speed) = wheel.position_loop(10.0, Angle::from_degrees(60.0))?;
    /// let (inner, _, _) = wheel.speed_loop(40.0, Angle::from_degrees(60.0))?.gains();
    /// assert_eq!(speed.gains().0, inner);
    /// assert!((position.gains().0 - 8.796).abs() < 0.01); // 10 rad/s, over the speed loop's gain of 1.137 there
    /// # Ok::<(), drivetrain::error::ConfigError>(())
    /// ```
    pub fn position_loop(
        &self,
        bandwidth_rad_per_s: f32,
        phase_margin: Angle,
    ) -> Result<(PidConfig, PidConfig), ConfigError> {
        let frequency = bandwidth_rad_per_s;
        positive("bandwidth", frequency)?;
        let speed = self.speed_loop(INNER * frequency, phase_margin)?;
        let (kp, ki, _) = speed.gains();
        // The open speed loop at the bandwidth, as a complex number: gain and lag of controller and plant.
        let integral = ki / frequency;
        let of_controller = math::atan2(integral, kp);
        let (gain, lag) = self.inverse(frequency);
        let size = math::sqrt(kp * kp + integral * integral) / gain;
        let (sine, cosine) = math::sin_cos(of_controller + lag);
        let (real, imaginary) = (size * cosine, -size * sine);
        // Closed: L / (1 + L).
        let distance = math::sqrt((1.0 + real) * (1.0 + real) + imaginary * imaginary);
        let closed_lag = of_controller + lag + math::atan2(imaginary, 1.0 + real);
        let most = FRAC_PI_2 - closed_lag;
        if phase_margin.as_radians() > most {
            return Err(out_of_reach(phase_margin, most));
        }
        let position = PidConfig::new(frequency * distance / size, 0.0, 0.0);
        position.validate()?;
        Ok((position, speed))
    }

    /// Returns the effort for a velocity and an acceleration, for feed-forward: `kS sign(velocity) + kV velocity + kA acceleration`.
    ///
    /// The bias is left out. At rest, the sign is that of the acceleration: the effort to set off. NaN or infinity in an argument gives
    /// zero, and an overflowing sum ±`f32::MAX`, for any gains.
    ///
    /// Costs 46 instructions on a Cortex-M4F (`docs/figures.md`).
    ///
    /// # Examples
    /// For the states of a [`Profile`](crate::control::Profile):
    /// ```
    /// use drivetrain::control::Plant;
    ///
    /// const WHEEL: Plant = match Plant::of_gains(0.3, 0.05, 0.01) {
    ///     Ok(wheel) => wheel,
    ///     Err(_) => panic!("gains"),
    /// };
    /// assert_eq!(WHEEL.effort(10.0, 20.0), 1.0); // 0.3 + 0.5 + 0.2
    /// assert_eq!(WHEEL.effort(0.0, -20.0), -0.5); // sets off backwards
    /// ```
    #[must_use]
    pub const fn effort(&self, velocity: f32, acceleration: f32) -> f32 {
        if !(velocity.is_finite() && acceleration.is_finite()) {
            return 0.0;
        }
        let direction = if velocity == 0.0 { acceleration } else { velocity };
        let with_speed = finite(friction(self.ks, direction) + finite(self.kv * velocity));
        finite(with_speed + finite(self.ka * acceleration))
    }

    /// Returns the inertia in kg m² at the shaft, for speeds in rad/s and a torque of so many Nm for each `U`.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::control::Plant;
    ///
    /// let wheel = Plant::new(0.4, 0.0, 0.03, 0.003, 0.001)?; // A
    /// assert!((wheel.inertia_kg_m2(0.3) - 0.009).abs() < 1e-6); // an M3508: 0.3 Nm/A
    /// # Ok::<(), drivetrain::error::ConfigError>(())
    /// ```
    #[must_use]
    pub const fn inertia_kg_m2(&self, torque_constant_nm: f32) -> f32 {
        self.ka * torque_constant_nm
    }

    /// Returns the dry friction in Nm at the shaft, for a torque of so many Nm for each `U`.
    #[must_use]
    pub const fn friction_nm(&self, torque_constant_nm: f32) -> f32 {
        self.ks * torque_constant_nm
    }
}

/// The range of a phase margin, in degrees.
fn out_of_reach(phase_margin: Angle, most_rad: f32) -> ConfigError {
    ConfigError::Range {
        parameter: "phase margin in degrees",
        value: phase_margin.as_degrees(),
        least: 0.0,
        most: most_rad.to_degrees(),
    }
}
