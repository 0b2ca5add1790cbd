use super::kinematics::{Normal, Row, fit};
use super::{Kinematics, positive};
use crate::error::ConfigError;
use crate::geometry::{Body, Pose2, Rotation2, Twist, Vec2};
use crate::units::{Angle, AngularVelocity};

/// The kinematics of `N` omni wheels of one radius, at any places and in any directions.
///
/// A wheel at `p` that rolls along the unit vector `d` has the surface speed `d . v + (p x d) wz`. The motion is the
/// least-squares fit to all wheels. The values of the wheels come in the order of the constructor;
/// [`three`](Self::three) and [`four`](Self::four) are the usual layouts.
///
/// # The number of wheels at run time
/// `N` is part of the type: a chassis has exactly the memory, the motors and the count of lost wheels for its wheels. Places and
/// directions are values. A program that reads the number from a file has a branch for each number, and one function for all of
/// them:
/// ```
/// use drivetrain::chassis::{Chassis, Omni};
/// use drivetrain::geometry::{Body, Pose2, Twist};
/// use drivetrain::units::Angle;
///
/// fn run<const N: usize>(wheels: [Pose2<Body>; N]) -> Option<f32> {
///     let chassis = Chassis::new(Omni::new(0.05, wheels).ok()?);
///     let wheels = chassis.kinematics().inverse(Twist::new(0.0, 0.0, 1.0));
///     wheels.first().map(|wheel| wheel.as_rad_per_s())
/// }
///
/// let wheel = |degrees| Pose2::tangential(Angle::from_degrees(degrees), 0.2);
/// let places = [60.0, 180.0, 300.0].map(wheel); // of a file
/// let speed = match *places.as_slice() {
///     [a, b, c] => run([a, b, c]),
///     [a, b, c, d] => run([a, b, c, d]),
///     _ => None,
/// };
/// assert!((speed.unwrap() - 0.2 / 0.05).abs() < 1e-4);
/// ```
///
/// # Examples
/// ```
/// use drivetrain::{chassis::Omni, geometry::{Pose2, Twist}, units::Angle};
///
/// let wheel = |x, y, degrees| Pose2::new(x, y, Angle::from_degrees(degrees));
/// let layout = Omni::new(0.05, [wheel(0.0, 0.2, 0.0), wheel(0.0, -0.2, 0.0), wheel(-0.2, 0.0, 90.0)])?;
/// let [left, right, rear] = layout.inverse(Twist::new(1.0, 0.0, 1.0)); // ahead and to the left
/// assert!((left.as_rad_per_s() - (1.0 - 0.2) / 0.05).abs() < 1e-4);
/// assert!((right.as_rad_per_s() - (1.0 + 0.2) / 0.05).abs() < 1e-4);
/// assert!((rear.as_rad_per_s() + 0.2 / 0.05).abs() < 1e-4);
///
/// let wheel = |degrees| Pose2::tangential(Angle::from_degrees(degrees), 0.2);
/// let five = Omni::new(0.05, [0.0, 72.0, 144.0, 216.0, 288.0].map(wheel))?;
/// let [front, ..] = five.inverse(Twist::new(1.0, 0.5, 2.0));
/// assert!((front.as_rad_per_s() - (0.5 + 0.2 * 2.0) / 0.05).abs() < 1e-4);
/// # Ok::<(), drivetrain::error::ConfigError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Omni<const N: usize> {
    rows: [Row; N],
    shares: [Twist<Body>; N],
    wheel_radius_m: f32,
    per_radius: f32,
}

impl<const N: usize> Omni<N> {
    /// Takes the radius of the wheels in m, and for each wheel its point of contact in m and its rolling direction for a
    /// positive velocity, counter-clockwise from forward.
    ///
    /// # Errors
    /// Names the value that is not finite or not above zero. [`ConfigError::Singular`] when the wheels leave some
    /// motion undetermined, or nearly: fewer than three, all parallel, all pointing at one centre, or all so far on one
    /// side of the origin that a turn looks like a straight way (some 20 times their distance from their centre).
    pub fn new(wheel_radius_m: f32, wheels: [Pose2<Body>; N]) -> Result<Self, ConfigError> {
        positive(wheel_radius_m, "wheel_radius_m")?;
        if !wheels.iter().all(|wheel| wheel.position().to_vec().is_finite()) {
            return Err(ConfigError::NotFinite("position_m"));
        }
        if !wheels.iter().all(|wheel| wheel.angle.is_finite()) {
            return Err(ConfigError::NotFinite("direction"));
        }
        let rows = wheels.map(|wheel| {
            let direction = Rotation2::new(wheel.angle).apply(Vec2::new(1.0, 0.0));
            Row::new(direction, wheel.position().to_vec())
        });
        let inverse = Normal::of(rows).inverse().ok_or(ConfigError::Singular("every motion"))?;
        let shares = rows.map(|row| inverse.share(row) * wheel_radius_m);
        Ok(Self { rows, shares, wheel_radius_m, per_radius: 1.0 / wheel_radius_m })
    }

