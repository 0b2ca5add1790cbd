//! State space: regulators, observers and filters for plants of several states, with matrices as arrays.
//!
//! ```text
//!              +-- LinearSystem::effort of the reference ------+
//!              |                                               v
//! reference ---+--> LinearQuadraticRegulator: K (r - x) -----> + ---> u ---> plant ---> y
//!                        ^                                         |                   |
//!                        |  x                                      v                   v
//!                        +-------- KalmanFilter or LuenbergerObserver: predict(u), correct(y)
//! ```
//! | type | does | reference of the same in wpimath, python-control |
//! |---|---|---|
//! | [`LinearSystem`] | a plant in steps, from `x' = a x + b u` by zero-order hold | `DiscretizeAB`, `c2d` |
//! | [`LinearQuadraticRegulator`] | states to a reference, by a gain of least cost | `LinearQuadraticRegulator`, `dlqr` |
//! | [`scheduled_gain`] | gains over a parameter | |
//! | [`LinearSystem::effort`] | inputs of a reference that moves | `LinearPlantInversionFeedforward` |
//! | [`KalmanFilter`] | states from noisy measurements, with their covariance | `KalmanFilter` |
//! | [`LuenbergerObserver`] | the same with a constant gain: placed, or of the filter in its steady state | `dlqe` |
//!
//! A matrix is an array of its rows: `[[f32; columns]; rows]`. `N` states, `M` inputs and `P` measurements are parameters of the types, so
//! matrices that do not fit together do not compile.
//!
//! # Precision
//! Riccati equations and exponentials at start, and the observers in the loop, are calculated in twice the precision of `f32` (48 bits)
//! and without `f64`, which small cores lack; regulator, inversion and schedule are `f32`. `judges/README.md` has the measured differences to
//! python-control, slycot and wpimath, over random systems of 1 to 6 states.
//!
//! Admitted conditioning: a solution of the Riccati equation with a condition number of up to 10^8, in units in which the states are of like
//! size. Beyond it the gain loses digits, or is refused.
//!
//! # Cost
//! Constructors that solve an equation are for the start, not for the loop: a gain takes up to 32 doublings and three steps of Newton.
//!
//! # Examples
//! A motor with inertia 0.01 kg m², damping 0.02 Nm s and a torque up to 3 Nm turns an arm; the angle is measured, its rate is not:
//! ```
//! use drivetrain::control::state_space::{
//!     KalmanFilter, LinearQuadraticRegulator, LinearSystem, bryson, diagonal,
//! };
//!
//! let arm = LinearSystem::discretized(&[[0.0, 1.0], [0.0, -2.0]], &[[0.0], [100.0]], 0.001)?;
//! let mut regulator = LinearQuadraticRegulator::new(&arm, &bryson(&[0.05, 2.0]), &bryson(&[3.0]))?
//!     .with_output_limit(&[3.0])?;
//! let mut filter = KalmanFilter::new(&arm, &[[1.0, 0.0]], &diagonal(&[0.0, 1e-4]), &diagonal(&[1e-6]))?;
//!
//! let mut truth = [0.0, 0.0]; // rad, rad/s
//! for _ in 0..500 {
//!     let torque_nm = regulator.step(&[1.0, 0.0], &filter.state());
//!     truth = arm.predict(&truth, &torque_nm);
//!     filter.predict(&torque_nm);
//!     filter.correct(&[truth[0]]);
//! }
//! assert!((truth[0] - 1.0).abs() < 1e-3 && truth[1].abs() < 1e-2);
//! # Ok::<(), drivetrain::error::ConfigError>(())
//! ```
//! Reference: G. F. Franklin, J. D. Powell, M. Workman, Digital Control of Dynamic Systems, 3rd edition, chapters 8 and 9.

mod observer;
mod regulator;
mod riccati;
#[cfg(test)]
#[expect(clippy::float_cmp, reason = "exact results are the rule under test")]
mod tests;

