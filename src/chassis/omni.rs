use super::error::positive;
use super::least_squares::{Normal, Row, fit};
use super::{ChassisError, Kinematics, OmniFourWheels, OmniThreeWheels};
use crate::geometry::{Body, Rotation2, Twist, Vec2};
use crate::units::{Angle, AngularVelocity};

/// One omni wheel: where it touches the floor, and which way it rolls.
///
/// # Examples
/// ```
/// use drivetrain::{chassis::{Omni, OmniWheel}, geometry::{Twist, Vec2}, units::Angle};
///
/// let wheel = |x, y, degrees| OmniWheel { position_m: Vec2::new(x, y), direction: Angle::from_degrees(degrees) };
/// let layout = Omni::new(0.05, [wheel(0.0, 0.2, 0.0), wheel(0.0, -0.2, 0.0), wheel(-0.2, 0.0, 90.0)])?;
/// let [left, right, rear] = layout.inverse(Twist::new(1.0, 0.0, 1.0)); // ahead and to the left
/// assert!((left.as_rad_per_s() - (1.0 - 0.2) / 0.05).abs() < 1e-4);
/// assert!((right.as_rad_per_s() - (1.0 + 0.2) / 0.05).abs() < 1e-4);
/// assert!((rear.as_rad_per_s() + 0.2 / 0.05).abs() < 1e-4);
/// # Ok::<(), drivetrain::chassis::ChassisError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct OmniWheel {
    /// The point of contact from the origin of the body, in m.
    pub position_m: Vec2,
    /// The direction of rolling for a positive wheel velocity, counter-clockwise from forward.
    pub direction: Angle,
}

impl OmniWheel {
    /// Takes the angle and the distance at which the wheel stands; positive rolls counter-clockwise round the origin.
    ///
    /// At the angle `a` and the distance `R` its surface speed is `-sin(a) vx + cos(a) vy + R wz`.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::{chassis::OmniWheel, units::Angle};
    ///
    /// let left = OmniWheel::tangential(Angle::from_degrees(90.0), 0.2);
    /// assert!((left.position_m.y - 0.2).abs() < 1e-6);
    /// assert_eq!(left.direction.as_degrees(), 180.0); // backward
    /// ```
    #[must_use]
    pub const fn tangential(angle: Angle, distance_m: f32) -> Self {
        let rotation = Rotation2::new(angle);
        Self {
            position_m: rotation.apply(Vec2::new(distance_m, 0.0)),
            direction: Angle::from_radians(angle.as_radians() + core::f32::consts::FRAC_PI_2),
        }
    }
}

/// The kinematics of `N` omni wheels of one radius, at any places and in any directions.
///
/// A wheel at `p` that rolls along the unit vector `d` has the surface speed `d . v + (p x d) wz`. The motion is the
/// least-squares fit to all wheels. The values of the wheels come in the order in which the wheels were given;
/// [`OmniThree`] and [`OmniFour`] have names for them.
///
/// # Examples
/// ```
/// use drivetrain::{chassis::{Omni, OmniWheel}, geometry::Twist, units::Angle};
///
/// let wheel = |degrees| OmniWheel::tangential(Angle::from_degrees(degrees), 0.2);
/// let five = Omni::new(0.05, [0.0, 72.0, 144.0, 216.0, 288.0].map(wheel))?;
/// let [front, ..] = five.inverse(Twist::new(1.0, 0.5, 2.0));
/// assert!((front.as_rad_per_s() - (0.5 + 0.2 * 2.0) / 0.05).abs() < 1e-4);
/// # Ok::<(), drivetrain::chassis::ChassisError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Omni<const N: usize> {
    rows: [Row; N],
    shares: [Twist<Body>; N],
    wheel_radius_m: f32,
    per_radius: f32,
}

impl<const N: usize> Omni<N> {
    /// Takes the radius of the wheels in m and the wheels.
    ///
    /// # Errors
    /// Names the value that is not finite or not above zero. [`ChassisError::Singular`] when the wheels leave some
    /// motion undetermined, or nearly: fewer than three, all parallel, all pointing at one centre, or all so far on one
    /// side of the origin that a turn looks like a straight way (some 20 times their distance from their centre).
    pub fn new(wheel_radius_m: f32, wheels: [OmniWheel; N]) -> Result<Self, ChassisError> {
        positive(wheel_radius_m, "wheel_radius_m")?;
        if !wheels.iter().all(|wheel| wheel.position_m.is_finite()) {
            return Err(ChassisError::NotFinite("position_m"));
        }
        if !wheels.iter().all(|wheel| wheel.direction.is_finite()) {
            return Err(ChassisError::NotFinite("direction"));
        }
        let rows = wheels.map(|wheel| {
            let direction = Rotation2::new(wheel.direction).apply(Vec2::new(1.0, 0.0));
            Row::new(direction, wheel.position_m)
        });
        let inverse = Normal::of(rows).inverse().ok_or(ChassisError::Singular("every motion"))?;
        let shares = rows.map(|row| inverse.share(row) * wheel_radius_m);
        Ok(Self { rows, shares, wheel_radius_m, per_radius: 1.0 / wheel_radius_m })
    }

