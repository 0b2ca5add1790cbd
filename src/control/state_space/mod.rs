//! State space: regulators, observers and filters for plants of several states, with matrices as arrays.
//!
//! ```text
//!              +-- PlantInversion: effort of the reference ----+
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
//! | [`GainSchedule`] | gains over a parameter | |
//! | [`PlantInversion`] | inputs of a reference that moves | `LinearPlantInversionFeedforward` |
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

mod estimate;
mod inversion;
mod kalman;
mod luenberger;
mod regulator;
mod riccati;
mod schedule;
mod system;
#[cfg(test)]
#[expect(clippy::float_cmp, reason = "exact results are the rule under test")]
mod tests;

pub use inversion::PlantInversion;
pub use kalman::KalmanFilter;
pub use luenberger::LuenbergerObserver;
pub use regulator::LinearQuadraticRegulator;
pub use schedule::GainSchedule;
pub use system::LinearSystem;

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
