//! Arms of several joints: the effort that holds their weight.
//!
//! ```text
//!        z                        elbow: axis -y through (0.25, 0, 0)
//!        ^    shoulder: axis -y    |
//!        |    through (0, 0, 0)    v          x
//!  base  o=========================o==========>
//!        | axis z                      the zero pose: all positions are 0
//! ```
//!
//! An arm is data: for each joint, from the base outward, its axis and the moved masses, all measured in the **base frame**
//! in the **zero pose**. No frame of a link is needed, nor an order of rotations (the screw axes of a product of exponentials). The
//! axes x, y, z are those of [`geometry`](crate::geometry): z points up if the base stands upright.
//!
//! | item | meaning |
//! |---|---|
//! | [`ArmJoint`] | an axis to turn about, or to slide along, and the masses between this joint and the next |
//! | [`SerialArm`] | the joints, a payload and the direction of gravity; from positions to efforts |
//!
//! # Signs and units
//! The position of a rotary joint is an angle in rad, positive counter-clockwise about its axis (right hand); of a prismatic joint,
//! a way in m, positive along its axis. Efforts are in Nm and N with the same signs: the effort is that of the **motor**, so a positive effort pushes the position upward. An encoder with another zero or sense is converted by the caller.
//!
//! # Example
//! The arm of the drawing lifts with positive angles. Level and stretched, the shoulder carries both links:
//!
//! ```
//! use drivetrain::geometry::Vec3;
//! use drivetrain::manipulator::{ArmJoint, SerialArm};
//!
//! let (up, lifting) = (Vec3::new(0.0, 0.0, 1.0), Vec3::new(0.0, -1.0, 0.0));
//! let along = |x_m| Vec3::new(x_m, 0.0, 0.0);
//! let arm = SerialArm::new([
//!     ArmJoint::revolute(up, Vec3::ZERO)?,
//!     ArmJoint::revolute(lifting, Vec3::ZERO)?.with_mass(0.6, along(0.125))?,
//!     ArmJoint::revolute(lifting, along(0.25))?.with_mass(0.4, along(0.35))?,
//! ]);
//! let [base, shoulder, elbow] = arm.holding_efforts(&[0.3, 0.0, 0.0]).ok_or("a position is unknown")?;
//! assert_eq!(base, 0.0);
//! assert!((shoulder - 9.81 * (0.6 * 0.125 + 0.4 * 0.35)).abs() < 1e-6);
//! assert!((elbow - 9.81 * 0.4 * 0.10).abs() < 1e-6);
//! # Ok::<(), Box<dyn core::error::Error>>(())
//! ```
//!
//! # Limits
//! Joints follow each other: a closed chain (a parallelogram, a belt from a motor in the base) is not a serial arm. Inertia, friction
//! and springs are not in the effort. The example `arm` drives one; `judges/README.md` has the comparison with `MuJoCo`.
//!
//! Reference: Lynch and Park, *Modern Robotics*, 4.1 (product of exponentials) and 8.3 (Newton and Euler, at rest).

mod joint;
mod serial_arm;

pub use joint::ArmJoint;
pub use serial_arm::SerialArm;
