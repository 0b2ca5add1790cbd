//! Observers: the Kalman filter, and the Luenberger observer.

use super::{LinearSystem, riccati};
use crate::control::matrix::{
    Grid, apply, difference, finite, identity, is_finite, not_negative, solved, sum, symmetric,
    times, times_transposed, transposed, wide,
};
use crate::control::number::Wide;
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
        if self.estimate.take(found.map(|(states, _)| states)) {
            if let Some((_, covariance)) = found {
                self.covariance = covariance;
            }
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

/// Estimates `N` states of a plant from `M` inputs and `P` measurements with a constant gain: a Luenberger observer.
///
/// ```text
/// predict   x = A x + B u
/// correct   x = x + K (y - C x)
/// ```
/// The error decays with the eigenvalues of `(1 - K C) A`. An observer that is written `x = A x + B u + L (y - C x)` has `L = A K`.
/// With a state for a disturbance in the plant it is an extended-state observer, as [`LoadObserver`](crate::control::LoadObserver) is one of
/// two states.
///
/// # Edge behaviour
/// An input, a measurement or a result that is NaN or infinite changes nothing, and [`rejected`](Self::rejected) grows. Without a measurement
/// in a step, call `predict` alone.
///
/// # Examples
/// ```
/// use drivetrain::control::state_space::{LinearSystem, LuenbergerObserver};
///
/// let cart = LinearSystem::discretized(&[[0.0, 1.0], [0.0, 0.0]], &[[0.0], [1.0]], 0.01)?;
/// // Both eigenvalues 0.9: 1 - 0.9², (1 - 0.9)² / dt.
/// let mut observer = LuenbergerObserver::new(&cart, &[[1.0, 0.0]], &[[0.19], [1.0]])?;
/// for step in 0..200 {
///     observer.predict(&[0.0]);
///     observer.correct(&[0.03 * step as f32]); // m: moves with 3 m/s
/// }
/// assert!((observer.state()[1] - 3.0).abs() < 1e-3);
/// # Ok::<(), drivetrain::error::ConfigError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct LuenbergerObserver<const N: usize, const M: usize, const P: usize> {
    plant: LinearSystem<N, M>,
    c: [[f32; N]; P],
    /// Not `f32`: where a measurement sees little of a state, the gains of two states nearly cancel in the loop, and a gain of 24 bits was
    /// seen to move a state by 1 in 20 000.
    gain: Grid<Wide, N, P>,
    /// Not `f32` either: a slow observer sums the rounding of 10 000 steps.
    estimate: Estimate<N>,
}

impl<const N: usize, const M: usize, const P: usize> LuenbergerObserver<N, M, P> {
    /// Takes the plant, the matrix `c` with a row for each measurement, and the gain with a row for each state. The state is zero.
    ///
    /// # Errors
    /// Names `c` or `gain` when an entry is NaN or infinite. [`ConfigError::Unstable`] with `gain`: the error does not decay.
    pub fn new(
        plant: &LinearSystem<N, M>,
        c: &[[f32; N]; P],
        gain: &[[f32; P]; N],
    ) -> Result<Self, ConfigError> {
        finite("c", c)?;
        finite("gain", gain)?;
        let left = difference(&identity(), &times(gain, c));
        if !riccati::decays(&times(&left, plant.a())) {
            return Err(ConfigError::Unstable("gain"));
        }
        Ok(Self { plant: *plant, c: *c, gain: wide(gain), estimate: Estimate::ZERO })
    }

