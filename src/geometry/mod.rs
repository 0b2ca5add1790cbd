//! Vectors, rotations, transforms and twists that cannot be mixed up: the frame is part of the type.
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
//! | item | what it is |
//! |---|---|
//! | [`Vec2`], [`Vec3`] | plain numbers along the axes, without a frame |
//! | [`Rotation2`], [`Heading`] | a turn in the plane; a heading keeps the angle too |
//! | [`Twist`] | a velocity in the plane: two of translation, one of rotation |
//! | [`Body`], [`World`], [`Gimbal`] | names of frames |
//!
//! The types catch a twist of the wrong frame:
//!
//! ```compile_fail
//! use drivetrain::geometry::{Body, Twist, World};
//!
//! let sum = Twist::<Body>::new(1.0, 0.0, 0.0) + Twist::<World>::new(1.0, 0.0, 0.0);
//! ```

mod frame;
mod rotation2;
mod twist;
mod vector;

pub use frame::{Body, Gimbal, World};
pub use rotation2::{Heading, Rotation2};
pub use twist::Twist;
pub use vector::{Vec2, Vec3};
