/// Why a geometry describes no chassis that can be driven.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum GeometryError {
    /// The named length must be above zero and finite.
    NotPositive(&'static str),
    /// The named value must be finite.
    NotFinite(&'static str),
    /// The wheels leave a direction of motion undetermined: the named one, or several.
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
    if length > 0.0 && length < f32::INFINITY {
        Ok(length)
    } else {
        Err(GeometryError::NotPositive(name))
    }
}
