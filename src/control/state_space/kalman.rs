use super::estimate::Estimate;
use super::riccati;
use super::system::LinearSystem;
use crate::control::matrix::{
    Grid, difference, finite, identity, is_finite, not_negative, solved, sum, symmetric, times,
    times_transposed, transposed, wide,
};
use crate::control::wide::Wide;
use crate::error::ConfigError;

/// Estimates `N` states of a plant from `M` inputs and `P` measurements, with a covariance that follows: a Kalman filter.
///
/// ```text
/// predict   x = A x + B u       P = A P Aᵀ + Q          Q: covariance of the noise that the plant gets in one step
/// correct   K = P Cᵀ (C P Cᵀ + R)⁻¹                     R: covariance of the noise of one measurement
///           x = x + K (y - C x)
///           P = (1 - K C) P (1 - K C)ᵀ + K R Kᵀ         the form of Joseph: P stays positive
/// ```
/// States and covariance are calculated in twice the precision of `f32`, and rounded when they are returned: in `f32` alone, the filter of
/// an unstable plant of 6 states with one measurement was seen to fail.
///
/// The measurement is `y = C x`: an input that acts on it at once is subtracted before.
///
/// # Which filter?
/// A measurement that is lost, late or of another kind each time: this filter, with a `predict` for each step and a `correct` for
/// each measurement. A measurement in each step: [`LuenbergerObserver::steady_state`](super::LuenbergerObserver::steady_state) with the same
/// arguments, whose gain is that of this filter after some steps, at a fraction of the instructions.
///
/// # Edge behaviour
/// An input, a measurement or a result that is NaN or infinite changes nothing, and [`rejected`](Self::rejected) grows.
///
/// # Examples
/// Position of a cart that is measured with a deviation of 0.1 m, pushed by unknown accelerations of 0.5 m/s²:
/// ```
/// use drivetrain::control::state_space::{KalmanFilter, LinearSystem, diagonal};
///
/// let cart = LinearSystem::discretized(&[[0.0, 1.0], [0.0, 0.0]], &[[0.0], [1.0]], 0.01)?;
/// let (q, r) = (diagonal(&[0.0, 0.005 * 0.005]), diagonal(&[0.1 * 0.1])); // 0.5 m/s² over 0.01 s, in m/s
/// let mut filter = KalmanFilter::new(&cart, &[[1.0, 0.0]], &q, &r)?;
/// for _ in 0..1_000 {
///     filter.predict(&[0.0]);
///     filter.correct(&[2.0]);
/// }
/// assert!((filter.state()[0] - 2.0).abs() < 1e-3);
/// assert!((filter.covariance()[0][0].sqrt() - 0.01764).abs() < 5e-5); // m, of the 0.1 m of a measurement
/// # Ok::<(), drivetrain::error::ConfigError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct KalmanFilter<const N: usize, const M: usize, const P: usize> {
    plant: LinearSystem<N, M>,
    c: Grid<Wide, P, N>,
    q: Grid<Wide, N, N>,
    r: Grid<Wide, P, P>,
    estimate: Estimate<N>,
    covariance: Grid<Wide, N, N>,
}

impl<const N: usize, const M: usize, const P: usize> KalmanFilter<N, M, P> {
    /// Takes the plant, the matrix `c` with a row for each measurement, and both covariances, symmetric. The state is zero, with the
    /// covariance that a filter before a measurement has in the steady state.
    ///
    /// # Errors
    /// [`ConfigError::NotFinite`] names a matrix with an entry that is NaN or infinite; [`ConfigError::Unusable`] one that is not
    /// symmetric; [`ConfigError::Negative`] a `q` with a negative eigenvalue, [`ConfigError::NotPositive`] an `r` with one that is
    /// negative or zero. [`ConfigError::NotStabilizable`] with `c`: a mode that does not decay is not seen by the measurements, or gets
    /// no noise.
    pub fn new(
        plant: &LinearSystem<N, M>,
        c: &[[f32; N]; P],
        q: &[[f32; N]; N],
        r: &[[f32; P]; P],
    ) -> Result<Self, ConfigError> {
        let (covariance, _) = riccati::filter(plant, c, q, r)?;
        let (c, q, r) = (wide(c), wide(&symmetric(q)), wide(&symmetric(r)));
        Ok(Self { plant: *plant, c, q, r, estimate: Estimate::ZERO, covariance })
    }

    /// Begins with another state and the covariance of its error.
    ///
    /// # Errors
    /// Names `state` or `covariance` when an entry is NaN or infinite; `covariance` when it is not symmetric or has a negative
    /// eigenvalue.
    pub fn with_start(
        mut self,
        state: &[f32; N],
        covariance: &[[f32; N]; N],
    ) -> Result<Self, ConfigError> {
        finite("state", &[*state])?;
        not_negative("covariance", covariance)?;
        self.estimate.set(state);
        self.covariance = wide(&symmetric(covariance));
        Ok(self)
    }

    /// Goes one time step ahead with the inputs of the plant.
    pub fn predict(&mut self, u: &[f32; M]) {
        let a = self.plant.exact_a();
        let states = self.estimate.predicted(&self.plant, u);
        let moved = times_transposed(&times(a, &self.covariance), a);
        self.take(Some((states, sum(&moved, &self.q))));
    }

    /// Corrects the state with one measurement of each output.
    ///
    /// Costs 23267 instructions on a Cortex-M4F, with `predict`, of 4 states, 2 inputs and 2 measurements (`docs/figures.md`).
    pub fn correct(&mut self, y: &[f32; P]) {
        self.take(self.corrected(y));
    }

    fn corrected(&self, y: &[f32; P]) -> Option<([Wide; N], Grid<Wide, N, N>)> {
        let of_output = times(&self.c, &self.covariance);
        let innovation = sum(&times_transposed(&of_output, &self.c), &self.r);
        let gain = transposed(&solved(&innovation, &of_output)?);
        let states = self.estimate.corrected(&self.c, &gain, y);
        let left = difference(&identity(), &times(&gain, &self.c));
        let kept = times_transposed(&times(&left, &self.covariance), &left);
        let added = times_transposed(&times(&gain, &self.r), &gain);
        Some((states, sum(&kept, &added)))
    }

    fn take(&mut self, found: Option<([Wide; N], Grid<Wide, N, N>)>) {
        let found = found.map(|(states, covariance)| (states, symmetric(&covariance)));
        let found = found.filter(|(_, covariance)| is_finite(covariance));
        if self.estimate.take(found.map(|(states, _)| states))
            && let Some((_, covariance)) = found
        {
            self.covariance = covariance;
        }
    }

    /// Returns the estimated states.
    #[must_use]
    pub fn state(&self) -> [f32; N] {
        self.estimate.states()
    }

    /// Returns the covariance of the error of the states.
    #[must_use]
    pub fn covariance(&self) -> [[f32; N]; N] {
        self.covariance.map(|row| row.map(Wide::narrow))
    }

    /// Returns the number of predictions and corrections that were refused; stays at 65535.
    #[must_use]
    pub const fn rejected(&self) -> u16 {
        self.estimate.rejected()
    }
}
