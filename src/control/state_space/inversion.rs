use super::system::LinearSystem;
use crate::control::matrix::{
    Grid, apply, identity, largest, narrow, solved, times, transposed, wide,
};
use crate::control::number;
use crate::control::wide::Wide;
use crate::error::ConfigError;

/// Returns the inputs that bring a plant from one reference to the next: feed-forward by inversion of the plant.
///
/// ```text
/// u = B⁺ (next - A reference)      B⁺ = (Bᵀ B)⁻¹ Bᵀ
/// ```
/// A reference that the plant can follow is followed exactly. Of another one, the states are approached with the least sum of squares, in the
/// units of the states. Added to the output of a [`LinearQuadraticRegulator`](super::LinearQuadraticRegulator), it leaves only the errors to the
/// regulator.
///
/// # Examples
/// ```
/// use drivetrain::control::state_space::{LinearSystem, PlantInversion};
///
/// let cart = LinearSystem::discretized(&[[0.0, 1.0], [0.0, 0.0]], &[[0.0], [0.5]], 0.01)?;
/// let inversion = PlantInversion::new(&cart)?;
/// let effort = inversion.effort(&[0.0, 1.0], &[0.010_05, 1.01]); // 1 m/s², a mass of 2 kg
/// assert!((effort[0] - 2.0).abs() < 1e-3);
/// # Ok::<(), drivetrain::error::ConfigError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct PlantInversion<const N: usize, const M: usize> {
    a: [[f32; N]; N],
    inverse: [[f32; N]; M],
}

/// Least pivot of `BᵀB` with columns of length 1.
const LEAST: f32 = 1e-9;

impl<const N: usize, const M: usize> PlantInversion<N, M> {
    /// Inverts a plant.
    ///
    /// # Errors
    /// [`ConfigError::Singular`] with `b`: an input moves no state, or several move the states in the same way, within 3 in 100 000.
    pub fn new(plant: &LinearSystem<N, M>) -> Result<Self, ConfigError> {
        let inverse = inverse(plant.b()).ok_or(ConfigError::Singular("b"))?;
        Ok(Self { a: *plant.a(), inverse })
    }

    /// Returns the inputs for one time step, from the reference now and that of the next step. A result that is NaN or infinite is
    /// zero or the largest number of its sign.
    #[must_use]
    pub fn effort(&self, reference: &[f32; N], next: &[f32; N]) -> [f32; M] {
        let mut change = *next;
        for (change, alone) in change.iter_mut().zip(apply(&self.a, reference)) {
            *change -= alone;
        }
        apply(&self.inverse, &change).map(number::finite)
    }
}

fn inverse<const N: usize, const M: usize>(b: &Grid<f32, N, M>) -> Option<Grid<f32, M, N>> {
    // Each input in a unit in which its largest effect is 1.
    let mut columns = transposed(&wide(b));
    let mut sizes = [0.0; M];
    for (column, size) in columns.iter_mut().zip(&mut sizes) {
        *size = largest(&[*column]);
        let scale = Wide::reciprocal(*size);
        *column = column.map(|entry| entry * scale);
    }
    let unit = solved(&times(&columns, &transposed(&columns)), &identity())?;
    // The inverse of a matrix that is nearly singular is large.
    let is_regular = largest(&unit) < 1.0 / LEAST;
    let mut result = times(&unit, &columns);
    for (row, size) in result.iter_mut().zip(sizes) {
        let scale = Wide::reciprocal(size);
        *row = row.map(|entry| entry * scale);
    }
    narrow(&result).filter(|_| is_regular)
}