    /// Returns the wheel velocities for the motion `twist` of the body.
    #[must_use]
    pub fn inverse(&self, twist: Twist<Body>) -> [AngularVelocity; N] {
        self.rows.map(|row| AngularVelocity::from_rad_per_s(row.of(twist) * self.per_radius))
    }

    /// Returns the motion of the body that fits the wheel velocities best (least squares).
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

/// Gives a layout its named wheels around an [`Omni`].
macro_rules! named_omni {
    ($(#[$doc:meta])* $name:ident, $wheels:ident, $count:literal, $degrees:expr) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq)]
        pub struct $name(Omni<$count>);

        impl $name {
            /// Takes the radius of the wheels and their distance from the centre, in m.
            ///
            /// # Errors
            /// Names the length that is not above zero and finite.
            pub fn new(wheel_radius_m: f32, distance_m: f32) -> Result<Self, ChassisError> {
                let distance_m = positive(distance_m, "distance_m")?;
                let wheel = |degrees| {
                    OmniWheel::tangential(Angle::from_degrees(degrees), distance_m)
                };
                Omni::new(wheel_radius_m, $degrees.map(wheel)).map(Self)
            }

            /// Returns the wheel velocities for the motion `twist` of the body.
            #[must_use]
            pub fn inverse(&self, twist: Twist<Body>) -> $wheels<AngularVelocity> {
                $wheels::from_array(self.0.inverse(twist))
            }

            /// Returns the motion of the body that fits the wheel velocities best (least squares).
            #[must_use]
            pub fn forward(&self, wheels: $wheels<AngularVelocity>) -> Twist<Body> {
                self.0.forward(wheels.into_array())
            }
        }

        impl Kinematics for $name {
            type Wheels<T: Copy> = $wheels<T>;
            type Speed = AngularVelocity;
            type Steering = ();

            const UNSTEERED: () = ();

            fn inverse(&self, twist: Twist<Body>) -> $wheels<AngularVelocity> {
                self.inverse(twist)
            }

            fn forward(&self, wheels: $wheels<AngularVelocity>) -> Twist<Body> {
                self.forward(wheels)
            }

            fn forward_partial(
                &self,
                wheels: $wheels<Option<AngularVelocity>>,
            ) -> Option<Twist<Body>> {
                self.0.forward_partial(wheels.into_array())
            }

            fn wheel_radius_m(&self) -> f32 {
                self.0.wheel_radius_m
            }

            fn map<T: Copy, U: Copy>(wheels: $wheels<T>, f: impl FnMut(T) -> U) -> $wheels<U> {
                wheels.map(f)
            }

            fn zip<T: Copy, U: Copy>(a: $wheels<T>, b: $wheels<U>) -> $wheels<(T, U)> {
                a.zip(b)
            }
        }
    };
}

named_omni! {
    /// Three omni wheels at 60, -60 and 180 degrees: two in front, one behind; positive rolls counter-clockwise.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::{chassis::OmniThree, geometry::Twist};
    ///
    /// let wheels = OmniThree::new(0.05, 0.2)?.inverse(Twist::new(0.0, 1.0, 0.0)); // to the left
    /// assert!((wheels.rear.as_rad_per_s() + 20.0).abs() < 1e-4);
    /// assert!((wheels.front_left.as_rad_per_s() - 10.0).abs() < 1e-4);
    /// # Ok::<(), drivetrain::chassis::ChassisError>(())
    /// ```
    OmniThree, OmniThreeWheels, 3, [60.0, -60.0, 180.0]
}

named_omni! {
    /// Four omni wheels on the corners of a square, at 45, -45, 135 and -135 degrees; positive rolls counter-clockwise.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::{chassis::OmniFour, geometry::Twist};
    ///
    /// let wheels = OmniFour::new(0.05, 0.2)?.inverse(Twist::new(1.0, 0.0, 0.0));
    /// let slow = core::f32::consts::FRAC_1_SQRT_2 / 0.05; // the rollers take the rest
    /// assert!((wheels.front_left.as_rad_per_s() + slow).abs() < 1e-4);
    /// assert!((wheels.front_right.as_rad_per_s() - slow).abs() < 1e-4);
    /// # Ok::<(), drivetrain::chassis::ChassisError>(())
    /// ```
    OmniFour, OmniFourWheels, 4, [45.0, -45.0, 135.0, -135.0]
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "signs are exact")]
mod tests {
    use super::*;

