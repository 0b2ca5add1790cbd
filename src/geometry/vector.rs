//! Vectors and points.

use crate::math::sqrt;
use core::marker::PhantomData;

/// Two numbers along x and y, of any unit and any frame.
///
/// # Examples
/// ```
/// use drivetrain::geometry::Vec2;
///
/// let forward = Vec2::new(3.0, 0.0);
/// let left = Vec2::new(0.0, 4.0);
/// assert_eq!((forward + left).norm(), 5.0);
/// assert_eq!(forward.cross(left), 12.0); // left is counter-clockwise of forward
/// ```
#[derive(Debug, Default, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Vec2 {
    /// Along x: forward is positive.
    pub x: f32,
    /// Along y: left is positive.
    pub y: f32,
}

/// Three numbers along x, y and z, of any unit and any frame.
///
/// # Examples
/// ```
/// use drivetrain::geometry::Vec3;
///
/// let forward = Vec3::new(1.0, 0.0, 0.0);
/// let left = Vec3::new(0.0, 1.0, 0.0);
/// assert_eq!(forward.cross(left), Vec3::new(0.0, 0.0, 1.0)); // up
/// ```
#[derive(Debug, Default, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Vec3 {
    /// Along x: forward is positive.
    pub x: f32,
    /// Along y: left is positive.
    pub y: f32,
    /// Along z: up is positive.
    pub z: f32,
}

impl Vec2 {
    /// The zero vector.
    pub const ZERO: Self = Self::new(0.0, 0.0);

    /// Takes the parts along x (forward) and y (left).
    #[must_use]
    pub const fn new(x: f32, y: f32) -> Self {
        Self { x, y }
    }

    /// Returns the scalar product.
    #[must_use]
    pub const fn dot(self, other: Self) -> f32 {
        self.x * other.x + self.y * other.y
    }

    /// Returns the z part of the vector product: positive when `other` is counter-clockwise of `self`.
    #[must_use]
    pub const fn cross(self, other: Self) -> f32 {
        self.x * other.y - self.y * other.x
    }

    /// Returns the length.
    #[must_use]
    pub fn norm(self) -> f32 {
        sqrt(self.dot(self))
    }

    /// Returns whether neither part is NaN or infinite.
    #[must_use]
    pub const fn is_finite(self) -> bool {
        self.x.is_finite() && self.y.is_finite()
    }
}

impl Vec3 {
    /// The zero vector.
    pub const ZERO: Self = Self::new(0.0, 0.0, 0.0);

    /// Takes the parts along x (forward), y (left) and z (up).
    #[must_use]
    pub const fn new(x: f32, y: f32, z: f32) -> Self {
        Self { x, y, z }
    }

    /// Returns the scalar product.
    #[must_use]
    pub const fn dot(self, other: Self) -> f32 {
        self.x * other.x + self.y * other.y + self.z * other.z
    }

    /// Returns the vector product: perpendicular to both, by the right hand.
    #[must_use]
    pub const fn cross(self, other: Self) -> Self {
        Self::new(
            self.y * other.z - self.z * other.y,
            self.z * other.x - self.x * other.z,
            self.x * other.y - self.y * other.x,
        )
    }

    /// Returns the length.
    #[must_use]
    pub fn norm(self) -> f32 {
        sqrt(self.dot(self))
    }

    /// Returns whether no part is NaN or infinite.
    #[must_use]
    pub const fn is_finite(self) -> bool {
        self.x.is_finite() && self.y.is_finite() && self.z.is_finite()
    }
}

/// Gives a struct of `f32` parts, and perhaps a frame, its linear arithmetic part by part.
macro_rules! linear {
    ($name:ident $(<$frame:ident>)?, $($part:ident),+ $(; $marker:ident)?) => {
        impl $(<$frame>)? core::ops::Add for $name $(<$frame>)? {
            type Output = Self;
            fn add(self, other: Self) -> Self {
                Self { $($part: self.$part + other.$part,)+ $($marker: self.$marker)? }
            }
        }

        impl $(<$frame>)? core::ops::Sub for $name $(<$frame>)? {
            type Output = Self;
            fn sub(self, other: Self) -> Self {
                Self { $($part: self.$part - other.$part,)+ $($marker: self.$marker)? }
            }
        }

        impl $(<$frame>)? core::ops::Neg for $name $(<$frame>)? {
            type Output = Self;
            fn neg(self) -> Self {
                Self { $($part: -self.$part,)+ $($marker: self.$marker)? }
            }
        }

        impl $(<$frame>)? core::ops::Mul<f32> for $name $(<$frame>)? {
            type Output = Self;
            fn mul(self, factor: f32) -> Self {
                Self { $($part: self.$part * factor,)+ $($marker: self.$marker)? }
            }
        }
    };
}
pub(super) use linear;

