/// Why a geometry describes no chassis that can be driven.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum GeometryError {
    /// The named length must be above zero and finite.
    NotPositive(&'static str),
    /// The named value must be finite.
    NotFinite(&'static str),
    /// The wheels leave a direction of motion undetermined, or nearly: the named one, or several.
    ///
    /// That is when the condition number of their normal equations is above 1000: a motion then shows in the wheels with
    /// less than about 3 % of the strongest. A turn counts in m, at the mean distance of the wheels from the origin.
    Singular(&'static str),
}

impl core::fmt::Display for GeometryError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::NotPositive(name) => write!(f, "{name} must be above zero and finite"),
            Self::NotFinite(name) => write!(f, "{name} must be finite"),
            Self::Singular(what) => write!(f, "the wheels do not determine {what}"),
        }
    }
}

impl core::error::Error for GeometryError {}

/// Lets a length pass that is above zero and finite.
pub(super) const fn positive(length: f32, name: &'static str) -> Result<f32, GeometryError> {
    // Of a smaller one the reciprocal is not finite.
    if length >= f32::MIN_POSITIVE && length < f32::INFINITY {
        Ok(length)
    } else {
        Err(GeometryError::NotPositive(name))
    }
}
