//! Small matrices as arrays of rows.

use super::number::Wide;
use crate::error::ConfigError;
use core::ops::{Add, Div, Mul, Sub};

/// A matrix with `R` rows and `C` columns of the numbers in which it is calculated.
pub(crate) type Grid<T, const R: usize, const C: usize> = [[T; C]; R];

/// `f32` in the loop, [`Wide`] at start.
pub(crate) trait Number:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self>
{
    const ZERO: Self;
    const ONE: Self;

    /// Returns the absolute value, rounded.
    fn size(self) -> f32;
    fn half(self) -> Self;
}

impl Number for f32 {
    const ZERO: Self = 0.0;
    const ONE: Self = 1.0;

    #[inline]
    fn size(self) -> f32 {
        self.abs()
    }

    #[inline]
    fn half(self) -> Self {
        0.5 * self
    }
}

impl Number for Wide {
    const ZERO: Self = Self::of(0.0);
    const ONE: Self = Self::of(1.0);

    #[inline]
    fn size(self) -> f32 {
        self.narrow().abs()
    }

    #[inline]
    fn half(self) -> Self {
        self.scaled(0.5)
    }
}

#[inline]
pub(super) fn dot<T: Number, const N: usize>(a: &[T; N], b: &[T; N]) -> T {
    a.iter().zip(b).fold(T::ZERO, |sum, (a, b)| sum + *a * *b)
}

/// Returns the product of a matrix and a vector.
#[inline]
pub(super) fn apply<T: Number, const R: usize, const C: usize>(
    matrix: &Grid<T, R, C>,
    vector: &[T; C],
) -> [T; R] {
    let mut product = [T::ZERO; R];
    for (place, row) in product.iter_mut().zip(matrix) {
        *place = dot(row, vector);
    }
    product
}

/// Returns `a x + b u`.
#[inline]
pub(super) fn stepped<T: Number, const N: usize, const M: usize>(
    (a, x): (&Grid<T, N, N>, &[T; N]),
    (b, u): (&Grid<T, N, M>, &[T; M]),
) -> [T; N] {
    let mut next = apply(a, x);
    for (state, change) in next.iter_mut().zip(apply(b, u)) {
        *state = *state + change;
    }
    next
}

/// Returns `a bᵀ`.
#[inline(never)]
pub(super) fn times_transposed<T: Number, const R: usize, const K: usize, const C: usize>(
    a: &Grid<T, R, K>,
    b: &Grid<T, C, K>,
) -> Grid<T, R, C> {
    let mut product = [[T::ZERO; C]; R];
    for (place, row) in product.iter_mut().zip(a) {
        *place = apply(b, row);
    }
    product
}

/// Returns `a b`.
#[inline(never)]
pub(super) fn times<T: Number, const R: usize, const K: usize, const C: usize>(
    a: &Grid<T, R, K>,
    b: &Grid<T, K, C>,
) -> Grid<T, R, C> {
    let mut product = [[T::ZERO; C]; R];
    for (place, row) in product.iter_mut().zip(a) {
        for (factor, of_b) in row.iter().zip(b) {
            for (sum, entry) in place.iter_mut().zip(of_b) {
                *sum = *sum + *factor * *entry;
            }
        }
    }
    product
}

#[inline]
pub(super) fn transposed<T: Number, const R: usize, const C: usize>(
    matrix: &Grid<T, R, C>,
) -> Grid<T, C, R> {
    let mut result = [[T::ZERO; R]; C];
    for (column, row) in matrix.iter().enumerate() {
        for (value, place) in row.iter().zip(&mut result) {
            if let Some(place) = place.get_mut(column) {
                *place = *value;
            }
        }
    }
    result
}

/// Returns the matrix of each pair of entries.
#[inline]
pub(super) fn paired<T: Number, const R: usize, const C: usize>(
    a: &Grid<T, R, C>,
    b: &Grid<T, R, C>,
    of: impl Fn(T, T) -> T,
) -> Grid<T, R, C> {
    let mut result = *a;
    for (place, entry) in result.iter_mut().flatten().zip(b.iter().flatten()) {
        *place = of(*place, *entry);
    }
    result
}

pub(super) fn sum<T: Number, const R: usize, const C: usize>(
    a: &Grid<T, R, C>,
    b: &Grid<T, R, C>,
) -> Grid<T, R, C> {
    paired(a, b, |a, b| a + b)
}

pub(super) fn difference<T: Number, const R: usize, const C: usize>(
    a: &Grid<T, R, C>,
    b: &Grid<T, R, C>,
) -> Grid<T, R, C> {
    paired(a, b, |a, b| a - b)
}

/// Returns a matrix with its mirror image: a symmetric one without the differences that rounding makes.
pub(super) fn symmetric<T: Number, const N: usize>(matrix: &Grid<T, N, N>) -> Grid<T, N, N> {
    paired(matrix, &transposed(matrix), |a, b| (a + b).half())
}

/// Adds a number to the diagonal.
pub(super) fn with_diagonal<T: Number, const N: usize>(
    mut matrix: Grid<T, N, N>,
    number: T,
) -> Grid<T, N, N> {
    for (place, row) in matrix.iter_mut().enumerate() {
        if let Some(entry) = row.get_mut(place) {
            *entry = *entry + number;
        }
    }
    matrix
}

pub(super) fn identity<T: Number, const N: usize>() -> Grid<T, N, N> {
    with_diagonal([[T::ZERO; N]; N], T::ONE)
}

/// Returns the largest absolute value; NaN if there is one.
pub(super) fn largest<T: Number, const R: usize, const C: usize>(matrix: &Grid<T, R, C>) -> f32 {
    matrix.iter().flatten().map(|entry| entry.size()).fold(0.0, larger)
}

