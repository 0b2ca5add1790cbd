//! From a motion of the body to wheel speeds and back, for every wheel layout.
//!
//! Axes, signs and units are drawn in [`geometry`](crate::geometry): x forward, y left, counter-clockwise positive. A
//! positive wheel velocity rolls forward; on an omni wheel, along its given direction.
//!
//! | layout | wheels | remarks |
//! |---|---|---|
//! | [`Mecanum`] | [`MecanumWheels`] | both roller mountings |
//! | [`Omni`] | an array, as given | three and more wheels at any place, in any direction |
//! | [`Omni::three`], [`Omni::four`] | an array, front left first | positive rolls counter-clockwise |
//! | [`Differential`] | an array: left, right | cannot move sideways |
//! | [`Swerve`] | an array, as given | steered by the shorter way, at rest the angles are held; X-lock |
//!
//! A layout is made once from its dimensions; the constructor refuses an impossible layout with a
//! [`ConfigError`]. If there are more wheels than unknowns, `forward` is the least-squares fit, and
//! [`slip_m_s`](Kinematics::slip_m_s) measures the contradiction between the wheels.
//!
//! ```text
//! Modes ──> Chassis: command ──> acceleration limit ──> inverse ──> wheel limit ──> steering ──> wheel targets
//!                    odometry <── forward <───────────────────────────────────────────────────── wheel speeds
//! ```
//!
//! | on top of a layout | function |
//! |---|---|
//! | [`Chassis`] | commands in body or world frame, [`ChassisLimits`], [`Odometry`], lost wheels, lock |
//! | [`Chassis::drive`] | its motors, of one device or of several; [`ModuleMotors`] for swerve modules |
//! | [`Modes`] | relax, follow the gimbal, rotor, independent |
//! | [`PowerModel`], [`PowerBuffer`], [`PowerFit`] | cut all torques by one factor to keep a power limit |
//! | [`CapacitorPlan`] | adds the power of a super-capacitor to the limit, down to its reserve |
//! | [`Balancer`], [`FiveBar`] | beside the layouts: a robot that balances on two wheels with legs |
//!
//! References: K. Lynch, F. Park, *Modern Robotics* (2017), chapters 3 and 13.
//!
//! ```
//! use drivetrain::chassis::{Chassis, ChassisLimits, Mecanum, MecanumWheels};
//! use drivetrain::{geometry::{Heading, Twist, Vec2}, time::{Instant, Tick}, units::{Angle, AngularVelocity}};
//!
//! let mut chassis = Chassis::new(Mecanum::new(0.076, Vec2::new(0.20, 0.18))?);
//! chassis.set_limits(ChassisLimits::new().with_wheel_speed(AngularVelocity::from_rpm(450.0)))?;
//!
//! // Each millisecond:
//! let facing_left = Heading::new(Angle::from_degrees(90.0));
//! chassis.set_world(Twist::new(1.0, 0.0, 0.0), facing_left);
//! let measured = MecanumWheels::splat(Some(AngularVelocity::ZERO));
//! let targets = chassis.update(measured, Tick::new(Instant::from_micros(1_000), 0.001));
//! assert!((targets.front_left.as_rad_per_s() - 1.0 / 0.076).abs() < 1e-3); // strafing to the right
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! An owner of motors that the application wrote is a [`VelocityDrive`](crate::motor::VelocityDrive):
//! ```
//! use drivetrain::chassis::{Chassis, Differential};
//! use drivetrain::motor::{TargetError, VelocityDrive};
//! use drivetrain::{geometry::Twist, time::{Instant, Tick}, units::AngularVelocity};
//!
//! /// Two motors that do at once what they are told.
//! struct Motors([AngularVelocity; 2]);
//!
//! impl VelocityDrive<usize> for Motors {
//!     fn velocity(&self, motor: usize) -> Option<AngularVelocity> {
//!         self.0.get(motor).copied()
//!     }
//!     fn set_velocity(&mut self, motor: usize, target: AngularVelocity) -> Result<(), TargetError> {
//!         *self.0.get_mut(motor).ok_or(TargetError::Detached)? = target;
//!         Ok(())
//!     }
//! }
//!
//! let mut chassis = Chassis::new(Differential::new(0.1, 0.25)?);
//! let mut motors = Motors([AngularVelocity::ZERO; 2]);
//! chassis.set_body(Twist::new(1.0, 0.0, 0.0));
//! let tick = Tick::new(Instant::from_micros(1_000), 0.001);
//! chassis.drive(&mut motors, [0, 1], tick);
//! assert!((motors.0[1].as_rad_per_s() - 10.0).abs() < 1e-5);
//! # Ok::<(), drivetrain::error::ConfigError>(())
//! ```