    fn four() -> OmniFour {
        OmniFour::new(0.05, 0.2).unwrap()
    }

    fn signs(vx: f32, vy: f32, wz: f32) -> [f32; 4] {
        let speeds = four().inverse(Twist::new(vx, vy, wz));
        speeds.map(|speed| speed.as_rad_per_s().signum()).into_array()
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

    // The third seed (x right, y forward, wheels clockwise from front right) leaves the factor 1/sqrt(2) out,
    // and with a heading it does not put its rotated v_y into the rows and loses the signs of rows 3 and 4.
    #[test]
    fn the_third_seeds_rows_hold_once_the_root_of_one_half_is_back() {
        let (x, y, w) = (0.3_f32, 0.8, 1.5); // its axes: x right, y forward
        let ours = four().inverse(Twist::new(y, -x, w)).map(|speed| speed.as_rad_per_s() * 0.05);
        let half = core::f32::consts::FRAC_1_SQRT_2;
        let is_near =
            |ours: f32, theirs: f32| assert!((ours - theirs).abs() < 1e-6, "{ours} {theirs}");
        is_near(ours.front_right, half * (-x + y) + w * 0.2);
        is_near(ours.rear_right, half * (x + y) + w * 0.2);
        is_near(ours.rear_left, half * (x - y) + w * 0.2);
        is_near(ours.front_left, half * (-x - y) + w * 0.2);
    }

    #[test]
    fn wheels_that_leave_a_motion_undetermined_are_refused() {
        let wheel = |x, y, degrees| OmniWheel {
            position_m: Vec2::new(x, y),
            direction: Angle::from_degrees(degrees),
        };
        let singular = Err(ChassisError::Singular("every motion"));
        let parallel = [wheel(0.2, 0.2, 0.0), wheel(0.2, -0.2, 0.0), wheel(-0.2, 0.2, 180.0)];
        assert_eq!(Omni::new(0.05, parallel), singular);
        let radial = [wheel(0.2, 0.0, 0.0), wheel(0.0, 0.2, 90.0), wheel(-0.2, 0.0, 180.0)];
        assert_eq!(Omni::new(0.05, radial), singular);
        let two = [wheel(0.2, 0.0, 90.0), wheel(0.0, 0.2, 180.0)];
        assert_eq!(Omni::new(0.05, two), Err(ChassisError::Singular("every motion")));
        let nan = [wheel(f32::NAN, 0.0, 90.0), wheel(0.0, 0.2, 180.0), wheel(0.0, 0.3, 30.0)];
        assert_eq!(Omni::new(0.05, nan), Err(ChassisError::NotFinite("position_m")));
        assert_eq!(OmniThree::new(0.0, 0.2), Err(ChassisError::NotPositive("wheel_radius_m")));
        assert_eq!(OmniThree::new(0.05, -0.2), Err(ChassisError::NotPositive("distance_m")));
    }

    #[test]
    fn four_wheels_may_lose_one_and_three_may_not() {
        let motion = Twist::new(0.5, -0.25, 1.0);
        let mut partial = four().inverse(motion).map(Some);
        partial.rear_left = None;
        let error = four().forward_partial(partial).unwrap() - motion;
        assert!(error.linear().norm() < 1e-5 && error.wz_rad_s.abs() < 1e-4, "{error:?}");
        let three = OmniThree::new(0.05, 0.2).unwrap();
        let mut partial = three.inverse(motion).map(Some);
        partial.rear = None;
        assert_eq!(three.forward_partial(partial), None);
    }

    #[test]
    fn a_lifted_wheel_shows_as_slip_and_rolling_shows_none() {
        let rolling = four().inverse(Twist::new(0.5, -0.25, 1.0));
        assert!(four().slip_m_s(rolling) < 1e-5);
        let mut lifted = rolling;
        lifted.rear_left = lifted.rear_left + AngularVelocity::from_rad_per_s(8.0);
        assert!((four().slip_m_s(lifted) - 8.0 * 0.05 / 4.0).abs() < 1e-5);
    }
}
