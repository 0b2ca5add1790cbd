//! Common parts of all motors, of any family.
//!
//! The bus owns the motors and the application holds small `Copy` handles, so the traits here are
//! implemented by the *owner* of the motors and take the handle as an argument: nothing borrows a motor.
//!
//! ```text
//! CAN frame ──> CanDevice::ingest      update ──> next_frame ──> CAN frame
//!                        │                ▲           ▲ requeue
//! application ── VelocityDrive::set_velocity(handle, target)
//!             <─ VelocityDrive::velocity(handle)
//! ```
//!
//! | item | what it is |
//! |---|---|
//! | [`CanDevice`] | the seam between a device family and whatever moves its frames |
//! | [`VelocityDrive`] | an owner of motors that follow a velocity: all that a chassis needs |
//! | [`AngleDrive`] | an owner of motors that go to an angle: those that steer |
//! | [`OneOf`] | the handle of a motor whose owner is one of several |
//! | [`Capabilities`] | what a motor offers: which targets, which readings |
//! | [`MotorName`], [`Link`] | how a motor is called, and whether it is heard |
//! | [`ArmError`], [`TargetError`] | why nothing moves |
//! | [`DriveProtocol`], [`Order`], [`Actuator`], [`Guard`], [`Vitals`] | one motor with its drive, of a family or of your own, and the rules that make it safe |
//! | [`StopHoming`] | finds the zero of a shaft at a mechanical stop |
//! | [`Condition`], [`Edge`](crate::time::Edge), [`Health`] | what is wrong with a motor, each change of it, and all of it in a line |
//! | [`HealthConfig`] | what is looked for, and what follows |
//! | [`BusLoad`] | how full the bus is |
//!
//! A motor of the application joins by implementing [`DriveProtocol`]: its ids, frames and loop, and of safety only the frame of
//! rest. A motor outside of this scheme implements [`CanDevice`] itself, with a [`Guard`] for each motor. Tuples and arrays
//! of devices are [`Devices`]; a struct of devices names its parts in one method.
//!
//! # States
//! The rules of all families have two states for each motor. Where a cell of a table is empty, the state stays. The [`Link`] follows the age of the feedback, by the limits of [`Timeouts`]:
//!
//! | link | feedback is received | feedback is older than *late* | feedback is older than *offline* | lost time |
//! |---|---|---|---|---|
//! | unheard | online | | | |
//! | online | online | late | offline | late |
//! | late | online | | offline | |
//! | offline | recovering, or online when one frame is enough | | | |
//! | recovering | online with the last of the good frames in a row | | offline | |
//!
//! Time is lost in an update that does not lie after the update before, or lies before the arming. After a pause of more than 60 s all
//! feedback counts as older than *offline*. A motor without feedback is always online.
//!
//! The arming decides whether the motor takes targets: only an armed motor does.
//!
//! | arming | a granted request to arm | offline | a fault, lost time, a lost zero | disarm, emergency stop |
//! |---|---|---|---|---|
//! | disarmed | armed | | | |
//! | armed | | latched | tripped; with a lost zero, a geared motor of `dji` stays armed and refuses positions | disarmed |
//! | latched | armed | | tripped | disarmed |
//! | tripped | armed | | | disarmed |
//!
//! A latched and a tripped motor differ in one thing: if [`with_resume`](crate::dji::Config::with_resume) is configured, a latched motor
//! takes targets again by itself when online. Each latch, each trip, and the emergency stop when set and when cleared, begin the pause of the gesture: a
//! request to arm is granted after 100 ms without a request. Disarming begins no pause.

mod actuator;
mod arming;
mod capability;
mod claim;
mod device;
mod devices;
mod drive;
mod guard;
mod health;
mod homing;
mod link;
mod load;
mod safety;
mod switch;
mod watch;

pub use actuator::{Actuator, DriveProtocol, Impedance, ImpedanceControl, Order, Target};
pub(crate) use actuator::{
    ControlMode, Form, Goal, Inquiry, Preparation, Questions, Settings, Shaft, TimeoutUnits, Told,
    TorqueLoops, code_from, ingest_eight, inside, lowest_bit, mit_model, models,
    register_questions, registers,
};
pub use arming::{ArmError, Missing, WrongSetting};
pub(crate) use arming::{Obstacles, are_armed};
pub use capability::{Capabilities, Capability};
pub(crate) use claim::Route;
pub use claim::{Claim, MotorName};
pub use device::{CanDevice, Ingest, Visitor};
pub use devices::Devices;
pub(crate) use devices::ask;
pub use drive::{AngleDrive, Measured, OneOf, TargetError, VelocityDrive};
pub use guard::Guard;
pub(crate) use health::{
    Answers, BACK, BRAKING_S, Journal, Latch, Latched, Monitor, Sample, Severity, Traffic,
    check_soft_limits, elapsed, velocity_inside,
};
pub use health::{Condition, Conditions, Health, HealthConfig, Reaction, Vitals};
pub use homing::{HomingStep, StopHoming};
pub use link::{Link, Timeouts};
pub(crate) use link::{SILENCE_US, age, is_near, take_age};
pub use load::BusLoad;
pub use safety::OPENING;
pub(crate) use safety::{DeviceGuard, Guarded, Hold, MotorGuard, Output, Rest};
pub use switch::{ArmingSwitch, SwitchOrder};
pub(crate) use watch::Watch;
