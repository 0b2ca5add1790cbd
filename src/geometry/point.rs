use super::vector::{copy, linear};
use super::{Vec2, Vec3};
use core::marker::PhantomData;

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
