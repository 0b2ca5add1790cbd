//! The rows of state space: four states, two inputs, two measurements.

use crate::meter::{CALLS, instructions};
use crate::report::row;
use core::hint::black_box;
use drivetrain::control::state_space::{
    KalmanFilter, LinearQuadraticRegulator, LinearSystem, LuenbergerObserver, bryson, diagonal,
};

type Regulator = LinearQuadraticRegulator<4, 2>;
type Filter = KalmanFilter<4, 2, 2>;
type Observer = LuenbergerObserver<4, 2, 2>;

#[unsafe(no_mangle)]
#[inline(never)]
fn control_lqr(regulator: &mut Regulator, reference: &[f32; 4], state: &[f32; 4]) -> [f32; 2] {
    regulator.step(reference, state)
}

#[unsafe(no_mangle)]
#[inline(never)]
fn control_kalman(filter: &mut Filter, input: &[f32; 2], measured: &[f32; 2]) {
    filter.predict(input);
    filter.correct(measured);
}

#[unsafe(no_mangle)]
#[inline(never)]
fn control_luenberger(observer: &mut Observer, input: &[f32; 2], measured: &[f32; 2]) {
    observer.predict(input);
    observer.correct(measured);
}

/// A pendulum with a flywheel on a cart: m, rad, m/s, rad/s; inputs are a force in N and a torque in Nm.
const A: [[f32; 4]; 4] =
    [[0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0], [0.0, -2.45, -0.1, 0.0], [0.0, 20.4, 0.0, -0.1]];
const B: [[f32; 2]; 4] = [[0.0, 0.0], [0.0, 0.0], [0.5, 0.2], [-0.83, 1.5]];
const C: [[f32; 4]; 2] = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0]];
const LARGEST: [f32; 4] = [0.2, 0.1, 1.0, 1.0];
const EFFORT: [f32; 2] = [30.0, 3.0];
const DT_S: f32 = 0.001;

pub fn rows() {
    let plant = LinearSystem::discretized(&black_box(A), &B, DT_S).unwrap();
    let mut regulator =
        LinearQuadraticRegulator::new(&plant, &bryson(&LARGEST), &bryson(&EFFORT)).unwrap();
    let state = |call: u32| black_box([0.1, 0.02, 0.0, call as f32 / CALLS as f32]);
    let reference = black_box([0.0; 4]);
    let each = |step: fn(&mut Regulator, &[f32; 4], &[f32; 4]) -> [f32; 2], call| {
        _ = black_box(step(&mut regulator, &reference, &state(call)));
    };
    row("lqr_4x2", &[instructions(control_lqr as _, each)]);

    let disturbance = diagonal(&[1e-8, 1e-8, 1e-3, 1e-3]);
    let of_output = diagonal(&[4e-6, 9e-6]);
    let input = black_box([1.0, 0.1]);
    let measured = |call: u32| black_box([0.1 * call as f32 / CALLS as f32, 0.02]);
    let mut filter = KalmanFilter::new(&plant, &C, &disturbance, &of_output).unwrap();
    let each = |step: fn(&mut Filter, &[f32; 2], &[f32; 2]), call| {
        step(&mut filter, &input, &measured(call));
    };
    row("kalman_4x2", &[instructions(control_kalman as _, each)]);

    let mut observer =
        LuenbergerObserver::steady_state(&plant, &C, &disturbance, &of_output).unwrap();
    let each = |step: fn(&mut Observer, &[f32; 2], &[f32; 2]), call| {
        step(&mut observer, &input, &measured(call));
    };
    row("luenberger_4x2", &[instructions(control_luenberger as _, each)]);
}
