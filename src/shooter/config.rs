use crate::error::ConfigError;
use crate::time::Duration;
use crate::units::AngularVelocity;
use crate::wire::referee::BarrelHeat;

/// Largest number of chambers of a loader, and of shots in 1 s.
const MOST: f32 = 64.0;

/// Geometry and limits of a shooter.
///
/// | parameter | default |
/// |---|---|
/// | tolerance of the wheels | 1 % of their speed |
/// | heat of a shot | 10, a ball of 17 mm; 100 for 42 mm |
/// | reserve below the heat limit | the heat of one shot |
/// | a loader that stands is jammed after | 100 ms |
/// | tries to clear a jam | 3 |
/// | gain from way to speed of the loader | 20 rad/s per rad |
/// | heat limit without the referee system | none: nothing is shot |
///
/// # Examples
/// ```
/// use drivetrain::shooter::{Shooter, ShooterConfig};
/// use drivetrain::units::AngularVelocity;
///
/// let wheels = AngularVelocity::from_rpm(6_000.0);
/// let config = ShooterConfig::new(wheels, 8, 10.0).with_tries(5);
/// assert!((config.feed_velocity().as_rad_per_s() - 7.854).abs() < 1e-3); // 10 of 8 chambers in 1 s
/// let error = Shooter::new(config.with_tolerance(0.0)).unwrap_err();
/// assert_eq!(error.to_string(), "tolerance: must be more than zero, and finite");
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ShooterConfig {
    pub(super) wheels: AngularVelocity,
    pub(super) chambers: u8,
    pub(super) shots_per_s: f32,
    pub(super) tolerance: f32,
    pub(super) heat_of_shot: u16,
    pub(super) reserve: Option<u16>,
    pub(super) jam_s: f32,
    pub(super) tries: u8,
    pub(super) gain_per_s: f32,
    pub(super) without_referee: Option<BarrelHeat>,
}

impl ShooterConfig {
    /// Takes the speed of the friction wheels, the number of chambers in a turn of the loader's output shaft, and the shots in 1 s.
    #[must_use]
    pub const fn new(wheels: AngularVelocity, chambers: u8, shots_per_s: f32) -> Self {
        Self {
            wheels,
            chambers,
            shots_per_s,
            tolerance: 0.01,
            heat_of_shot: 10,
            reserve: None,
            jam_s: 0.1,
            tries: 3,
            gain_per_s: 20.0,
            without_referee: None,
        }
    }

    /// Sets the largest error of the wheels, as a share of their speed, at which a shot is released.
    #[must_use]
    pub const fn with_tolerance(self, share: f32) -> Self {
        Self { tolerance: share, ..self }
    }

    /// Sets the heat of a shot and the heat to keep free below the limit.
    #[must_use]
    pub const fn with_heat(self, of_shot: u16, reserve: u16) -> Self {
        Self { heat_of_shot: of_shot, reserve: Some(reserve), ..self }
    }

    /// Sets the time after which a driven loader at standstill counts as jammed.
    #[must_use]
    pub const fn with_jam_after(self, time: Duration) -> Self {
        Self { jam_s: time.as_secs_f32(), ..self }
    }

    /// Sets the number of attempts to clear a jam of one shot. After the last, the shooter stops with
    /// [`Jammed`](super::ShooterFault::Jammed).
    #[must_use]
    pub const fn with_tries(self, tries: u8) -> Self {
        Self { tries, ..self }
    }

    /// Sets the gain of the loader: speed per distance to its goal, in rad/s per rad.
    #[must_use]
    pub const fn with_loader_gain(self, per_s: f32) -> Self {
        Self { gain_per_s: per_s, ..self }
    }

    /// Sets limit and cooling for practice, while the referee system is silent. The field `heat` is ignored.
    #[must_use]
    pub const fn with_heat_without_referee(self, heat: BarrelHeat) -> Self {
        Self { without_referee: Some(heat), ..self }
    }

    /// Returns the feeding speed of the loader.
    #[must_use]
    pub const fn feed_velocity(&self) -> AngularVelocity {
        AngularVelocity::from_rad_per_s(self.shots_per_s * self.pitch_rad())
    }

    /// Returns the angle between two chambers of the loader.
    pub(super) const fn pitch_rad(&self) -> f32 {
        core::f32::consts::TAU / self.chambers as f32
    }

    pub(super) const fn validate(&self) -> Result<(), ConfigError> {
        let wheels = self.wheels.as_rad_per_s();
        let jam_us = self.jam_s * 1e6;
        let positive = [
            ("wheels", wheels),
            ("tolerance", self.tolerance),
            ("loader_gain", self.gain_per_s),
            ("jam_after", jam_us),
        ];
        let mut rest: &[(&'static str, f32)] = &positive;
        while let [(parameter, value), others @ ..] = rest {
            if !(*value > 0.0 && value.is_finite()) {
                return Err(ConfigError::NotPositive(parameter));
            }
            rest = others;
        }
        match ConfigError::check_limit("chambers", self.chambers as f32, MOST) {
            Ok(()) => ConfigError::check_limit("shots_per_s", self.shots_per_s, MOST),
            refused @ Err(_) => refused,
        }
    }
}