pub use observer::{KalmanFilter, LuenbergerObserver};
pub(crate) use regulator::GainSchedule;
pub use regulator::{LinearQuadraticRegulator, scheduled_gain};

use crate::control::matrix::{
    Grid, Number, finite, identity, narrow, row_sum, stepped, sum, times, wide, with_diagonal,
};
use crate::control::number::Wide;
use crate::error;
use crate::error::ConfigError;

/// A linear plant of `N` states and `M` inputs, in steps of constant duration: `x[k + 1] = A x[k] + B u[k]`.
///
/// `A` and `B` are arrays of rows. States and inputs have the units of the caller: `A[i][j]` has the unit of state `i` over the unit
/// of state `j`, `B[i][j]` the unit of state `i` over the unit of input `j`.
///
/// At 1 kHz a slow pole is 0.9999: rounded to `f32`, its rate changes by 6e-4. A plant that is made from continuous matrices therefore
/// keeps `A` in twice the precision too, for gains and observers.
///
/// # Examples
/// A mass of 2 kg that a force pushes: position in m, velocity in m/s, force in N, 10 ms.
/// ```
/// use drivetrain::control::state_space::LinearSystem;
///
/// let mass = LinearSystem::discretized(&[[0.0, 1.0], [0.0, 0.0]], &[[0.0], [0.5]], 0.01)?;
/// assert_eq!(mass.a(), &[[1.0, 0.01], [0.0, 1.0]]);
/// assert_eq!(mass.b(), &[[0.000_025], [0.005]]); // t² / 2m, t / m
/// assert_eq!(mass.predict(&[1.0, 2.0], &[4.0]), [1.0201, 2.02]);
/// # Ok::<(), drivetrain::error::ConfigError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct LinearSystem<const N: usize, const M: usize> {
    a: [[f32; N]; N],
    b: [[f32; M]; N],
    /// `a` before it is rounded.
    exact_a: Grid<Wide, N, N>,
}

impl<const N: usize, const M: usize> LinearSystem<N, M> {
    /// Takes the matrices of a plant that is discrete already.
    ///
    /// # Errors
    /// Names `a` or `b` when an entry is NaN or infinite.
    pub fn discrete(a: &[[f32; N]; N], b: &[[f32; M]; N]) -> Result<Self, ConfigError> {
        finite("a", a)?;
        finite("b", b)?;
        Ok(Self { a: *a, b: *b, exact_a: wide(a) })
    }

    /// Makes `x' = a x + b u` discrete, with an input that stays constant for the time step `dt_s` in seconds (zero-order hold).
    ///
    /// ```text
    /// A = exp(a dt)      B = ∫ exp(a t) dt b, from 0 to dt
    /// ```
    /// Calculated in twice the precision of `f32`, by 16 terms of the series over a part of the step and by doubling that part.
    ///
    /// # Errors
    /// Names `a`, `b` or `dt_s` when an entry is NaN or infinite, or the time step is not above zero. [`ConfigError::OutOfRange`]
    /// with `dt_s`: a mode of the plant grows beyond `f32` within one step.
    pub fn discretized(
        a: &[[f32; N]; N],
        b: &[[f32; M]; N],
        dt_s: f32,
    ) -> Result<Self, ConfigError> {
        finite("a", a)?;
        finite("b", b)?;
        error::positive("dt_s", dt_s)?;
        let step = exponential(a, dt_s).and_then(|(change, integral)| {
            let exact = with_diagonal(change, Wide::ONE);
            let b = narrow(&times(&integral, &wide(b)))?;
            Some(Self { a: narrow(&exact)?, b, exact_a: exact })
        });
        step.ok_or(ConfigError::OutOfRange("dt_s"))
    }

    /// Returns the matrix of the states, a row for each next state.
    #[must_use]
    pub const fn a(&self) -> &[[f32; N]; N] {
        &self.a
    }

    /// Returns the matrix of the inputs, a row for each next state.
    #[must_use]
    pub const fn b(&self) -> &[[f32; M]; N] {
        &self.b
    }

