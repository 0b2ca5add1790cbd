/// Why numbers from outside are no rotation or no transform.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum MatrixError {
    /// A number is NaN or infinite.
    NotFinite,
    /// The rows are not perpendicular, not of length 1 (to 1e-3), or mirrored; or the quaternion has no length.
    NotRotation,
    /// The last row of the homogeneous matrix is not 0, .., 0, 1.
    NotHomogeneous,
}

impl core::fmt::Display for MatrixError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Self::NotFinite => "a number is NaN or infinite",
            Self::NotRotation => "not a rotation: the rows are skewed, scaled or mirrored",
            Self::NotHomogeneous => "the last row is not 0, .., 0, 1",
        })
    }
}

impl core::error::Error for MatrixError {}

/// How far lengths and right angles of a matrix from outside may be off.
pub(super) const TOLERANCE: f32 = 1e-3;