const fn larger(most: f32, size: f32) -> f32 {
    if size > most || size.is_nan() { size } else { most }
}

/// Returns the largest sum of a row, which bounds each eigenvalue; infinite or NaN if an entry is.
pub(super) fn row_sum<T: Number, const R: usize, const C: usize>(matrix: &Grid<T, R, C>) -> f32 {
    let sum = |row: &[T; C]| row.iter().map(|entry| entry.size()).sum::<f32>();
    matrix.iter().map(sum).fold(0.0, larger)
}

/// Returns the solution `x` of `left x = right`; `None` if a pivot is zero or not finite. By Gauss and Jordan with the largest
/// pivot of each column.
#[inline(never)]
pub(crate) fn solved<T: Number, const N: usize, const C: usize>(
    left: &Grid<T, N, N>,
    right: &Grid<T, N, C>,
) -> Option<Grid<T, N, C>> {
    let (mut left, mut right) = (*left, *right);
    // The column of which a row was the pivot.
    let mut columns = [None; N];
    for column in 0..N {
        let mut largest = 0.0;
        let mut pivot = None;
        for (row, entries) in left.iter().enumerate() {
            let size = entries.get(column)?.size();
            if columns.get(row)?.is_none() && size > largest {
                (largest, pivot) = (size, Some(row));
            }
        }
        let row = pivot.filter(|_| largest.is_finite())?;
        *columns.get_mut(row)? = Some(column);
        let (of_left, of_right) = (left.get_mut(row)?, right.get_mut(row)?);
        let scale = T::ONE / *of_left.get(column)?;
        of_left.iter_mut().chain(of_right.iter_mut()).for_each(|entry| *entry = *entry * scale);
        let (of_left, of_right) = (*of_left, *of_right);
        for (other, (entries, results)) in left.iter_mut().zip(&mut right).enumerate() {
            let factor = *entries.get(column)?;
            if other != row {
                reduce(entries, &of_left, factor);
                reduce(results, &of_right, factor);
            }
        }
    }
    let mut solution = right;
    for (column, row) in columns.iter().zip(&right) {
        *solution.get_mut((*column)?)? = *row;
    }
    Some(solution)
}

#[inline]
fn reduce<T: Number, const C: usize>(row: &mut [T; C], pivot: &[T; C], factor: T) {
    for (entry, of_pivot) in row.iter_mut().zip(pivot) {
        *entry = *entry - factor * *of_pivot;
    }
}

pub(super) fn wide<const R: usize, const C: usize>(matrix: &Grid<f32, R, C>) -> Grid<Wide, R, C> {
    matrix.map(|row| row.map(Wide::of))
}

/// Rounds to `f32`. `None` if an entry is not finite.
pub(super) fn narrow<const R: usize, const C: usize>(
    matrix: &Grid<Wide, R, C>,
) -> Option<Grid<f32, R, C>> {
    let result = matrix.map(|row| row.map(Wide::narrow));
    is_finite(&result).then_some(result)
}

pub(super) fn is_finite<T: Number, const R: usize, const C: usize>(matrix: &Grid<T, R, C>) -> bool {
    matrix.iter().flatten().all(|entry| entry.size().is_finite())
}

/// Refuses a matrix with an entry that is NaN or infinite.
pub(super) fn finite<const R: usize, const C: usize>(
    parameter: &'static str,
    matrix: &Grid<f32, R, C>,
) -> Result<(), ConfigError> {
    if is_finite(matrix) { Ok(()) } else { Err(ConfigError::NotFinite(parameter)) }
}

/// Change of a symmetric matrix by rounding to `f32`, as a share of its largest entry.
const ROUNDING: f32 = 1e-6;

/// Refuses a matrix that is not symmetric, or that has a negative eigenvalue beyond rounding.
pub(super) fn not_negative<const N: usize>(
    parameter: &'static str,
    matrix: &Grid<f32, N, N>,
) -> Result<(), ConfigError> {
    let size = symmetric_size(parameter, matrix)?;
    let shift = Wide::of(size) * ROUNDING;
    // Without a single entry there is no pivot either.
    if size == 0.0 || has_positive_pivots(&with_diagonal(wide(matrix), shift)) {
        Ok(())
    } else {
        Err(ConfigError::Negative(parameter))
    }
}

/// Refuses a matrix that is not symmetric, or that has an eigenvalue of zero or less.
pub(super) fn positive<const N: usize>(
    parameter: &'static str,
    matrix: &Grid<f32, N, N>,
) -> Result<(), ConfigError> {
    symmetric_size(parameter, matrix)?;
    let is_positive = has_positive_pivots(&wide(matrix));
    if is_positive { Ok(()) } else { Err(ConfigError::NotPositive(parameter)) }
}

fn symmetric_size<const N: usize>(
    parameter: &'static str,
    matrix: &Grid<f32, N, N>,
) -> Result<f32, ConfigError> {
    finite(parameter, matrix)?;
    let size = largest(matrix);
    let skew = largest(&difference(matrix, &transposed(matrix)));
    if skew <= ROUNDING * size { Ok(size) } else { Err(ConfigError::Unusable(parameter)) }
}

/// Whether a symmetric matrix is positive definite: elimination without exchange then has positive pivots.
fn has_positive_pivots<const N: usize>(matrix: &Grid<Wide, N, N>) -> bool {
    let mut rows = *matrix;
    for column in 0..N {
        let Some(pivot) = rows.get(column).copied() else { return false };
        let Some(divisor) = pivot.get(column).copied() else { return false };
        if divisor.narrow() <= 0.0 || !divisor.narrow().is_finite() {
            return false;
        }
        for row in rows.iter_mut().skip(column + 1) {
            let Some(entry) = row.get(column).copied() else { return false };
            reduce(row, &pivot, entry / divisor);
        }
    }
    true
}
