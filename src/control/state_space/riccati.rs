use super::LinearSystem;
use crate::control::matrix::{
    Grid, Number, difference, finite, is_finite, largest, not_negative, positive, row_sum, solved,
    sum, symmetric, times, times_transposed, transposed, wide, with_diagonal,
};
use crate::control::number::Wide;
use crate::error::ConfigError;

/// Each doubling squares the closed loop: 32 are 4·10^9 steps, in which a pole of 1 - 10^-8 decays.
const DOUBLINGS: u32 = 32;
/// Change of the cost in the last doubling, as a share of it.
const CONVERGED: f32 = 1e-8;
/// The closed loop over all steps until then.
const DECAYED: f32 = 1e-6;
/// Steps of Newton: each has the square of the error before.
const REFINEMENTS: u32 = 3;

/// Cost and gain of a discrete algebraic Riccati equation.
#[derive(Debug, Clone, Copy)]
pub(super) struct Solution<const N: usize, const M: usize> {
    /// The stabilizing `X` of `X = AᵀXA - AᵀXB (R + BᵀXB)⁻¹ BᵀXA + Q`.
    pub(super) cost: Grid<Wide, N, N>,
    /// `K = (R + BᵀXB)⁻¹ BᵀXA`.
    pub(super) gain: Grid<Wide, M, N>,
}

/// Solves the equation of a regulator. `None` if no stabilizing solution is found.
///
/// The structure-preserving doubling algorithm: E. K.-W. Chu, H.-Y. Fan, W.-W. Lin, C.-S. Wang, Structure-preserving algorithms for
/// periodic discrete-time algebraic Riccati equations, International Journal of Control 77 (2004), section 2. `a` is the
/// closed loop over 2^k steps and falls to zero with the square of its error; if it does not, the loop has a pole on the unit circle
/// or outside.
pub(super) fn solve<const N: usize, const M: usize>(
    system: (&Grid<Wide, N, N>, &Grid<Wide, N, M>),
    (q, r): (&Grid<Wide, N, N>, &Grid<Wide, M, M>),
) -> Option<Solution<N, M>> {
    let (first, b) = system;
    let reach = times(b, &solved(r, &transposed(b))?);
    // Cost and reach of like size: far from both ends of `f32`. The gain does not depend on it.
    let scale = balance(largest(q), largest(&reach));
    let mut a = *first;
    let mut g = reach.map(|row| row.map(|entry| entry.scaled(scale)));
    let mut h = q.map(|row| row.map(|entry| entry.scaled(1.0 / scale)));
    for _ in 0..DOUBLINGS {
        let w = with_diagonal(times(&g, &h), Wide::ONE);
        let a_next = solved(&w, &a)?;
        let g_next = solved(&w, &g)?;
        let a_transposed = transposed(&a);
        let change = times(&a_transposed, &times(&h, &a_next));
        g = symmetric(&sum(&g, &times(&a, &times_transposed(&g_next, &a))));
        h = symmetric(&sum(&h, &change));
        a = times(&a, &a_next);
        let (size, changed) = (largest(&h), largest(&change));
        if !size.is_finite() || !row_sum(&a).is_finite() {
            return None;
        }
        if changed <= CONVERGED * size && row_sum(&a) < DECAYED {
            let cost = h.map(|row| row.map(|entry| entry.scaled(scale)));
            return refined(system, (q, r), gain(system, &cost, r)?);
        }
    }
    None
}

/// Improves a gain by the method of Newton: the cost of a gain is a sum without differences, and the gain of least cost for it has the
/// square of the error before. `None` if the loop of the gain does not decay.
///
/// An unstable plant loses digits in the doubling, since `a` grows before it falls. Source: G. A. Hewer, An iterative technique for
/// the computation of the steady state gains for the discrete optimal regulator, IEEE Transactions on Automatic Control 16 (1971).
fn refined<const N: usize, const M: usize>(
    (a, b): (&Grid<Wide, N, N>, &Grid<Wide, N, M>),
    (q, r): (&Grid<Wide, N, N>, &Grid<Wide, M, M>),
    mut k: Grid<Wide, M, N>,
) -> Option<Solution<N, M>> {
    let mut cost = *q;
    for _ in 0..REFINEMENTS {
        let effort = times(&transposed(&k), &times(r, &k));
        cost = summed(&difference(a, &times(b, &k)), &sum(q, &effort))?;
        k = gain((a, b), &cost, r)?;
    }
    Some(Solution { cost, gain: k })
}

