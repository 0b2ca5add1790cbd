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
//! [`ConfigError`](crate::error::ConfigError). If there are more wheels than unknowns, `forward` is the least-squares fit, and
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
//! | [`WheelDrive`] | the motors that it drives, of one device or of several; [`ModuleMotors`] for swerve modules |
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

mod balance;
mod balance_model;
mod base;
mod capacitor;
mod clock;
mod differential;
mod drive;
mod error;
mod kinematics;
mod least_squares;
mod leg;
mod limits;
mod mecanum;
mod mode;
mod odometry;
mod omni;
mod power;
mod power_buffer;
mod power_fit;
mod status;
mod steering;
mod swerve;
mod wheels;

pub use balance::{BalancePhase, Balancer};
pub use balance_model::BalanceModel;
pub use base::Chassis;
pub use capacitor::CapacitorPlan;
pub use differential::Differential;
pub use drive::{ModuleMotors, WheelDrive};
pub use kinematics::{Kinematics, WheelSpeed};
pub use leg::{FiveBar, LegEffort, LegState};
pub use limits::ChassisLimits;
pub use mecanum::Mecanum;
pub use mode::{ChassisMode, ModeConfig, Modes};
pub use odometry::Odometry;
pub use omni::Omni;
pub use power::{PowerModel, WheelLoad};
pub use power_buffer::PowerBuffer;
pub use power_fit::PowerFit;
pub use status::ChassisStatus;
pub use steering::SwerveSteering;
pub use swerve::{ModuleState, Swerve};
pub use wheels::MecanumWheels;
