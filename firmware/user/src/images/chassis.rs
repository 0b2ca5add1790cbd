//! A mecanum chassis and the yaw of a gimbal on one bus, under a runner: states are read, edges are taken.

#![no_std]
#![no_main]

mod board;

use board::{Board, halt, micros, pilot};
use core::hint::black_box;
use cortex_m as _;
use drivetrain::chassis::{Mecanum, MecanumWheels};
use drivetrain::control::PidConfig;
use drivetrain::dji::{AttachError, Bus, Config, Gm6020Voltage, Handle, M3508};
use drivetrain::geometry::{Body, Twist, Vec2};
use drivetrain::motor::VelocityDrive;
use drivetrain::runner::{Nb, Runner};
use drivetrain::time::Instant;
use drivetrain::units::{Angle, AngularVelocity};

const SPEED: PidConfig = PidConfig::new(1.9, 2.4, 0.0);
const YAW: (PidConfig, PidConfig) =
    (PidConfig::new(15.0, 0.0, 0.0), PidConfig::new(2.0, 20.0, 0.0));

fn attach(
    bus: &mut Bus,
) -> Result<(MecanumWheels<Handle<M3508>>, Handle<Gm6020Voltage>), AttachError> {
    let wheel = |id| Config::<M3508>::new(id).speed_loop(SPEED);
    let wheels = MecanumWheels {
        front_left: bus.attach(wheel(2))?,
        front_right: bus.attach(wheel(1).reversed())?,
        rear_left: bus.attach(wheel(3))?,
        rear_right: bus.attach(wheel(4).reversed())?,
    };
    Ok((wheels, bus.attach(Config::new(5).position_loop(YAW.0, YAW.1))?))
}

#[cortex_m_rt::entry]
fn main() -> ! {
    let mut bus = Bus::new();
    let Ok((wheels, yaw)) = attach(&mut bus) else { halt() };
    let Ok(mecanum) = Mecanum::new(0.076, Vec2::new(0.20, 0.18)) else { halt() };
    let mut runner = Runner::new(Nb(Board), || Instant::from_micros(micros()), bus);
    let mut was_on = true;
    loop {
        runner.poll(16);
        let Some(tick) = runner.due() else { continue };
        let (is_on, [vx, vy, wz]) = pilot();
        if !is_on {
            runner.device_mut().disarm();
        } else if !was_on {
            _ = runner.arm(tick);
        }
        was_on = is_on;
        let wanted = Twist::<Body>::new(vx, vy, wz);
        let (speeds, _) = mecanum.inverse(wanted).desaturate(AngularVelocity::from_rpm(450.0));
        let bus = runner.device_mut();
        _ = bus.drive(wheels.zip(speeds).into_array());
        _ = bus.set_angle(yaw, Angle::from_radians(wz));
        for wheel in wheels.into_array() {
            black_box(bus.state(wheel).map(|state| state.velocity));
        }
        runner.tick(tick);
        while let Some(edge) = runner.device_mut().next_edge() {
            black_box(&edge);
        }
        while let Some(edge) = runner.next_edge() {
            black_box(&edge);
        }
    }
}
