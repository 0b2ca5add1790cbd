//! Gains and filters of `control::state_space`, for `judges/state_space.py`.
//!
//! ```text
//! drivetrain-judges state-space design N M          f32 of a system in: a, b, c, q, r, the covariances of noise, the time step;
//!                                                   out: A and B of the discrete plant; of the arguments as a discrete plant: gain of
//!                                                   the regulator and gain of the observer in the steady state; gain of the regulator
//!                                                   of the discrete plant; effort of the plant inversion from zero to a state of ones.
//!                                                   NaN in place of each that is refused
//! drivetrain-judges state-space filter N M STEPS    A, B, C, the covariances of noise and of the start, the time step in, zero of a discrete plant, then
//!                                                   STEPS times inputs and measurements; out: as often the states of the filter and of
//!                                                   the observer
//! ```
//! `N` states, 1 to 6; `M` inputs and as many measurements, 1 or 2. Matrices are written by rows.

use crate::defect::{defects, factor};
use crate::{Outcome, floats};
use drivetrain::control::state_space::{
    KalmanFilter, LinearQuadraticRegulator, LinearSystem, LuenbergerObserver,
};
use std::io::{Read, Write};

defects! {
    /// An input for half of the step only.
    Hold = "hold",
    /// Effort costs more by 1 in 1000.
    Cost = "cost",
    /// The measurements have more noise by 1 in 1000.
    Noise = "noise",
    /// The covariance of the start is larger by 1 in 100.
    Start = "start",
}

pub fn run(arguments: &[&str], mut input: impl Read, output: &mut impl Write) -> Outcome<()> {
    let (arguments, defect) = Defect::split(arguments)?;
    let [verb, states, inputs, rest @ ..] = arguments else {
        return Err("see the head of judges/src/state_space.rs for the arguments".into());
    };
    let steps = match (*verb, rest) {
        ("design", []) => None,
        ("filter", [steps]) => Some(steps.parse()?),
        _ => return Err("see the head of judges/src/state_space.rs for the arguments".into()),
    };
    macro_rules! of_sizes {
        ($(($n:literal, $m:literal)),*) => {
            match (states.parse()?, inputs.parse()?) {
                $(($n, $m) => of_size::<$n, $m>(steps, defect, &mut input, output),)*
                (n, m) => Err(format!("no systems of {n} states and {m} inputs").into()),
            }
        };
    }
    of_sizes!(
        (1, 1),
        (2, 1),
        (3, 1),
        (4, 1),
        (5, 1),
        (6, 1),
        (1, 2),
        (2, 2),
        (3, 2),
        (4, 2),
        (5, 2),
        (6, 2)
    )
}

fn of_size<const N: usize, const M: usize>(
    steps: Option<u32>,
    defect: Defect,
    input: &mut impl Read,
    output: &mut impl Write,
) -> Outcome<()> {
    // The first number of a system, or the end.
    while let Some([first]) = floats::next(input)? {
        match steps {
            None => design::<N, M>(first, defect, input, output)?,
            Some(steps) => filter::<N, M>(first, steps, defect, input, output)?,
        }
    }
    Ok(())
}

fn design<const N: usize, const M: usize>(
    first: f32,
    defect: Defect,
    input: &mut impl Read,
    output: &mut impl Write,
) -> Outcome<()> {
    let (a, b, c, q, mut r) = system::<N, M>(first, input)?;
    let (noise, mut of_output) = (matrix::<N, N>(None, input)?, matrix::<M, M>(None, input)?);
    let dt_s = number(input)?;
    scale(&mut r, factor(defect, Defect::Cost, 1.001));
    scale(&mut of_output, factor(defect, Defect::Noise, 1.001));

    let plant = LinearSystem::discretized(&a, &b, dt_s).ok();
    let mut of_input = plant.map_or([[f32::NAN; M]; N], |plant| *plant.b());
    scale(&mut of_input, factor(defect, Defect::Hold, 0.5));
    write(&plant.map_or([[f32::NAN; N]; N], |plant| *plant.a()), output)?;
    write(&of_input, output)?;

    let same = LinearSystem::discrete(&a, &b)?;
    let gain = |plant| Some(*LinearQuadraticRegulator::new(plant, &q, &r).ok()?.gain());
    write(&gain(&same).unwrap_or([[f32::NAN; N]; M]), output)?;
    let observer = LuenbergerObserver::steady_state(&same, &c, &noise, &of_output).ok();
    write(&observer.map_or([[f32::NAN; M]; N], |observer| observer.gain()), output)?;
    write(&plant.as_ref().and_then(gain).unwrap_or([[f32::NAN; N]; M]), output)?;
    let inverse = same.input_inverse().ok();
    write(&[inverse.map_or([f32::NAN; M], |it| same.effort(&it, &[0.0; N], &[1.0; N]))], output)
}

fn filter<const N: usize, const M: usize>(
    first: f32,
    steps: u32,
    defect: Defect,
    input: &mut impl Read,
    output: &mut impl Write,
) -> Outcome<()> {
    let (a, b, c, q, mut r) = system::<N, M>(first, input)?;
    let mut start = matrix::<N, N>(None, input)?;
    scale(&mut r, factor(defect, Defect::Noise, 1.001));
    scale(&mut start, factor(defect, Defect::Start, 1.01));
    let dt_s = number(input)?;
    let plant = if dt_s > 0.0 {
        LinearSystem::discretized(&a, &b, dt_s)?
    } else {
        LinearSystem::discrete(&a, &b)?
    };
    let mut filter = KalmanFilter::new(&plant, &c, &q, &r)?.with_start(&[0.0; N], &start)?;
    let mut observer = LuenbergerObserver::steady_state(&plant, &c, &q, &r)?;
    for _ in 0..steps {
        let [u] = matrix::<1, M>(None, input)?;
        let [y] = matrix::<1, M>(None, input)?;
        filter.predict(&u);
        filter.correct(&y);
        observer.predict(&u);
        observer.correct(&y);
        write(&[filter.state(), observer.state()], output)?;
    }
    if filter.rejected() > 0 || observer.rejected() > 0 {
        return Err("a step was refused".into());
    }
    Ok(())
}

fn scale<const R: usize, const C: usize>(matrix: &mut [[f32; C]; R], factor: f32) {
    matrix.iter_mut().flatten().for_each(|entry| *entry *= factor);
}

fn matrix<const R: usize, const C: usize>(
    mut first: Option<f32>,
    input: &mut impl Read,
) -> Outcome<[[f32; C]; R]> {
    let mut matrix = [[0.0; C]; R];
    for entry in matrix.iter_mut().flatten() {
        *entry = match first.take() {
            Some(first) => first,
            None => number(input)?,
        };
    }
    Ok(matrix)
}

fn number(input: &mut impl Read) -> Outcome<f32> {
    let [number] = floats::read(input)?;
    Ok(number)
}

fn write<const R: usize, const C: usize>(
    matrix: &[[f32; C]; R],
    output: &mut impl Write,
) -> Outcome<()> {
    floats::write(matrix.iter().flatten().copied(), output)
}

/// A, B, C and two costs or covariances of a system.
type System<const N: usize, const M: usize> =
    ([[f32; N]; N], [[f32; M]; N], [[f32; N]; M], [[f32; N]; N], [[f32; M]; M]);

fn system<const N: usize, const M: usize>(
    first: f32,
    input: &mut impl Read,
) -> Outcome<System<N, M>> {
    Ok((
        matrix(Some(first), input)?,
        matrix(None, input)?,
        matrix(None, input)?,
        matrix(None, input)?,
        matrix(None, input)?,
    ))
}
