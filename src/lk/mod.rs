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
//! A drive answers each frame within 0.25 ms, and sends nothing by itself. So the bus carries two a motor and cycle: at
//! 1 kHz and 1 Mbit/s three motors fill the bus.
//!
//! [`Motor`] is such a drive as a [`DriveProtocol`](crate::motor::DriveProtocol); [`Actuator`](crate::motor::Actuator) makes a device of the motor. Its
//! control mode is an [`ImpedanceControl`](crate::motor::ImpedanceControl) or a [`Mode`]:
//!
//! | mode | targets | torque is limited by |
//! |---|---|---|
//! | [`ImpedanceControl`](crate::motor::ImpedanceControl): torque frames, the loops run here | torque and [`Impedance`](crate::motor::Impedance); with gains or loops velocity and angle | the torque limit of the mode |
//! | [`Mode::velocity`] | velocity | the drive alone |
//! | [`Mode::velocity_with_torque_limit`] | velocity | the drive, and the torque limit of the mode |
//! | [`Mode::position_velocity`] | angle | the drive alone |
//!
//! **Rest is a torque frame with a current of 0** in each mode, and the drive is off besides. Even switched off, a drive answers a
//! torque frame with feedback, so the torque frame also polls the drive. `0x81` (stop) is never sent: the manual leaves open whether
//! a stopped drive holds.
//!
//! **Off clears the turns** counted by the drive. So [`Mode::position_velocity`] reads the angle anew each time when the drive runs,
//! before a position is sent, and each 32 cycles from then on: a drive whose count has changed by more than half a turn of the rotor
//! has lost its supply, and trips the motor.
//!
//! **The state is read** before a motor is armed, while the drive is switched on or off, and in place of each 32nd command. A
//! drive with an error is not armed. Errors are cleared with every second frame to switch the drive off.
//!
//! The answer to a question is no feedback, so feedback is missing for one cycle then: a program with less than 250 updates a second has to
//! give [`Actuator`](crate::motor::Actuator) longer [`Timeouts`](crate::motor::Timeouts).
//!
//! **When the program stops, the drive does not.** The protocol has no time-out of the drive: no frame sets or reads one, and a drive
//! goes on with its last command when the cable is cut. Bit 7 of the errors, on newer drives, is an input time-out; its
//! setting is not public.
//!
//! **The first byte tells feedback from other frames.** The echo of off and run is no feedback. Both directions share an id, so a
//! command read back would look like feedback: a frame like a command of the motor counts as a command of another controller, see
//! [`second_master`](crate::motor::CanDevice::second_master). At exactly 0 °C some feedback reads like a command, and is lost: at
//! rest and in torque mode, feedback without a current and with an encoder of 0; in [`Mode::velocity`], feedback without a current or
//! below the limit; in [`Mode::position_velocity`], feedback with a small positive current.
//!
//! Angles and velocities belong to the output shaft, from the encoder of the rotor and the gear. The angle of a geared motor
//! is counted from the rotor's angle at the first feedback; the rotor has to make less than half a turn between two frames.
//!
//! ```
//! use drivetrain::lk::{Model, Motor};
//! use drivetrain::motor::{Devices, ImpedanceControl, Actuator};
//! use drivetrain::time::Instant;
//!
//! let mode = ImpedanceControl::new(2.0)?.with_gains(5.0, 0.2)?; // at most 2 Nm; 5 Nm/rad and 0.2 Nm s/rad
//! let mut yaw = Actuator::new(Motor::new(Model::MF9025_16T, 1, mode)?);
//! let refused = yaw.arm(Instant::from_micros(1_000)).map_err(|error| error.to_string());
//! assert_eq!(refused, Err("no feedback from MF9025-16T #1".into()));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! **Not for MyActuator's RMD-X** with protocol V3 or V4, see the family [`rmd`](crate::rmd): their frames have the same first bytes,
//! another scale of the current, and answers on 0x240 + id, so such a drive is never heard. Nor for the series MS without a
//! torque frame. A holding brake (0x8C) is neither released nor applied.
//!
//! Sources: "Motor CAN bus communication protocol" V2.35 of the vendor, as quoted by public programs: frames, ids, scales, effects of
//! off and run, two of the error bits. The other six bits, and the current limit in bytes 2 and 3 of 0xA2, as pylkmotor 1.0.6 has
//! them; with V2.35 these two bytes are 0. Not known: the side from which the manual sees its positive direction, called clockwise
//! there: angles and torques have the sign of the drive, and [`Actuator::reversed`](crate::motor::Actuator::reversed) reverses both. Whether a drive counts turns while
//! off.

pub(crate) mod bus;
pub(crate) mod codec;
pub(crate) mod config;
pub(crate) mod model;
#[cfg(test)]
mod tests;

pub use bus::Motor;
pub use codec::{Command, Feedback, State};
pub use config::Mode;
pub use model::{Model, Series};
