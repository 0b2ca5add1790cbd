use super::Kinematics;
use super::error::positive;
use crate::error::ConfigError;
use crate::geometry::{Body, Twist};
use crate::units::AngularVelocity;

/// The kinematics of two driven sides without sideways motion.
///
/// ```text
/// r * left = vx - half track * wz        r * right = vx + half track * wz        vy = 0
/// ```
///
/// The wheels are an array: all of the left side (+y), then all of the right side.
///
/// # Examples
/// ```
/// use drivetrain::chassis::Differential;
/// use drivetrain::geometry::Twist;
///
/// // Sides 0.5 m apart: half of it.
/// let [left, right] = Differential::new(0.1, 0.25)?.inverse(Twist::new(1.0, 0.0, 2.0)); // ahead and to the left
/// assert!((left.as_rad_per_s() - 5.0).abs() < 1e-5);
/// assert!((right.as_rad_per_s() - 15.0).abs() < 1e-5);
/// # Ok::<(), drivetrain::error::ConfigError>(())
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
    /// Takes the radius of the wheels, and half the distance between the left side and the right side, both in m.
    ///
    /// Tracks and skid steering act like sides further apart: measure the distance by turning in place.
    ///
    /// # Errors
    /// Names the length that is not above zero and finite.
    pub const fn new(wheel_radius_m: f32, half_track_m: f32) -> Result<Self, ConfigError> {
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
    pub const fn inverse(&self, twist: Twist<Body>) -> [AngularVelocity; 2] {
        let yaw = twist.wz_rad_s * self.half_track_m;
        [
            AngularVelocity::from_rad_per_s((twist.vx_m_s - yaw) * self.per_radius),
            AngularVelocity::from_rad_per_s((twist.vx_m_s + yaw) * self.per_radius),
        ]
    }

    /// Returns the motion of the body; its sideways part is zero.
    #[must_use]
    pub const fn forward(&self, [left, right]: [AngularVelocity; 2]) -> Twist<Body> {
        let (left, right) = (left.as_rad_per_s(), right.as_rad_per_s());
        Twist::new(0.5 * self.wheel_radius_m * (left + right), 0.0, self.yaw_per * (right - left))
    }
}

impl Kinematics for Differential {
    type Wheels<T: Copy> = [T; 2];
    type Speed = AngularVelocity;
    type Steering = ();

    const UNSTEERED: () = ();

    fn inverse(&self, twist: Twist<Body>) -> [AngularVelocity; 2] {
        self.inverse(twist)
    }

    fn forward(&self, wheels: [AngularVelocity; 2]) -> Twist<Body> {
        self.forward(wheels)
    }

    /// Both sides are needed.
    fn forward_partial(&self, [left, right]: [Option<AngularVelocity>; 2]) -> Option<Twist<Body>> {
        Some(self.forward([left?, right?]))
    }

    fn wheel_radius_m(&self) -> f32 {
        self.wheel_radius_m
    }

    fn map<T: Copy, U: Copy>(wheels: [T; 2], f: impl FnMut(T) -> U) -> [U; 2] {
        wheels.map(f)
    }

    fn zip<T: Copy, U: Copy>([a, b]: [T; 2], [c, d]: [U; 2]) -> [(T, U); 2] {
        [(a, c), (b, d)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chassis() -> Differential {
        Differential::new(0.5, 0.25).unwrap()
    }

    fn sides(vx: f32, vy: f32, wz: f32) -> (f32, f32) {
        let [left, right] = chassis().inverse(Twist::new(vx, vy, wz));
        (left.as_rad_per_s(), right.as_rad_per_s())
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
        assert_eq!(chassis().forward_partial([Some(AngularVelocity::ZERO), None]), None);
    }

    #[test]
    fn a_length_of_zero_is_named() {
        let flat = Differential::new(0.5, 0.0);
        assert_eq!(flat, Err(ConfigError::NotPositive("half_track_m")));
    }
}
