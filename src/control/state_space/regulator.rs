//! Regulators: the gain of least cost, gains by a schedule, and the inverted plant.

use super::{LinearSystem, riccati};
use crate::control::matrix::{
    Grid, apply, finite, identity, is_finite, largest, narrow, paired, solved, times, transposed,
    wide,
};
use crate::control::number::{self, Wide};
use crate::error::{self, ConfigError, positive};
use crate::math::limited;

/// Holds a plant at a reference with the least cost of errors and effort: a linear-quadratic regulator of `N` states, `M` inputs.
///
/// ```text
/// u = K (reference - x)      K minimises the sum of eᵀ Q e + uᵀ R u over all steps, e = reference - x
/// ```
/// `Q` is the cost of errors, `R` of effort; [`bryson`](super::bryson) makes both from the largest error and the largest effort
/// that are acceptable. The gain solves a discrete Riccati equation in twice the precision of `f32`: at start, not in the loop.
///
/// # Edge behaviour
/// If a reference or a state is NaN or infinite, the last output is returned and [`rejected`](Self::rejected) grows. Outputs are
/// within [`with_output_limit`](Self::with_output_limit), and within `f32` without a limit. A limit does not wind up: there is no
/// integral. A constant load needs a state of its own in the plant, and a filter that estimates the state.
///
/// # Examples
/// A flywheel of 0.01 kg m² by a motor whose torque is the input; 5 rad/s is the acceptable error, 2 Nm the acceptable torque:
/// ```
/// use drivetrain::control::state_space::{LinearQuadraticRegulator, LinearSystem, bryson};
///
/// let wheel = LinearSystem::discretized(&[[0.0]], &[[100.0]], 0.005)?;
/// let mut speed = LinearQuadraticRegulator::new(&wheel, &bryson(&[5.0]), &bryson(&[2.0]))?
///     .with_output_limit(&[2.0])?;
/// assert!((speed.gain()[0][0] - 0.362).abs() < 1e-3); // Nm for rad/s
/// assert_eq!(speed.step(&[300.0], &[0.0]), [2.0]);
/// # Ok::<(), drivetrain::error::ConfigError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct LinearQuadraticRegulator<const N: usize, const M: usize> {
    gain: [[f32; N]; M],
    limit: [f32; M],
    output: [f32; M],
    rejected: u16,
}

impl<const N: usize, const M: usize> LinearQuadraticRegulator<N, M> {
    /// Calculates the gain for a plant and the costs of errors (`q`) and of effort (`r`), both symmetric.
    ///
    /// # Errors
    /// [`ConfigError::NotFinite`] names a matrix with an entry that is NaN or infinite; [`ConfigError::Unusable`] one that is not
    /// symmetric; [`ConfigError::Negative`] a `q` with a negative eigenvalue, [`ConfigError::NotPositive`] an `r` with one that is
    /// negative or zero. [`ConfigError::NotStabilizable`] with `b`: a mode that does not decay is not reached by the inputs, or costs
    /// nothing.
    pub fn new(
        plant: &LinearSystem<N, M>,
        q: &[[f32; N]; N],
        r: &[[f32; M]; M],
    ) -> Result<Self, ConfigError> {
        let solution = riccati::regulator(plant, q, r)?;
        let gain = narrow(&solution.gain).ok_or(ConfigError::NotStabilizable("b"))?;
        Ok(Self::made_of(gain))
    }

    /// Takes a gain of another program, a row for each input: calculated on a computer, or placed by hand.
    ///
    /// # Errors
    /// Names `gain` when an entry is NaN or infinite. A gain that does not stabilise the plant is not noticed.
    pub fn from_gain(gain: &[[f32; N]; M]) -> Result<Self, ConfigError> {
        finite("gain", gain)?;
        Ok(Self::made_of(*gain))
    }

    const fn made_of(gain: [[f32; N]; M]) -> Self {
        Self { gain, limit: [f32::MAX; M], output: [0.0; M], rejected: 0 }
    }