    /// Wheels at these angles, at one distance from the centre.
    fn round(wheel_radius_m: f32, distance_m: f32, degrees: [f32; N]) -> Result<Self, ConfigError> {
        let distance_m = positive(distance_m, "distance_m")?;
        let wheel = |degrees| Pose2::tangential(Angle::from_degrees(degrees), distance_m);
        Self::new(wheel_radius_m, degrees.map(wheel))
    }

    /// Returns the wheel velocities for the motion `twist` of the body.
    ///
    /// Costs 44 instructions on a Cortex-M4F, for four wheels (`docs/figures.md`).
    #[must_use]
    pub fn inverse(&self, twist: Twist<Body>) -> [AngularVelocity; N] {
        self.rows.map(|row| AngularVelocity::from_rad_per_s(row.of(twist) * self.per_radius))
    }

    /// Returns the motion of the body of best fit to the wheel velocities (least squares).
    ///
    /// Costs 44 instructions on a Cortex-M4F, for four wheels (`docs/figures.md`).
    #[must_use]
    pub fn forward(&self, wheels: [AngularVelocity; N]) -> Twist<Body> {
        self.shares
            .iter()
            .zip(wheels)
            .fold(Twist::ZERO, |sum, (&share, wheel)| sum + share * wheel.as_rad_per_s())
    }

    fn forward_partial(&self, wheels: [Option<AngularVelocity>; N]) -> Option<Twist<Body>> {
        let known = self.rows.iter().zip(&wheels).filter_map(|(&row, wheel)| {
            wheel.map(|velocity| (row, velocity.as_rad_per_s() * self.wheel_radius_m))
        });
        fit(known)
    }
}

impl Omni<3> {
    /// Three wheels at 60, -60 and 180 degrees: front left, front right, rear. Positive rolls counter-clockwise.
    ///
    /// Takes the radius of the wheels and their distance from the centre, in m.
    ///
    /// # Errors
    /// Names the length that is not above zero and finite.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::{chassis::Omni, geometry::Twist};
    ///
    /// let [front_left, _, rear] = Omni::three(0.05, 0.2)?.inverse(Twist::new(0.0, 1.0, 0.0)); // to the left
    /// assert!((rear.as_rad_per_s() + 20.0).abs() < 1e-4);
    /// assert!((front_left.as_rad_per_s() - 10.0).abs() < 1e-4);
    /// # Ok::<(), drivetrain::error::ConfigError>(())
    /// ```
    pub fn three(wheel_radius_m: f32, distance_m: f32) -> Result<Self, ConfigError> {
        Self::round(wheel_radius_m, distance_m, [60.0, -60.0, 180.0])
    }
}

impl Omni<4> {
    /// Four wheels on the corners of a square, at 45, -45, 135 and -135 degrees: front left, front right, rear left, rear
    /// right. Positive rolls counter-clockwise.
    ///
    /// Takes the radius of the wheels and their distance from the centre, in m.
    ///
    /// # Errors
    /// Names the length that is not above zero and finite.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::{chassis::Omni, geometry::Twist};
    ///
    /// let [front_left, front_right, ..] = Omni::four(0.05, 0.2)?.inverse(Twist::new(1.0, 0.0, 0.0));
    /// let slow = core::f32::consts::FRAC_1_SQRT_2 / 0.05; // the rollers take the rest
    /// assert!((front_left.as_rad_per_s() + slow).abs() < 1e-4);
    /// assert!((front_right.as_rad_per_s() - slow).abs() < 1e-4);
    /// # Ok::<(), drivetrain::error::ConfigError>(())
    /// ```
    pub fn four(wheel_radius_m: f32, distance_m: f32) -> Result<Self, ConfigError> {
        Self::round(wheel_radius_m, distance_m, [45.0, -45.0, 135.0, -135.0])
    }
}

/// Pairs two arrays of one length.
#[expect(clippy::indexing_slicing, reason = "from_fn counts to N, the length of both")]
pub(super) fn zip_arrays<T: Copy, U: Copy, const N: usize>(a: [T; N], b: [U; N]) -> [(T, U); N] {
    core::array::from_fn(|index| (a[index], b[index]))
}

impl<const N: usize> Kinematics for Omni<N> {
    type Wheels<T: Copy> = [T; N];
    type Speed = AngularVelocity;
    type Steering = ();

    const UNSTEERED: () = ();

    fn inverse(&self, twist: Twist<Body>) -> [AngularVelocity; N] {
        self.inverse(twist)
    }

    fn forward(&self, wheels: [AngularVelocity; N]) -> Twist<Body> {
        self.forward(wheels)
    }

    fn forward_partial(&self, wheels: [Option<AngularVelocity>; N]) -> Option<Twist<Body>> {
        self.forward_partial(wheels)
    }

    fn wheel_radius_m(&self) -> f32 {
        self.wheel_radius_m
    }

    fn map<T: Copy, U: Copy>(wheels: [T; N], f: impl FnMut(T) -> U) -> [U; N] {
        wheels.map(f)
    }

