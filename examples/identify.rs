//! Friction, resistance, inertia and delay of a motor that is known by nothing but its limits, and a speed loop from these by
//! bandwidth and phase margin; on the simulator.
//!
//! ```text
//! cargo run --release --example identify [FILE.svg]
//! ```
//!
//! Prints the plant beside the facts of the simulator, and the gains as a line of Rust; plots the first second of the run, and a
//! step with guessed gains and with these. Fails when inertia or friction is off by 5 %, or the step is not the better one.
//! On a real robot, lift the wheels off the ground first, and choose limits that the mechanism can take.

mod output;
mod picture;

use drivetrain::control::{Excitation, Identification, PidConfig, Plant};
use drivetrain::dji::{Bus, Config, Handle, M3508};
use drivetrain::runner::{Nb, Runner};
use drivetrain::sim::{MotorConfig, Simulation};
use drivetrain::time::Duration;
use drivetrain::units::{Angle, AngularVelocity, Current};
use output::console;
use picture::{BLUE, GREY, RED};
use std::error::Error;

type Outcome<T> = Result<T, Box<dyn Error>>;

/// Limits of the run: A, rad/s and rad.
const EFFORT: f32 = 10.0;
const SPEED: f32 = 30.0;
const WAY: f32 = 100.0;
/// Of the load, beside 0.008 kg m² and 0.12 Nm of the motor.
const LOAD_KG_M2: f32 = 0.02;
const LOAD_NM: f32 = 0.3;
/// Nm at the output shaft for 1 A.
const TORQUE_CONSTANT: f32 = 0.3;
const GUESSED: PidConfig = PidConfig::new(0.3, 3.0, 0.0).with_output_limit(EFFORT);
const TARGET: f32 = 15.0;

#[derive(Debug, Default, Clone, Copy)]
struct Sample {
    time_s: f32,
    speed: f32,
    effort: f32,
    guessed: f32,
    tuned: f32,
}

fn main() -> Outcome<()> {
    let path = output::path("identify");
    let mut excitation = Excitation::new(EFFORT, SPEED, WAY)?;
    let mut identification = Identification::new(20.0, 0.2)?;
    let mut samples = Vec::new();
    run(GUESSED, 11_000, |bus, motor, speed, dt_s| {
        let effort = excitation.update(speed, dt_s);
        if !excitation.is_complete() {
            identification.sample(effort, speed, dt_s);
            let time_s = samples.last().map_or(0.0, |sample: &Sample| sample.time_s + dt_s);
            samples.push(Sample { time_s, speed, effort, ..Sample::default() });
        }
        _ = bus.set_current(motor, Current::from_amperes(effort));
    })?;
    if let Some(failure) = excitation.failure() {
        return Err(failure.into());
    }
    let plant = identification.result()?;
    report(&plant);

    let margin = Angle::from_degrees(60.0);
    let bandwidth = plant.bandwidth(margin)?;
    let tuned = plant.speed_loop(bandwidth, margin)?.with_output_limit(EFFORT);
    let (kp, ki, _) = tuned.gains();
    console::line(format_args!("60 degrees at {bandwidth:.0} rad/s:"));
    console::line(format_args!(
        "PidConfig::new({kp:.3}, {ki:.3}, 0.0).with_feed_forward({:.3}, {:.4}).with_output_limit({EFFORT:.1})",
        plant.ks, plant.kv,
    ));
    let (guessed, tuned) = (step(GUESSED)?, step(tuned)?);
    for ((sample, guessed), tuned) in samples.iter_mut().zip(&guessed).zip(&tuned) {
        (sample.guessed, sample.tuned) = (*guessed, *tuned);
    }
    let (guessed, tuned) = (itae(&guessed), itae(&tuned));
    console::line(format_args!(
        "step to {TARGET} rad/s: time and absolute error {guessed:.3} rad s guessed, {tuned:.3} identified"
    ));
    samples.truncate(1_000);
    plot(&path, &samples)?;
    console::line(format_args!("plot: {path}"));
    let is_near = |found: f32, real: f32| (found / real - 1.0).abs() < 0.05;
    let has_inertia = is_near(plant.inertia_kg_m2(TORQUE_CONSTANT), 0.008 + LOAD_KG_M2);
    let has_friction = is_near(plant.friction_nm(TORQUE_CONSTANT), 0.12 + LOAD_NM);
    if has_inertia && has_friction && tuned < guessed {
        Ok(())
    } else {
        Err("inertia or friction is off by 5 %, or the guessed gains are better".into())
    }
}