    /// Limits the output of each input to ± its limit.
    ///
    /// # Errors
    /// Names `output_limit` when a limit is zero, negative, NaN or infinite.
    pub fn with_output_limit(mut self, limit: &[f32; M]) -> Result<Self, ConfigError> {
        limit.iter().try_for_each(|limit| positive("output_limit", *limit))?;
        self.limit = *limit;
        Ok(self)
    }

    /// Returns the inputs of the plant that drive the states `x` to the reference.
    ///
    /// Costs 99 instructions on a Cortex-M4F, of 4 states and 2 inputs (`docs/figures.md`).
    pub fn step(&mut self, reference: &[f32; N], x: &[f32; N]) -> [f32; M] {
        let mut error = *reference;
        for (error, state) in error.iter_mut().zip(x) {
            *error -= state;
        }
        if !is_finite(&[error]) {
            self.rejected = self.rejected.saturating_add(1);
            return self.output;
        }
        let output = apply(&self.gain, &error);
        for ((place, value), limit) in self.output.iter_mut().zip(output).zip(&self.limit) {
            *place = limited(number::finite(value), -limit, *limit);
        }
        self.output
    }

    /// Replaces the gain from the next step on, as [`scheduled_gain`] returns. A gain with an entry that is NaN or
    /// infinite is refused: the last one stays, and [`rejected`](Self::rejected) grows.
    pub fn set_gain(&mut self, gain: &[[f32; N]; M]) {
        if is_finite(gain) {
            self.gain = *gain;
        } else {
            self.rejected = self.rejected.saturating_add(1);
        }
    }

    /// Returns the gain: a row for each input, a column for each state.
    #[must_use]
    pub const fn gain(&self) -> &[[f32; N]; M] {
        &self.gain
    }

    /// Returns the number of steps and gains that were refused; stays at 65535.
    #[must_use]
    pub const fn rejected(&self) -> u16 {
        self.rejected
    }
}

/// Returns the gain at a value of one parameter, from a table of parameter and gain by rising parameter: a gain schedule.
///
/// Between two rows the gains are interpolated linearly; beyond the ends they are those of the ends. A loop whose gain stabilises the
/// plant at each row is not by that stable between them: choose rows so near that neighbours have like gains, and test between.
///
/// Returns `None` if the parameter is NaN, the table has no row, or the rows on either side of the parameter do not rise. The other rows
/// are not checked.
///
/// # Examples
/// The leg of a balancing robot changes its length: 0.1 to 0.3 m.
/// ```
/// use drivetrain::control::state_space::{LinearQuadraticRegulator, scheduled_gain};
///
/// let legs = [(0.1, [[10.0, 1.0]]), (0.2, [[14.0, 1.5]]), (0.3, [[20.0, 2.5]])];
/// assert_eq!(scheduled_gain(&legs, 0.15), Some([[12.0, 1.25]]));
/// assert_eq!(scheduled_gain(&legs, 1.0), Some([[20.0, 2.5]]));
///
/// let mut balance = LinearQuadraticRegulator::from_gain(&[[10.0, 1.0]])?;
/// if let Some(gain) = scheduled_gain(&legs, 0.25) {
///     balance.set_gain(&gain);
/// }
/// assert_eq!(balance.step(&[0.0, 0.0], &[0.1, 0.0]), [-1.7]);
/// # Ok::<(), drivetrain::error::ConfigError>(())
/// ```
#[must_use]
pub fn scheduled_gain<const N: usize, const M: usize>(
    table: &[(f32, [[f32; N]; M])],
    parameter: f32,
) -> Option<[[f32; N]; M]> {
    let mut below = None;
    for (at, gain) in table {
        if parameter <= *at {
            let Some((before, lower)) = below else { return Some(*gain) };
            // Halves, so that a table over the whole of f32 has no infinite width.
            let share = (0.5 * parameter - 0.5 * before) / (0.5 * at - 0.5 * before);
            return (before < *at).then(|| {
                paired(&lower, gain, |lower, upper| (1.0 - share) * lower + share * upper)
            });
        }
        below = Some((*at, *gain));
    }
    below.map(|(_, gain)| gain).filter(|_| !parameter.is_nan())
}

