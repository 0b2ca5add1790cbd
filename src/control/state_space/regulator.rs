use super::riccati;
use super::system::LinearSystem;
use crate::control::error::positive;
use crate::control::matrix::{apply, finite, is_finite, narrow};
use crate::control::number::{self, limited};
use crate::error::ConfigError;

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
/// integral. For a load that is constant, add a state for it to the plant and estimate it with a filter.
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

    /// Replaces the gain from the next step on, as a [`GainSchedule`](super::GainSchedule) asks for. A gain with an entry that is NaN or
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
