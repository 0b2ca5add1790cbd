//! Damiao's joint and hub motors: DM-J, DM-H and others with the same drive.
//!
//! ```text
//! command    0x000 + id  MIT                 position 16 | velocity 12 | kp 12 | kd 12 | torque 12 bits
//!            0x100 + id  position-velocity   position f32 | velocity limit f32
//!            0x200 + id  velocity            velocity f32
//!            0x300 + id  force-position      position f32 | velocity limit u16 | current share u16
//!            the same, and id alone: enable, disable, clear error: seven times 0xFF, and 0xFC, 0xFD, 0xFB
//! registers  0x7FF       id 16 | read 0x33, write 0x55, store 0xAA | number | value
//! feedback   master id   status 4 | id 4 | position 16 | velocity 12 | torque 12 bits | two temperatures
//! ```
//! Standard frames of 8 bytes at 1 Mbit/s. A drive answers each frame with a frame, so the bus carries two a motor and cycle: at
//! 1 kHz three motors fill the bus. Several drives may share a master id.
//!
//! [`Motor`] is such a drive as a [`DriveProtocol`](crate::motor::DriveProtocol); [`Actuator`](crate::motor::Actuator) makes a device of the motor. Its
//! control mode is an [`ImpedanceControl`](crate::motor::ImpedanceControl) or a [`Mode`]:
//!
//! | mode | targets | torque is limited by | rest is |
//! |---|---|---|---|
//! | [`ImpedanceControl`](crate::motor::ImpedanceControl): MIT | torque and [`Impedance`](crate::motor::Impedance); with gains or loops velocity and angle | the torque limit of the mode | no gains, no torque |
//! | [`Mode::force_position`] | angle | the torque limit of the mode | disabled |
//! | [`Mode::position_velocity`] | angle | the drive alone | disabled |
//! | [`Mode::velocity`] | velocity | the drive alone | disabled |
//!
//! **Before a motor is armed, its registers are read.** `CTRL_MODE`, `PMAX`, `VMAX` and `TMAX` have to match the configuration,
//! else [`arm`](crate::motor::Devices::arm) names the register and both values: a drive in another mode discards the
//! commands, and a drive with other ranges gives another torque. The first answer takes some 50 ms.
//!
//! **When the program stops, the drive does**: `TIMEOUT` is written and read back each time before the drive is enabled, 100 ms
//! unless configured otherwise. If the drive does not confirm a register in 8 reads, the motor trips, and
//! [`arm`](crate::motor::Devices::arm) names the register until the drive confirms.
//!
//! ```
//! use drivetrain::damiao::{Model, Motor};
//! use drivetrain::motor::{Devices, ImpedanceControl, Actuator};
//! use drivetrain::time::Instant;
//!
//! let mode = ImpedanceControl::new(3.0)?.with_gains(20.0, 0.6)?; // at most 3 Nm; 20 Nm/rad and 0.6 Nm s/rad
//! let mut joint = Actuator::new(Motor::new(Model::J4310, 1, mode)?);
//! let refused = joint.arm(Instant::from_micros(1_000)).map_err(|error| error.to_string());
//! assert_eq!(refused, Err("no feedback from DM-J4310 #1".into()));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Sources: the register table and frames as python-damiao-driver (damiao-motor 1.0.6) documents them, in agreement with librm and
//! reBot; the master id, the time-out and the states also from the manual of the DM-J4310-2EC. Frames of public tests are in
//! `tests/data/wire`. Not known: the behaviour of a drive enabled without a target in the modes other than MIT; so a target where the
//! shaft is goes out in each cycle until it is. In a position mode, a drive enabled while its shaft turns brakes the shaft with the
//! whole torque of the drive. `Mode::force_position` takes TMAX for the torque at full current, as damiao-motor says. Programs of the
//! vendor send enabling and disabling frames to the id of the mode, public packages to the bare id: here the frames go to both in
//! turn.

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