/// Gains of `N` states and `M` inputs over one parameter, from a checked table of `K` rows.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub(crate) struct GainSchedule<const N: usize, const M: usize, const K: usize> {
    table: [(f32, [[f32; N]; M]); K],
}

impl<const N: usize, const M: usize, const K: usize> GainSchedule<N, M, K> {
    /// Takes the rows: parameter and gain, by rising parameter.
    ///
    /// # Errors
    /// Names `parameter` or `gain` when one is NaN or infinite; [`ConfigError::Reversed`] with `parameter` when it does not rise;
    /// [`ConfigError::Unusable`] with `table` when there is no row.
    pub(crate) fn new(table: [(f32, [[f32; N]; M]); K]) -> Result<Self, ConfigError> {
        if table.is_empty() {
            return Err(ConfigError::Unusable("table"));
        }
        for (parameter, gain) in &table {
            error::finite("parameter", *parameter)?;
            finite("gain", gain)?;
        }
        if table.iter().zip(table.iter().skip(1)).any(|(row, next)| row.0 >= next.0) {
            return Err(ConfigError::Reversed("parameter"));
        }
        Ok(Self { table })
    }

    /// Returns the gain at a value of the parameter; `None` if that is NaN.
    pub(crate) fn gain(&self, parameter: f32) -> Option<[[f32; N]; M]> {
        scheduled_gain(&self.table, parameter)
    }
}

/// Least pivot of `BᵀB` with columns of length 1.
const LEAST: f32 = 1e-9;

impl<const N: usize, const M: usize> LinearSystem<N, M> {
    /// Inverts the matrix of the inputs, for [`effort`](Self::effort): `B⁺ = (Bᵀ B)⁻¹ Bᵀ`, a row for each input.
    ///
    /// # Errors
    /// [`ConfigError::Singular`] with `b`: an input moves no state, or several move the states in the same way, within 3 in 100 000.
    pub fn input_inverse(&self) -> Result<[[f32; N]; M], ConfigError> {
        inverse(self.b()).ok_or(ConfigError::Singular("b"))
    }

    /// Returns the inputs that bring the plant from one reference to the next: feed-forward by inversion of the plant.
    ///
    /// ```text
    /// u = B⁺ (next - A reference)
    /// ```
    /// `inverse` is the matrix B⁺ of [`input_inverse`](Self::input_inverse). A reference that the plant can follow is followed exactly. Of
    /// another one, the states are approached with the least sum of squares, in the units of the states. Added to the output of a
    /// [`LinearQuadraticRegulator`], it leaves only the errors to the regulator. A result that is NaN or infinite is zero or the
    /// largest number of its sign.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::control::state_space::LinearSystem;
    ///
    /// let cart = LinearSystem::discretized(&[[0.0, 1.0], [0.0, 0.0]], &[[0.0], [0.5]], 0.01)?;
    /// let inverse = cart.input_inverse()?;
    /// let effort = cart.effort(&inverse, &[0.0, 1.0], &[0.010_05, 1.01]); // 1 m/s², a mass of 2 kg
    /// assert!((effort[0] - 2.0).abs() < 1e-3);
    /// # Ok::<(), drivetrain::error::ConfigError>(())
    /// ```
    #[must_use]
    pub fn effort(
        &self,
        inverse: &[[f32; N]; M],
        reference: &[f32; N],
        next: &[f32; N],
    ) -> [f32; M] {
        let mut change = *next;
        for (change, alone) in change.iter_mut().zip(apply(self.a(), reference)) {
            *change -= alone;
        }
        apply(inverse, &change).map(number::finite)
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
