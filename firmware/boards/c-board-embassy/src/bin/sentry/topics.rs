//! What the tasks tell each other. All tasks run in one executor, outside of interrupts.

use drivetrain::geometry::{Body, Twist};
use drivetrain::time::Instant;
use drivetrain::units::Angle;
use drivetrain::wire::dbus::Remote;
use embassy_sync::blocking_mutex::raw::ThreadModeRawMutex;
use embassy_sync::pubsub::PubSubChannel;
use embassy_sync::signal::Signal;
use embassy_sync::watch::Watch;
use pilot::sentry::{Aim, Attitude, Barrel, Event, Shot};

/// A topic that holds its last value.
pub type Topic<T> = Watch<ThreadModeRawMutex, T, 2>;

/// What the remote control shows, and when it was heard.
pub static REMOTE: Topic<(Remote, Instant)> = Watch::new();
/// What the remote control asks of the tasks: nothing when it is silent, and while the sentry brakes without it.
pub static PILOT: Watch<ThreadModeRawMutex, Remote, 0> = Watch::new();
/// What the IMU measures.
pub static ATTITUDE: Topic<Attitude> = Watch::new();
/// How the chassis is to move, and when that was decided.
pub static MOTION: Topic<(Twist<Body>, Instant)> = Watch::new();
/// Where the gimbal is to look.
pub static AIM: Topic<Aim> = Watch::new();
/// What the shooter is to do: taken once, so that its targets grow old when its task is dead.
pub static SHOT: Signal<ThreadModeRawMutex, Shot> = Signal::new();
/// The yaw of the gimbal in the chassis.
pub static CHASSIS_YAW: Topic<Option<Angle>> = Watch::new();
/// What the shooter does.
pub static BARREL: Topic<Barrel> = Watch::new();
/// Whether both buses are armed.
pub static ARMED: Topic<bool> = Watch::new();
/// What happened: four of them wait for a listener that is late, two listen.
pub static EVENTS: PubSubChannel<ThreadModeRawMutex, Event, 4, 2, 0> = PubSubChannel::new();