    /// Returns the matrix of the states before it is rounded.
    const fn exact_a(&self) -> &Grid<Wide, N, N> {
        &self.exact_a
    }

    /// Returns the states after one time step, in the precision of the observers.
    fn predict_exactly(&self, x: &[Wide; N], u: &[f32; M]) -> [Wide; N] {
        stepped((&self.exact_a, x), (&wide(&self.b), &u.map(Wide::of)))
    }

    /// Returns the states after one time step with the input `u`. NaN and infinity in the arguments show in the result.
    #[must_use]
    #[inline]
    pub fn predict(&self, x: &[f32; N], u: &[f32; M]) -> [f32; N] {
        stepped((&self.a, x), (&self.b, u))
    }
}

/// Terms of the series: the rest is below 0.5^16 / 17!, 10^-19.
const TERMS: u16 = 16;
/// Halvings of a time step: enough for the largest product of entry and time step that `f32` has, of 6 states.
const HALVINGS: u32 = 264;

/// Returns `exp(a t) - 1` and `∫ exp(a t) dt`.
fn exponential<const N: usize>(
    a: &Grid<f32, N, N>,
    dt_s: f32,
) -> Option<(Grid<Wide, N, N>, Grid<Wide, N, N>)> {
    let mut part_s = dt_s;
    let mut halvings = 0;
    // Entries of up to 1e38 are halved beside the step, or their sum would be infinite.
    let size = |part_s: f32| row_sum(&a.map(|row| row.map(|entry| entry * part_s)));
    while size(part_s).is_nan() || size(part_s) > 0.5 {
        part_s *= 0.5;
        halvings += 1;
        if halvings > HALVINGS || part_s < f32::MIN_POSITIVE {
            return None;
        }
    }
    let x = a.map(|row| row.map(|entry| Wide::product(entry, part_s)));
    // 1 + x/2 (1 + x/3 (1 + ...)), which is the integral over the part.
    let mut series = identity();
    for term in (2..=TERMS).rev() {
        let share = Wide::reciprocal(f32::from(term));
        let next = times(&x, &series).map(|row| row.map(|entry| entry * share));
        series = with_diagonal(next, Wide::ONE);
    }
    let mut change = times(&x, &series);
    let mut integral = series.map(|row| row.map(|entry| entry * part_s));
    for _ in 0..halvings {
        integral = sum(&integral, &sum(&integral, &times(&change, &integral)));
        let twice = sum(&change, &change);
        change = sum(&twice, &times(&change, &change));
    }
    Some((change, integral))
}

/// Returns the matrix with these values on its diagonal: covariances of noises that are independent, from squared deviations.
///
/// # Examples
/// ```
/// use drivetrain::control::state_space::diagonal;
///
/// assert_eq!(diagonal(&[1.0, 4.0]), [[1.0, 0.0], [0.0, 4.0]]);
/// ```
#[must_use]
pub fn diagonal<const N: usize>(values: &[f32; N]) -> [[f32; N]; N] {
    let mut matrix = [[0.0; N]; N];
    for ((place, row), value) in matrix.iter_mut().enumerate().zip(values) {
        if let Some(entry) = row.get_mut(place) {
            *entry = *value;
        }
    }
    matrix
}

/// Returns the cost of errors or effort from the largest acceptable value of each: `1 / largest²` on the diagonal (Bryson's rule).
///
/// An infinite value costs nothing; zero and NaN give an entry that each constructor refuses.
///
/// # Examples
/// ```
/// use drivetrain::control::state_space::bryson;
///
/// assert_eq!(bryson(&[0.5, 10.0]), [[4.0, 0.0], [0.0, 0.01]]);
/// ```
#[must_use]
pub fn bryson<const N: usize>(largest: &[f32; N]) -> [[f32; N]; N] {
    diagonal(&largest.map(|value| 1.0 / (value * value)))
}
