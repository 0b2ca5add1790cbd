//! Motors on VESC drives: any motor on a drive with the firmware `bldc`.
//!
//! ```text
//! commands   packet << 8 | id   value i32, high byte first
//!            0 duty 1/100000    1 current mA        2 brake mA      3 speed in electrical rpm
//!            4 position 1 µ°    10, 11, 13 current, brake, handbrake in 1/100000    12 handbrake mA
//! status     9                  electrical rpm i32 | current i16 0.1 A | duty i16 1/1000
//!            14, 15             Ah i32 | charged i32; Wh i32 | charged i32, both in 1/10000
//!            16                 driver °C | motor °C | input current A, i16 in 0.1 | position i16 1/50 °
//!            27                 tachometer i32, 6 counts an electrical turn | supply i16 0.1 V
//!            58                 three inputs in mV | servo input 1/1000, i16 each
//! question   8                  254 | 0 | 50 | 00 00 80 00
//! answer     8 << 8 | 254       id | 1 | 50 | 00 00 80 00 | fault code
//! ```
//! Extended frames, big-endian, at the bit rate set in the drive: 500 kbit/s at delivery. The ids are 0 to 253: 254 is the id
//! of this program, and 255 means every drive.
//!
//! [`Motor`] is such a drive as a [`DriveProtocol`](crate::motor::DriveProtocol); [`Actuator`](crate::motor::Actuator) makes a device of the motor. Its
//! control mode is a [`Mode`]:
//!
//! | mode | targets | current is limited by | a value of zero |
//! |---|---|---|---|
//! | [`Mode::current`], [`current_with_speed_loop`](Mode::current_with_speed_loop), [`current_with_loops`](Mode::current_with_loops) | torque; with loops velocity and angle | [`Model::current_limit_a`] | lets the shaft go |
//! | [`Mode::duty`] | velocity, by a loop of ours | the drive alone | brakes: the phases are shorted |
//! | [`Mode::velocity`] | velocity, by the loop of the drive | the drive alone | lets the shaft go, as does any speed below the drive's smallest, 900 electrical rpm at delivery |
//! | [`Mode::position`] | angle, by the loop of the drive | the drive alone | 0° |
//!
//! Only [`Mode::current`] has its current scaled by the share of the order, so heat and a stall reduce the current there. In the
//! modes of the drive's own loops the share has no effect once the output range is open; only rest stops the motor.
//!
//! The drive lets the shaft go for currents below its smallest, 0.05 A at delivery.
//!
//! **Rest** is a current of 0: the shaft turns freely. [`Motor::with_rest`] chooses another rest. There is no frame to enable or
//! disable a VESC: the drive follows any command at once.
//!
//! A command to id 255 moves each drive on the bus: another program with such commands is not seen as a second master.
//!
//! **When the program stops, the drive goes on** until its own time-out, then it brakes with its own time-out brake current: 1000 ms
//! and 0 A at delivery. Neither can be read or written by a short frame, so set them in VESC Tool (App Settings, General): 100 ms is
//! ten periods of the slowest loop that makes sense. A time-out of 0 means never.
//!
//! **The status frames have no fault code.** After a fault the drive ignores commands for 500 ms at delivery, and then follows them
//! again. So the motor asks for the code: each 10 ms at rest, and in the place of each 50th command. The motor is not armed before
//! the first answer, nor after four questions in a row without an answer, and a fault trips the motor.
//!
//! **What to set in VESC Tool**: CAN mode "VESC"; status 1 at 200 Hz or more, as feedback counts as late after 10 ms unless the
//! [time-outs](crate::motor::Timeouts) say otherwise. Status 5 at the same rate where an angle is controlled, or status 4 with
//! [`Motor::with_encoder`]: a motor whose targets need an angle counts as heard when both frames have come. Status 4 for the
//! temperatures. At delivery no status is sent at all.
//!
//! ```
//! use drivetrain::encoder::GearRatio;
//! use drivetrain::motor::{Devices, Actuator};
//! use drivetrain::time::Instant;
//! use drivetrain::units::AngularVelocity;
//! use drivetrain::vesc::{Mode, Model, Motor};
//!
//! const SHOOTER: Model = Model {
//!     name: "5065",
//!     pole_pairs: 7,
//!     gear: GearRatio::DIRECT,
//!     torque_constant_nm_per_a: 0.035, // 9.55 / 270 rpm/V
//!     current_limit_a: 30.0,
//!     max_velocity: AngularVelocity::from_rpm(6_000.0),
//! };
//! let mut shooter = Actuator::new(Motor::new(SHOOTER, 23, Mode::current())?);
//! let refused = shooter.arm(Instant::from_micros(1_000)).map_err(|error| error.to_string());
//! assert_eq!(refused, Err("no feedback from 5065 #23".into()));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Sources: `comm_can.c`, `commands.c`, `mc_interface.c`, `mcpwm_foc.c`, `foc_math.c`, `timeout.c` and `datatypes.h` of vedderb/bldc
//! as of August 2026, and its `documentation/comm_can.md`. Where the two differ, the firmware counts: the speed has a scale of 1, not
//! 1000, and status 6 is packet 58, not 28. A command has four bytes here, never more: the firmware reads a current of six bytes or
//! more as a delay and the current after it. Not known: the differences in firmware of others for VESC-compatible drives; firmware
//! without an answer to the question for the fault needs [`Motor::without_fault_code`].

mod bus;
mod codec;
mod config;
mod model;
#[cfg(test)]
mod tests;

pub use bus::Motor;
pub use codec::{Command, Feedback};
pub use config::{Mode, Rest};
pub use model::Model;
