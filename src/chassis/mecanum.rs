use super::kinematics::{Fastest, MAX_CONDITION, slowed};
use super::{Kinematics, positive};
use crate::error::ConfigError;
use crate::geometry::{Body, Twist, Vec2};
use crate::units::AngularVelocity;
use core::f32::consts::SQRT_2;

/// The kinematics of four mecanum wheels.
///
/// With the lever arm `L = half track + half wheelbase` and the wheel radius `r`:
///
/// ```text
/// r * front_left  = vx - vy - L wz        r * front_right = vx + vy + L wz
/// r * rear_left   = vx + vy - L wz        r * rear_right  = vx - vy + L wz
/// ```
///
/// A positive wheel velocity rolls forward on every wheel; how its motor is mounted is the motor's business.
///
/// `FLOOR` is the letter formed by the rollers that touch the floor. `'O'` is the usual mounting; from above, the visible
/// rollers then form an X. With `'X'` the sign of vy changes, and `L` is half track - half wheelbase, so a square chassis
/// cannot turn. Another letter does not compile:
///
/// ```compile_fail
/// use drivetrain::{chassis::Mecanum, geometry::Vec2};
///
/// let mecanum = Mecanum::<'Y'>::with_rollers(0.1, Vec2::new(0.3, 0.2));
/// ```
///
/// Takes 20 bytes on a Cortex-M4F (`docs/figures.md`).
///
/// # Examples
/// ```
/// use drivetrain::chassis::Mecanum;
/// use drivetrain::geometry::{Twist, Vec2};
///
/// // Axles 0.6 m apart, wheels 0.4 m apart: the front left wheel is half of each from the centre.
/// let mecanum = Mecanum::new(0.1, Vec2::new(0.3, 0.2))?;
/// let wheels = mecanum.inverse(Twist::new(1.0, 0.5, 2.0));
/// assert!((wheels.front_left.as_rad_per_s() - (1.0 - 0.5 - 0.5 * 2.0) / 0.1).abs() < 1e-4);
/// assert!((wheels.front_right.as_rad_per_s() - (1.0 + 0.5 + 0.5 * 2.0) / 0.1).abs() < 1e-4);
/// # Ok::<(), drivetrain::error::ConfigError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Mecanum<const FLOOR: char = 'O'> {
    /// Wheel velocity for 1 m/s in any direction, and for 1 rad/s.
    per_linear: f32,
    per_yaw: f32,
    /// The same the other way, a quarter for each wheel.
    linear_per: f32,
    yaw_per: f32,
    wheel_radius_m: f32,
}

impl Mecanum {
    /// Takes the radius of the wheels over the rollers, and the place of the front left wheel from the centre, in m, with
    /// the rollers in the usual mounting.
    ///
    /// `front_left_m.x` is half the distance of the axles, `front_left_m.y` half the distance from the left wheels to the
    /// right wheels, centre to centre. The other three wheels mirror it.
    ///
    /// # Errors
    /// Names the length that is not above zero and finite.
    pub const fn new(wheel_radius_m: f32, front_left_m: Vec2) -> Result<Self, ConfigError> {
        Self::with_rollers(wheel_radius_m, front_left_m)
    }
}

impl<const FLOOR: char> Mecanum<FLOOR> {
    /// The sign of the sideways part, and of the half wheelbase in the lever arm.
    const SIDE: f32 = {
        assert!(matches!(FLOOR, 'O' | 'X'), "the rollers on the floor form an O or an X");
        if FLOOR == 'O' { 1.0 } else { -1.0 }
    };

