//! RobStride's joint motors RS00 to RS06, and Xiaomi's CyberGear with the same protocol.
//!
//! ```text
//! id         28 .. 24                 23 ..  8                   7 ..  0
//! command    1 operation              torque                     motor     position 16 | velocity 16 | kp 16 | kd 16 bits
//!            3 enable, 4 disable      host                       motor     4: 1 clears faults
//!            6 set zero, 7 set id     host, for 7 the new id     motor     1
//!            17 read, 18 write        host                       motor     index 16 | 0 | value 32
//!            22 store                 host                       motor     1 to 8; CyberGear: the bit rate
//! feedback   2                        mode 2 | faults 6 | motor  host      position 16 | velocity 16 | torque 16 | temperature
//!            17 parameter             failed 8 | motor           host      index 16 | 0 | value 32
//!            21 faults                motor                      host      faults 32 | warnings 32
//! ```
//! Extended frames of 8 bytes at 1 Mbit/s. A drive answers each frame with a frame, so the bus carries two a motor and cycle: at
//! 1 kHz three motors fill the bus.
//!
//! [`Motor`] is such a drive as a [`DriveProtocol`](crate::motor::DriveProtocol); [`Actuator`](crate::motor::Actuator) makes a device of the motor. Its run
//! mode is an [`ImpedanceControl`](crate::motor::ImpedanceControl) or a [`Mode`]:
//!
//! | mode | `run_mode` | targets | torque is limited by | rest is |
//! |---|--:|---|---|---|
//! | [`ImpedanceControl`](crate::motor::ImpedanceControl): operation | 0 | torque and [`Impedance`](crate::motor::Impedance); with gains or loops velocity and angle | the torque limit of the mode, here and in the drive | no gains, no torque |
//! | [`Mode::position`] | 5, CyberGear 1 | angle | the current limit of the mode | disabled |
//! | [`Mode::velocity`] | 2 | velocity | the current limit of the mode | disabled |
//! | [`Mode::current`] | 3 | torque | the current limit of the mode | no current |
//!
//! **Before a motor is armed, `run_mode` is read, and written if different**: a drive forgets the mode with the supply.
//! [`arm`](crate::motor::Devices::arm) refuses until the drive has the right mode. `mechPos`, the position with its turns, is read as
//! well: the feedback of a RobStride starts again at the other end of its range, and an angle beyond the range is unknown, so no
//! spring and no position mode is driven from such an angle. A motor in [`Mode::position`] is not armed there.
//!
//! **Before a drive is enabled**, these are written and read back, each time: `canTimeout`, 100 ms unless configured otherwise; in
//! the operation mode `limit_torque`; in the position and speed modes `limit_cur` at zero, opened with the output afterwards, and
//! `limit_spd`. The target is where the shaft is. If the drive does not confirm a parameter in 8 reads, the motor trips, and `arm`
//! names the parameter until the drive confirms.
//!
//! **When the program stops, a RobStride does; a CyberGear does not.** A CyberGear has no time-out for commands, and goes on with its
//! last command when the cable is cut: with its last torque, or to its last position. Only a loss of the supply ends the motion. Keep
//! the torque limit low, and have a switch for the supply. The maker's tool lists a time-out (`CAN_TIMEOUT`, 0x200C), but no documented
//! frame writes it, and a CyberGear did not take the frame for other parameters (python-cybergear 0.1.2).
//!
//! ```
//! use drivetrain::motor::{Devices, ImpedanceControl, Actuator};
//! use drivetrain::robstride::{Model, Motor};
//! use drivetrain::time::Instant;
//!
//! let mode = ImpedanceControl::new(6.0)?.with_gains(40.0, 1.5)?; // at most 6 Nm; 40 Nm/rad and 1.5 Nm s/rad
//! let mut knee = Actuator::new(Motor::new(Model::RS03, 127, mode)?);
//! let refused = knee.arm(Instant::from_micros(1_000)).map_err(|error| error.to_string());
//! assert_eq!(refused, Err("no feedback from RS03 #127".into()));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Every frame of another node to the motor counts as a frame of a second master, also the question of a tool for a parameter.
//!
//! A fault is an error of the motor, with a code:
//!
//! | code | fault | from |
//! |---|---|---|
//! | 16 to 21 | bits 16 to 21 of the id: under-voltage, over-current, over-temperature, magnetic encoder, stall (CyberGear: Hall encoder), not calibrated | feedback |
//! | 32 to 63 | 32 and the bit of the report: 0 motor too hot, 1 driver, 2 under-voltage, 3 over-voltage, 4, 5 and 16 current of phase B, C, A, 7 not calibrated, 8 hardware, 9 position, 14 stall | report of faults |
//! | 1 | the drive calibrates itself | feedback |
//!
//! Sources: the maker's manuals of RS00 to RS06, 28 April 2026, chapter 4; for the CyberGear its manual as belovictor/cybergear-docs
//! translates the text. Frames of public tests are in `tests/data/robstride`.
//!
//! Not known:
//! * Whether all drives truncate to counts, as the manuals' code does, or round: half a count either way.
//! * The host in the answer to an operation frame, as the frame names no host. So feedback to any host counts.
//! * Whether a disabled drive answers an operation frame. The manuals name the answer without a condition, and
//!   [`arm`](crate::motor::Devices::arm) finds no feedback without an answer.
//! * Whether the firmware resets a limit at enabling. The current limit goes out again with every 16th command.
//! * The position in a drive's own loop beyond the range of its feedback. So no position is sent there.
//! * The answer for `mechPos` of a CyberGear with a firmware before 1.2.1.5. Without an answer, the motor is never armed.
//! * The layout of a drive's own reports: chapter 4.1.11 has type 24, chapter 4.2.1 type 2. The reports are off at delivery, and reports of
//!   type 24 are not read.
//!
//! **The protocol with 11-bit ids** (type 25 or `protocol_1` switch to it) is not here. Its feedback has no state, so an enabled drive or
//! a reset is not seen; parameters can be read since firmware 0.0.3.27 only; and the manuals of RS02, RS03 and RS04 give it the
//! velocity range of the RS00. Leave the drive in the private protocol, as delivered.

mod bus;
mod codec;
mod config;
mod model;
#[cfg(test)]
mod tests;

pub use bus::Motor;
pub use codec::{Command, Feedback, Status};
pub use config::Mode;
pub use model::{Model, Register};
