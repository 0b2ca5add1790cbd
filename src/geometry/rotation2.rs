//! Rotations in the plane, and headings.

use super::Vec2;
#[cfg(feature = "serde")]
use super::{is_unit, unit_scale};
#[cfg(feature = "serde")]
use crate::error::ConfigError;
use crate::math::{atan2, sin_cos};
use crate::units::Angle;

/// A turn in the plane, kept as a unit vector (cosine, sine): applying it needs no trigonometry.
///
/// Counter-clockwise is positive. Every composition rounds: after 10^6 of them the vector's length is up to 10 % off and
/// its angle up to 1e-3 rad. [`normalized`](Self::normalized), once in a thousand, keeps the length to 2e-7. A value read
/// with `serde` is brought back to length 1; a value without a length is refused.
///
/// # Examples
/// ```
/// use drivetrain::{geometry::{Rotation2, Vec2}, units::Angle};
///
/// let quarter = Rotation2::new(Angle::from_degrees(90.0));
/// let turned = quarter.apply(Vec2::new(1.0, 0.0));
/// assert!(turned.x.abs() < 1e-6 && (turned.y - 1.0).abs() < 1e-6);
/// assert!((quarter.compose(quarter).angle().as_degrees().abs() - 180.0).abs() < 1e-4);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(try_from = "StoredRotation2"))]
pub struct Rotation2 {
    cos: f32,
    sin: f32,
}

impl Rotation2 {
    /// No turn.
    pub const IDENTITY: Self = Self { cos: 1.0, sin: 0.0 };

    /// Takes an angle; NaN and infinity give a rotation of NaN.
    #[must_use]
    pub const fn new(angle: Angle) -> Self {
        let (sin, cos) = sin_cos(angle.as_radians());
        Self { cos, sin }
    }

    pub(super) const fn from_parts(cos: f32, sin: f32) -> Self {
        Self { cos, sin }
    }

    /// Returns the cosine.
    #[must_use]
    pub const fn cos(self) -> f32 {
        self.cos
    }

    /// Returns the sine.
    #[must_use]
    pub const fn sin(self) -> f32 {
        self.sin
    }

    /// Returns the angle, in -π..=π.
    #[must_use]
    pub fn angle(self) -> Angle {
        Angle::from_radians(angle_of(self.sin, self.cos))
    }

    /// Turns a vector.
    #[must_use]
    pub const fn apply(self, vector: Vec2) -> Vec2 {
        Vec2::new(
            self.cos * vector.x - self.sin * vector.y,
            self.sin * vector.x + self.cos * vector.y,
        )
    }

    /// Returns the turn by `first`, then by `self`; the order does not matter in the plane.
    #[must_use]
    pub const fn compose(self, first: Self) -> Self {
        Self {
            cos: self.cos * first.cos - self.sin * first.sin,
            sin: self.sin * first.cos + self.cos * first.sin,
        }
    }

    /// Returns the turn back.
    #[must_use]
    pub const fn inverse(self) -> Self {
        Self { cos: self.cos, sin: -self.sin }
    }

    /// Returns the same turn with its vector brought back to length 1, for lengths within 10 % of 1.
    #[must_use]
    pub const fn normalized(self) -> Self {
        // One Newton step of 1/sqrt at 1: an error e of the length becomes 1.5 e^2.
        let scale = 1.5 - 0.5 * (self.cos * self.cos + self.sin * self.sin);
        Self { cos: self.cos * scale, sin: self.sin * scale }
    }

    /// Returns the turn at the fraction `t` of the shorter way from `self` to `other`.
    ///
    /// `t` = 0 gives `self`, 1 gives `other`; values outside continue in the same direction.
    #[must_use]
    pub fn interpolate(self, other: Self, t: f32) -> Self {
        let step = self.inverse().compose(other).angle() * t;
        self.compose(Self::new(step))
    }
}

/// The arc tangent as exact as `f32` allows, also where [`atan2`] was traded for speed.
pub(super) fn angle_of(sin: f32, cos: f32) -> f32 {
    let angle = atan2(sin, cos);
    if cfg!(feature = "micromath") {
        let (s, c) = sin_cos(angle);
        let along = cos * c + sin * s;
        if along > 0.0 {
            return angle + (sin * c - cos * s) / along;
        }
    }
    angle
}

/// The direction of the chassis in the world, with its sine and cosine at hand.
///
/// Make it once a tick from the gyroscope's yaw: every conversion of that tick then costs four products. The angle may
/// have any number of turns. With `serde`, only the angle is stored.
///
/// # Examples
/// ```
/// use drivetrain::{geometry::Heading, units::Angle};
///
/// const LEFT: Heading = Heading::new(Angle::from_degrees(90.0));
/// assert_eq!(LEFT.angle().as_degrees(), 90.0);
/// assert!((LEFT.rotation().sin() - 1.0).abs() < 1e-6);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(from = "Angle", into = "Angle"))]
pub struct Heading {
    angle: Angle,
    rotation: Rotation2,
}

impl Heading {
    /// Facing along the x axis of the world.
    pub const ZERO: Self = Self { angle: Angle::ZERO, rotation: Rotation2::IDENTITY };

    /// Takes the angle from the x axis of the world to that of the body, counter-clockwise positive.
    #[must_use]
    pub const fn new(angle: Angle) -> Self {
        Self { angle, rotation: Rotation2::new(angle) }
    }

    /// Returns the angle as given.
    #[must_use]
    pub const fn angle(self) -> Angle {
        self.angle
    }

    /// Returns the turn from the x axis of the world to that of the body.
    #[must_use]
    pub const fn rotation(self) -> Rotation2 {
        self.rotation
    }

    /// Returns whether the angle is neither NaN nor infinite.
    #[must_use]
    pub const fn is_finite(self) -> bool {
        self.angle.is_finite()
    }
}

impl From<Angle> for Heading {
    fn from(angle: Angle) -> Self {
        Self::new(angle)
    }
}

impl From<Heading> for Angle {
    fn from(heading: Heading) -> Self {
        heading.angle()
    }
}

impl Default for Heading {
    fn default() -> Self {
        Self::ZERO
    }
}

impl Default for Rotation2 {
    fn default() -> Self {
        Self::IDENTITY
    }
}

/// The form in a file; reading checks it, or brings it into form.
#[cfg(feature = "serde")]
#[derive(serde::Deserialize)]
#[serde(rename = "Rotation2")]
struct StoredRotation2 {
    cos: f32,
    sin: f32,
}

#[cfg(feature = "serde")]
impl TryFrom<StoredRotation2> for Rotation2 {
    type Error = ConfigError;

    /// Takes a vector of any length but zero.
    fn try_from(StoredRotation2 { cos, sin }: StoredRotation2) -> Result<Self, ConfigError> {
        let vector = Vec2::new(cos, sin);
        let square = vector.dot(vector);
        if is_unit(square) {
            return Ok(Self::from_parts(cos, sin));
        }
        if !vector.is_finite() {
            return Err(ConfigError::NotFinite("quaternion"));
        }
        let scale = unit_scale(square)?;
        Ok(Self::from_parts(cos * scale, sin * scale))
    }
}