/// Makes a value copyable for all frames: these are names only.
macro_rules! copy {
    ($name:ident <$($frame:ident),+>) => {
        impl<$($frame),+> Clone for $name<$($frame),+> {
            fn clone(&self) -> Self {
                *self
            }
        }

        impl<$($frame),+> Copy for $name<$($frame),+> {}
    };
}
pub(super) use copy;

linear!(Vec2, x, y);
linear!(Vec3, x, y, z);

/// A place in the plane, in the frame `F`, in m.
///
/// # Examples
/// ```
/// use drivetrain::geometry::{Body, Point2};
///
/// let front_left = Point2::<Body>::new(0.2, 0.18);
/// assert_eq!(front_left.y_m, 0.18); // to the left
/// ```
#[derive(Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(bound = ""))]
pub struct Point2<F> {
    /// Along x in m: forward is positive.
    pub x_m: f32,
    /// Along y in m: left is positive.
    pub y_m: f32,
    #[cfg_attr(feature = "serde", serde(skip))]
    frame: PhantomData<F>,
}

/// A place in space, in the frame `F`, in m.
///
/// # Examples
/// ```
/// use drivetrain::geometry::{Body, Point3};
///
/// let camera = Point3::<Body>::new(0.1, 0.0, 0.35);
/// assert_eq!(camera.z_m, 0.35); // above the origin
/// ```
#[derive(Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(bound = ""))]
pub struct Point3<F> {
    /// Along x in m: forward is positive.
    pub x_m: f32,
    /// Along y in m: left is positive.
    pub y_m: f32,
    /// Along z in m: up is positive.
    pub z_m: f32,
    #[cfg_attr(feature = "serde", serde(skip))]
    frame: PhantomData<F>,
}

copy!(Point2<F>);
copy!(Point3<F>);
linear!(Point2<F>, x_m, y_m; frame);
linear!(Point3<F>, x_m, y_m, z_m; frame);

impl<F> Point2<F> {
    /// The origin of the frame.
    pub const ORIGIN: Self = Self::new(0.0, 0.0);

    /// Takes the coordinates along x (forward) and y (left) in m.
    #[must_use]
    pub const fn new(x_m: f32, y_m: f32) -> Self {
        Self { x_m, y_m, frame: PhantomData }
    }

    /// Returns the coordinates without the frame, in m.
    #[must_use]
    pub const fn to_vec(self) -> Vec2 {
        Vec2::new(self.x_m, self.y_m)
    }

    /// Names the frame of a plain vector, in m.
    #[must_use]
    pub const fn from_vec(vector: Vec2) -> Self {
        Self::new(vector.x, vector.y)
    }
}

impl<F> Point3<F> {
    /// The origin of the frame.
    pub const ORIGIN: Self = Self::new(0.0, 0.0, 0.0);

    /// Takes the coordinates along x (forward), y (left) and z (up) in m.
    #[must_use]
    pub const fn new(x_m: f32, y_m: f32, z_m: f32) -> Self {
        Self { x_m, y_m, z_m, frame: PhantomData }
    }

    /// Returns the coordinates without the frame, in m.
    #[must_use]
    pub const fn to_vec(self) -> Vec3 {
        Vec3::new(self.x_m, self.y_m, self.z_m)
    }

    /// Names the frame of a plain vector, in m.
    #[must_use]
    pub const fn from_vec(vector: Vec3) -> Self {
        Self::new(vector.x, vector.y, vector.z)
    }
}

impl<F> Default for Point2<F> {
    fn default() -> Self {
        Self::ORIGIN
    }
}

impl<F> Default for Point3<F> {
    fn default() -> Self {
        Self::ORIGIN
    }
}

/// Conversions to and from the types of `mint`.
#[cfg(feature = "mint")]
macro_rules! conversions {
    ($([$($frame:ident)?] $ours:ty, $theirs:ty: $($field:ident = $part:ident)+;)+) => {$(
        impl$(<$frame>)? From<$theirs> for $ours {
            fn from(theirs: $theirs) -> Self {
                Self::new($(theirs.$part),+)
            }
        }

        impl$(<$frame>)? From<$ours> for $theirs {
            fn from(ours: $ours) -> Self {
                Self { $($part: ours.$field),+ }
            }
        }
    )+};
}

#[cfg(feature = "mint")]
conversions! {
    [] Vec2, mint::Vector2<f32>: x = x y = y;
    [] Vec3, mint::Vector3<f32>: x = x y = y z = z;
    [F] Point2<F>, mint::Point2<f32>: x_m = x y_m = y;
    [F] Point3<F>, mint::Point3<f32>: x_m = x y_m = y z_m = z;
}
