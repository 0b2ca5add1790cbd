//! The joint motors of a snake robot: each drive holds its own position loop and is led by registers.
//!
//! # The protocol on one page
//! Classic CAN at 1 Mbit/s, standard data frames, numbers big-endian. A joint has **one id, 1 to 12, for both
//! directions**: the controller asks and writes on it, the joint answers on it.
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
//! | `09` | speed with which it goes to its target | pulses a second: rpm * 65536 / 60 | from the host |
//! | `0A` | target position | pulses | from the host |
//! | `0B`, `0C` | acceleration, deceleration | pulses a second², inferred: 1000 rpm a second | 0x0010AAAA |
//! | `0F` | work mode | | 1 |
//! | `10` | 1 enables, 0 disables | | |
//!
//! A write is not answered. There is no error reply: what is not a known reply is counted ([`Counters`]).
//!
//! # What safe means here
//! A drive that is enabled goes on to its last target, and holds it, **whatever becomes of its controller**. So a joint is
//! made safe by a frame, not by silence: *relaxed* and *safe output* are both `01 10 00000000`, disable. It is sent
//!
//! * to every joint with the first update, so that a controller that was reset stops what its predecessor left running;
//! * at once, before all else and to all joints, on emergency stop, disarming, a fault, lost feedback, an old target, a
//!   target that is not finite, a bad time step, zeroing, detaching: at most 12 frames, 1.4 ms of the bus;
//! * again each 100 ms as long as a joint is relaxed: a drive may have missed it.
//!
//! A relaxed joint is disabled before it is brought up again, however soon that is, and whatever relaxed it: also one that
//! is armed before the next update. It is written in the order mode, current, acceleration, deceleration, speed, target,
//! enable, so that none is enabled with a target from before; then its target is repeated in its turn, so that a lost frame does
//! not last. The enable is never repeated: a drive that lost its supply stays disabled, is seen to be
//! ([`State::resets`]), and waits to be armed.
//!
//! # What is noticed
//! Every change is an [`Edge`](crate::motor::Edge) with its time, which waits until [`Joints::next_edge`] reads it;
//! [`Joints::health`] is the line for a log.
//!
//! | condition | it holds while | the joint |
//! |---|---|---|
//! | late, offline | there is no fresh position; it is lost, until ten came in a row | is disabled; waits to be armed after *offline* |
//! | ESC fault | it was found disabled, or further off than it can go, until it is armed | is disabled, waits to be armed |
//! | position uncertain | the drive may have lost its zero, until that is set | goes on |
//! | stalled | it has a way to go and does not move: blocked in either direction | as configured; goes on |
//! | command lost | the application let its target grow too old | is disabled, until the next target |
//! | second master | another node wrote to it or asked it within the last second | goes on, and is not armed |
//!
//! # One id, two senders
//! Two nodes that begin to send one id in the same bit do not arbitrate: they destroy each other's frames until one is
//! off the bus. So while an answer is due, [`Joints`] sends nothing to that joint, a stop neither, until the first update after
//! [`Joints::with_reply_timeout`] (2 ms, so the third at 1 kHz; 10 ms at most). `embedded-can` has frames of one id sent in
//! order, so a write before a read does no harm.
//!
//! # The budget
//! Each update asks one joint and writes to one ([`Joints::with_frames_per_update`]), in turn: 12 joints report each
//! 12 ms, two positions for one speed. [`Joints::load`] reckons it. Beside a GM6020 and a C610 at 1 kHz:
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
//! That is four frames in a tick, and 12 more for a stop of all: a controller with three mailboxes needs a driver that
//! queues what waits and feeds them from its transmit interrupt, as the example `snake` has one. Without it the frames
//! that found no room go out first in the next tick.
//!
//! # Sources
//! The public firmware of the robot (`can1.c`, `chasis_task.c`, `uart3.c`). It reads only the position and never looks at
//! the register of a reply; here a reply is sorted by it. What a drive does when it hears nothing is not documented, nor
//! whether it answers for every register: if not for `10`, that shows as requests without an answer
//! ([`State::unanswered`]), one of 24, and a drive that lost its enable is noticed only by its position.

mod answers;
mod budget;
mod bus;
mod command;
mod config;
mod counters;
mod device;
mod error;
mod feedback;
mod handle;
mod model;
mod offset;
mod schedule;
mod slot;
mod state;
mod targets;
#[cfg(test)]
mod tests;

pub use bus::Joints;
pub use command::Command;
pub use config::Config;
pub use counters::Counters;
pub use error::AttachError;
pub use feedback::Reply;
pub use handle::Joint;
pub use model::{IDS, PULSES_PER_TURN, Register};
pub use state::State;
