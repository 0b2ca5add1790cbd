//! RobStride's joint motors RS00 to RS06, and Xiaomi's CyberGear, which speaks the same protocol.
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
//! Extended frames of 8 bytes at 1 Mbit/s. A drive sends one for each that it gets, so the bus carries two a motor and cycle: at
//! 1 kHz it is full with three.
//!
//! [`Motor`] is one of them as an [`OwnMotor`](crate::motor::OwnMotor); [`Own`](crate::motor::Own) makes a device of it. Its run
//! mode is an [`ImpedanceControl`](crate::motor::ImpedanceControl) or a [`Mode`]:
//!
//! | mode | `run_mode` | targets | torque is limited by | rest is |
//! |---|--:|---|---|---|
//! | [`ImpedanceControl`](crate::motor::ImpedanceControl): operation | 0 | torque and [`Impedance`](crate::motor::Impedance); with gains or loops velocity and angle | the torque limit of the mode, here and in the drive | no gains, no torque |
//! | [`Mode::position`] | 5, CyberGear 1 | angle | the current limit of the mode | disabled |
//! | [`Mode::velocity`] | 2 | velocity | the current limit of the mode | disabled |
//! | [`Mode::current`] | 3 | torque | the current limit of the mode | no current |
//!
//! **Before a motor is armed, `run_mode` is read, and set where it is another one**: a drive forgets it with the supply.
//! [`arm`](crate::motor::Devices::arm) refuses until the drive has the right one. `mechPos`, the position with its turns, is read as
//! well: the feedback of a RobStride starts again at the other end of its range, and an angle beyond is none, so that no spring and no
//! position mode is driven from it. A motor in [`Mode::position`] is not armed there.
//!
//! **Before a drive is enabled**, these are written and read back, each time: `canTimeout`, 100 ms unless configured otherwise; in
//! the operation mode `limit_torque`; in the position and speed modes `limit_cur` at zero, which opens with the output afterwards, and
//! `limit_spd`. The target is where the shaft is.
//!
//! **When the program stops, a RobStride does; a CyberGear does not.** It has no time-out for commands, so it goes on with its last
//! command when the cable is cut: with its last torque, or to its last position. Only its supply ends that. Keep the torque limit low,
//! and have a switch for the supply.
//!
//! ```
//! use drivetrain::motor::{Devices, ImpedanceControl, Own};
//! use drivetrain::robstride::{Model, Motor};
//! use drivetrain::time::Instant;
//!
//! let mode = ImpedanceControl::new(6.0)?.with_gains(40.0, 1.5)?; // at most 6 Nm; 40 Nm/rad and 1.5 Nm s/rad
//! let mut knee = Own::new(Motor::new(Model::RS03, 127, mode)?);
//! let refused = knee.arm(Instant::from_micros(1_000)).map_err(|error| error.to_string());
//! assert_eq!(refused, Err("no feedback from RS03 #127".into()));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Every frame to the motor that another node sends counts as that of a second master, also the question of a tool for a parameter.
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
//! translates it. Frames of public tests are in `tests/data/robstride`.
//!
//! Not known:
//! * Whether all drives truncate to counts, as the manuals' code does, or round: half a count either way.
//! * To which host a drive answers an operation frame, which names none. So feedback counts whichever host it names.
//! * Whether a drive that is disabled answers an operation frame. The manuals name the answer without a condition, and
//!   [`arm`](crate::motor::Devices::arm) finds no feedback where it does not.
//! * Whether the firmware resets a limit when it is enabled. The current limit goes out again with every 16th command.
//! * Which position a drive's own loop sees beyond the range of its feedback. So none is sent there.
//! * What a CyberGear with a firmware before 1.2.1.5 answers for `mechPos`. If it does not, it is never armed.
//! * The layout of a drive's own reports: chapter 4.1.11 has type 24, chapter 4.2.1 type 2. They are off at delivery, and those of
//!   type 24 are not read.
//!
//! **The protocol with 11-bit ids** (type 25 or `protocol_1` switch to it) is not here. Its feedback has no state, so nobody sees a drive
//! that is enabled, or has reset; parameters can be read since firmware 0.0.3.27 only; and the manuals of RS02, RS03 and RS04 give it the
//! velocity range of the RS00. Leave the drive in the private protocol, as delivered.

mod bus;
mod command;
mod config;
mod feedback;
mod model;
mod register;
#[cfg(test)]
mod tests;

pub use bus::Motor;
pub use command::Command;
pub use config::Mode;
pub use feedback::{Feedback, Status};
pub use model::Model;
pub use register::Register;
