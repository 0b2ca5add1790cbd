use super::vector::copy;
use super::{Heading, Point2, Rotation2, Transform2, Vec2};
use crate::math::wrap_pi;
use crate::units::Angle;
use core::marker::PhantomData;

/// A position and a direction in the plane, in the frame `F`: as reported by an odometry and read by a person.
///
/// # Examples
/// ```
/// use drivetrain::{geometry::{Body, Point2, Pose2, World}, units::Angle};
///
/// let robot = Pose2::<World>::new(1.0, 2.0, Angle::from_degrees(90.0));
/// let ahead = robot.to_transform::<Body>().apply(Point2::new(0.5, 0.0));
/// assert!((ahead.x_m - 1.0).abs() < 1e-6 && (ahead.y_m - 2.5).abs() < 1e-6);
/// ```
#[derive(Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(bound = ""))]
pub struct Pose2<F> {
    /// Position along x in m.
    pub x_m: f32,
    /// Position along y in m.
    pub y_m: f32,
    /// Direction of the body's x axis, counter-clockwise from the x axis of `F`.
    pub angle: Angle,
    #[cfg_attr(feature = "serde", serde(skip))]
    frame: PhantomData<F>,
}

copy!(Pose2<F>);

impl<F> Pose2<F> {
    /// At the origin, facing along x.
    pub const ORIGIN: Self = Self::new(0.0, 0.0, Angle::ZERO);

    /// Takes the position in m and the direction.
    #[must_use]
    pub const fn new(x_m: f32, y_m: f32, angle: Angle) -> Self {
        Self { x_m, y_m, angle, frame: PhantomData }
    }

    /// Takes an angle and a distance in m from the origin; the pose faces counter-clockwise round the origin there.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::{geometry::{Body, Pose2}, units::Angle};
    ///
    /// let left = Pose2::<Body>::tangential(Angle::from_degrees(90.0), 0.2);
    /// assert!((left.y_m - 0.2).abs() < 1e-6);
    /// assert_eq!(left.angle.as_degrees(), 180.0); // backward
    /// ```
    #[must_use]
    pub const fn tangential(angle: Angle, distance_m: f32) -> Self {
        let place = Rotation2::new(angle).apply(Vec2::new(distance_m, 0.0));
        let direction = Angle::from_radians(angle.as_radians() + core::f32::consts::FRAC_PI_2);
        Self::new(place.x, place.y, direction)
    }

    /// Returns the position.
    #[must_use]
    pub const fn position(self) -> Point2<F> {
        Point2::new(self.x_m, self.y_m)
    }

    /// Returns the direction with its sine and cosine.
    #[must_use]
    pub const fn heading(self) -> Heading {
        Heading::new(self.angle)
    }

    /// Returns the transform from the frame at this pose.
    #[must_use]
    pub const fn to_transform<Own>(self) -> Transform2<Own, F> {
        Transform2::new(Rotation2::new(self.angle), Vec2::new(self.x_m, self.y_m))
    }

    /// Returns this pose as seen from another of the same frame; its angle is in -π..=π.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::{geometry::{Body, Pose2, World}, units::Angle};
    ///
    /// let robot = Pose2::<World>::new(1.0, 1.0, Angle::from_degrees(90.0));
    /// let goal = Pose2::<World>::new(1.0, 3.0, Angle::from_degrees(180.0));
    /// let seen: Pose2<Body> = goal.relative_to(robot);
    /// assert!((seen.x_m - 2.0).abs() < 1e-6 && seen.y_m.abs() < 1e-6); // 2 m ahead
    /// assert!((seen.angle.as_degrees() - 90.0).abs() < 1e-4);
    /// ```
    #[must_use]
    pub const fn relative_to<Own>(self, base: Self) -> Pose2<Own> {
        let way = Vec2::new(self.x_m - base.x_m, self.y_m - base.y_m);
        let seen = base.heading().rotation().inverse().apply(way);
        let turn = wrap_pi(self.angle.as_radians() - base.angle.as_radians());
        Pose2::new(seen.x, seen.y, Angle::from_radians(turn))
    }
}

impl<F> Default for Pose2<F> {
    fn default() -> Self {
        Self::ORIGIN
    }
}
