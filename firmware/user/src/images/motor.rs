//! One motor with a speed loop, without a runner.

#![no_std]
#![no_main]

mod board;

use board::{Board, DriverFrame, halt, micros, pilot};
use cortex_m as _;
use drivetrain::control::PidConfig;
use drivetrain::dji::{Bus, Config, M3508};
use drivetrain::frame::CanFrame;
use drivetrain::time::{Duration, Instant, Ticker};
use drivetrain::units::AngularVelocity;
use embedded_can::nb::Can;

const SPEED: PidConfig = PidConfig::new(1.9, 2.4, 0.0);

#[cortex_m_rt::entry]
fn main() -> ! {
    let mut can = Board;
    let mut bus = Bus::new();
    let Ok(wheel) = bus.attach(Config::<M3508>::new(1).speed_loop(SPEED)) else { halt() };
    let mut ticker = Ticker::new(Duration::from_millis(1));
    let mut was_on = true;
    loop {
        let now = Instant::from_micros(micros());
        while let Ok(frame) = can.receive() {
            if let Some(frame) = CanFrame::copy_of(&frame) {
                _ = bus.ingest(&frame, now);
            }
        }
        let Some(tick) = ticker.due(now) else { continue };
        let (is_on, [rad_per_s, ..]) = pilot();
        if !is_on {
            bus.disarm();
        } else if !was_on {
            _ = bus.arm(now);
        }
        was_on = is_on;
        _ = bus.set_velocity(wheel, AngularVelocity::from_rad_per_s(rad_per_s));
        bus.update(tick);
        while let Some(frame) = bus.next_frame() {
            let is_sent =
                frame.convert::<DriverFrame>().is_some_and(|it| can.transmit(&it).is_ok());
            if !is_sent {
                bus.requeue(&frame);
                break;
            }
        }
    }
}
