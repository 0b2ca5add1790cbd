//! Vectors, rotations, transforms and twists with their frame in the type, so frames cannot be mixed up.
//!
//! ```text
//!                x  forward
//!                ^
//!   front left   |   front right        z points up, out of the page
//!        [ ]-----+-----[ ]              counter-clockwise is positive,
//!         |      |      |               seen from above
//!  y <----+------o      |
//!  left   |             |               units: m, s, rad
//!        [ ]-----------[ ]
//!   rear left        rear right
//! ```
//!
//! These axes hold for the whole crate: the body frame of a chassis, and any other frame that carries a name.
//!
//! | item | meaning |
//! |---|---|
//! | [`Vec2`], [`Vec3`] | plain numbers along the axes, without a frame |
//! | [`Point2`], [`Point3`] | a place in a frame |
//! | [`Rotation2`], [`Heading`] | a turn in the plane; a heading keeps the angle too |
//! | [`Rotation3`] | a turn in space: unit quaternion, from and to roll, pitch and yaw |
//! | [`Transform2`], [`Transform3`] | where one frame stands in another |
//! | [`Pose2`] | position and direction in a frame of the plane; in space, a [`Transform3`] |
//! | [`Twist`] | a velocity in the plane; [`Transform2::exp`] is the way it makes in a time |
//! | [`Body`], [`World`], [`Gimbal`] | names of frames |
//!
//! A frame of your own is any type: `#[derive(Debug, PartialEq)] enum Camera {}`. The names cost nothing at run time.
//! The types do not distinguish two robots whose frames have the same name, nor numbers of the wrong unit.
//!
//! With the feature `mint`, vectors, points and rotations convert to and from those of `glam`, `nalgebra` and others:
//!
#![cfg_attr(feature = "mint", doc = "```")]
#![cfg_attr(not(feature = "mint"), doc = "```ignore")]
//! use drivetrain::geometry::{Body, Point3, Vec2};
//!
//! let point = Point3::<Body>::new(0.1, 0.0, 0.35);
//! let theirs: glam::Vec3 = mint::Point3::<f32>::from(point).into();
//! assert_eq!(theirs.z, 0.35);
//! let way = Vec2::from(mint::Vector2::from(glam::Vec2::new(3.0, 4.0)));
//! assert_eq!(way.norm(), 5.0);
//! ```
//!
//! The types catch a twist of the wrong frame:
//!
//! ```compile_fail
//! use drivetrain::geometry::{Body, Twist, World};
//!
//! let sum = Twist::<Body>::new(1.0, 0.0, 0.0) + Twist::<World>::new(1.0, 0.0, 0.0);
//! ```

mod rotation2;
mod rotation3;
mod transform2;
mod transform3;
mod twist;
mod vector;

pub use rotation2::{Heading, Rotation2};
pub use rotation3::{Attitude, AttitudeSource, Rotation3};
pub use transform2::{Pose2, Transform2};
pub use transform3::Transform3;
pub use twist::Twist;
pub use vector::{Point2, Point3, Vec2, Vec3};

use crate::error::ConfigError;
use crate::math::sqrt;

/// The frame of the chassis: x forward, y left, origin at the origin of the kinematics (the centre of the wheels).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Body {}

/// The frame of the floor: fixed, with its origin and x axis where the heading was zeroed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum World {}

/// The frame of the driver's view: x in the direction of the gimbal, turned against the chassis by its yaw.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Gimbal {}

/// How far lengths and right angles of a matrix from outside may be off.
const TOLERANCE: f32 = 1e-3;

/// A unit vector may be this far off in its squared length and still be taken bit by bit: rounding of `f32`.
#[cfg(feature = "serde")]
const ROUNDING: f32 = 1e-6;

#[cfg(feature = "serde")]
fn is_unit(square: f32) -> bool {
    (square - 1.0).abs() <= ROUNDING
}

/// Returns the factor that brings the vector of a rotation to length 1, from the square of its length.
fn unit_scale(square: f32) -> Result<f32, ConfigError> {
    if !(1e-12..=1e12).contains(&square) {
        return Err(ConfigError::Unusable("quaternion"));
    }
    Ok(1.0 / sqrt(square))
}
