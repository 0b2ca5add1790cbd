//! DJI C610/M2006, C620/M3508 and GM6020: four motors to a command frame, one feedback frame a motor.
//!
//! # The protocol on one page
//! Classic CAN at 1 Mbit/s, standard data frames of 8 bytes, all numbers big-endian.
//!
//! | model | ids | command id, slots 0..=3 | feedback id | command, full scale | gear |
//! |---|---|---|---|---|---|
//! | [`M2006`] on C610 | 1..=8 | 0x200 for 1..=4, 0x1FF for 5..=8 | 0x200 + id | 10000 = 10 A | 36:1 |
//! | [`M3508`] on C620 | 1..=8 | 0x200 for 1..=4, 0x1FF for 5..=8 | 0x200 + id | 16384 = 20 A | 3591:187 |
//! | [`Gm6020Voltage`] | 1..=7 | 0x1FF for 1..=4, 0x2FF for 5..=7 | 0x204 + id | 25000 = 24 V nominal | 1:1 |
//! | [`Gm6020Current`] (a) | 1..=7 | 0x1FE for 1..=4, 0x2FE for 5..=7 | 0x204 + id | 16384 = 3 A | 1:1 |
//!
//! (a) Only if current control was switched on in the motor with RoboMaster Assistant, on ESC firmware with this mode. In the other mode
//! the motor ignores the frame: the two models are not interchangeable.
//!
//! Command frame: four `i16`, one a slot; a slot without a motor is sent as 0. Feedback frame, 1 kHz by default:
//!
//! | bytes | content |
//! |---|---|
//! | 0..=1 | rotor angle, 0..=8191 for one turn |
//! | 2..=3 | rotor speed, `i16`, rpm |
//! | 4..=5 | torque current, `i16`, in the scale of the current command |
//! | 6 | motor temperature in °C; nothing on C610 |
//! | 7 | error code ([`ErrorCode`]); 0 on old firmware. For GM6020 no list is known: codes are kept as received |
//!
//! Positive is counter-clockwise looking at the shaft, for angle, speed, current and command alike.
//!
//! [`WordGains`] converts gains of another program, in these raw numbers.
//!
//! # Collisions on one bus
//! A frame id and a slot have one owner each. [`Bus::attach`] therefore refuses:
//! * the same feedback id: C6x0 #5..=8 with GM6020 #1..=4 *in either mode* (0x205..=0x208);
//! * the same command slot: C6x0 #5..=8 with GM6020 (voltage) #1..=4 on 0x1FF;
//! * one physical id in two modes or models: C610 #n with C620 #n, GM6020 #n as voltage and as current.
//!
//! `attach` is a `const fn`: in a `const` the same refusal is a compile error, in words.
//!
//! ```compile_fail
//! use drivetrain::dji::{AttachError, Bus, Config, Gm6020Current, M3508};
//!
//! const BUS: Bus = {
//!     let mut bus = Bus::new();
//!     match bus.attach(Config::<M3508>::new(5)) {
//!         Ok(_) => {}
//!         Err(error) => panic!("{}", error.message(&mut [0; AttachError::LONGEST])),
//!     }
//!     match bus.attach(Config::<Gm6020Current>::new(1)) {
//!         Ok(_) => {}
//!         // error[E0080]: evaluation panicked: GM6020 (current) #1 collides with M3508 #5 on 0x205
//!         Err(error) => panic!("{}", error.message(&mut [0; AttachError::LONGEST])),
//!     }
//!     bus
//! };
//! let bus = BUS;
//! ```
//!
//! # Arbitration on a full bus
//! [`Bus::load`] returns the load: at 1 kHz five motors fit; six do not fit in the worst case. The lowest id wins, so **0x2FE and 0x2FF
//! lose arbitration to all feedback** while 0x1FE, 0x1FF and 0x200 win: on an overloaded bus GM6020 #5..=7 are the first to miss their
//! commands, and the highest feedback ids are lost next.
//!
//! The example above with a free id for the GM6020 compiles:
//!
//! ```
//! use drivetrain::dji::{AttachError, Bus, Config, Gm6020Current, M3508};
//!
//! const BUS: Bus = {
//!     let mut bus = Bus::new();
//!     match bus.attach(Config::<M3508>::new(5)) {
//!         Ok(_) => {}
//!         Err(error) => panic!("{}", error.message(&mut [0; AttachError::LONGEST])),
//!     }
//!     match bus.attach(Config::<Gm6020Current>::new(2)) {
//!         Ok(_) => {}
//!         Err(error) => panic!("{}", error.message(&mut [0; AttachError::LONGEST])),
//!     }
//!     bus
//! };
//! assert_eq!(BUS.motors().count(), 2);
//! ```
//!
//! # Targets measured by another sensor
//! For example the yaw of a gimbal, measured by an IMU, independent of the chassis.
//!
//! **Both loops** run on the measurement: the position loop on its angle, the speed loop on its rate. The rate of the encoder is relative
//! to the base. A speed loop on this rate would hold the gimbal against the chassis, not in the world, and the angle would be off while the
//! chassis turns.
//!
//! The measurement counts from its own time. A measurement older than [`Timeouts::measured`](crate::motor::Timeouts::measured) is refused
//! with an error. If a measurement grows older than that, the output is zero within a tick, as if the application had stopped. The
//! feedback of the motor must be fresh as well. Set the target in each tick; between two measurements, with the last one.
//!
//! ```
//! use drivetrain::control::PidConfig;
//! use drivetrain::dji::{Bus, Config, Gm6020Voltage};
//! use drivetrain::frame::CanFrame;
//! use drivetrain::motor::{Measured, TargetError};
//! use drivetrain::time::{Duration, Instant, Tick};
//! use drivetrain::units::{Angle, AngularVelocity};
//!
//! let angle = PidConfig::new(10.0, 0.0, 0.0); // rad/s per rad
//! let rate = PidConfig::new(2.0, 0.0, 0.0); // V per rad/s
//! let mut bus = Bus::new();
//! let config = Config::<Gm6020Voltage>::new(1).position_loop(angle, rate);
//! let yaw = bus.attach(config.with_opening(Duration::ZERO))?; // for one update
//! let now = Instant::from_micros(1_000);
//! bus.ingest(&CanFrame::standard(0x205, [0; 8]).ok_or("not an 11-bit id")?, now);
//! bus.arm(now)?;
//!
//! // 0.1 rad to go, and the gimbal already turns there at 0.5 rad/s in the world.
//! let imu = Measured {
//!     angle: Angle::from_radians(0.2),
//!     velocity: AngularVelocity::from_rad_per_s(0.5),
//!     at: now,
//! };
//! bus.set_angle_measured(yaw, Angle::from_radians(0.3), imu)?;
//! bus.update(Tick::new(now, 0.001));
//! let frame = bus.next_frame().ok_or("nothing to send")?;
//! assert_eq!(format!("{frame:?}"), "1FF [8] 04 12 00 00 00 00 00 00"); // 2 * (10 * 0.1 - 0.5) = 1 V: 1042
//!
//! let late = Instant::from_micros(30_000);
//! bus.ingest(&CanFrame::standard(0x205, [0; 8]).ok_or("not an 11-bit id")?, late);
//! bus.update(Tick::new(late, 0.001));
//! let refused = bus.set_angle_measured(yaw, Angle::from_radians(0.3), imu);
//! assert_eq!(refused, Err(TargetError::StaleMeasurement)); // 29 ms old
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # A limit over several motors
//! [`Bus::scale_outputs`] scales the commands of an update by one factor, for instance to keep a power limit:
//!
//! ```
//! use drivetrain::chassis::PowerModel;
//! use drivetrain::dji::{Bus, Config, M3508};
//! use drivetrain::frame::CanFrame;
//! use drivetrain::time::{Duration, Instant, Tick};
//! use drivetrain::units::{AngularVelocity, Current};
//!
//! let mut bus = Bus::new();
//! let at_once = |id| Config::<M3508>::new(id).with_opening(Duration::ZERO); // for one update
//! let wheels = bus.attach_all([1, 2].map(at_once))?;
//! let now = Instant::from_micros(1_000);
//! for id in [0x201, 0x202] {
//!     let at_100_rpm = [0, 0, 0x07, 0x80, 0, 0, 30, 0]; // 1920 rpm of the rotor, behind 19.2 to 1
//!     bus.ingest(&CanFrame::standard(id, at_100_rpm).ok_or("id")?, now);
//! }
//! bus.arm(now)?;
//! for wheel in wheels {
//!     bus.set_current(wheel, Current::from_amperes(10.0))?;
//! }
//! bus.update(Tick::new(now, 0.001));
//!
//! let model = PowerModel::new(0.0, 0.475, 0.065, 0.0)?; // of current and speed
//! let loads = wheels.map(|wheel| {
//!     let current = bus.commanded_current(wheel).map_or(0.0, |current| current.as_amperes());
//!     (current, bus.state(wheel).map_or(AngularVelocity::ZERO, |state| state.velocity))
//! });
//! let (scale, _) = model.cut(loads, 60.0); // both together would take 112 W
//! bus.scale_outputs(wheels, scale);
//! let left = bus.commanded_current(wheels[0]).ok_or("detached")?;
//! assert!((left.as_amperes() - 5.62).abs() < 0.01);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Sources
//! Layout, ids, scale and rate of the C610: DJI C610 user guide V1.0 (2019.03), pages 8 and 9. The manuals of C620 and GM6020 were not at
//! hand; their facts are common to independent public drivers (taproot, librm, HNU's framework, IFR). The drivers differ on the GM6020
//! voltage limit: 25000 for current motors, 30000 for old motors ([`Config::with_legacy_full_scale`]). The voltage of full scale is
//! nominal: sources state 24 V or 25.2 V.

mod attach;
mod bus;
mod codec;
mod config;
mod device;
mod error;
mod model;
mod motors;
mod outbox;
mod slot;
mod targets;
#[cfg(test)]
mod tests;
mod watch;

pub use bus::Bus;
pub use codec::{ErrorCode, Feedback, State};
pub use config::{Config, WordGains};
pub use error::AttachError;
pub use model::{Facts, Gm6020Current, Gm6020Voltage, M2006, M3508, Model};
pub use motors::{AnyHandle, Handle};
use outbox::CommandFrame;
pub use watch::Counters;
