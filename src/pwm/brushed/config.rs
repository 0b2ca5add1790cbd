use crate::control::{Pid, PidConfig};
use crate::error::ConfigError;
use crate::motor::{Condition, HealthConfig, MotorName, OPENING, Reaction, Timeouts};
use crate::time::Duration;
use crate::units::AngularVelocity;

/// Configuration of a brushed motor.
///
/// # Examples
/// ```
/// use drivetrain::control::PidConfig;
/// use drivetrain::pwm::BrushedConfig;
///
/// // 11 lines, counted fourfold, behind a gear of 30: 1320 counts a turn of the output shaft.
/// const WHEEL: BrushedConfig = BrushedConfig::new(1)
///     .with_encoder(11.0 * 4.0 * 30.0, 16)
///     .with_speed_loop(PidConfig::new(0.02, 0.3, 0.0)) // of full duty, per rad/s and per rad
///     .with_limit(0.8);
/// assert!(WHEEL.validate().is_ok());
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BrushedConfig {
    pub(super) name: MotorName,
    pub(super) counts_per_turn: Option<f32>,
    pub(super) counter_bits: u32,
    pub(super) filter_s: f32,
    pub(super) speed: Option<PidConfig>,
    pub(super) limit: f32,
    pub(super) reversed: bool,
    pub(super) timeouts: Timeouts,
    pub(super) opening: Duration,
    pub(super) no_load: Option<AngularVelocity>,
    pub(super) health: &'static HealthConfig,
}

impl BrushedConfig {
    /// Takes the number of the motor in errors. Without encoder and loop, with full duty as its limit.
    #[must_use]
    pub const fn new(id: u8) -> Self {
        Self {
            name: MotorName::new("brushed", id),
            counts_per_turn: None,
            counter_bits: 32,
            filter_s: 0.005,
            speed: None,
            limit: 1.0,
            reversed: false,
            timeouts: Timeouts::new(),
            opening: OPENING,
            no_load: None,
            health: &USUAL,
        }
    }

    /// Adds an encoder: its counts for a turn of the output shaft, and the width of its counter in bits, 8 to 32.
    #[must_use]
    pub const fn with_encoder(self, counts_per_turn: f32, counter_bits: u32) -> Self {
        Self { counts_per_turn: Some(counts_per_turn), counter_bits, ..self }
    }

    /// Sets the time constant that smooths the measured velocity, in s: 5 ms at first, 0 for none.
    #[must_use]
    pub const fn with_velocity_filter(self, time_constant_s: f32) -> Self {
        Self { filter_s: time_constant_s, ..self }
    }

    /// Adds a speed loop: rad/s of the output shaft in, a share of full duty out. The loop needs the encoder.
    #[must_use]
    pub const fn with_speed_loop(self, speed: PidConfig) -> Self {
        Self { speed: Some(speed), ..self }
    }

    /// Lowers the largest duty, for the loop and for direct commands alike: above 0, at most 1.
    #[must_use]
    pub const fn with_limit(self, share: f32) -> Self {
        Self { limit: share, ..self }
    }

    /// Turns the positive direction around, of duty and encoder alike.
    #[must_use]
    pub const fn reversed(self) -> Self {
        Self { reversed: !self.reversed, ..self }
    }

    /// Sets the time in which the output range opens after arming, from zero to the whole; 0.2 s at first.
    #[must_use]
    pub const fn with_opening(self, time: Duration) -> Self {
        Self { opening: time, ..self }
    }

    /// Sets when counts and targets count as lost.
    #[must_use]
    pub const fn with_timeouts(self, timeouts: Timeouts) -> Self {
        Self { timeouts, ..self }
    }

    /// Sets the speed of the output shaft at full duty without load. Without this speed, a runaway is not detected, for
    /// example of a motor whose encoder counts the wrong way.
    #[must_use]
    pub const fn with_no_load_speed(self, speed: AngularVelocity) -> Self {
        Self { no_load: Some(speed), ..self }
    }

    /// Sets the monitored conditions and reactions of a motor with an encoder. At first as [`HealthConfig::new`], but a
    /// stall relaxes: a broken encoder line looks the same, and a speed loop would drive the motor at full duty for
    /// ever.
    #[must_use]
    pub const fn with_health(self, config: &'static HealthConfig) -> Self {
        Self { health: config, ..self }
    }

    /// Checks every parameter.
    ///
    /// # Errors
    /// Names the first invalid parameter.
    pub fn validate(&self) -> Result<(), ConfigError> {
        let bad = |number: f32| !(number.is_finite() && number > 0.0);
        if let Err(parameter) = self.health.validate() {
            return Err(ConfigError::Unusable(parameter));
        }
        Err(ConfigError::Unusable(if self.counts_per_turn.is_some_and(bad) {
            "counts per turn"
        } else if !(8..=32).contains(&self.counter_bits) {
            "counter width"
        } else if !(self.filter_s.is_finite() && self.filter_s >= 0.0) {
            "velocity filter"
        } else if !(self.limit > 0.0 && self.limit <= 1.0) {
            "limit"
        } else if self.no_load.map(AngularVelocity::as_rad_per_s).is_some_and(bad) {
            "no-load speed"
        } else if self.speed.is_some() && self.counts_per_turn.is_none() {
            "speed loop without an encoder"
        } else {
            return self.make_loop().map(|_| ());
        }))
    }

    pub(super) fn make_loop(&self) -> Result<Option<Pid>, ConfigError> {
        let Some(speed) = self.speed else { return Ok(None) };
        let (lower, upper) = speed.output_range();
        // In this form NaN stays, and is refused.
        let lower = if lower < -self.limit { -self.limit } else { lower };
        let upper = if upper > self.limit { self.limit } else { upper };
        Pid::new(speed.with_output_range(lower, upper)).map(Some)
    }
}

/// The monitored conditions by default.
pub(super) static USUAL: HealthConfig =
    HealthConfig::new().with_reaction(Condition::Stalled, Reaction::Relax);
