//! Motors of LK-TECH (also K-TECH or LKMTECH): the direct-drive series MF and the geared series MG.
//!
//! ```text
//! both directions  0x140 + id, standard, 8 bytes; id 1 to 32; numbers have their low byte first
//!
//! byte 0  command                1              2 .. 3                  4 .. 5          6 .. 7
//! 0x80    off                    0              0                       0               0         answer: the same
//! 0x88    run                    0              0                       0               0         answer: the same
//! 0xA1    torque                 0              0                       current i16     0         answer: feedback
//! 0xA2    velocity               0              current limit u16       0.01 °/s i32              answer: feedback
//! 0xA4    position               0              velocity limit °/s u16  0.01 ° i32                answer: feedback
//! 0x92    read the angle         0.01 ° i56 in bytes 1 to 7                                       answer
//! 0x9A    read the state         temperature i8 | 0.01 V u16 | 0.01 A i16 | state | errors        answer
//! 0x9B    clear errors           the same                                                         answer
//! 0x9C    read feedback          temperature i8 | current i16 | velocity °/s i16 | encoder u16    answer
//! ```
//! A drive sends one frame for each that it gets, within 0.25 ms, and none by itself. So the bus carries two a motor and cycle: at
//! 1 kHz and 1 Mbit/s it is full with three.
//!
//! [`Motor`] is one of them as an [`OwnMotor`](crate::motor::OwnMotor); [`Own`](crate::motor::Own) makes a device of it. Its control
//! mode is an [`ImpedanceControl`](crate::motor::ImpedanceControl) or a [`Mode`]:
//!
//! | mode | targets | torque is limited by |
//! |---|---|---|
//! | [`ImpedanceControl`](crate::motor::ImpedanceControl): torque frames, the loops run here | torque and [`Impedance`](crate::motor::Impedance); with gains or loops velocity and angle | the torque limit of the mode |
//! | [`Mode::velocity`] | velocity | the drive alone |
//! | [`Mode::velocity_with_torque_limit`] | velocity | the drive, and the torque limit of the mode |
//! | [`Mode::position_velocity`] | angle | the drive alone |
//!
//! **Rest is a torque frame with a current of 0** in each mode, and the drive is off besides. It answers a torque frame with feedback
//! when it is off too, so that frame also polls it. `0x81` (stop) is never sent: the manual does not say whether a stopped drive holds.
//! **Off clears the turns** that the drive has counted. So [`Mode::position_velocity`] reads the angle anew each time when the drive runs,
//! before it sends a position, and each 32 cycles from then on: a drive whose count has changed by more than half a turn of the rotor
//! has lost its supply, and trips the motor.
//!
//! **The state is read** before a motor is armed, while the drive is switched on or off, and in place of each 32nd command. A
//! drive with an error is not armed. Errors are cleared with every second frame that switches the drive off.
//!
//! The answer to a question is no feedback, so feedback is missing for one cycle then: a program with less than 250 updates a second has to
//! give [`Own`](crate::motor::Own) longer [`Timeouts`](crate::motor::Timeouts).
//!
//! **When the program stops, the drive does not.** The protocol has no time-out of the drive: no frame sets or reads one, and a drive
//! goes on with its last command when the cable is cut. Bit 7 of the errors, which newer drives have, is an input time-out; how it
//! is set is not public.
//!
//! **Feedback is told from other frames by its first byte.** The echo of off and run is no feedback. One id has both directions, so
//! a command that is read back would look like feedback: a frame that reads like a command of the motor is taken for one of another
//! controller, see [`second_master`](crate::motor::CanDevice::second_master). At exactly 0 °C some feedback reads like a command,
//! and is lost: at rest and in torque mode that without a current and with an encoder of 0, in [`Mode::velocity`] that without a current or
//! below the limit, in [`Mode::position_velocity`] that with a small positive current.
//!
//! Angles and velocities are those of the output shaft, from the encoder of the rotor and the gear. The angle of a geared motor
//! is counted from the rotor's angle at the first feedback; the rotor has to make less than half a turn between two frames.
//!
//! ```
//! use drivetrain::lk::{Model, Motor};
//! use drivetrain::motor::{Devices, ImpedanceControl, Own};
//! use drivetrain::time::Instant;
//!
//! let mode = ImpedanceControl::new(2.0)?.with_gains(5.0, 0.2)?; // at most 2 Nm; 5 Nm/rad and 0.2 Nm s/rad
//! let mut yaw = Own::new(Motor::new(Model::MF9025_16T, 1, mode)?);
//! let refused = yaw.arm(Instant::from_micros(1_000)).map_err(|error| error.to_string());
//! assert_eq!(refused, Err("no feedback from MF9025-16T #1".into()));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! **Not for MyActuator's RMD-X** with protocol V3 or V4, which is the family [`rmd`](crate::rmd): its frames have the same first bytes,
//! another scale of the current, and answers on 0x240 + id, so that such a drive is never heard. Nor for the series MS, which has no
//! torque frame. A holding brake (0x8C) is neither released nor applied.
//!
//! Sources: "Motor CAN bus communication protocol" V2.35 of the vendor, as public programs quote it: frames, ids, scales, what off and
//! run do, two of the error bits. The other six bits, and the current limit in bytes 2 and 3 of 0xA2, as pylkmotor 1.0.6 has them; with
//! V2.35 these two bytes are 0. Not known: from which side the manual sees its positive direction, which it calls clockwise: angles
//! and torques have the sign of the drive, and [`Motor::reversed`] turns it round. Whether a drive counts turns while it is off.

pub(crate) mod bus;
pub(crate) mod command;
pub(crate) mod config;
mod feedback;
pub(crate) mod model;
#[cfg(test)]
mod tests;

pub use bus::Motor;
pub use command::Command;
pub use config::Mode;
pub use feedback::{Feedback, State};
pub use model::{Model, Series};