    /// Calculates the gain that a [`KalmanFilter`] of the same arguments has in the steady state, in twice the precision
    /// of `f32`: at start, not in the loop.
    ///
    /// # Errors
    /// Those of [`KalmanFilter::new`](super::KalmanFilter::new).
    ///
    /// # Examples
    /// ```
    /// use drivetrain::control::state_space::{LinearSystem, LuenbergerObserver, diagonal};
    ///
    /// // A constant, with a noise of 1 a step and of 1 a measurement: P = 1.618, the golden ratio, and K = P / (P + 1).
    /// let constant = LinearSystem::discrete(&[[1.0]], &[[0.0]])?;
    /// let one = diagonal(&[1.0]);
    /// let observer = LuenbergerObserver::steady_state(&constant, &[[1.0]], &one, &one)?;
    /// assert!((observer.gain()[0][0] - 0.618_034).abs() < 1e-6);
    /// # Ok::<(), drivetrain::error::ConfigError>(())
    /// ```
    pub fn steady_state(
        plant: &LinearSystem<N, M>,
        c: &[[f32; N]; P],
        q: &[[f32; N]; N],
        r: &[[f32; P]; P],
    ) -> Result<Self, ConfigError> {
        let (_, gain) = riccati::filter(plant, c, q, r)?;
        Ok(Self { plant: *plant, c: *c, gain, estimate: Estimate::ZERO })
    }

    /// Begins with another state.
    ///
    /// # Errors
    /// Names `state` when an entry is NaN or infinite.
    pub fn with_state(mut self, state: &[f32; N]) -> Result<Self, ConfigError> {
        finite("state", &[*state])?;
        self.estimate.set(state);
        Ok(self)
    }

    /// Goes one time step ahead with the inputs of the plant.
    pub fn predict(&mut self, u: &[f32; M]) {
        self.estimate.take(Some(self.estimate.predicted(&self.plant, u)));
    }

    /// Corrects the state with one measurement of each output.
    ///
    /// Costs 1874 instructions on a Cortex-M4F, with `predict`, of 4 states, 2 inputs and 2 measurements (`docs/figures.md`).
    pub fn correct(&mut self, y: &[f32; P]) {
        self.estimate.take(Some(self.estimate.corrected(&wide(&self.c), &self.gain, y)));
    }

    /// Returns the estimated states.
    #[must_use]
    pub fn state(&self) -> [f32; N] {
        self.estimate.states()
    }

    /// Returns the gain: a row for each state, a column for each measurement.
    #[must_use]
    pub fn gain(&self) -> [[f32; P]; N] {
        self.gain.map(|row| row.map(Wide::narrow))
    }

    /// Returns the number of predictions and corrections that were refused; stays at 65535.
    #[must_use]
    pub const fn rejected(&self) -> u16 {
        self.estimate.rejected()
    }
}

/// The estimated states of an observer, in twice the precision of `f32`, and the steps that it refused.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
struct Estimate<const N: usize> {
    states: [Wide; N],
    rejected: u16,
}

impl<const N: usize> Estimate<N> {
    const ZERO: Self = Self { states: [Wide::ZERO; N], rejected: 0 };

    fn set(&mut self, states: &[f32; N]) {
        self.states = states.map(Wide::of);
    }

    /// Returns the states after one time step.
    fn predicted<const M: usize>(&self, plant: &LinearSystem<N, M>, u: &[f32; M]) -> [Wide; N] {
        plant.predict_exactly(&self.states, u)
    }

    /// Returns the states, moved by the gain towards a measurement.
    #[inline]
    fn corrected<const P: usize>(
        &self,
        c: &Grid<Wide, P, N>,
        gain: &Grid<Wide, N, P>,
        y: &[f32; P],
    ) -> [Wide; N] {
        let mut residual = y.map(Wide::of);
        for (residual, expected) in residual.iter_mut().zip(apply(c, &self.states)) {
            *residual = *residual - expected;
        }
        let mut result = self.states;
        for (state, change) in result.iter_mut().zip(apply(gain, &residual)) {
            *state = *state + change;
        }
        result
    }

    /// Takes states that are finite, and counts others. Returns whether the states were taken.
    fn take(&mut self, states: Option<[Wide; N]>) -> bool {
        let taken = states.filter(|states| is_finite(&[*states]));
        match taken {
            Some(states) => self.states = states,
            None => self.rejected = self.rejected.saturating_add(1),
        }
        taken.is_some()
    }

    fn states(&self) -> [f32; N] {
        self.states.map(Wide::narrow)
    }

    const fn rejected(&self) -> u16 {
        self.rejected
    }
}
