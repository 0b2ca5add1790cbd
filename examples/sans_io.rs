//! Without the runner: an own loop over the calls of the bus, for any driver, with or without `embedded-can` traits.
//!
//! A GM6020 turns its absolute angle back and forth. `cargo run --example sans_io`

mod console;

use drivetrain::control::PidConfig;
use drivetrain::dji::{Bus, Config, Gm6020Voltage};
use drivetrain::frame::CanFrame;
use drivetrain::sim::{Controller, MotorConfig, Simulation};
use drivetrain::time::{Duration, Tick, Ticker};
use drivetrain::units::Angle;
use std::error::Error;

/// Stands for the driver of a board: two functions over raw ids and bytes.
struct Driver<'w>(Controller<'w>);

impl Driver<'_> {
    fn receive(&mut self) -> Option<(u16, Vec<u8>)> {
        use embedded_can::{Frame, Id, nb::Can};
        let frame = self.0.receive().ok()?;
        let Id::Standard(id) = frame.id() else { return None };
        Some((id.as_raw(), frame.data().to_vec()))
    }

    /// Gives back what is still to be sent: the frame itself, or one that had to make way for it.
    fn send(&mut self, frame: &CanFrame) -> Option<CanFrame> {
        use embedded_can::nb::Can;
        self.0.transmit(frame).unwrap_or(Some(*frame))
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    const ANGLE: PidConfig = PidConfig::new(15.0, 0.0, 0.0);
    const RATE: PidConfig = PidConfig::new(1.0, 5.0, 0.0);

    let world = Simulation::new(1);
    world.attach(MotorConfig::gm6020_voltage(1))?;
    let mut driver = Driver(world.controller());

    let mut bus = Bus::new();
    let yaw = bus.attach(Config::<Gm6020Voltage>::new(1).position_loop(ANGLE, RATE))?;
    let mut ticker = Ticker::new(Duration::from_millis(1));
    let mut armed_once = false;

    for ms in 0..3_000_u32 {
        world.advance(Duration::from_millis(1));
        let now = world.now();
        while let Some((id, data)) = driver.receive() {
            _ = bus.ingest_raw(id, &data, now);
        }
        let Some(tick) = ticker.due(now) else { continue };
        if !armed_once {
            // By itself, which only a simulated robot may: in each millisecond until the motor is heard, never after a fault.
            armed_once = bus.arm(now).is_ok();
        } else {
            let target = if ms % 2_000 < 1_000 { 90.0 } else { 270.0 };
            bus.set_angle(yaw, Angle::from_degrees(target))?;
        }
        step(&mut bus, &mut driver, tick);
        if ms % 250 == 249 {
            let angle =
                bus.state(yaw).map_or(f32::NAN, |state| state.position.angle().as_degrees());
            console::line(format_args!("{ms:>5} ms  {angle:7.2} degrees"));
        }
    }
    let angle = bus.state(yaw).ok_or("the motor was never heard")?.position.angle();
    if (angle.as_degrees() - 90.0).abs() > 1.0 {
        return Err(
            format!("the motor stands at {:.2} degrees instead of 90", angle.as_degrees()).into()
        );
    }
    Ok(())
}

fn step(bus: &mut Bus, driver: &mut Driver<'_>, tick: Tick) {
    bus.update(tick);
    while let Some(frame) = bus.next_frame() {
        if let Some(left) = driver.send(&frame) {
            bus.requeue(&left); // offered again after the next update, with newer values
            if left == frame {
                break; // no place now
            }
        }
    }
}