    /// Takes the dimensions as [`new`](Mecanum::new) does, with the rollers in the mounting named by the type.
    ///
    /// # Errors
    /// Names the length that is not above zero and finite. [`ConfigError::Singular`] for `'X'` when half track and half
    /// wheelbase are nearly the same: when they differ by less than 4 % of the distance of the wheels.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::chassis::Mecanum;
    /// use drivetrain::geometry::{Twist, Vec2};
    ///
    /// let wheels = Mecanum::<'X'>::with_rollers(0.1, Vec2::new(0.1, 0.3))?.inverse(Twist::new(0.0, 1.0, 0.0));
    /// assert!((wheels.front_left.as_rad_per_s() - 10.0).abs() < 1e-5); // to the left, the other way round
    /// # Ok::<(), drivetrain::error::ConfigError>(())
    /// ```
    pub const fn with_rollers(
        wheel_radius_m: f32,
        front_left_m: Vec2,
    ) -> Result<Self, ConfigError> {
        let Vec2 { x: half_wheelbase_m, y: half_track_m } = front_left_m;
        if let Err(error) = positive(wheel_radius_m, "wheel_radius_m") {
            return Err(error);
        }
        if let Err(error) = positive(half_wheelbase_m, "front_left_m.x") {
            return Err(error);
        }
        if let Err(error) = positive(half_track_m, "front_left_m.y") {
            return Err(error);
        }
        let arm_m = half_track_m + Self::SIDE * half_wheelbase_m;
        // The condition number of its normal equations, with two parts for translation.
        let reach_m2 = half_track_m * half_track_m + half_wheelbase_m * half_wheelbase_m;
        if arm_m * arm_m * MAX_CONDITION < SQRT_2 * reach_m2 {
            return Err(ConfigError::Singular("rotation: the chassis is square"));
        }
        Ok(Self {
            per_linear: 1.0 / wheel_radius_m,
            per_yaw: arm_m / wheel_radius_m,
            linear_per: 0.25 * wheel_radius_m,
            yaw_per: 0.25 * wheel_radius_m / arm_m,
            wheel_radius_m,
        })
    }

    /// Returns the wheel velocities for the motion `twist` of the body.
    ///
    /// Costs 18 instructions on a Cortex-M4F (`docs/figures.md`).
    #[must_use]
    #[inline]
    pub const fn inverse(&self, twist: Twist<Body>) -> MecanumWheels<AngularVelocity> {
        let x = twist.vx_m_s * self.per_linear;
        let y = Self::SIDE * twist.vy_m_s * self.per_linear;
        let yaw = twist.wz_rad_s * self.per_yaw;
        let (falling, rising) = (x - y, x + y);
        MecanumWheels {
            front_left: AngularVelocity::from_rad_per_s(falling - yaw),
            front_right: AngularVelocity::from_rad_per_s(rising + yaw),
            rear_left: AngularVelocity::from_rad_per_s(rising - yaw),
            rear_right: AngularVelocity::from_rad_per_s(falling + yaw),
        }
    }

    /// Returns the motion of the body of best fit to the wheel velocities (least squares).
    ///
    /// Costs 19 instructions on a Cortex-M4F (`docs/figures.md`).
    #[must_use]
    #[inline]
    pub const fn forward(&self, wheels: MecanumWheels<AngularVelocity>) -> Twist<Body> {
        let front_left = wheels.front_left.as_rad_per_s();
        let front_right = wheels.front_right.as_rad_per_s();
        let rear_left = wheels.rear_left.as_rad_per_s();
        let rear_right = wheels.rear_right.as_rad_per_s();
        let (falling, rising) = (front_left + rear_right, front_right + rear_left);
        let (falling_yaw, rising_yaw) = (rear_right - front_left, front_right - rear_left);
        Twist::new(
            (rising + falling) * self.linear_per,
            Self::SIDE * (rising - falling) * self.linear_per,
            (rising_yaw + falling_yaw) * self.yaw_per,
        )
    }
}

impl<const FLOOR: char> Kinematics for Mecanum<FLOOR> {
    type Wheels<T: Copy> = MecanumWheels<T>;
    type Speed = AngularVelocity;
    type Steering = ();

    const UNSTEERED: () = ();

    fn inverse(&self, twist: Twist<Body>) -> MecanumWheels<AngularVelocity> {
        self.inverse(twist)
    }

    fn forward(&self, wheels: MecanumWheels<AngularVelocity>) -> Twist<Body> {
        self.forward(wheels)
    }

