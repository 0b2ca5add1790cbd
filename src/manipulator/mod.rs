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

mod serial_arm;

pub use serial_arm::SerialArm;

use crate::error::ConfigError;
use crate::geometry::Vec3;

/// The longest distance from the origin in m, and the largest mass in kg, of a part.
const MOST: f32 = 1_000.0;

/// A joint of a serial arm with its link, in the base frame in the zero pose.
///
/// Without [`with_mass`](Self::with_mass) the link weighs nothing.
///
/// # Examples
/// ```
/// use drivetrain::error::ConfigError;
/// use drivetrain::geometry::Vec3;
/// use drivetrain::manipulator::ArmJoint;
///
/// // A tube of 0.6 kg, and the motor of the next joint at its end.
/// let shoulder = ArmJoint::revolute(Vec3::new(0.0, -1.0, 0.0), Vec3::ZERO)?
///     .with_mass(0.6, Vec3::new(0.125, 0.0, 0.0))?
///     .with_mass(0.3, Vec3::new(0.25, 0.0, 0.0))?;
/// assert!((shoulder.mass_kg() - 0.9).abs() < 1e-6);
/// assert_eq!(ArmJoint::prismatic(Vec3::ZERO), Err(ConfigError::NotPositive("length of the axis")));
/// # Ok::<(), ConfigError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ArmJoint {
    /// Of length 1.
    axis: Vec3,
    motion: JointMotion,
    load: Load,
}

/// How a joint moves.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
enum JointMotion {
    /// About the axis through this place.
    Turns(Vec3),
    Slides,
}

/// Masses as one: the sum, and the sum of mass times place, in kg and kg m.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
struct Load {
    mass: f32,
    moment: Vec3,
}

impl ArmJoint {
    /// Takes a rotary joint: its axis, of any length above 1e-6, and a place on the axis in m.
    ///
    /// Any place on the axis will do.
    ///
    /// # Errors
    /// [`ConfigError`] if a number is NaN or infinite, the axis has no length, or the place is farther than 1000 m.
    pub fn revolute(axis: Vec3, through_m: Vec3) -> Result<Self, ConfigError> {
        place("through_m", through_m)?;
        Self::new(axis, JointMotion::Turns(through_m))
    }

    /// Takes a prismatic joint: its axis, of any length above 1e-6.
    ///
    /// # Errors
    /// [`ConfigError`] if a number is NaN or infinite, or the axis has no length.
    pub fn prismatic(axis: Vec3) -> Result<Self, ConfigError> {
        Self::new(axis, JointMotion::Slides)
    }

    /// Adds a mass in kg to the link between this joint and the next, with its centre of mass in m.
    ///
    /// A link of several parts takes one call for each.
    ///
    /// # Errors
    /// [`ConfigError`] if the mass is negative or above 1000 kg, or the centre farther than 1000 m; NaN is neither.
    pub fn with_mass(self, mass_kg: f32, centre_m: Vec3) -> Result<Self, ConfigError> {
        Ok(Self { load: self.load.plus(Load::new(mass_kg, centre_m)?), ..self })
    }

    /// Returns the mass of the link in kg.
    #[must_use]
    pub const fn mass_kg(&self) -> f32 {
        self.load.mass
    }

    fn new(axis: Vec3, motion: JointMotion) -> Result<Self, ConfigError> {
        const LEAST: f32 = 1e-6;
        if !axis.is_finite() {
            return Err(ConfigError::NotFinite("axis"));
        }
        // Squares of large numbers would overflow.
        let size = axis.x.abs().max(axis.y.abs()).max(axis.z.abs());
        if size < LEAST {
            return Err(ConfigError::NotPositive("length of the axis"));
        }
        let [x, y, z] = [axis.x, axis.y, axis.z].map(|part| part / size);
        let scaled = Vec3::new(x, y, z);
        Ok(Self { axis: scaled * (1.0 / scaled.norm()), motion, load: Load::NONE })
    }
}

impl Load {
    const NONE: Self = Self { mass: 0.0, moment: Vec3::ZERO };

    fn new(mass_kg: f32, centre_m: Vec3) -> Result<Self, ConfigError> {
        ConfigError::check_range("mass_kg", mass_kg, 0.0, MOST)?;
        place("centre_m", centre_m)?;
        Ok(Self { mass: mass_kg, moment: centre_m * mass_kg })
    }

    fn plus(self, other: Self) -> Self {
        Self { mass: self.mass + other.mass, moment: self.moment + other.moment }
    }
}

fn place(parameter: &'static str, place: Vec3) -> Result<(), ConfigError> {
    ConfigError::check_range(parameter, place.x, -MOST, MOST)?;
    ConfigError::check_range(parameter, place.y, -MOST, MOST)?;
    ConfigError::check_range(parameter, place.z, -MOST, MOST)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::string::ToString;

    const UP: Vec3 = Vec3::new(0.0, 0.0, 1.0);
    const NAN: Vec3 = Vec3::new(0.0, f32::NAN, 0.0);
    const FAR: Vec3 = Vec3::new(0.0, 0.0, -1_001.0);

    #[test]
    fn an_axis_without_length_or_of_no_number_is_refused() {
        let short = Vec3::new(1e-7, 0.0, -1e-7);
        let endless = Vec3::new(f32::INFINITY, 0.0, 0.0);
        for (axis, error) in [
            (Vec3::ZERO, ConfigError::NotPositive("length of the axis")),
            (short, ConfigError::NotPositive("length of the axis")),
            (NAN, ConfigError::NotFinite("axis")),
            (endless, ConfigError::NotFinite("axis")),
        ] {
            assert_eq!(ArmJoint::revolute(axis, Vec3::ZERO), Err(error));
            assert_eq!(ArmJoint::prismatic(axis), Err(error));
        }
    }

    #[test]
    fn an_axis_of_any_length_counts_as_one_of_length_1() {
        for length in [1e-5, 0.3, 1.0, 40.0, 1e30] {
            let joint = ArmJoint::prismatic(Vec3::new(3.0, 0.0, -4.0) * (0.2 * length)).unwrap();
            assert!((joint.axis - Vec3::new(0.6, 0.0, -0.8)).norm() < 2e-7, "{joint:?}");
        }
    }

    #[test]
    fn a_mass_or_a_place_beyond_its_range_is_named_with_its_value() {
        let joint = ArmJoint::prismatic(UP).unwrap();
        for mass in [-0.1, 1_000.5, f32::NAN, f32::INFINITY] {
            let error = joint.with_mass(mass, Vec3::ZERO).unwrap_err();
            assert_eq!(error.to_string(), std::format!("mass_kg {mass}: 0 to 1000 are allowed"));
        }
        for centre in [NAN, FAR] {
            assert_eq!(joint.with_mass(1.0, centre).unwrap_err().parameter(), "centre_m");
            assert_eq!(ArmJoint::revolute(UP, centre).unwrap_err().parameter(), "through_m");
        }
    }
}