/// Returns the sum of `(aᵀ)^k cost a^k` over all steps; `None` if it does not converge.
fn summed<const N: usize>(
    a: &Grid<Wide, N, N>,
    cost: &Grid<Wide, N, N>,
) -> Option<Grid<Wide, N, N>> {
    let (mut a, mut cost) = (*a, *cost);
    for _ in 0..DOUBLINGS {
        let later = times(&transposed(&a), &times(&cost, &a));
        cost = symmetric(&sum(&cost, &later));
        a = times(&a, &a);
        if !row_sum(&a).is_finite() || !largest(&cost).is_finite() {
            return None;
        }
        if row_sum(&a) < DECAYED {
            return Some(cost);
        }
    }
    None
}

fn gain<const N: usize, const M: usize>(
    (a, b): (&Grid<Wide, N, N>, &Grid<Wide, N, M>),
    cost: &Grid<Wide, N, N>,
    r: &Grid<Wide, M, M>,
) -> Option<Grid<Wide, M, N>> {
    let of_input = times(&transposed(b), cost);
    solved(&sum(r, &times(&of_input, b)), &times(&of_input, a))
}

/// Returns a power of two near the root of `cost / reach`: exact as a factor.
fn balance(cost: f32, reach: f32) -> f32 {
    let exponent = |value: f32| value.to_bits() >> 23;
    if cost > 0.0 && reach > 0.0 {
        // Exponents are 0 to 254, so half of a difference is within ±127 of the exponent of 1.
        let twice = 254 + exponent(cost) - exponent(reach);
        f32::from_bits((twice / 2).clamp(64, 190) << 23)
    } else {
        1.0
    }
}

/// Returns the solution for a regulator of states with the costs `q` and `r`.
pub(super) fn regulator<const N: usize, const M: usize>(
    system: &LinearSystem<N, M>,
    q: &Grid<f32, N, N>,
    r: &Grid<f32, M, M>,
) -> Result<Solution<N, M>, ConfigError> {
    not_negative("q", q)?;
    positive("r", r)?;
    solve((system.exact_a(), &wide(system.b())), (&wide(q), &wide(r)))
        .ok_or(ConfigError::NotStabilizable("b"))
}

/// Returns covariance before a measurement and gain of a filter in the steady state: the regulator of the transposed system.
pub(super) fn filter<const N: usize, const M: usize, const P: usize>(
    system: &LinearSystem<N, M>,
    c: &Grid<f32, P, N>,
    q: &Grid<f32, N, N>,
    r: &Grid<f32, P, P>,
) -> Result<(Grid<Wide, N, N>, Grid<Wide, N, P>), ConfigError> {
    finite("c", c)?;
    not_negative("q", q)?;
    positive("r", r)?;
    let (a, c) = (transposed(system.exact_a()), transposed(&wide(c)));
    let steady = solve((&a, &c), (&wide(q), &wide(r))).and_then(|solution| {
        let covariance = solution.cost;
        // The gain of a filter that corrects before it predicts has no factor of `a`.
        let of_output = times(&transposed(&c), &covariance);
        let innovation = sum(&wide(r), &times(&of_output, &c));
        let gain = solved(&innovation, &of_output)?;
        (is_finite(&covariance) && is_finite(&gain)).then_some((covariance, transposed(&gain)))
    });
    steady.ok_or(ConfigError::NotStabilizable("c"))
}

/// Whether all eigenvalues lie within the unit circle: a power of the matrix becomes small.
pub(super) fn decays<const N: usize>(matrix: &Grid<f32, N, N>) -> bool {
    let mut power = wide(matrix);
    for _ in 0..DOUBLINGS {
        let size = row_sum(&power);
        if size < 1.0 {
            return true;
        }
        if !size.is_finite() {
            return false;
        }
        power = times(&power, &power);
    }
    false
}