    /// Three wheels are enough: a rigid chassis has `front_left + front_right = rear_left + rear_right`.
    fn forward_partial(
        &self,
        wheels: MecanumWheels<Option<AngularVelocity>>,
    ) -> Option<Twist<Body>> {
        let MecanumWheels { front_left: fl, front_right: fr, rear_left: rl, rear_right: rr } =
            wheels;
        let all = match (fl, fr, rl, rr) {
            (None, Some(fr), Some(rl), Some(rr)) => [rl + rr - fr, fr, rl, rr],
            (Some(fl), None, Some(rl), Some(rr)) => [fl, rl + rr - fl, rl, rr],
            (Some(fl), Some(fr), None, Some(rr)) => [fl, fr, fl + fr - rr, rr],
            (Some(fl), Some(fr), Some(rl), None) => [fl, fr, rl, fl + fr - rl],
            _ => wheels.all()?.into_array(),
        };
        Some(self.forward(MecanumWheels::from_array(all)))
    }

    fn wheel_radius_m(&self) -> f32 {
        self.wheel_radius_m
    }

    fn map<T: Copy, U: Copy>(wheels: MecanumWheels<T>, f: impl FnMut(T) -> U) -> MecanumWheels<U> {
        wheels.map(f)
    }

    fn zip<T: Copy, U: Copy>(a: MecanumWheels<T>, b: MecanumWheels<U>) -> MecanumWheels<(T, U)> {
        a.zip(b)
    }
}

