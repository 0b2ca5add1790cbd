//! A CAN interrupt that stamps frames into a queue, a 1 kHz task, and a 100 Hz task that sets targets.
//!
//! Threads stand for the contexts of a microcontroller: the frame queue is the same there (RTIC: a local resource of
//! the interrupt and one of the task), and the mailbox of targets is a critical-section mutex. The fast task takes a target out: a target
//! that stays would be renewed in each tick, and a motor whose 100 Hz task hangs would turn for ever. Here the task hangs for 0.2 s.
//! `cargo run --example interrupt_queue`

mod console;

use drivetrain::control::PidConfig;
use drivetrain::dji::{Bus, Config, M3508};
use drivetrain::frame::CanFrame;
use drivetrain::runner::{BlockingTx, EmergencyStop, FrameQueue, Runner};
use drivetrain::sim::{MotorConfig, Simulation};
use drivetrain::time::{Duration, Instant};
use drivetrain::units::AngularVelocity;
use std::error::Error;
use std::sync::Mutex;
use std::sync::mpsc;
use std::thread;

/// Set from any context; the runner looks at it in each tick.
static STOP: EmergencyStop = EmergencyStop::new();

fn main() -> Result<(), Box<dyn Error>> {
    const SPEED: PidConfig = PidConfig::new(0.5, 3.0, 0.0);

    let world = Simulation::new(3);
    let motor = world.attach(MotorConfig::m3508(1))?;

    let mut bus = Bus::new();
    let wheel = bus.attach(Config::<M3508>::new(1).speed_loop(SPEED))?;
    // This driver's transmit waits for a place and its receive belongs to the interrupt: so the runner only sends.
    let clock = world.clock();
    let mut runner =
        Runner::new(BlockingTx(world.controller()), clock, bus).with_emergency_stop(&STOP);

    let mut queue = FrameQueue::<16>::new();
    let (mut interrupt, mut received) = queue.split();
    let target = Mutex::new(None::<AngularVelocity>); // the newest value only, and once
    let (wire, hardware) = mpsc::channel::<(CanFrame, Instant)>();
    let (handled, wait) = mpsc::channel::<()>();

    thread::scope(|scope| {
        scope.spawn(move || {
            for (frame, arrived) in hardware {
                interrupt.push(&frame, arrived);
                if handled.send(()).is_err() {
                    break;
                }
            }
        });

        let mut reached = 0.0_f32;
        let mut rested = false;
        let mut armed_once = false;
        for ms in 0..1_000_u64 {
            let mut frames = 0;
            world.advance(Duration::from_millis(1));
            while let Ok(frame) = embedded_can::nb::Can::receive(&mut world.controller()) {
                frames += usize::from(wire.send((frame, world.now())).is_ok());
            }
            wait.iter().take(frames).for_each(drop);

            if ms % 10 == 0 && !(600..800).contains(&ms) {
                // The 100 Hz task, and its pause.
                if let Ok(mut target) = target.lock() {
                    let rpm = if ms < 800 { 200.0 } else { 0.0 };
                    *target = Some(AngularVelocity::from_rpm(rpm));
                }
            }
            if ms == 900 {
                STOP.set();
            }

            // The 1 kHz task.
            runner.poll_queue(&mut received, 32);
            let Some(tick) = runner.due() else { continue };
            // By itself, which only a simulated robot may: when the motor is heard, never after a fault or a stop.
            armed_once = armed_once || runner.arm(tick).is_ok();
            // Once: 100 ms after the last target, the motor rests by its deadline.
            if let Some(newest) = target.lock().ok().and_then(|mut target| target.take()) {
                _ = runner.device_mut().set_velocity(wheel, newest); // refused, harmlessly, until armed
            }
            runner.tick(tick);

            let state = runner.device().state(wheel);
            let rpm = state.map_or(0.0, |state| state.velocity.as_rpm());
            if ms == 799 {
                let is_forgotten = state.is_some_and(|state| state.forgotten_targets == 1);
                rested = is_forgotten && world.motor(motor).is_some_and(|motor| motor.command == 0);
            }
            if ms == 599 {
                reached = rpm;
            }
            if ms % 100 == 99 {
                console::line(format_args!(
                    "{:>4} ms  {rpm:6.1} rpm  armed {}",
                    ms + 1,
                    runner.is_armed()
                ));
            }
        }
        drop(wire);
        console::line(format_args!("{} frames dropped by the queue", runner.statistics().lost));
        let is_armed = runner.is_armed();
        if (reached - 200.0).abs() > 4.0 || !rested || is_armed {
            let text =
                format!("reached {reached:.1} rpm of 200, rested {rested}, armed {is_armed}");
            return Err(text.into());
        }
        Ok(())
    })
}
