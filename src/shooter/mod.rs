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

mod config;
mod heat;
mod loader;
mod machine;
mod state;

pub use config::ShooterConfig;
pub use machine::Shooter;
pub use state::{
    LoaderFeedback, ShooterFault, ShooterFeedback, ShooterOrder, ShooterState, ShooterTargets,
};
