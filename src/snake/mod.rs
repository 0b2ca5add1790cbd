//! The joint motors of a snake robot: each drive has its own position loop, controlled by registers.
//!
//! # The protocol on one page
//! Classic CAN at 1 Mbit/s, standard data frames, numbers big-endian. A joint has **one id, 1 to 12, for both directions**: requests and
//! writes of the controller, and replies of the joint.
//!
//! | frame | sender | length | bytes |
//! |---|---|---|---|
//! | write | controller | 6 | `01`, register, `i32` |
//! | read | controller | 2 | `03`, register |
//! | reply | joint | 6 | `04`, register, `i32` |
//!
//! | register | | unit | the robot's firmware writes |
//! |---|---|---|---|
//! | `06` | actual speed, read only | pulses a second | |
//! | `07` | actual position, read only | pulses, 65536 a turn | |
//! | `08` | current | not known | 2000 |
//! | `09` | speed of moves to the target | pulses a second: rpm * 65536 / 60 | from the host |
//! | `0A` | target position | pulses | from the host |
//! | `0B`, `0C` | acceleration, deceleration | pulses a second², inferred: 1000 rpm a second | 0x0010AAAA |
//! | `0F` | work mode | | 1 |
//! | `10` | 1 enables, 0 disables | | |
//!
//! A write is not answered. There is no error reply. A frame that is no known reply is counted ([`Counters`]).
//!
//! # Safe output
//! An enabled drive goes on to its last target, and holds it, **regardless of its controller**. A joint is therefore made safe by a frame,
//! not by silence: *relaxed* and *safe output* are both `01 10 00000000`, disable. This frame is sent
//!
//! * to every joint with the first update, so that after a reset of the controller no joint goes on with an earlier command;
//! * at once, before all else and to all joints, on emergency stop, disarming, a fault, lost feedback, an expired target, a
//!   target that is not finite, a second bad time step in a row or a late one, zeroing, detaching: at most 12 frames, 1.4 ms of the bus;
//! * again each 100 ms while a joint is relaxed: a drive may have missed the frame.
//!
//! A relaxed joint is always disabled before the next bring-up, for any cause and after any time, even if armed before the next update. The
//! order of writes is mode, current, acceleration, deceleration, speed, target, enable: a joint is enabled with a target one turn of writes
//! old (12 ms of 12 joints at 1 kHz), and older while the driver refuses the enable. Then the target is repeated, which bounds the effect of a
//! lost frame: in its turn as long as new targets leave room, and with the first check of ages after 100 ms as a new target. The enable is
//! never repeated. A drive that lost its supply for less than *late* stays disabled, is detected ([`State::resets`]), and waits to be armed.
//! After a longer loss, the joint was late: it is brought up from the beginning and keeps its zero, and after 100 ms loses its zero and waits
//! to be armed. A joint that lost its zero takes no target, as [`NotHomed`](crate::motor::TargetError::NotHomed), until [`Joints::zero`] or
//! [`Joints::set_offset`].
//!
//! # Conditions
//! Every change is an [`Edge`](crate::time::Edge) with its time, latched until [`Joints::next_edge`] reads it. [`Joints::health`] is the
//! line for a log.
//!
//! | condition | holds while | the joint |
//! |---|---|---|
//! | late, offline | there is no fresh position; the joint is lost, until ten positions in a row | is disabled; waits to be armed after *offline*, or 100 ms (and *late*) without a position |
//! | ESC fault | the joint was found disabled before *late*, or further off than possible, until armed | is disabled, waits to be armed |
//! | position uncertain | the drive may have lost its zero, until the zero is set | is relaxed by the loss; once armed, refuses targets until the zero is set, unless the joint was never given a zero |
//! | stalled | the joint is away from its target and does not move: blocked in either direction | as configured; goes on |
//! | command lost | the application let the target expire | is disabled, until the next target |
//! | second master | another node wrote to the joint or polled it within the last second | goes on, and is not armed |
//!
//! # One id, two senders
//! Two nodes that begin to send one id in the same bit do not arbitrate: each destroys the frames of the other until one node is off the
//! bus. While a reply is outstanding, [`Joints`] therefore sends no frame to that joint, not even a stop, until the first update after
//! [`Joints::with_reply_timeout`] (2 ms, so the third at 1 kHz; 10 ms at most). `embedded-can` requires frames of one id to be sent in
//! order, so a write before a read does no harm.
//!
//! # The budget
//! Each update polls one joint and writes to one ([`Joints::with_frames_per_update`]), in turn: each of 12 joints replies every 12 ms, with
//! two positions for one speed. [`Joints::load`] computes the load. Beside a GM6020 and a C610 at 1 kHz:
//!
//! ```
//! use drivetrain::motor::BusLoad;
//! use drivetrain::snake::Joints;
//!
//! let joints = Joints::new().load();
//! assert_eq!(joints.to_string(), "26 % to 31 %");
//! let gripper = BusLoad::new(1_000_000).with_frames(4, 1_000); // two feedbacks, two commands
//! assert_eq!(joints.and(&gripper).to_string(), "70 % to 85 %");
//! ```
//!
//! This load is four frames in a tick, and 12 more for a stop of all joints. A controller with three mailboxes needs a driver that queues
//! frames and sends them from its transmit interrupt, as in the example `snake`. Without a queue, frames without room go out first in the
//! next tick.
//!
//! # Sources
//! The public firmware of the robot (`can1.c`, `chasis_task.c`, `uart3.c`). The firmware reads only the position and ignores the register
//! of a reply; this module sorts replies by the register. The behaviour of a drive without frames is not documented, nor whether a drive
//! replies for every register. If a drive does not reply for `10`, one request of 24 stays unanswered ([`State::unanswered`]), and a drive
//! that lost its enable is detected only by its position.

mod bus;
mod codec;
mod config;
mod device;
mod model;
mod schedule;
mod slot;
mod targets;
#[cfg(test)]
mod tests;

pub use codec::{Command, State};
pub use config::{AttachError, Config};
pub use model::{Counters, IDS, PULSES_PER_TURN, Register};
pub use schedule::Joints;
pub use slot::Joint;