mod balance;
mod base;
mod drive;
mod kinematics;
mod leg;
mod mecanum;
mod mode;
mod odometry;
mod omni;
mod power;
mod power_buffer;
mod steering;
mod swerve;

pub use balance::{BalancePhase, Balancer};
pub use base::Chassis;
pub use drive::ModuleMotors;
pub use kinematics::{Kinematics, WheelSpeed};
pub use leg::{BalanceModel, FiveBar, LegEffort, LegState};
pub use mecanum::{Mecanum, MecanumWheels};
pub use mode::{ChassisMode, ModeConfig, Modes};
pub use odometry::Odometry;
pub use omni::{Differential, Omni};
pub use power::{PowerFit, PowerModel};
pub use power_buffer::{CapacitorPlan, PowerBuffer};
pub use steering::ModuleState;
pub use swerve::Swerve;

use crate::error::ConfigError;
use crate::geometry::{Twist, World};
use crate::motor::TargetError;
use crate::units::AngularVelocity;

/// The time for which a command drives without a renewal, unless the application sets another time.
const COMMAND_TIMEOUT_S: f32 = 0.1;
/// The longest time for which a command may drive: the deadline of a motor's target, which the chassis renews in each tick.
const MAX_COMMAND_TIMEOUT_S: f32 = 1.0;

/// How fast a chassis may go and change. Everything is off by default but the deadline for commands: 0.1 s.
///
/// # Examples
/// ```
/// use drivetrain::{chassis::ChassisLimits, units::AngularVelocity};
///
/// let limits = ChassisLimits::new()
///     .with_acceleration(3.0, 20.0)
///     .with_wheel_speed(AngularVelocity::from_rpm(450.0));
/// assert!(limits.validate().is_ok());
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ChassisLimits {
    linear_m_s2: f32,
    angular_rad_s2: f32,
    wheel_rad_s: f32,
    command_timeout_s: f32,
}

impl ChassisLimits {
    /// Nothing limited; commands older than 0.1 s count as zero.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            linear_m_s2: f32::MAX,
            angular_rad_s2: f32::MAX,
            wheel_rad_s: f32::MAX,
            command_timeout_s: COMMAND_TIMEOUT_S,
        }
    }

    /// Sets the largest acceleration in m/s² in any direction, and in rad/s². Both above zero.
    ///
    /// One factor shortens the change of the whole motion, turn included, so the change keeps its direction.
    #[must_use]
    pub const fn with_acceleration(self, linear_m_s2: f32, angular_rad_s2: f32) -> Self {
        Self { linear_m_s2, angular_rad_s2, ..self }
    }

    /// Sets the largest speed of a wheel, above zero. All wheels slow down together.
    #[must_use]
    pub const fn with_wheel_speed(self, limit: AngularVelocity) -> Self {
        Self { wheel_rad_s: limit.as_rad_per_s(), ..self }
    }

    /// Sets after how many seconds without a new command the chassis comes to a stop. Above zero, and at most 1 s.
    #[must_use]
    pub const fn with_command_timeout(self, timeout_s: f32) -> Self {
        Self { command_timeout_s: timeout_s, ..self }
    }

    /// Checks all values.
    ///
    /// # Errors
    /// Names the first value that is not above zero, or a command timeout above 1 s: with an infinite time-out, a chassis
    /// whose program is dead would drive for ever.
    pub fn validate(&self) -> Result<(), ConfigError> {
        let named = [
            (self.linear_m_s2, "linear_m_s2"),
            (self.angular_rad_s2, "angular_rad_s2"),
            (self.wheel_rad_s, "wheel speed"),
            (self.command_timeout_s, "command timeout"),
        ];
        for (value, name) in named {
            if value.is_nan() || value <= 0.0 {
                return Err(ConfigError::NotAboveZero(name));
            }
        }
        let timeout_s = self.command_timeout_s;
        ConfigError::check_limit("command timeout in s", timeout_s, MAX_COMMAND_TIMEOUT_S)
    }

    const fn wheel_speed(&self) -> AngularVelocity {
        AngularVelocity::from_rad_per_s(self.wheel_rad_s)
    }

    const fn command_timeout_s(&self) -> f32 {
        self.command_timeout_s
    }

    /// Moves `from` towards `to` as far as `dt_s` allows: without time nothing moves, limited or not.
    fn approach(&self, from: Twist<World>, to: Twist<World>, dt_s: f32) -> Twist<World> {
        if dt_s <= 0.0 {
            return from;
        }
        let change = to - from;
        let linear = share(change.linear().norm(), self.linear_m_s2, dt_s);
        let angular = share(change.wz_rad_s.abs(), self.angular_rad_s2, dt_s);
        let share = if linear < angular { linear } else { angular };
        if share < 1.0 { from + change * share } else { to }
    }
}