    fn zip<T: Copy, U: Copy>(a: [T; N], b: [U; N]) -> [(T, U); N] {
        zip_arrays(a, b)
    }
}

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
#[expect(clippy::float_cmp, reason = "signs are exact")]
mod tests {
    use super::*;

    fn four() -> Omni<4> {
        Omni::four(0.05, 0.2).unwrap()
    }

    fn signs(vx: f32, vy: f32, wz: f32) -> [f32; 4] {
        let speeds = four().inverse(Twist::new(vx, vy, wz));
        speeds.map(|speed| speed.as_rad_per_s().signum())
    }

    #[test]
    fn driving_forward_turns_the_left_wheels_clockwise_and_backward_the_other_way() {
        assert_eq!(signs(1.0, 0.0, 0.0), [-1.0, 1.0, -1.0, 1.0]);
        assert_eq!(signs(-1.0, 0.0, 0.0), [1.0, -1.0, 1.0, -1.0]);
    }

    #[test]
    fn strafe_left_turns_the_front_wheels_counter_clockwise_and_right_the_other_way() {
        assert_eq!(signs(0.0, 1.0, 0.0), [1.0, 1.0, -1.0, -1.0]);
        assert_eq!(signs(0.0, -1.0, 0.0), [-1.0, -1.0, 1.0, 1.0]);
    }

    #[test]
    fn turning_turns_all_wheels_the_same_way() {
        assert_eq!(signs(0.0, 0.0, 1.0), [1.0; 4]);
        assert_eq!(signs(0.0, 0.0, -1.0), [-1.0; 4]);
    }

    // The third seed (x right, y forward, wheels clockwise from front right) leaves the factor
    // 1/sqrt(2) out; with a heading, the rows lack its rotated v_y, and rows 3 and 4 lose their
    // signs.
    #[test]
    fn the_third_seeds_rows_hold_once_the_root_of_one_half_is_back() {
        let (x, y, w) = (0.3_f32, 0.8, 1.5); // its axes: x right, y forward
        let [front_left, front_right, rear_left, rear_right] =
            four().inverse(Twist::new(y, -x, w)).map(|speed| speed.as_rad_per_s() * 0.05);
        let half = core::f32::consts::FRAC_1_SQRT_2;
        let is_near =
            |ours: f32, theirs: f32| assert!((ours - theirs).abs() < 1e-6, "{ours} {theirs}");
        is_near(front_right, half * (-x + y) + w * 0.2);
        is_near(rear_right, half * (x + y) + w * 0.2);
        is_near(rear_left, half * (x - y) + w * 0.2);
        is_near(front_left, half * (-x - y) + w * 0.2);
    }

    #[test]
    fn wheels_that_leave_a_motion_undetermined_are_refused() {
        let wheel = |x, y, degrees| Pose2::new(x, y, Angle::from_degrees(degrees));
        let singular = Err(ConfigError::Singular("every motion"));
        let parallel = [wheel(0.2, 0.2, 0.0), wheel(0.2, -0.2, 0.0), wheel(-0.2, 0.2, 180.0)];
        assert_eq!(Omni::new(0.05, parallel), singular);
        let radial = [wheel(0.2, 0.0, 0.0), wheel(0.0, 0.2, 90.0), wheel(-0.2, 0.0, 180.0)];
        assert_eq!(Omni::new(0.05, radial), singular);
        let two = [wheel(0.2, 0.0, 90.0), wheel(0.0, 0.2, 180.0)];
        assert_eq!(Omni::new(0.05, two), Err(ConfigError::Singular("every motion")));
        let nan = [wheel(f32::NAN, 0.0, 90.0), wheel(0.0, 0.2, 180.0), wheel(0.0, 0.3, 30.0)];
        assert_eq!(Omni::new(0.05, nan), Err(ConfigError::NotFinite("position_m")));
        assert_eq!(Omni::three(0.0, 0.2), Err(ConfigError::NotPositive("wheel_radius_m")));
        assert_eq!(Omni::three(0.05, -0.2), Err(ConfigError::NotPositive("distance_m")));
    }

    #[test]
    fn four_wheels_may_lose_one_and_three_may_not() {
        let motion = Twist::new(0.5, -0.25, 1.0);
        let mut partial = four().inverse(motion).map(Some);
        partial[2] = None; // rear left
        let error = four().forward_partial(partial).unwrap() - motion;
        assert!(error.linear().norm() < 1e-5 && error.wz_rad_s.abs() < 1e-4, "{error:?}");
        let three = Omni::three(0.05, 0.2).unwrap();
        let mut partial = three.inverse(motion).map(Some);
        partial[2] = None; // rear
        assert_eq!(three.forward_partial(partial), None);
    }

    #[test]
    fn a_lifted_wheel_shows_as_slip_and_rolling_wheels_do_not() {
        let rolling = four().inverse(Twist::new(0.5, -0.25, 1.0));
        assert!(four().slip_m_s(rolling) < 1e-5);
        let mut lifted = rolling;
        lifted[2] = lifted[2] + AngularVelocity::from_rad_per_s(8.0);
        assert!((four().slip_m_s(lifted) - 8.0 * 0.05 / 4.0).abs() < 1e-5);
    }

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
