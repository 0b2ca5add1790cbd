//! A simulated world to test robots in: CAN buses, motors with their ESCs, and their faults.
//!
//! [`Simulation`] stands for everything beyond the CAN driver. The code under test gets the driver's end of a bus,
//! [`Controller`], which implements both [`embedded_can::nb::Can`] and [`embedded_can::blocking::Can`], and a clock,
//! `&Simulation`; the test moves time, and reads the true state rather than the reported state.
//!
//! ```text
//!  code under test                        Simulation
//!  ┌──────────────┐   ┌──────────────────────────────────────────────────┐
//!  │ driver calls ├───┤ Controller: 3 mailboxes, receive queue           │
//!  │              │   │      ║                                           │
//!  │              │   │ ═════╩══ bus ══╦══════════╦══════════╦═══════════│ arbitration, bit-exact times
//!  │              │   │          ESC + motor  ESC + motor  foreign nodes │
//!  │ clock        ├───┤ &Simulation    ╚═ own clock, own phase           │
//!  └──────────────┘   └──────────────────────────────────────────────────┘
//! ```
//!
//! | item | meaning |
//! |---|---|
//! | [`Simulation`] | the three buses, up to 16 motors and 12 joints, and the time |
//! | [`MotorConfig`], [`JointConfig`] | a motor to attach, or a joint of a snake robot with its drive |
//! | [`MotorKey`], [`MotorState`] | an attached motor or joint, and its true state |
//! | [`ChassisConfig`], [`Wheel`], [`ChassisState`] | a body on wheels of any layout, and its true state |
//! | [`SerialLine`] | a serial line that takes its time, and damages bytes |
//! | [`Controller`] | the driver's end of a bus |
//! | [`Fault`] | a fault and its window of time |
//! | [`SimError`] | why something is refused, or a call of the driver failed |
//! | [`Transmission`], [`Sender`], [`Traffic`] | every frame on a [`Line`] with its time, as a line of candump; bus load and counters |
//! | [`contract`] | check of a device, also of the application, against its promises |
//! | [`frame_bits`], [`nominal_bits`], [`worst_case_bits`] | how long a frame is on the wire |
//!
//! ```
//! use drivetrain::frame::CanFrame;
//! use drivetrain::sim::{MotorConfig, Simulation};
//! use drivetrain::time::Duration;
//! use embedded_can::nb::Can;
//!
//! let world = Simulation::new(7);
//! let wheel = world.attach(MotorConfig::m3508(1))?;
//! let mut can = world.controller();
//! let two_amperes = CanFrame::standard(0x200, [0x06, 0x66, 0, 0, 0, 0, 0, 0]).ok_or("id")?;
//! can.transmit(&two_amperes).map_err(|_| "refused")?;
//! world.advance(Duration::from_millis(40));
//!
//! let feedback = can.receive().map_err(|_| "nothing heard")?;
//! assert_eq!(feedback.header(), 0x201);
//! let motor = world.motor(wheel).ok_or("not attached")?;
//! assert!((motor.current.as_amperes() - 2.0).abs() < 0.001);
//! assert!((motor.torque_nm - 0.6).abs() < 0.001);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Accuracy
//! Exact: frame lengths with stuff bits and checksum, arbitration, mailbox rules, slots, scales, rounding; the same
//! seed and the same calls give the same states, bit for bit, on every target. Documented: torque constants, gears and
//! no-load speeds. **Estimates**: inertia, friction, winding, heat, jitter of the ESC, and its reaction when commands
//! stop ([`MotorConfig::with_command_timeout`]).
//!
//! A wheel on the ground holds within its friction (estimate 0.8, so about 2 Nm a wheel under 20 kg): at a larger
//! torque the wheel spins, as on a real floor.
//!
//! 18 runs, from a stalled motor to a sliding chassis, are compared with `MuJoCo`: they agree within 1 % of the largest value, but for
//! the transfer of weight below (`judges/README.md`).
//!
//! Not simulated: error frames and error counters, two senders of one id at the same bit, cogging, the supply's sag, the transfer
//! of weight to other wheels when a chassis accelerates, and the effect of a turning module on the floor, on its wheel's drive
//! and on the body. Motors move in steps of 100 µs; in between, the feedback continues their angle in a line.
//!
//! # A node of your own
//! A test can play any other node of a bus: read each frame in [`Simulation::advance_with`] and answer with
//! [`Simulation::inject`].

mod bits;
mod body;
mod chassis;
pub mod contract;
mod controller;
mod drive;
mod engine;
mod error;
mod esc;
mod fault;
mod joint;
mod line;
mod mailbox;
mod motor;
mod random;
mod ring;
mod rotor;
mod serial;
mod simulation;
mod wheel;

pub use bits::{INTERMISSION_BITS, frame_bits, nominal_bits, worst_case_bits};
pub use chassis::{ChassisConfig, ChassisState};
pub use controller::Controller;
pub use drive::{
    DamiaoDrive, DriveShaft, LkDrive, OdriveDrive, RmdDrive, RobStrideDrive, VescDrive, VescMotor,
};
pub use error::SimError;
pub use fault::Fault;
pub use joint::JointConfig;
pub use line::{Line, Sender, Traffic, Transmission};
pub use motor::{MotorConfig, MotorKey, MotorState};
pub use serial::SerialLine;
pub use simulation::Simulation;
pub use wheel::Wheel;
