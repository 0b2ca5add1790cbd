//! Motors of MyActuator: the series RMD-X and RMD-L with protocol V3 or V4 on CAN.
//!
//! ```text
//! commands  0x140 + id, answers 0x240 + id, standard, 8 bytes; id 1 to 32; numbers have their low byte first
//!
//! byte 0  command                1   2 .. 3                4 .. 7                     answer
//! 0x80    off                    0   0                     0                          the same
//! 0x77    release the brake      0   0                     0                          the same
//! 0x78    lock the brake         0   0                     0                          the same
//! 0xA1    torque                 0   0                     0.01 A i16, 0, 0           feedback
//! 0xA2    velocity               0   0                     0.01 °/s i32               feedback
//! 0xA4    position               0   velocity limit °/s u16 0.01 ° i32                feedback
//! 0x92    read the angle         0   0                     0                          0.01 ° i32 in bytes 4 to 7
//! 0x9A    read the state         0   0                     0                          temperature, brake, supply, errors
//! 0xB3    set the time-out       0   0                     ms u32                     the same
//! 0x76    reset                  0   0                     0                          none
//! ```
//! The frames descend from those of [`lk`](crate::lk), and the two families share their control modes. The frames differ: the
//! current has another scale, and angles and velocities are of the output shaft. A drive answers each frame with a frame:
//! at 1 kHz and 1 Mbit/s the bus is full with three motors.
//!
//! [`Motor`] is such a drive as a [`DriveProtocol`](crate::motor::DriveProtocol); [`Actuator`](crate::motor::Actuator) makes a device of the motor. The
//! control mode is its type:
//!
//! | mode | targets | torque is limited by |
//! |---|---|---|
//! | [`ImpedanceControl`](crate::motor::ImpedanceControl): torque frames, the loops run here | torque and [`Impedance`](crate::motor::Impedance); with gains or loops velocity and angle | the torque limit of the mode |
//! | [`Mode::velocity`] | velocity | the drive alone |
//! | [`Mode::position_velocity`] | angle | the drive alone |
//!
//! **Rest is a torque frame with a current of 0** in each mode, and "off" is sent besides, every 100 ms. `0x81` (stop) is never sent:
//! the drive holds the shaft then. The protocol has no frame to enable a drive, and no answer tells whether a drive is off: any
//! command runs the drive.
//!
//! **Before a motor is armed** its state and its angle are read. **Before it is driven** its state is read again, and the drive has
//! to confirm its time-out; then a torque motor has its holding brake released, as torques do not release the brake, and a position
//! motor its angle read. The brake opens before the output does: a loaded joint sinks for the 0.2 s of
//! [`with_opening`](crate::motor::Actuator::with_opening). When the motor is at rest again, the brake released by the motor is locked
//! 0.1 s after "off". The manual says only of torques that the brake stays locked, so with a velocity or a position the drive is left
//! to release the brake.
//!
//! **When the program stops, the drive does**: after [`Motor::with_timeout`], 100 ms at first, the drive switches itself off and
//! locks its brake. The drive keeps this time in its flash memory, and no frame reads it. So the time is written when the drive is to
//! be enabled and has been away since the last time, at most 8 times in a row. A drive that answers with another time, or not at all,
//! is not driven, and `arm` says so until the drive has been away; [`Motor::without_timeout`] is for such a drive. Seen by a user,
//! not in the manual: a drive whose time has expired sends a frame with the first byte 0xF1 each second. The next command is sent
//! back in the place of an answer, and not followed. Both trip the motor.
//!
//! **The angle** of feedback is in whole degrees. Each 16th command gives way to a question for the angle in 0.01°; in between the
//! angle moves on by the velocity, within a degree of the feedback. A question for the state takes the place of each 32nd. Their
//! answers are no feedback, so a program with less than 250 updates a second has to give [`Actuator`](crate::motor::Actuator) longer
//! [`Timeouts`](crate::motor::Timeouts).
//!
//! **Errors** are in the state. A drive with an error is not armed. Most of them go away with their cause; the others by
//! [`Motor::reset_drive`] alone, since the protocol has no frame to clear errors. The code of an error is the place of its lowest bit,
//! from 1.
//!
//! **A command sent back is no feedback.** Feedback with a temperature of exactly 0 °C may read like a command, and is lost then: in
//! torque mode and at rest, feedback without a current between 0 and 1°; in [`Mode::velocity`], feedback without a current; in
//! [`Mode::position_velocity`], feedback with a small positive current.
//!
//! ```
//! use drivetrain::motor::{Devices, ImpedanceControl, Actuator};
//! use drivetrain::rmd::{Model, Motor};
//! use drivetrain::time::Instant;
//!
//! let mode = ImpedanceControl::new(20.0)?.with_gains(60.0, 2.0)?; // at most 20 Nm; 60 Nm/rad and 2 Nm s/rad
//! let mut knee = Actuator::new(Motor::new(Model::X8_60, 1, mode)?);
//! let refused = knee.arm(Instant::from_micros(1_000)).map_err(|error| error.to_string());
//! assert_eq!(refused, Err("no feedback from RMD-X8-60 #1".into()));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! **Not for drives with protocol V1 or V2**: such drives answer on 0x140 + id, and are never heard; some belong to
//! [`lk`](crate::lk). The impedance frames on 0x400 + id are not used, since V4.4 changed their ranges, and only the date of a drive's
//! program tells the ranges; nor are replies at fixed times (0xB6) nor the frame for all drives (0x280).
//!
//! Sources: "Motor Motion Protocol" V4.2 of the vendor (May 2024): frames, scales, ids, errors, time-out, all examples. The drivers
//! `myactuator_rmd` (protocol V3.8) and `axol`: ids and frames of V3, bits 0x0800 and 0x4000 of the errors, the errors kept by V4.4
//! until a reset, the duration of a reset (1.1 s) and of releasing the brake (up to 0.15 s). Behaviour after the time-out: pull
//! request 4 of `myactuator_rmd_ros`. The table of the models: see [`Model`].
//!
//! Not known: the side from which the manual sees its positive direction: angles and torques have the sign of the drive, and
//! [`Actuator::reversed`](crate::motor::Actuator::reversed) reverses both. Whether off locks the holding brake. Whether a drive goes on with its last command when frames
//! come again after its time-out. If so, the command runs until the second frame of the program arrives: for one update, or for the
//! whole time-out where only one frame gets through. So a drive that was not heard gets rest or off alone, until its feedback comes.
//! Whether a drive answers while its brake opens: after 100 ms without an answer the motor trips, and needs longer
//! [`Timeouts`](crate::motor::Timeouts). How feedback counts beyond 32767°, 91 turns. An example of the manual answers a time-out
//! with zeros where its text says that the frame is sent back: such a drive is refused.

mod bus;
mod codec;
mod config;
mod model;
#[cfg(test)]
mod tests;

pub use codec::{Command, Feedback, State};
pub use config::{Mode, Motor};
pub use model::Model;
