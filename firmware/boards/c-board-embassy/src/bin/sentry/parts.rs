//! The tasks of the sentry beside the control loop: its senses, and what each part wants.

use crate::topics::{
    AIM, ARMED, ATTITUDE, BARREL, CHASSIS_YAW, EVENTS, MOTION, PILOT, REMOTE, SHOT,
};
use c_board_embassy::now;
use drivetrain::time::{Duration, Instant};
use drivetrain::wire::Deframer;
use drivetrain::wire::dbus::{Dbus, Remote};
use drivetrain::wire::hipnuc::{Imu, MAX_FRAME};
use embassy_stm32::mode::Async;
use embassy_stm32::usart::UartRx;
use embassy_time::Ticker;
use pilot::sentry::{Aiming, Attitude, Event, Shooter, Steering};

/// A remote control that was not heard for so long is neutral.
const REMOTE_DEADLINE: Duration = Duration::from_millis(100);

/// Returns what the remote control shows; neutral when that is too old.
pub fn fresh((remote, at): (Remote, Instant), now: Instant) -> Remote {
    if now.since(at) <= REMOTE_DEADLINE { remote } else { Remote::default() }
}

#[embassy_executor::task]
pub async fn hear_remote(mut line: UartRx<'static, Async>) {
    let (mut dbus, mut bytes, topic) = (Dbus::new(), [0; 36], REMOTE.sender());
    loop {
        // Each read is a transfer of its own: a ring of embassy 0.6 may read old bytes anew after an error of the line.
        let count = line.read_until_idle(&mut bytes).await.unwrap_or(0);
        let (mut rest, now) = (bytes.get(..count).unwrap_or_default(), now());
        while let Some(remote) = dbus.read(&mut rest, now) {
            topic.send((remote, now));
        }
    }
}

#[embassy_executor::task]
pub async fn hear_imu(mut line: UartRx<'static, Async>) {
    let (mut imu, mut bytes) = (Deframer::<Imu, MAX_FRAME>::new(), [0; 128]);
    let (topic, mut last) = (ATTITUDE.sender(), None);
    loop {
        let count = line.read_until_idle(&mut bytes).await.unwrap_or(0);
        let mut rest = bytes.get(..count).unwrap_or_default();
        while let Some(frame) = imu.read(&mut rest) {
            // One whose time stands sends an old attitude.
            if frame.time_ms != last {
                topic.send(Attitude::new(&frame, now()));
            }
            last = frame.time_ms;
        }
    }
}

#[embassy_executor::task]
pub async fn steer() {
    const PERIOD_S: f32 = 0.002;
    let Ok(mut steering) = Steering::new() else { panic!("the modes do not fit") };
    let topic = MOTION.sender();
    let mut wake = Ticker::every(embassy_time::Duration::from_millis(2));
    loop {
        wake.next().await;
        let now = now();
        let remote = PILOT.try_get().unwrap_or_default();
        let yaw = CHASSIS_YAW.try_get().flatten();
        topic.send((steering.update(&remote, yaw, PERIOD_S), now));
    }
}

#[embassy_executor::task]
pub async fn aim() {
    const PERIOD_S: f32 = 0.001;
    let (mut aiming, topic) = (Aiming::default(), AIM.sender());
    let mut wake = Ticker::every(embassy_time::Duration::from_millis(1));
    loop {
        wake.next().await;
        let Some(seen) = ATTITUDE.try_get() else { continue };
        let remote = PILOT.try_get().unwrap_or_default();
        let is_armed = ARMED.try_get() == Some(true);
        topic.send(aiming.update(&remote, seen, is_armed, PERIOD_S));
    }
}

#[embassy_executor::task]
pub async fn shoot() {
    let mut shooter = Shooter::default();
    let events = EVENTS.immediate_publisher();
    let mut was_jammed = false;
    let mut wake = Ticker::every(embassy_time::Duration::from_millis(2));
    loop {
        wake.next().await;
        let now = now();
        let remote = PILOT.try_get().unwrap_or_default();
        let barrel = BARREL.try_get().unwrap_or_default();
        SHOT.signal(shooter.update(&remote, barrel, now));
        if shooter.is_jammed() && !was_jammed {
            events.publish_immediate(Event::Jammed);
        }
        was_jammed = shooter.is_jammed();
    }
}
