//! ODrive's motor controllers over CAN: the protocol CANSimple of firmware 0.5 and 0.6.
//!
//! ```text
//! id         node * 32 + number                 standard frames, low byte first, node 0 to 62
//! commands   0x02 stop with an error            0x0C position  turns f32 | turns/s, Nm i16 in 1/1000
//!            0x07 axis state u32                0x0D velocity  turns/s f32 | Nm f32
//!            0x0B control mode, input mode u32  0x0E torque    Nm f32
//!            0x0F limits  turns/s, A f32        0x18 clear errors
//! feedback   0x01 heartbeat                     axis error u32 | state | three bytes that differ from 0.5 to 0.6
//!            0x09 encoder estimates             turns f32 | turns/s f32
//!            0x03 errors, 0.6 only              active errors u32 | disarm reason u32
//! endpoints  0x04, answer 0x05, 0.6 only        read or write | number u16 | 0 | value
//! ```
//! Turns, torques and currents on the wire are of the motor; the values of [`Motor`] are of the output shaft, by its
//! [gear](Motor::with_gear). [`Actuator`](crate::motor::Actuator) makes a device of the motor. Its control
//! mode is an [`ImpedanceControl`](crate::motor::ImpedanceControl) or a [`Mode`]:
//!
//! | mode | targets | torque is limited by | rest is |
//! |---|---|---|---|
//! | [`ImpedanceControl`](crate::motor::ImpedanceControl): torque | torque and [`Impedance`](crate::motor::Impedance); with gains or loops velocity and angle | each command, and the drive's current limit | a torque of zero, then idle |
//! | [`Mode::velocity`] | velocity | the drive's current limit | idle |
//! | [`Mode::position`], [`position_with_filter`](Mode::position_with_filter), [`position_with_trajectory`](Mode::position_with_trajectory) | angle; at once, by the drive's filter, or by its trajectory | the drive's current limit | idle |
//!
//! **The link is the encoder estimates.** Only the estimates count as feedback. The heartbeat tells the state of the axis and its
//! errors: after half a second without a heartbeat a motor is not armed, and a driven motor trips. Stale estimates beside a fresh
//! heartbeat do not drive.
//!
//! **Settings of the drive**, made by USB before the drive is on the bus: node id, bit rate, and a calibrated motor and encoder with
//! the right torque constant. The heartbeat has to be cyclic (`heartbeat_rate_ms`, in 0.6 `heartbeat_msg_rate_ms`: 100 ms at
//! delivery), as 0.5 sends the heartbeat in no other way. The estimates may be cyclic (`encoder_rate_ms`, `encoder_msg_rate_ms`:
//! 10 ms at delivery). If the estimates are older than 5 ms a remote frame asks for them, in the place of a command; so set them to
//! 1 ms or 2 ms for a loop on torque. In 0.6 the motor at rest also asks for heartbeat and errors, and after
//! an endpoint that was not confirmed sends the modes and reads that endpoint. All else is set by the motor each
//! time before the drive is enabled, and lost with the supply: control mode, input mode, velocity limit, current limit, and the
//! limits of a trajectory. `startup_closed_loop_control` has to be off: after a reset the drive would run in a mode that the motor
//! has not set. A motor at rest requests idle, so no program with this motor may run while the drive calibrates.
//!
//! **How the drive is enabled**: while the heartbeat says idle, modes and limits, then a target where the shaft is, then a request
//! for closed loop, sent once: a second request would drop the torque. When the drive stays idle for half a second, the motor has a
//! fault for a moment. Idle is requested until a heartbeat says so.
//!
//! **Modes are read back in 0.6 only**, and there only with [`Endpoints`]: without them, and in 0.5, nothing on the bus tells the mode of
//! the drive. So modes and limits are sent again after closed loop was requested, and each 100 commands; the modes not in position
//! mode, where firmware 0.5 would take the angle of the shaft for its target.
//!
//! **When the program stops, the drive goes on** with its last command, unless its watchdog is on. For firmware 0.6 the watchdog is
//! set over CAN by [`Motor::with_endpoints`]. In 0.5 the watchdog is set by USB only: `axis.config.watchdog_timeout`,
//! `axis.config.enable_watchdog`. Each frame to the axis feeds the watchdog in 0.5. A drive whose watchdog expired has an error, is
//! idle, and is not armed until its errors are [cleared](Motor::clear_errors); the first frames after a start of the program find
//! such a drive.
//!
//! | error code | what |
//! |---|---|
//! | 1 to 32 | the lowest bit of the axis error, or of the active errors of 0.6 |
//! | 33, 34, 35 | 0.5.6: the motor, the encoder, the controller has an error, and the axis none |
//! | 63 | the drive did not become idle within 2 s |
//! | 64 to 127 | closed loop was refused: 64 and the procedure result of 0.6, 78 for one that is not calibrated |
//! | 129 to 160 | a warning: the bit of the disarm reason of 0.6, from 129 |
//!
//! ```
//! use drivetrain::motor::{Devices, Actuator};
//! use drivetrain::odrive::{Firmware, Mode, Model, Motor};
//! use drivetrain::time::Instant;
//! use drivetrain::units::AngularVelocity;
//!
//! let fastest = AngularVelocity::from_rpm(600.0); // of the wheel
//! let motor = Motor::new(Model::D5065, Firmware::V0_5, 3, fastest, Mode::velocity(2.0))?; // at most 2 Nm
//! let mut wheel = Actuator::new(motor.with_gear(5.0)?).reversed();
//! let refused = wheel.arm(Instant::from_micros(1_000)).map_err(|error| error.to_string());
//! assert_eq!(refused, Err("no feedback from D5065 #3".into()));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Sources: firmware and documentation of ODrive 0.5.1 to 0.5.6 (`can_simple.cpp`, `axis.cpp`, `controller.cpp`, `can-protocol.rst`);
//! for 0.6 the DBC 0.6.10 of odrive-can, the enumerations of odrive 0.6.11, odrive-messages 0.2.2, and public programs, with modes
//! and limits sent beside each command. Not known of 0.6: the frames to feed its watchdog; whether the watchdog also expires at rest,
//! without targets in velocity and position mode; whether the heartbeat has the disarm reason in the axis error; the required length
//! of a remote frame: here the length of the message. Extended ids are not supported. Never tried on a drive.

mod bus;
mod codec;
mod config;
mod model;
#[cfg(test)]
mod tests;

pub use codec::{Command, Feedback, Firmware, Heartbeat};
pub use config::{Endpoints, Mode, Motor};
pub use model::Model;
