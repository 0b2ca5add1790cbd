//! One motor with a speed loop under a runner.

#![no_std]
#![no_main]

mod board;

use board::{Board, halt, micros, pilot};
use cortex_m as _;
use drivetrain::control::PidConfig;
use drivetrain::dji::{Bus, Config, M3508};
use drivetrain::runner::{Nb, Runner};
use drivetrain::time::Instant;
use drivetrain::units::AngularVelocity;

const SPEED: PidConfig = PidConfig::new(1.9, 2.4, 0.0);

#[cortex_m_rt::entry]
fn main() -> ! {
    let mut bus = Bus::new();
    let Ok(wheel) = bus.attach(Config::<M3508>::new(1).speed_loop(SPEED)) else { halt() };
    let mut runner = Runner::new(Nb(Board), || Instant::from_micros(micros()), bus);
    let mut was_on = true;
    loop {
        runner.poll(16);
        let Some(tick) = runner.due() else { continue };
        let (is_on, [rad_per_s, ..]) = pilot();
        if !is_on {
            runner.device_mut().disarm();
        } else if !was_on {
            _ = runner.arm(tick);
        }
        was_on = is_on;
        _ = runner.device_mut().set_velocity(wheel, AngularVelocity::from_rad_per_s(rad_per_s));
        runner.tick(tick);
    }
}
