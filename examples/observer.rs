//! Load torque of a motor, observed within 20 ms from its feedback on the simulator: friction, a load of 1 Nm, and a blocked shaft.
//!
//! ```text
//! cargo run --release --example observer [FILE.svg]
//! ```
//!
//! The feedback of the motor has noise. Prints how soon each load is told and how much noise is left in the speed; fails when a
//! load is told late or the speed has more than half of the noise.

mod output;
mod picture;

use drivetrain::control::{LoadObserver, PidConfig};
use drivetrain::dji::{Bus, Config, M3508};
use drivetrain::runner::{Nb, Runner};
use drivetrain::sim::{Fault, MotorConfig, MotorKey, Simulation};
use drivetrain::time::{Duration, Instant};
use drivetrain::units::AngularVelocity;
use output::console;
use picture::{BLUE, GREY, RED};
use std::error::Error;

/// A per rad/s and A per rad.
const SPEED: PidConfig = PidConfig::new(0.6, 6.0, 0.0);
const TARGET_RAD_PER_S: f32 = 10.0;
/// Of the rotor speed in the feedback.
const NOISE_RPM: f32 = 20.0;
/// Of motor and gearbox, kg m².
const INERTIA: f32 = 0.008;
const BANDWIDTH_RAD_PER_S: f32 = 200.0;

const LOAD_S: f32 = 1.0;
const LOAD_NM: f32 = -1.0;
const BLOCKED_S: f32 = 2.0;
const END_S: f32 = 2.5;

#[derive(Debug, Clone, Copy)]
struct Sample {
    time_s: f32,
    truth: f32,
    measured: f32,
    observed: f32,
    load_nm: f32,
    torque_nm: f32,
}

fn main() -> Result<(), Box<dyn Error>> {
    let path = output::path("observer");
    let samples = drive()?;
    plot(&path, &samples)?;
    judge(&samples)?;
    console::line(format_args!("{path}"));
    Ok(())
}

fn drive() -> Result<Vec<Sample>, Box<dyn Error>> {
    let world = Simulation::new(24);
    let key = world.attach(MotorConfig::m3508(1).with_speed_noise_rpm(NOISE_RPM))?;
    let at =
        |time_s: f32| Instant::START + Duration::from_secs_f32(time_s).unwrap_or(Duration::ZERO);
    world.fault(Fault::BlockedShaft(key), at(BLOCKED_S)..)?;
    let mut bus = Bus::new();
    let motor = bus.attach(Config::<M3508>::new(1).speed_loop(SPEED))?;
    let mut runner = Runner::new(Nb(world.controller()), world.clock(), bus);
    let mut observer = LoadObserver::new(INERTIA, BANDWIDTH_RAD_PER_S)?;

    let mut samples = Vec::new();
    while world.now() < at(END_S) {
        world.advance(Duration::from_micros(100));
        runner.poll(16);
        let Some(tick) = runner.due() else { continue };
        // This motor arms by itself, which only a simulated one may.
        let _not_yet = runner.is_armed() || runner.arm(tick).is_ok();
        let time_s = tick.now().since(Instant::START).as_secs_f32();
        world.set_load_nm(key, if time_s < LOAD_S { 0.0 } else { LOAD_NM });
        let target = AngularVelocity::from_rad_per_s(TARGET_RAD_PER_S);
        _ = runner.device_mut().set_velocity(motor, target);
        if let Some(state) = runner.device().state(motor) {
            let measured = state.velocity.as_rad_per_s();
            observer.update(measured, state.torque_nm, tick.dt_s());
            let truth = truth(&world, key)?;
            samples.push(Sample {
                time_s,
                truth,
                measured,
                observed: observer.velocity_rad_per_s(),
                load_nm: observer.load_nm(),
                torque_nm: state.torque_nm,
            });
        }
        runner.tick(tick);
    }
    Ok(samples)
}

fn truth(world: &Simulation, key: MotorKey) -> Result<f32, Box<dyn Error>> {
    Ok(world.motor(key).ok_or("no motor")?.velocity.as_rad_per_s())
}

fn judge(samples: &[Sample]) -> Result<(), Box<dyn Error>> {
    let steady = || samples.iter().filter(|sample| (0.5..LOAD_S).contains(&sample.time_s));
    let rms = |value: fn(&Sample) -> f32| {
        (steady().map(value).map(|error| error * error).sum::<f32>() / steady().count() as f32)
            .sqrt()
    };
    let raw = rms(|sample| sample.measured - sample.truth);
    let observed = rms(|sample| sample.observed - sample.truth);
    console::line(format_args!(
        "speed        {raw:.3} rad/s of noise in the feedback, {observed:.3} after the observer"
    ));
    let friction = steady().map(|sample| sample.load_nm).sum::<f32>() / steady().count() as f32;
    console::line(format_args!("friction     {friction:.2} Nm"));

    let first = |from_s: f32, below_nm: f32| {
        let mut after = samples.iter().filter(|sample| sample.time_s >= from_s);
        let told = after.find(|sample| sample.load_nm < below_nm);
        told.map_or(f32::INFINITY, |sample| 1e3 * (sample.time_s - from_s))
    };
    let load_ms = first(LOAD_S, friction + 0.8 * LOAD_NM);
    // A shaft that stands at once gave all of its momentum away.
    let blocked_ms = first(BLOCKED_S, friction + LOAD_NM - 1.0);
    console::line(format_args!("load         {LOAD_NM} Nm: 80 % of it after {load_ms:.0} ms"));
    console::line(format_args!("blocked      1 Nm more after {blocked_ms:.0} ms"));
    if observed < 0.5 * raw && load_ms <= 20.0 && blocked_ms <= 20.0 {
        Ok(())
    } else {
        Err("more noise than half of the feedback's, or a load that was told late".into())
    }
}

fn plot(path: &str, samples: &[Sample]) -> Result<(), Box<dyn Error>> {
    let charts: [picture::Chart<'_, Sample>; 2] = [
        (
            "speed (grey: feedback, blue: observer)",
            "rad/s",
            8.0,
            11.0,
            &[(GREY, |sample| sample.measured), (BLUE, |sample| sample.observed)],
        ),
        (
            "torque (grey: of the motor, red: load that the observer tells)",
            "Nm",
            -6.0,
            6.0,
            &[(GREY, |sample| sample.torque_nm), (RED, |sample| sample.load_nm)],
        ),
    ];
    // Before, it speeds up.
    let steady = samples.iter().position(|sample| sample.time_s >= 0.4).unwrap_or(0);
    picture::draw(path, samples.get(steady..).unwrap_or(&[]), |sample| sample.time_s, &charts)
}
