use crate::control::error;
use crate::control::matrix::{finite, paired};
use crate::error::ConfigError;

/// Gains of `N` states and `M` inputs over one parameter, from a table of `K` rows: a gain schedule.
///
/// Between two rows the gains are interpolated linearly; beyond the ends they are those of the ends. A loop whose gain stabilises the
/// plant at each row is not by that stable between them: choose rows so near that neighbours have like gains, and test between.
///
/// # Examples
/// The leg of a balancing robot changes its length: 0.1 to 0.3 m.
/// ```
/// use drivetrain::control::state_space::{GainSchedule, LinearQuadraticRegulator};
///
/// let legs = GainSchedule::new([(0.1, [[10.0, 1.0]]), (0.2, [[14.0, 1.5]]), (0.3, [[20.0, 2.5]])])?;
/// assert_eq!(legs.gain(0.15), Some([[12.0, 1.25]]));
/// assert_eq!(legs.gain(1.0), Some([[20.0, 2.5]]));
///
/// let mut balance = LinearQuadraticRegulator::from_gain(&[[10.0, 1.0]])?;
/// if let Some(gain) = legs.gain(0.25) {
///     balance.set_gain(&gain);
/// }
/// assert_eq!(balance.step(&[0.0, 0.0], &[0.1, 0.0]), [-1.7]);
/// # Ok::<(), drivetrain::error::ConfigError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct GainSchedule<const N: usize, const M: usize, const K: usize> {
    table: [(f32, [[f32; N]; M]); K],
}

impl<const N: usize, const M: usize, const K: usize> GainSchedule<N, M, K> {
    /// Takes the rows: parameter and gain, by rising parameter.
    ///
    /// # Errors
    /// Names `parameter` or `gain` when one is NaN or infinite; [`ConfigError::Reversed`] with `parameter` when it does not rise;
    /// [`ConfigError::Unusable`] with `table` when there is no row.
    pub fn new(table: [(f32, [[f32; N]; M]); K]) -> Result<Self, ConfigError> {
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
    #[must_use]
    pub fn gain(&self, parameter: f32) -> Option<[[f32; N]; M]> {
        let mut below = None;
        for (at, gain) in &self.table {
            if parameter <= *at {
                let Some((before, lower)) = below else { return Some(*gain) };
                // Halves, so that a table over the whole of f32 has no infinite width.
                let share = (0.5 * parameter - 0.5 * before) / (0.5 * at - 0.5 * before);
                return Some(paired(&lower, gain, |lower, upper| {
                    (1.0 - share) * lower + share * upper
                }));
            }
            below = Some((*at, *gain));
        }
        below.map(|(_, gain)| gain).filter(|_| !parameter.is_nan())
    }
}
