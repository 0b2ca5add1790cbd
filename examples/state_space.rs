//! A pendulum that stands on a cart: a regulator and a Kalman filter hold it, push it back and move it by a metre.
//!
//! ```text
//! cargo run --release --example state_space [FILE.svg]
//! ```
//!
//! The plant is the nonlinear one, in steps of 0.1 ms; the controller knows its linear model, sees two noisy measurements (the place of
//! the cart and the angle of the pendulum) at 200 Hz, and limits its force. Prints the largest angle and the error at the end; fails if the
//! pendulum leans by more than 0.35 rad or the cart is not within 2 cm of its target at the end.

mod output;
mod picture;

use drivetrain::control::state_space::{
    KalmanFilter, LinearQuadraticRegulator, LinearSystem, bryson, diagonal,
};
use output::console;
use picture::{BLUE, GREY, RED};
use std::error::Error;

/// kg, kg, m, m/s².
const CART: f32 = 2.0;
const PENDULUM: f32 = 0.5;
const LENGTH: f32 = 0.6;
const GRAVITY: f32 = 9.81;
/// N.
const LIMIT: f32 = 30.0;
const DT_S: f32 = 0.005;
const PARTS: u16 = 50;
const STEPS: u16 = 1_600;
/// At 3 s, in N over 0.1 s; at 5 s the target moves, in m.
const PUSH: (u16, u16, f32) = (600, 620, 20.0);
const MOVE: (u16, f32) = (1_000, 1.0);
/// Deviations of the measurements: m, rad.
const NOISE: [f32; 2] = [0.002, 0.003];

struct Sample {
    time_s: f32,
    target: f32,
    truth: [f32; 4],
    estimate: [f32; 4],
    force: f32,
}

/// About uniform within ±√3, which has a deviation of 1: xorshift.
struct Noise(u32);

impl Noise {
    fn next(&mut self) -> f32 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 17;
        self.0 ^= self.0 << 5;
        3.0_f32.sqrt() * (self.0 as f32 / (u32::MAX / 2) as f32 - 1.0)
    }
}

/// Place, angle (0 stands), speed and rate after a part of a step.
fn moved([place, angle, speed, rate]: [f32; 4], force: f32, dt_s: f32) -> [f32; 4] {
    let (sin, cos) = angle.sin_cos();
    let mass = CART + PENDULUM * sin * sin;
    let acceleration = (force + PENDULUM * sin * (LENGTH * rate * rate - GRAVITY * cos)) / mass;
    let turning = (GRAVITY * sin - acceleration * cos) / LENGTH;
    let (speed, rate) = (speed + acceleration * dt_s, rate + turning * dt_s);
    [place + speed * dt_s, angle + rate * dt_s, speed, rate]
}

fn main() -> Result<(), Box<dyn Error>> {
    let path = output::path("state_space");
    let samples = drive()?;
    plot(&path, &samples)?;
    judge(&samples)?;
    console::line(format_args!("{path}"));
    Ok(())
}

fn drive() -> Result<Vec<Sample>, Box<dyn Error>> {
    // The plant above, at a small angle.
    let a = [
        [0.0, 0.0, 1.0, 0.0],
        [0.0, 0.0, 0.0, 1.0],
        [0.0, -PENDULUM * GRAVITY / CART, 0.0, 0.0],
        [0.0, (CART + PENDULUM) * GRAVITY / (CART * LENGTH), 0.0, 0.0],
    ];
    let b = [[0.0], [0.0], [1.0 / CART], [-1.0 / (CART * LENGTH)]];
    let plant = LinearSystem::discretized(&a, &b, DT_S)?;
    let mut regulator =
        LinearQuadraticRegulator::new(&plant, &bryson(&[0.2, 0.1, 1.0, 1.0]), &bryson(&[LIMIT]))?
            .with_output_limit(&[LIMIT])?;
    let c = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0]];
    let disturbance = diagonal(&[1e-8, 1e-8, 1e-3, 1e-3]);
    let of_output = diagonal(&NOISE.map(|deviation| deviation * deviation));
    let mut filter = KalmanFilter::new(&plant, &c, &disturbance, &of_output)?;

    let (mut truth, mut noise) = ([0.0, 0.1, 0.0, 0.0], Noise(28));
    let mut samples = Vec::new();
    for step in 0..STEPS {
        filter.correct(&[truth[0] + NOISE[0] * noise.next(), truth[1] + NOISE[1] * noise.next()]);
        let target = if step < MOVE.0 { 0.0 } else { MOVE.1 };
        let estimate = filter.state();
        let [force] = regulator.step(&[target, 0.0, 0.0, 0.0], &estimate);
        let time_s = f32::from(step) * DT_S;
        samples.push(Sample { time_s, target, truth, estimate, force });
        filter.predict(&[force]);
        let push = if (PUSH.0..PUSH.1).contains(&step) { PUSH.2 } else { 0.0 };
        for _ in 0..PARTS {
            truth = moved(truth, force + push, DT_S / f32::from(PARTS));
        }
    }
    Ok(samples)
}

fn judge(samples: &[Sample]) -> Result<(), Box<dyn Error>> {
    let lean = samples.iter().map(|sample| sample.truth[1].abs()).fold(0.0, f32::max);
    let last = samples.last().ok_or("no sample")?;
    let error = last.truth[0] - last.target;
    let off: f32 = samples.iter().map(|it| (it.estimate[3] - it.truth[3]).powi(2)).sum();
    let off = (off / samples.len() as f32).sqrt();
    console::line(format_args!("pendulum     leans by at most {lean:.3} rad"));
    console::line(format_args!("cart         {:.1} mm from its target at the end", 1e3 * error));
    console::line(format_args!("rate         estimated within {off:.3} rad/s, not measured"));
    if lean < 0.35 && error.abs() < 0.02 {
        Ok(())
    } else {
        Err("the pendulum leans too far, or the cart is not at its target".into())
    }
}

fn plot(path: &str, samples: &[Sample]) -> Result<(), Box<dyn Error>> {
    let charts: [picture::Chart<'_, Sample>; 3] = [
        (
            "cart (grey: target, blue: truth)",
            "m",
            -0.5,
            1.5,
            &[(GREY, |it| it.target), (BLUE, |it| it.truth[0])],
        ),
        (
            "rate of the pendulum (grey: truth, red: estimate)",
            "rad/s",
            -2.0,
            2.0,
            &[(GREY, |it| it.truth[3]), (RED, |it| it.estimate[3])],
        ),
        ("force", "N", -LIMIT, LIMIT, &[(BLUE, |it| it.force)]),
    ];
    picture::draw(path, samples, |sample| sample.time_s, &charts)
}
