use super::error::positive;
use super::{ChassisError, DifferentialWheels, Kinematics};
use crate::geometry::{Body, Twist};
use crate::units::AngularVelocity;

/// The dimensions of a chassis with a driven left and a driven right side: all in m, above zero.
///
/// # Examples
/// ```
/// use drivetrain::{chassis::{Differential, DifferentialGeometry}, geometry::Twist};
///
/// // Sides 0.5 m apart: half of it.
/// let geometry = DifferentialGeometry { wheel_radius_m: 0.1, half_track_m: 0.25 };
/// let turning = Differential::new(geometry)?.inverse(Twist::new(0.0, 0.0, 2.0));
/// assert!((turning.right.as_rad_per_s() - 0.25 * 2.0 / 0.1).abs() < 1e-5);
/// # Ok::<(), drivetrain::chassis::ChassisError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct DifferentialGeometry {
    /// Radius of the wheels.
    pub wheel_radius_m: f32,
    /// Half the distance from the left side to the right one. Tracks and skid steering act like wider ones: measure
    /// it by turning in place.
    pub half_track_m: f32,
}

/// The kinematics of two driven sides that cannot move sideways.
///
/// ```text
/// r * left = vx - half track * wz        r * right = vx + half track * wz        vy = 0
/// ```
///
/// # Examples
/// ```
/// use drivetrain::chassis::{Differential, DifferentialGeometry};
/// use drivetrain::geometry::Twist;
///
/// let geometry = DifferentialGeometry { wheel_radius_m: 0.1, half_track_m: 0.25 };
/// let wheels = Differential::new(geometry)?.inverse(Twist::new(1.0, 0.0, 2.0)); // ahead and to the left
/// assert!((wheels.left.as_rad_per_s() - 5.0).abs() < 1e-5);
/// assert!((wheels.right.as_rad_per_s() - 15.0).abs() < 1e-5);
/// # Ok::<(), drivetrain::chassis::ChassisError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Differential {
    wheel_radius_m: f32,
    half_track_m: f32,
    per_radius: f32,
    yaw_per: f32,
}

impl Differential {
    /// Takes the dimensions.
    ///
    /// # Errors
    /// Names the length that is not above zero and finite.
    pub const fn new(geometry: DifferentialGeometry) -> Result<Self, ChassisError> {
        let DifferentialGeometry { wheel_radius_m, half_track_m } = geometry;
        if let Err(error) = positive(wheel_radius_m, "wheel_radius_m") {
            return Err(error);
        }
        if let Err(error) = positive(half_track_m, "half_track_m") {
            return Err(error);
        }
        Ok(Self {
            wheel_radius_m,
            half_track_m,
            per_radius: 1.0 / wheel_radius_m,
            yaw_per: 0.5 * wheel_radius_m / half_track_m,
        })
    }

    /// Returns the wheel velocities for the motion `twist` of the body; its sideways part is left out.
    #[must_use]
    pub const fn inverse(&self, twist: Twist<Body>) -> DifferentialWheels<AngularVelocity> {
        let yaw = twist.wz_rad_s * self.half_track_m;
        DifferentialWheels {
            left: AngularVelocity::from_rad_per_s((twist.vx_m_s - yaw) * self.per_radius),
            right: AngularVelocity::from_rad_per_s((twist.vx_m_s + yaw) * self.per_radius),
        }
    }

    /// Returns the motion of the body; its sideways part is zero.
    #[must_use]
    pub const fn forward(&self, wheels: DifferentialWheels<AngularVelocity>) -> Twist<Body> {
        let (left, right) = (wheels.left.as_rad_per_s(), wheels.right.as_rad_per_s());
        Twist::new(0.5 * self.wheel_radius_m * (left + right), 0.0, self.yaw_per * (right - left))
    }
}

impl Kinematics for Differential {
    type Wheels<T: Copy> = DifferentialWheels<T>;
    type Speed = AngularVelocity;
    type Steering = ();

    const UNSTEERED: () = ();

    fn inverse(&self, twist: Twist<Body>) -> DifferentialWheels<AngularVelocity> {
        self.inverse(twist)
    }

    fn forward(&self, wheels: DifferentialWheels<AngularVelocity>) -> Twist<Body> {
        self.forward(wheels)
    }

    /// Both sides are needed.
    fn forward_partial(
        &self,
        wheels: DifferentialWheels<Option<AngularVelocity>>,
    ) -> Option<Twist<Body>> {
        wheels.all().map(|all| self.forward(all))
    }

    fn wheel_radius_m(&self) -> f32 {
        self.wheel_radius_m
    }

    fn map<T: Copy, U: Copy>(
        wheels: DifferentialWheels<T>,
        f: impl FnMut(T) -> U,
    ) -> DifferentialWheels<U> {
        wheels.map(f)
    }

    fn zip<T: Copy, U: Copy>(
        a: DifferentialWheels<T>,
        b: DifferentialWheels<U>,
    ) -> DifferentialWheels<(T, U)> {
        a.zip(b)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GEOMETRY: DifferentialGeometry =
        DifferentialGeometry { wheel_radius_m: 0.5, half_track_m: 0.25 };

    fn sides(vx: f32, vy: f32, wz: f32) -> (f32, f32) {
        let wheels = Differential::new(GEOMETRY).unwrap().inverse(Twist::new(vx, vy, wz));
        (wheels.left.as_rad_per_s(), wheels.right.as_rad_per_s())
    }

    #[test]
    fn forward_turns_both_sides_forward_and_backward_both_backward() {
        assert_eq!(sides(1.0, 0.0, 0.0), (2.0, 2.0));
        assert_eq!(sides(-1.0, 0.0, 0.0), (-2.0, -2.0));
    }

    #[test]
    fn turning_left_turns_the_left_side_backward_and_right_forward() {
        assert_eq!(sides(0.0, 0.0, 2.0), (-1.0, 1.0));
        assert_eq!(sides(0.0, 0.0, -2.0), (1.0, -1.0));
    }

    #[test]
    fn a_sideways_command_does_nothing() {
        assert_eq!(sides(0.0, 3.0, 0.0), (0.0, 0.0));
    }

    #[test]
    fn a_lost_side_leaves_the_motion_unknown() {
        let chassis = Differential::new(GEOMETRY).unwrap();
        let lost = DifferentialWheels { left: Some(AngularVelocity::ZERO), right: None };
        assert_eq!(chassis.forward_partial(lost), None);
    }

    #[test]
    fn a_length_of_zero_is_named() {
        let flat = DifferentialGeometry { half_track_m: 0.0, ..GEOMETRY };
        assert_eq!(Differential::new(flat), Err(ChassisError::NotPositive("half_track_m")));
    }
}
