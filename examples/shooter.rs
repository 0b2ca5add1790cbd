//! Two friction wheels and a loader, on the simulator: a single shot, a burst with a jam, and long fire up to the heat limit.
//!
//! ```text
//! cargo run --release --example shooter [FILE.svg]
//! ```
//!
//! The heat of the barrel comes as frames of the referee system, ten times a second. Fails when a ball leaves at another speed than that
//! of the wheels within 1 %, when the count is wrong, or when the true heat exceeds the limit.

mod output;
mod picture;

use drivetrain::control::PidConfig;
use drivetrain::dji::{Bus, Config, Handle, M2006, M3508};
use drivetrain::motor::VelocityDrive;
use drivetrain::runner::{Nb, Runner};
use drivetrain::shooter::{Shooter, ShooterFeedback, ShooterOrder, ShooterState};
use drivetrain::sim::{Fault, MotorConfig, MotorKey, Simulation};
use drivetrain::time::{Duration, Instant};
use drivetrain::units::AngularVelocity;
use drivetrain::wire::referee::{Referee, encode};
use output::console;
use picture::{BLUE, GREY, RED};
use std::error::Error;

const WHEELS: AngularVelocity = AngularVelocity::from_rpm(400.0);
const CHAMBERS: u8 = 8;
const SHOTS_PER_S: f32 = 10.0;
/// A per rad/s and A per rad.
const WHEEL_SPEED: PidConfig = PidConfig::new(2.0, 20.0, 0.0);
const LOADER_SPEED: PidConfig = PidConfig::new(1.0, 10.0, 0.0);

const HEAT_LIMIT: u8 = 150;
const COOLING_PER_S: u8 = 30;
const HEAT_OF_SHOT: f32 = 10.0;

const END_S: f32 = 12.0;
/// Something holds the loader in the middle of the burst.
const JAM_S: (f32, f32) = (3.25, 3.55);

/// The trigger, as a pilot would hold it.
fn order(time_s: f32) -> ShooterOrder {
    match time_s {
        time if time < 0.5 => ShooterOrder::Rest,
        time if time < 2.0 => ShooterOrder::Spin,
        time if time < 2.5 => ShooterOrder::Fire(1),
        time if time < 3.0 => ShooterOrder::Spin,
        time if time < 5.0 => ShooterOrder::Fire(5),
        time if time < 5.5 => ShooterOrder::Spin,
        time if time < 11.0 => ShooterOrder::Fire(255),
        _ => ShooterOrder::Rest,
    }
}

#[derive(Debug, Clone, Copy)]
struct Sample {
    time_s: f32,
    wheel_rpm: f32,
    loader_rpm: f32,
    heat: f32,
    believed: f32,
    shots: f32,
    balls: f32,
}

/// The barrel in the world: balls that leave brake the wheels, and heat it.
struct Barrel<'w> {
    world: &'w Simulation,
    wheels: [MotorKey; 2],
    loader: MotorKey,
    /// Of the loader's encoder.
    start: i64,
    balls: i64,
    heat: f32,
    /// The largest deviation of a wheel when a ball left, as a share of its speed.
    off: f32,
    brake_ms: u32,
}

impl Barrel<'_> {
    fn rpm(&self, motor: MotorKey) -> f32 {
        self.world.motor(motor).map_or(0.0, |motor| motor.velocity.as_rpm())
    }

    /// Of the slower wheel. The second turns the other way round.
    fn wheel_rpm(&self) -> f32 {
        let [first, second] = self.wheels.map(|wheel| self.rpm(wheel));
        first.min(-second)
    }

    /// Goes on by 1 ms.
    fn step(&mut self) {
        let counts = self.world.motor(self.loader).map_or(0, |motor| motor.encoder_counts);
        // The loader's gear is 36. A ball drops when nine tenths of a chamber are past.
        let chamber = 36 * 8_192 / i64::from(CHAMBERS);
        let balls = (counts - self.start + chamber * 11 / 100).div_euclid(chamber);
        self.heat = (self.heat - 1e-3 * f32::from(COOLING_PER_S)).max(0.0);
        if balls > self.balls {
            self.heat += HEAT_OF_SHOT * (balls - self.balls) as f32;
            let [first, second] = self.wheels.map(|wheel| self.rpm(wheel));
            for rpm in [first, -second] {
                self.off = self.off.max((rpm / WHEELS.as_rpm() - 1.0).abs());
            }
            (self.balls, self.brake_ms) = (balls, 5);
        }
        let brake_nm = if self.brake_ms > 0 { 1.5 } else { 0.0 };
        self.brake_ms = self.brake_ms.saturating_sub(1);
        let [first, second] = self.wheels;
        self.world.set_load_nm(first, -brake_nm);
        self.world.set_load_nm(second, brake_nm);
    }

    /// The frames of the referee system, to the robot.
    fn report(&self, referee: &mut Referee, now: Instant) -> Result<(), Box<dyn Error>> {
        let state = [3, 1, 200, 0, 200, 0, COOLING_PER_S, 0, HEAT_LIMIT, 0, 80, 0, 0b111];
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "below 256")]
        let power = [0, 0, 0, 0, 0, 0, 0, 0, 60, 0, self.heat as u8, 0, 0, 0];
        for (command, data) in [(0x0201, &state[..]), (0x0202, &power)] {
            let mut frame = [0; 32];
            let mut received = encode(command, 0, data, &mut frame)?;
            while referee.read(&mut received, now).is_some() {}
        }
        Ok(())
    }
}

