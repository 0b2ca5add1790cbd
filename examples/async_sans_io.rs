//! The same calls from async tasks, as under embassy: one task receives, one ticks and sends, no runner, no trait.
//!
//! embassy's CAN halves wait with `.await`, which fits no blocking or polling trait; the bus does not mind. On a board
//! the two functions below are embassy tasks, the `RefCell` is an `embassy_sync` mutex, `Timer` is
//! `embassy_time::Ticker`. `cargo run --example async_sans_io`

mod console;

use drivetrain::control::PidConfig;
use drivetrain::dji::{Bus, Config, Handle, M2006};
use drivetrain::frame::CanFrame;
use drivetrain::sim::{MotorConfig, Simulation};
use drivetrain::time::{Duration, Instant, Tick};
use drivetrain::units::AngularVelocity;
use std::cell::RefCell;
use std::error::Error;
use std::future::{Future, poll_fn};
use std::pin::pin;
use std::task::{Context, Poll, Waker};

/// An async driver over the simulated controller: both halves wait without blocking.
struct AsyncCan<'w>(&'w Simulation);

impl AsyncCan<'_> {
    async fn receive(&self) -> CanFrame {
        poll_fn(|_| match embedded_can::nb::Can::receive(&mut self.0.controller()) {
            Ok(frame) => Poll::Ready(frame),
            Err(_) => Poll::Pending,
        })
        .await
    }

    /// Waits for a place, and gives back a frame that had to make way.
    async fn send(&self, frame: &CanFrame) -> Option<CanFrame> {
        poll_fn(|_| match embedded_can::nb::Can::transmit(&mut self.0.controller(), frame) {
            Ok(evicted) => Poll::Ready(evicted),
            Err(_) => Poll::Pending,
        })
        .await
    }

    async fn at(&self, time: Instant) {
        poll_fn(|_| if self.0.now() >= time { Poll::Ready(()) } else { Poll::Pending }).await;
    }
}

async fn receive(can: &AsyncCan<'_>, bus: &RefCell<Bus>) {
    loop {
        let frame = can.receive().await;
        _ = bus.borrow_mut().ingest(&frame, can.0.now());
    }
}

async fn control(can: &AsyncCan<'_>, bus: &RefCell<Bus>, motor: Handle<M2006>) {
    const PERIOD: Duration = Duration::from_millis(1);
    let mut next = can.0.now();
    let mut armed_once = false;
    loop {
        next = next + PERIOD;
        can.at(next).await;
        let tick = Tick::new(can.0.now(), PERIOD.as_secs_f32());
        {
            let mut bus = bus.borrow_mut();
            // By itself, which only a simulated robot may: when the motor is heard, and never again after a fault.
            armed_once = armed_once || bus.arm(tick.now()).is_ok();
            _ = bus.set_velocity(motor, AngularVelocity::from_rpm(-100.0));
            bus.update(tick);
        }
        // Never across an await: the borrow ends before the frame waits for its place. A bus that stands still holds
        // the task here, and the frame grows old: give the wait a time limit on a board (`embassy_time::with_timeout`),
        // and hand the frame to `requeue` when it is over.
        loop {
            let frame = bus.borrow_mut().next_frame();
            let Some(frame) = frame else { break };
            if let Some(evicted) = can.send(&frame).await {
                bus.borrow_mut().requeue(&evicted);
            }
        }
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let world = Simulation::new(5);
    world.attach(MotorConfig::m2006(3))?;
    let can = AsyncCan(&world);
    let mut bus = Bus::new();
    let motor = bus.attach(Config::<M2006>::new(3).speed_loop(PidConfig::new(0.2, 2.0, 0.0)))?;
    let bus = RefCell::new(bus);

    // An executor of two tasks: everything is polled every 100 µs of simulated time.
    let mut context = Context::from_waker(Waker::noop());
    let mut receive = pin!(receive(&can, &bus));
    let mut control = pin!(control(&can, &bus, motor));
    for _ in 0..5_000 {
        world.advance(Duration::from_micros(100));
        _ = receive.as_mut().poll(&mut context);
        _ = control.as_mut().poll(&mut context);
    }

    let state = bus.borrow().state(motor).ok_or("the motor was never heard")?;
    console::line(format_args!(
        "{}: {:.1} rpm, {:.2} A",
        state.motor,
        state.velocity.as_rpm(),
        state.current.as_amperes()
    ));
    if (state.velocity.as_rpm() + 100.0).abs() > 2.0 {
        return Err("the motor does not turn at -100 rpm".into());
    }
    Ok(())
}
