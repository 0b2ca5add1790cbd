//! A shooter for balls: two friction wheels and a loader. Counts shots, clears jams, and keeps the heat limit of the barrel.
//!
//! ```text
//!  pilot ── order ──┐                                     ┌── speed of both wheels
//!  motors ─ feedback ┼──> Shooter::update (each tick) ────┤
//!  referee ── heat ─┘                                     └── speed of the loader
//! ```
//!
//! The module is independent of bus and motor: from feedback to target speeds ([`ShooterTargets`]). A motor of any family fits, if its
//! drive has a velocity loop and a position of the shaft over many turns. The speed is that of the shaft: friction wheels on M3508 without
//! their gearbox are attached with [`with_gear(GearRatio::DIRECT)`](crate::dji::Config::with_gear), some 6000 rpm; the example `shooter`
//! turns geared wheels at 400 rpm.
//!
//! | state | wheels | loader | left when |
//! |---|---|---|---|
//! | [`Rest`](ShooterState::Rest) | 0 | 0 | an order other than `Rest`, while armed |
//! | [`SpinningUp`](ShooterState::SpinningUp) | speed | 0 | both wheels are within 1 % for 20 ms |
//! | [`Ready`](ShooterState::Ready) | speed | 0 | a shot is released |
//! | [`Feeding`](ShooterState::Feeding) | speed | turns to the next chamber | the shot is counted, or the loader stands for 100 ms |
//! | [`Clearing`](ShooterState::Clearing) | speed | turns half a chamber back | the way back is done, or 200 ms |
//! | [`Cooling`](ShooterState::Cooling) | speed | 0 | the next shot fits below the heat limit |
//! | [`Fault`](ShooterState::Fault) | 0 | 0 | the order is `Rest`, or the robot is disarmed |
//!
//! The shooter releases a shot when the wheels are within 1 % and the heat of the shot fits below the limit. The heat counts from then on,
//! before the referee system reports it: a burst then does not exceed the limit during the 100 ms between two reports.
//!
//! ```
//! use drivetrain::shooter::{ShooterOrder, Shooter, ShooterConfig, ShooterFeedback, ShooterState};
//! use drivetrain::time::{Instant, Tick};
//! use drivetrain::units::AngularVelocity;
//!
//! let wheels = AngularVelocity::from_rpm(6_000.0);
//! let mut shooter = Shooter::new(ShooterConfig::new(wheels, 8, 10.0))?; // 8 chambers, 10 shots in 1 s
//! let tick = Tick::new(Instant::from_micros(1_000), 0.001);
//!
//! let disarmed = ShooterFeedback::default();
//! let targets = shooter.update(ShooterOrder::Fire(1), &disarmed, tick);
//! assert_eq!((targets.wheels.as_rpm(), targets.loader.as_rpm()), (0.0, 0.0));
//! assert_eq!(shooter.state(), ShooterState::Rest);
//! # Ok::<(), drivetrain::error::ConfigError>(())
//! ```
//!
//! Limits: a shot is counted by the rotation of the loader, so a chamber without a ball counts too. The speed of the ball is not regulated.
//! Both wheels have the same target: attach one of two counter-rotating wheels as `reversed`.

mod loader;
mod machine;

pub use machine::Shooter;

use crate::encoder::Position;
use crate::error::ConfigError;
use crate::time::Duration;
use crate::units::AngularVelocity;
use crate::wire::referee::BarrelHeat;

/// Order of the pilot to a shooter, given in each tick.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum ShooterOrder {
    /// Wheels and loader stand. Clears a fault.
    #[default]
    Rest,
    /// The wheels turn, and the loader stands.
    Spin,
    /// The wheels turn, and the shooter releases this number of shots: 1 for a single shot, 255 for continuous fire.
    ///
    /// A burst begins when the order changes to `Fire`. While the order stays, no further shot follows. When the order changes back, the
    /// rest of the burst is dropped. If the trigger was held while the robot was armed, release the trigger first.
    Fire(u8),
}

/// State of a shooter.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub enum ShooterState {
    /// All motors stand.
    Rest,
    /// The wheels are not yet at their speed, or no longer.
    SpinningUp,
    /// The wheels are at their speed.
    Ready,
    /// A shot moves through the loader.
    Feeding,
    /// The loader turns back after a jam.
    Clearing,
    /// A shot waits until the barrel is cool enough, or until its heat is known.
    Cooling,
    /// All motors stand until the order is [`ShooterOrder::Rest`], or the robot is disarmed.
    Fault(ShooterFault),
}

/// Cause of a stop.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub enum ShooterFault {
    /// A friction wheel has no fresh feedback.
    WheelLost,
    /// A friction wheel is not within the tolerance after 3 s of spinning up.
    WheelSlow,
    /// The loader has no fresh feedback.
    LoaderLost,
    /// The loader stood again after the last attempt to clear it.
    Jammed,
}

impl core::fmt::Display for ShooterFault {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Self::WheelLost => "a friction wheel has no fresh feedback",
            Self::WheelSlow => "a friction wheel did not reach its speed in 3 s",
            Self::LoaderLost => "the loader has no fresh feedback",
            Self::Jammed => "the loader is jammed: clear it, then order rest",
        })
    }
}

/// Feedback of the loader's motor, at its output shaft.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct LoaderFeedback {
    /// Turns and angle, from any zero; positive in the feeding direction.
    pub position: Position,
    /// Speed, positive in the feeding direction.
    pub velocity: AngularVelocity,
}

/// Feedback for one tick of a shooter. The default is a disarmed robot without feedback.
#[derive(Debug, Default, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ShooterFeedback {
    /// Whether all three motors may be driven.
    pub is_armed: bool,
    /// Speeds of the friction wheels, positive in the shooting direction; `None` without fresh feedback.
    pub wheels: [Option<AngularVelocity>; 2],
    /// The loader; `None` without fresh feedback.
    pub loader: Option<LoaderFeedback>,
    /// Heat of the barrel; `None` while the referee system is silent.
    pub heat: Option<BarrelHeat>,
}

/// Target speeds of a shooter's motors.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ShooterTargets {
    /// Both friction wheels, positive in the shooting direction.
    pub wheels: AngularVelocity,
    /// The loader, positive in the feeding direction.
    pub loader: AngularVelocity,
}

impl ShooterTargets {
    /// All motors stand.
    pub const REST: Self = Self { wheels: AngularVelocity::ZERO, loader: AngularVelocity::ZERO };
}

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
    wheels: AngularVelocity,
    chambers: u8,
    shots_per_s: f32,
    tolerance: f32,
    heat_of_shot: u16,
    reserve: Option<u16>,
    jam_s: f32,
    tries: u8,
    gain_per_s: f32,
    without_referee: Option<BarrelHeat>,
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
    /// [`Jammed`](ShooterFault::Jammed).
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
    const fn pitch_rad(&self) -> f32 {
        core::f32::consts::TAU / self.chambers as f32
    }

    const fn validate(&self) -> Result<(), ConfigError> {
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