/// How much of a change fits into a step.
fn share(change: f32, limit: f32, dt_s: f32) -> f32 {
    if limit >= f32::MAX || change <= limit * dt_s { 1.0 } else { limit * dt_s / change }
}

impl Default for ChassisLimits {
    fn default() -> Self {
        Self::new()
    }
}

/// Status of a chassis, besides its motion.
///
/// # Examples
/// ```
/// use drivetrain::chassis::{Chassis, Omni};
/// use drivetrain::time::{Instant, Tick};
///
/// let mut chassis = Chassis::new(Omni::three(0.05, 0.2)?);
/// let _ = chassis.update([None; 3], Tick::new(Instant::from_micros(1_000), 0.001));
/// let status = chassis.status();
/// assert_eq!((status.motion_known, status.lost_wheels), (false, 3));
/// assert_eq!(status.blind_s, 0.001);
/// # Ok::<(), drivetrain::error::ConfigError>(())
/// ```
#[derive(Debug, Default, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ChassisStatus {
    /// The motion of the last tick was measured: by all wheels, or by the others while [`lost_wheels`](Self::lost_wheels) is
    /// above zero. With too few wheels the motion is unknown: the position stands still; a gyroscope's heading continues.
    pub motion_known: bool,
    /// Wheels without feedback in the last tick; a velocity or an angle that is NaN or infinite is no feedback.
    pub lost_wheels: u8,
    /// Seconds without a known motion, in all.
    pub blind_s: f32,
    /// Largest contradiction between the wheels of the last tick in m/s; `None` while a wheel is lost, because the
    /// others then determine too little. Never NaN: `f32::MAX` on overflow.
    pub slip_m_s: Option<f32>,
    /// The last tick ran without a fresh command, or the clock is dead.
    pub command_stale: bool,
    /// The wheels' speed limit slowed the chassis in the last tick.
    pub saturated: bool,
    /// Commands, headings and poses that were NaN or infinite, in all; a command and its heading count once.
    pub rejected: u16,
    /// Wheels with a motor that refused its target in the last [`drive`](Chassis::drive).
    pub refused: u8,
    /// Why the first of them did.
    pub refusal: Option<TargetError>,
}

/// Accepts a length above zero and finite.
const fn positive(length: f32, name: &'static str) -> Result<f32, ConfigError> {
    // The reciprocal of a smaller length is not finite.
    if length >= f32::MIN_POSITIVE && length < f32::INFINITY {
        Ok(length)
    } else {
        Err(ConfigError::NotPositive(name))
    }
}

/// Accepts a finite value of zero or more.
fn not_negative(value: f32, name: &'static str) -> Result<f32, ConfigError> {
    if value.is_finite() && value >= 0.0 { Ok(value) } else { Err(ConfigError::Negative(name)) }
}

/// Limits a value to ± a limit of zero or more.
const fn within(value: f32, limit: f32) -> f32 {
    crate::math::limited(value, -limit, limit)
}

/// Counts the ticks without usable time: ages in seconds stand still in them.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
struct DeadClock(u8);

impl DeadClock {
    /// Ticks without usable time after which the clock counts as dead.
    const PATIENCE: u8 = 100;

    const fn new() -> Self {
        Self(0)
    }

    /// Takes the step of a tick, and returns a usable step, above zero and finite, unchanged; otherwise zero.
    const fn take_step(&mut self, dt_s: f32) -> f32 {
        if dt_s > 0.0 && dt_s.is_finite() {
            self.0 = 0;
            dt_s
        } else {
            self.0 = self.0.saturating_add(1);
            0.0
        }
    }

    const fn is_dead(self) -> bool {
        self.0 >= Self::PATIENCE
    }
}
