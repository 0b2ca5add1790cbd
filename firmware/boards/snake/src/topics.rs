//! What the tasks tell each other. All tasks run in one executor, outside of interrupts.

use drivetrain::wire::hipnuc::Imu;
use drivetrain::wire::host_link::HostCommand;
use embassy_sync::blocking_mutex::raw::ThreadModeRawMutex;
use embassy_sync::pubsub::PubSubChannel;
use embassy_sync::watch::Watch;
use pilot::snake::{Event, Heard, Report};

/// A topic that holds its last value.
pub type Topic<T> = Watch<ThreadModeRawMutex, T, 2>;

/// What the computer wants.
pub static COMMAND: Topic<Heard<HostCommand>> = Watch::new();
/// What each IMU measures.
pub static IMUS: [Topic<Heard<Imu>>; 4] = [const { Watch::new() }; 4];
/// Where everything is.
pub static REPORT: Topic<Report> = Watch::new();
/// Whether all motors are armed.
pub static ARMED: Topic<bool> = Watch::new();
/// What happened: four of them wait for a listener that is late, two listen.
pub static EVENTS: PubSubChannel<ThreadModeRawMutex, Event, 4, 2, 0> = PubSubChannel::new();