/// Runs the motor for some ticks; `work` gets its handle, its measured speed and the time step.
fn run(
    speed: PidConfig,
    ticks: u32,
    mut work: impl FnMut(&mut Bus, Handle<M3508>, f32, f32),
) -> Outcome<()> {
    let world = Simulation::new(1);
    let config = MotorConfig::m3508(1).with_load_inertia_kg_m2(LOAD_KG_M2);
    world.attach(config.with_load_friction_nm(LOAD_NM).with_speed_noise_rpm(10.0))?;
    let mut bus = Bus::new();
    // An output that opens after arming is not the recorded effort.
    let motor =
        bus.attach(Config::<M3508>::new(1).with_opening(Duration::ZERO).speed_loop(speed))?;
    let mut runner = Runner::new(Nb(world.controller()), world.clock(), bus);
    let (mut armed, mut done) = (false, 0);
    while done < ticks {
        world.advance(Duration::from_micros(100));
        runner.poll(16);
        let Some(tick) = runner.due() else { continue };
        // This motor arms by itself, which only a simulated one may.
        armed = armed || runner.arm(tick).is_ok();
        let speed = runner.device().state(motor).map(|state| state.velocity.as_rad_per_s());
        if let (true, Some(speed)) = (armed, speed) {
            work(runner.device_mut(), motor, speed, tick.dt_s());
        }
        runner.tick(tick);
        done += 1;
    }
    Ok(())
}

/// The speeds of a step from rest.
fn step(speed: PidConfig) -> Outcome<Vec<f32>> {
    let mut speeds = Vec::new();
    run(speed, 1_200, |bus, motor, speed, _| {
        _ = bus.set_velocity(motor, AngularVelocity::from_rad_per_s(TARGET));
        speeds.push(speed);
    })?;
    speeds.truncate(1_000);
    Ok(speeds)
}

/// The integral of time and absolute error, at 1 kHz.
fn itae(speeds: &[f32]) -> f32 {
    let mut time_s = 0.0;
    let of = |speed: &f32| {
        time_s += 0.001;
        time_s * (TARGET - speed).abs() * 0.001
    };
    speeds.iter().map(of).sum()
}

fn report(plant: &Plant) {
    console::line(format_args!(
        "kS {:.3} ± {:.3} A, kV {:.4} ± {:.4} A s/rad, kA {:.5} ± {:.5} A s²/rad, delay {:.2} ms, noise {:.2} rad/s",
        plant.ks,
        plant.ks_deviation,
        plant.kv,
        plant.kv_deviation,
        plant.ka,
        plant.ka_deviation,
        1e3 * plant.delay_s,
        plant.noise,
    ));
    console::line(format_args!(
        "inertia {:.4} kg m² of {:.4}, dry friction {:.3} Nm of {:.3}",
        plant.inertia_kg_m2(TORQUE_CONSTANT),
        0.008 + LOAD_KG_M2,
        plant.friction_nm(TORQUE_CONSTANT),
        0.12 + LOAD_NM,
    ));
}

fn plot(path: &str, samples: &[Sample]) -> Outcome<()> {
    let charts: [picture::Chart<'_, Sample>; 2] = [
        (
            "the run (blue: speed, red: effort)",
            "rad/s, A",
            -SPEED,
            SPEED,
            &[(RED, |sample| sample.effort), (BLUE, |sample| sample.speed)],
        ),
        (
            "a step of the speed (grey: target, red: guessed gains, blue: identified)",
            "rad/s",
            0.0,
            1.6 * TARGET,
            &[(GREY, |_| TARGET), (RED, |sample| sample.guessed), (BLUE, |sample| sample.tuned)],
        ),
    ];
    picture::draw(path, samples, |sample| sample.time_s, &charts)
}
