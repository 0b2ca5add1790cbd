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
//! | a fault: [`WheelLost`](ShooterState::WheelLost), [`WheelSlow`](ShooterState::WheelSlow), [`LoaderLost`](ShooterState::LoaderLost), [`Jammed`](ShooterState::Jammed) | 0 | 0 | the order is `Rest`, or the robot is disarmed |
//!
//! The shooter releases a shot when the wheels are within 1 % and the heat of the shot fits below the limit. The heat counts from then on,
//! before the referee system reports it: a burst then does not exceed the limit during the 100 ms between two reports.
//!
//! ```
//! use drivetrain::shooter::{ShooterOrder, Shooter, ShooterFeedback, ShooterState};
//! use drivetrain::time::{Instant, Tick};
//! use drivetrain::units::AngularVelocity;
//!
//! let wheels = AngularVelocity::from_rpm(6_000.0);
//! let mut shooter = Shooter::new(wheels, 8, 10.0)?; // 8 chambers, 10 shots in 1 s
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
    /// Fault: a friction wheel has no fresh feedback.
    WheelLost,
    /// Fault: a friction wheel is not within the tolerance after 3 s of spinning up.
    WheelSlow,
    /// Fault: the loader has no fresh feedback, or a position that cannot be its own; then its chambers are not known: see [`Shooter`].
    LoaderLost,
    /// Fault: the loader stood again after the last attempt to clear it.
    Jammed,
}

impl ShooterState {
    /// Returns whether the state is a fault: all motors stand until the order is [`ShooterOrder::Rest`], or the robot is disarmed.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::shooter::ShooterState;
    ///
    /// assert!(ShooterState::Jammed.is_fault() && !ShooterState::Clearing.is_fault());
    /// assert_eq!(ShooterState::Jammed.to_string(), "the loader is jammed: clear it, then order rest");
    /// ```
    #[must_use]
    pub const fn is_fault(self) -> bool {
        matches!(self, Self::WheelLost | Self::WheelSlow | Self::LoaderLost | Self::Jammed)
    }
}

impl core::fmt::Display for ShooterState {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Self::Rest => "all motors stand",
            Self::SpinningUp => "the friction wheels are not at their speed",
            Self::Ready => "the friction wheels are at their speed",
            Self::Feeding => "a shot moves through the loader",
            Self::Clearing => "the loader turns back after a jam",
            Self::Cooling => "a shot waits for the heat of the barrel",
            Self::WheelLost => "a friction wheel has no fresh feedback",
            Self::WheelSlow => "a friction wheel did not reach its speed in 3 s",
            Self::LoaderLost => "the loader has no fresh feedback, or a wrong position",
            Self::Jammed => "the loader is jammed: clear it, then order rest",
        })
    }
}

/// Feedback for one tick of a shooter. The default is a disarmed robot without feedback.
#[derive(Debug, Default, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ShooterFeedback {
    /// Whether all three motors may be driven.
    pub is_armed: bool,
    /// Speeds of the friction wheels, positive in the shooting direction; `None` without fresh feedback.
    pub wheels: [Option<AngularVelocity>; 2],
    /// Position and velocity of the loader's output shaft, positive in the feeding direction, the position from any zero; `None` without
    /// fresh feedback. A value that is NaN or infinite counts as `None`.
    pub loader: Option<(Position, AngularVelocity)>,
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
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
struct ShooterConfig {
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
    const fn new(wheels: AngularVelocity, chambers: u8, shots_per_s: f32) -> Self {
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

    const fn feed_velocity(&self) -> AngularVelocity {
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
