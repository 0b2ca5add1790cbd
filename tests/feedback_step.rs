//! The step of a speed loop: that of the tick, or the time between two feedback frames, which arrive with a jitter of 0.2 ms.
//!
//! The figures stand in DESIGN, with what follows from them. A program that wants the second way does it as this test does.

#![cfg(test)]

use drivetrain::control::{Pid, PidConfig};
use drivetrain::dji::{Bus, Config, M3508};
use drivetrain::runner::{Nb, Runner};
use drivetrain::sim::{MotorConfig, Simulation};
use drivetrain::time::TimeStep;
use drivetrain::time::{Duration, Instant};
use drivetrain::units::Current;

/// Ripple of the true speed in rad/s and of the current in A, about their means over 8 ms.
#[derive(Debug, Clone, Copy)]
struct Ripple {
    speed: f32,
    current: f32,
}

fn deviation(values: &[f32]) -> f32 {
    let windows = values.chunks_exact(8);
    let count = windows.len() as f32 * 8.0;
    let squares = windows.map(|window| {
        let mean = window.iter().sum::<f32>() / 8.0;
        window.iter().map(|value| (value - mean).powi(2)).sum::<f32>()
    });
    (squares.sum::<f32>() / count).sqrt()
}

fn ripple(gains: PidConfig, by_stamp: bool, seed: u64) -> Ripple {
    let world = Simulation::new(seed);
    let jitter = Duration::from_micros(200);
    let key = world.attach(MotorConfig::m3508(1).with_feedback_jitter(jitter)).unwrap();
    let mut bus = Bus::new();
    let motor = bus.attach(Config::<M3508>::new(1)).unwrap();
    let mut runner = Runner::new(Nb(world.controller()), world.clock(), bus);
    let mut pid = Pid::new(gains.with_output_limit(20.0)).unwrap();
    let (mut stamp, mut before) = (Instant::START, Instant::START);
    let (mut received, mut was_armed) = (0, false);
    let (mut speeds, mut currents) = (Vec::new(), Vec::new());
    for ms in 0..4_000 {
        let tick = loop {
            // The interrupt: a stamp is exact to 10 µs.
            for _ in 0..10 {
                world.advance(Duration::from_micros(10));
                runner.poll(16);
                let frames = runner.statistics().received;
                if frames != received {
                    (received, stamp) = (frames, world.now());
                }
            }
            if let Some(tick) = runner.due() {
                break tick;
            }
        };
        was_armed = was_armed || runner.arm(tick).is_ok();
        let measured =
            runner.device().state(motor).map_or(0.0, |state| state.velocity.as_rad_per_s());
        let dt_s = if by_stamp { stamp.since(before).as_secs_f32() } else { tick.dt_s() };
        before = stamp;
        // It swings, so that the integral has something to do.
        let target = 10.0 + 2.0 * (ms as f32 * 0.02).sin();
        let output = pid.step(target, measured, &TimeStep::of(dt_s));
        _ = runner.device_mut().set_current(motor, Current::from_amperes(output));
        runner.tick(tick);
        if ms >= 1_000 {
            let truth = world.motor(key).unwrap();
            speeds.push(truth.velocity.as_rad_per_s() - target);
            currents.push(output);
        }
    }
    Ripple { speed: deviation(&speeds), current: deviation(&currents) }
}

/// The mean over some phases of tick and feedback.
fn mean(gains: PidConfig, by_stamp: bool) -> Ripple {
    let all: Vec<Ripple> = (1..=6).map(|seed| ripple(gains, by_stamp, seed)).collect();
    let mean = |value: fn(&Ripple) -> f32| all.iter().map(value).sum::<f32>() / all.len() as f32;
    Ripple { speed: mean(|ripple| ripple.speed), current: mean(|ripple| ripple.current) }
}

#[test]
fn a_step_from_the_stamps_makes_a_derivative_quieter_and_nothing_else() {
    let both = |gains| (mean(gains, false), mean(gains, true));
    let share = |(tick, stamp): (Ripple, Ripple)| {
        println!("step of the tick {tick:.4?}, of the stamps {stamp:.4?}");
        (stamp.speed / tick.speed, stamp.current / tick.current)
    };
    for gains in [PidConfig::new(0.6, 6.0, 0.0), PidConfig::new(2.0, 40.0, 0.0)] {
        let (speed, current) = share(both(gains));
        assert!((speed - 1.0).abs() < 0.01 && (current - 1.0).abs() < 0.01, "{speed} {current}");
    }
    let (speed, current) = share(both(PidConfig::new(0.6, 6.0, 0.005)));
    assert!((speed - 1.0).abs() < 0.01, "{speed}");
    assert!((0.7..0.9).contains(&current), "{current}");
}
