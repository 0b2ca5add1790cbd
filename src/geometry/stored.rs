//! The form of values with an invariant in a file, and their reading: checked, or brought into form.

use super::{Rotation2, Rotation3, Transform3, Vec2, Vec3};
use crate::error::ConfigError;

/// A unit vector may be this far off in its squared length and still be taken bit by bit: rounding of `f32`.
const ROUNDING: f32 = 1e-6;

#[derive(serde::Deserialize)]
#[serde(rename = "Rotation2")]
pub(super) struct StoredRotation2 {
    cos: f32,
    sin: f32,
}

impl TryFrom<StoredRotation2> for Rotation2 {
    type Error = ConfigError;

    /// Takes a vector of any length but zero.
    fn try_from(StoredRotation2 { cos, sin }: StoredRotation2) -> Result<Self, ConfigError> {
        let vector = Vec2::new(cos, sin);
        if is_unit(vector.dot(vector)) {
            return Ok(Self::from_parts(cos, sin));
        }
        // The turn about z is a turn in space.
        let [w, _, _, z] = Rotation3::from_quaternion(cos, 0.0, 0.0, sin)?.to_quaternion();
        Ok(Self::from_parts(w, z))
    }
}

#[derive(serde::Deserialize)]
#[serde(rename = "Rotation3")]
pub(super) struct StoredRotation3 {
    w: f32,
    vector: Vec3,
}

impl TryFrom<StoredRotation3> for Rotation3 {
    type Error = ConfigError;

    /// Takes a quaternion of any length but zero.
    fn try_from(StoredRotation3 { w, vector }: StoredRotation3) -> Result<Self, ConfigError> {
        if is_unit(w * w + vector.dot(vector)) {
            return Ok(Self::from_parts(w, vector));
        }
        Self::from_quaternion(w, vector.x, vector.y, vector.z)
    }
}

#[derive(serde::Deserialize)]
#[serde(rename = "Transform3")]
pub(super) struct StoredTransform3 {
    rows: [Vec3; 3],
    translation_m: Vec3,
}

impl<From, To> TryFrom<StoredTransform3> for Transform3<From, To> {
    type Error = ConfigError;

    fn try_from(stored: StoredTransform3) -> Result<Self, ConfigError> {
        let StoredTransform3 { rows, translation_m } = stored;
        Rotation3::check_rows(rows)?;
        Ok(Self::from_parts(rows, translation_m))
    }
}

fn is_unit(square: f32) -> bool {
    (square - 1.0).abs() <= ROUNDING
}
