use super::estimate::Estimate;
use super::riccati;
use super::system::LinearSystem;
use crate::control::matrix::{Grid, difference, finite, identity, times, wide};
use crate::control::wide::Wide;
use crate::error::ConfigError;

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

    /// Calculates the gain that a [`KalmanFilter`](super::KalmanFilter) of the same arguments has in the steady state, in twice the precision
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