/// What the three motors say.
fn feedback(bus: &Bus, wheels: [Handle<M3508>; 2], loader: Handle<M2006>) -> ShooterFeedback {
    let fresh = bus.velocity(loader).and_then(|_| bus.state(loader));
    ShooterFeedback {
        wheels: wheels.map(|wheel| bus.velocity(wheel)),
        loader: fresh.map(|state| (state.position, state.velocity)),
        ..ShooterFeedback::default()
    }
}

fn shoot() -> Result<(Vec<Sample>, f32), Box<dyn Error>> {
    let world = Simulation::new(17);
    let keys = [world.attach(MotorConfig::m3508(1))?, world.attach(MotorConfig::m3508(2))?];
    let loader_key = world.attach(MotorConfig::m2006(3).with_load_friction_nm(0.1))?;
    let at =
        |time_s: f32| Instant::START + Duration::from_secs_f32(time_s).unwrap_or(Duration::ZERO);
    world.fault(Fault::BlockedShaft(loader_key), at(JAM_S.0)..at(JAM_S.1))?;
    let mut barrel = Barrel {
        world: &world,
        wheels: keys,
        loader: loader_key,
        start: world.motor(loader_key).ok_or("no loader")?.encoder_counts,
        balls: 0,
        heat: 0.0,
        off: 0.0,
        brake_ms: 0,
    };

    let mut bus = Bus::new();
    let wheel = |id| Config::<M3508>::new(id).speed_loop(WHEEL_SPEED);
    let wheels = [bus.attach(wheel(1))?, bus.attach(wheel(2).reversed())?];
    let loader = bus.attach(Config::<M2006>::new(3).speed_loop(LOADER_SPEED))?;
    let mut runner = Runner::new(Nb(world.controller()), world.clock(), bus);
    let mut shooter = Shooter::new(WHEELS, CHAMBERS, SHOTS_PER_S)?;
    let mut referee = Referee::new(45);
    let (mut samples, mut before) = (Vec::new(), shooter.state());
    while world.now() < at(END_S) {
        world.advance(Duration::from_micros(100));
        runner.poll(16);
        let Some(tick) = runner.due() else { continue };
        let now = tick.now();
        let time_s = now.since(Instant::START).as_secs_f32();
        barrel.step();
        if samples.len().is_multiple_of(100) {
            barrel.report(&mut referee, now)?;
        }
        // This shooter arms by itself, which only a simulated one may.
        let is_armed = runner.is_armed() || runner.arm(tick).is_ok();

        let bus = runner.device_mut();
        let feedback = ShooterFeedback {
            is_armed,
            heat: referee.heat_17mm(now),
            ..feedback(bus, wheels, loader)
        };
        let targets = shooter.update(order(time_s), &feedback, tick);
        for wheel in wheels {
            _ = bus.set_velocity(wheel, targets.wheels);
        }
        _ = bus.set_velocity(loader, targets.loader);
        runner.tick(tick);

        if shooter.state() != before && shooter.state() == ShooterState::Clearing {
            console::line(format_args!("jam          at {time_s:.2} s, try {}", shooter.tries()));
        }
        before = shooter.state();
        samples.push(Sample {
            time_s,
            wheel_rpm: barrel.wheel_rpm(),
            loader_rpm: barrel.rpm(loader_key),
            heat: barrel.heat,
            believed: shooter.heat(),
            shots: shooter.shots() as f32,
            balls: barrel.balls as f32,
        });
    }
    Ok((samples, barrel.off))
}

fn main() -> Result<(), Box<dyn Error>> {
    let path = output::path("shooter");
    let (samples, off) = shoot()?;
    let last = samples.last().ok_or("no sample")?;
    let balls_at = |time_s: f32| {
        samples.iter().find(|sample| sample.time_s >= time_s).map_or(0.0, |sample| sample.balls)
    };
    let (single, burst) = (balls_at(3.0), balls_at(5.5));
    let hottest = samples.iter().map(|sample| sample.heat).fold(0.0, f32::max);
    console::line(format_args!(
        "shots        {} counted, {} left: {single} single, {} in the burst with the jam, then {}",
        last.shots,
        last.balls,
        burst - single,
        last.balls - burst
    ));
    console::line(format_args!(
        "wheels       within {:.2} % of their speed when a ball left",
        100.0 * off
    ));
    console::line(format_args!("heat         {hottest:.0} at most, the limit is {HEAT_LIMIT}"));

    let charts: [picture::Chart<'_, Sample>; 4] = [
        ("friction wheels", "rpm", 0.0, 450.0, &[(BLUE, |sample| sample.wheel_rpm)]),
        ("loader", "rpm", -100.0, 150.0, &[(BLUE, |sample| sample.loader_rpm)]),
        (
            "heat of the barrel (red: true, grey: as the shooter reckons)",
            "heat",
            0.0,
            160.0,
            &[(GREY, |sample| sample.believed), (RED, |sample| sample.heat)],
        ),
        ("shots", "count", 0.0, 40.0, &[(BLUE, |sample| sample.shots)]),
    ];
    picture::draw(&path, &samples, |sample| sample.time_s, &charts)?;
    console::line(format_args!("{path}"));
    #[expect(clippy::float_cmp, reason = "whole numbers")]
    let is_right = single == 1.0 && burst == 6.0 && last.shots == last.balls;
    if is_right && off < 0.01 && hottest <= f32::from(HEAT_LIMIT) {
        Ok(())
    } else {
        Err("a wrong count, a ball at another speed, or too much heat".into())
    }
}