/// Makes a struct with one value for each named wheel, and the functions on all of them at once.
macro_rules! named_wheels {
    ($(#[$doc:meta])* $name:ident, $count:literal { $($(#[$wheel_doc:meta])* $wheel:ident),+ }) => {
        $(#[$doc])*
        #[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
        #[cfg_attr(feature = "defmt", derive(defmt::Format))]
        #[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
        pub struct $name<T> {
            $($(#[$wheel_doc])* pub $wheel: T,)+
        }

        impl<T> $name<T> {
            /// Turns the value of every wheel into another, in the order of the fields.
            #[must_use]
            pub fn map<U>(self, mut f: impl FnMut(T) -> U) -> $name<U> {
                $name { $($wheel: f(self.$wheel),)+ }
            }

            /// Maps every value with a function that can fail.
            ///
            /// # Errors
            /// Passes on the first error; the wheels after it are left out.
            pub fn try_map<U, E>(
                self,
                mut f: impl FnMut(T) -> Result<U, E>,
            ) -> Result<$name<U>, E> {
                Ok($name { $($wheel: f(self.$wheel)?,)+ })
            }

            /// Pairs the values of every wheel with those of another set.
            #[must_use]
            pub fn zip<U>(self, other: $name<U>) -> $name<(T, U)> {
                $name { $($wheel: (self.$wheel, other.$wheel),)+ }
            }

            /// Borrows the value of every wheel.
            #[must_use]
            pub const fn as_ref(&self) -> $name<&T> {
                $name { $($wheel: &self.$wheel,)+ }
            }

            /// Borrows the value of every wheel for changing it.
            #[must_use]
            pub const fn as_mut(&mut self) -> $name<&mut T> {
                $name { $($wheel: &mut self.$wheel,)+ }
            }

            /// Returns the values in the order of the fields.
            #[must_use]
            pub fn into_array(self) -> [T; $count] {
                [$(self.$wheel,)+]
            }

            /// Takes the values in the order of the fields.
            #[must_use]
            pub fn from_array(values: [T; $count]) -> Self {
                let [$($wheel,)+] = values;
                Self { $($wheel,)+ }
            }
        }

        impl<T: Copy> $name<T> {
            /// Takes the same value for every wheel.
            #[must_use]
            pub const fn splat(value: T) -> Self {
                Self { $($wheel: value,)+ }
            }
        }

        impl<T> $name<Option<T>> {
            /// Returns all values if every wheel has a value.
            #[must_use]
            pub fn all(self) -> Option<$name<T>> {
                Some($name { $($wheel: self.$wheel?,)+ })
            }
        }

        impl<T> IntoIterator for $name<T> {
            type Item = T;
            type IntoIter = core::array::IntoIter<T, $count>;
            fn into_iter(self) -> Self::IntoIter {
                self.into_array().into_iter()
            }
        }

        impl $name<AngularVelocity> {
            /// Slows all wheels by one common factor until none is faster than `limit`: the direction of travel stays.
            ///
            /// Returns the wheels and the factor, 0 to 1. A limit that is negative or NaN counts as zero; if any wheel is NaN or
            /// infinite, all stop and the factor is 0.
            #[must_use]
            pub fn desaturate(self, limit: AngularVelocity) -> (Self, f32) {
                let mut fastest = Fastest::default();
                $(fastest.include(self.$wheel);)+
                let scale = fastest.scale(limit);
                (self.map(|wheel| slowed(wheel, scale)), scale)
            }
        }
    };
}

named_wheels! {
    /// One value for each wheel of a mecanum chassis: a speed, a handle, a target.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::{chassis::MecanumWheels, units::AngularVelocity};
    ///
    /// let rpm = MecanumWheels { front_left: 300.0, front_right: 600.0, rear_left: 0.0, rear_right: -150.0 };
    /// let (limited, factor) = rpm.map(AngularVelocity::from_rpm).desaturate(AngularVelocity::from_rpm(450.0));
    /// assert!((factor - 0.75).abs() < 1e-6);
    /// assert!((limited.front_right.as_rpm() - 450.0).abs() < 1e-3);
    /// assert!((limited.rear_right.as_rpm() + 112.5).abs() < 1e-3); // all by the same factor
    /// ```
    MecanumWheels, 4 {
        /// Front left: +x, +y.
        front_left,
        /// Front right: +x, -y.
        front_right,
        /// Rear left: -x, +y.
        rear_left,
        /// Rear right: -x, -y.
        rear_right
    }
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "halves and quarters are exact")]
mod tests {
    use super::*;

    const RADIUS_M: f32 = 0.5;
    const SQUARE: Vec2 = Vec2::new(0.25, 0.25);
    const OBLONG: Vec2 = Vec2::new(0.25, 0.5);

    fn wheels<const FLOOR: char>(mecanum: &Mecanum<FLOOR>, vx: f32, vy: f32, wz: f32) -> [f32; 4] {
        mecanum.inverse(Twist::new(vx, vy, wz)).map(AngularVelocity::as_rad_per_s).into_array()
    }

    fn usual() -> Mecanum {
        Mecanum::new(RADIUS_M, SQUARE).unwrap()
    }

    #[test]
    fn driving_forward_turns_all_wheels_forward() {
        assert_eq!(wheels(&usual(), 1.0, 0.0, 0.0), [2.0, 2.0, 2.0, 2.0]);
        assert_eq!(wheels(&usual(), -1.0, 0.0, 0.0), [-2.0, -2.0, -2.0, -2.0]);
    }

    // The first seed registers FR, FL, RL, RR on rows in the order FL, FR, RL, RR: its robot turned
    // instead of strafing.
    #[test]
    fn strafe_left_turns_front_left_backward() {
        assert_eq!(wheels(&usual(), 0.0, 1.0, 0.0), [-2.0, 2.0, 2.0, -2.0]);
    }

    #[test]
    fn strafe_right_turns_front_left_forward() {
        assert_eq!(wheels(&usual(), 0.0, -1.0, 0.0), [2.0, -2.0, -2.0, 2.0]);
    }

    #[test]
    fn turning_counter_clockwise_turns_the_left_wheels_backward() {
        assert_eq!(wheels(&usual(), 0.0, 0.0, 2.0), [-2.0, 2.0, -2.0, 2.0]);
        assert_eq!(wheels(&usual(), 0.0, 0.0, -2.0), [2.0, -2.0, 2.0, -2.0]);
    }

    #[test]
    fn rolling_front_left_backward_and_front_right_forward_is_a_strafe_to_the_left() {
        let turn = AngularVelocity::from_rad_per_s;
        let strafe = MecanumWheels::from_array([-2.0, 2.0, 2.0, -2.0].map(turn));
        assert_eq!(usual().forward(strafe), Twist::new(0.0, 1.0, 0.0));
        let spin = MecanumWheels::from_array([-2.0, 2.0, -2.0, 2.0].map(turn));
        assert_eq!(usual().forward(spin), Twist::new(0.0, 0.0, 2.0));
    }

    // The fifth seed's rows are left-handed (y forward, x right, clockwise positive) and have no unit.
    #[test]
    fn the_fifth_seeds_rows_agree_after_its_axes_are_turned_into_ours() {
        let (right, front, clockwise) = (0.3_f32, 0.7_f32, 0.2_f32);
        let one = right - front + clockwise; // its wheel 1, front right, positive backward
        let fr = wheels(&usual(), front, -right, -clockwise / 0.5)[1] * 0.5;
        assert!((fr + one).abs() < 1e-6);
    }

    #[test]
    fn with_the_other_rollers_strafe_left_turns_front_left_forward() {
        let other = Mecanum::<'X'>::with_rollers(RADIUS_M, OBLONG).unwrap();
        assert_eq!(wheels(&other, 0.0, 1.0, 0.0), [2.0, -2.0, -2.0, 2.0]);
        assert_eq!(wheels(&other, 0.0, 0.0, 4.0), [-2.0, 2.0, -2.0, 2.0]);
    }

    #[test]
    fn with_the_other_rollers_a_square_chassis_is_refused() {
        let error = Mecanum::<'X'>::with_rollers(RADIUS_M, SQUARE);
        assert!(matches!(error, Err(ConfigError::Singular(_))));
    }

    #[test]
    fn a_length_of_zero_nan_or_infinity_is_named() {
        for bad in [0.0, -0.1, f32::NAN, f32::INFINITY] {
            let radius = Mecanum::new(bad, SQUARE);
            assert_eq!(radius, Err(ConfigError::NotPositive("wheel_radius_m")));
            let track = Mecanum::new(RADIUS_M, Vec2 { y: bad, ..SQUARE });
            assert_eq!(track, Err(ConfigError::NotPositive("front_left_m.y")));
        }
    }

    #[test]
    fn a_lifted_wheel_shows_as_slip_and_rolling_wheels_do_not() {
        let mecanum = usual();
        let rolling = mecanum.inverse(Twist::new(0.5, -0.25, 1.0));
        assert!(mecanum.slip_m_s(rolling) < 1e-6);
        let lifted = MecanumWheels {
            front_left: rolling.front_left + AngularVelocity::from_rad_per_s(8.0),
            ..rolling
        };
        assert!((mecanum.slip_m_s(lifted) - 8.0 * 0.5 / 4.0).abs() < 1e-6);
    }

    #[test]
    fn any_one_wheel_may_be_lost_and_two_may_not() {
        let mecanum = usual();
        let motion = Twist::new(0.5, -0.25, 1.0);
        let full = mecanum.inverse(motion).map(Some);
        for lost in 0..4 {
            let mut partial = full.into_array();
            partial[lost] = None;
            let partial = MecanumWheels::from_array(partial);
            assert_eq!(mecanum.forward_partial(partial), Some(motion));
        }
        let two = MecanumWheels { front_left: None, rear_right: None, ..full };
        assert_eq!(mecanum.forward_partial(two), None);
    }

    #[test]
    fn a_wheel_limit_that_is_broken_or_a_broken_wheel_stops_all() {
        let limit = AngularVelocity::from_rad_per_s;
        let fast = usual().inverse(Twist::new(1.0, 0.5, 0.0));
        let still = MecanumWheels::splat(AngularVelocity::ZERO);
        assert_eq!(fast.desaturate(limit(f32::NAN)), (still, 0.0));
        assert_eq!(fast.desaturate(limit(-1.0)), (still, 0.0));
        assert_eq!(fast.desaturate(limit(f32::INFINITY)), (fast, 1.0));
        let broken = MecanumWheels { rear_left: limit(f32::NAN), ..fast };
        assert_eq!(broken.desaturate(limit(10.0)), (still, 0.0));
    }
}
