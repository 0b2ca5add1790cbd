//! Transforms and poses in the plane.

use super::twist::Arc;
use super::vector::copy;
use super::{Body, Heading, Point2, Rotation2, TOLERANCE, Twist, Vec2};
use crate::error::ConfigError;
use crate::math::wrap_pi;
use crate::units::Angle;
use core::marker::PhantomData;

/// Place of the frame `From` in the frame `To`; applied to a point in `From`, gives the point in `To`.
///
/// # Examples
/// ```
/// use drivetrain::{geometry::{Body, Point2, Rotation2, Transform2, Vec2}, units::Angle};
///
/// #[derive(Debug, PartialEq)]
/// enum Sensor {}
///
/// // The first seed's example: a sensor at (0.2, 0.1), turned 45 degrees to the left, sees a point 0.5 m ahead.
/// let turn = Rotation2::new(Angle::from_degrees(45.0));
/// let sensor_to_body = Transform2::<Sensor, Body>::new(turn, Vec2::new(0.2, 0.1));
/// let point: Point2<Body> = sensor_to_body.apply(Point2::new(0.5, 0.0));
/// assert!((point.x_m - 0.553_553_4).abs() < 1e-6 && (point.y_m - 0.453_553_4).abs() < 1e-6);
/// ```
///
/// A point of another frame is refused:
/// ```compile_fail
/// use drivetrain::geometry::{Body, Gimbal, Point2, Transform2, World};
///
/// let body_to_world = Transform2::<Body, World>::IDENTITY;
/// body_to_world.apply(Point2::<Gimbal>::new(0.5, 0.0));
/// ```
///
/// and so is a chain whose links do not meet:
/// ```compile_fail
/// use drivetrain::geometry::{Body, Gimbal, Transform2, World};
///
/// Transform2::<Body, World>::IDENTITY.compose(Transform2::<Body, Gimbal>::IDENTITY);
/// ```
#[derive(Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(bound = ""))]
pub struct Transform2<From, To> {
    rotation: Rotation2,
    translation_m: Vec2,
    #[cfg_attr(feature = "serde", serde(skip))]
    frames: PhantomData<(From, To)>,
}

copy!(Transform2<From, To>);

impl<From, To> Transform2<From, To> {
    /// Both frames in the same place.
    pub const IDENTITY: Self = Self::new(Rotation2::IDENTITY, Vec2::ZERO);

    /// Takes the turn of `From` against `To`, and where the origin of `From` stands in `To` in m.
    #[must_use]
    pub const fn new(rotation: Rotation2, translation_m: Vec2) -> Self {
        Self { rotation, translation_m, frames: PhantomData }
    }

    /// Returns the turn of `From` against `To`.
    #[must_use]
    pub const fn rotation(self) -> Rotation2 {
        self.rotation
    }

    /// Returns where the origin of `From` stands in `To`, in m.
    #[must_use]
    pub const fn translation_m(self) -> Vec2 {
        self.translation_m
    }

    /// Returns the point of `From` as seen in `To`.
    ///
    /// Costs 14 instructions on a Cortex-M4F (`docs/figures.md`).
    #[must_use]
    #[inline]
    pub const fn apply(self, point: Point2<From>) -> Point2<To> {
        let turned = self.rotation.apply(point.to_vec());
        Point2::new(turned.x + self.translation_m.x, turned.y + self.translation_m.y)
    }

    /// Returns the transform that goes through `first` and then through `self`.
    ///
    /// Rounding adds up as in [`Rotation2`]; call [`normalized`](Self::normalized) once in a thousand. Then 10^6 composed
    /// steps are right to 1e-3 rad and to 1e-3 of the largest distance on the way; a circle of 1 m closes to 1 cm.
    ///
    /// Costs 26 instructions on a Cortex-M4F (`docs/figures.md`).
    #[must_use]
    #[inline]
    pub const fn compose<Start>(self, first: Transform2<Start, From>) -> Transform2<Start, To> {
        let turned = self.rotation.apply(first.translation_m);
        Transform2::new(
            self.rotation.compose(first.rotation),
            Vec2::new(turned.x + self.translation_m.x, turned.y + self.translation_m.y),
        )
    }

    /// Returns the transform back.
    ///
    /// Costs 15 instructions on a Cortex-M4F (`docs/figures.md`).
    #[must_use]
    #[inline]
    pub const fn inverse(self) -> Transform2<To, From> {
        let (back, t) = (self.rotation.inverse(), self.translation_m);
        // The turned translation with its sign changed, the minus taken into the products.
        let origin = Vec2::new(
            back.sin() * t.y - back.cos() * t.x,
            self.rotation.sin() * t.x - back.cos() * t.y,
        );
        Transform2::new(back, origin)
    }

    /// Returns where `From` stands as seen from `base`, both given in `To`.
    #[must_use]
    pub const fn relative_to<Base>(self, base: Transform2<Base, To>) -> Transform2<From, Base> {
        base.inverse().compose(self)
    }

    /// Returns the transform with its rotation brought back to length 1.
    #[must_use]
    pub const fn normalized(self) -> Self {
        Self::new(self.rotation.normalized(), self.translation_m)
    }

    /// Returns the transform at the fraction `t` of the way to `other`: the origin on the straight line, the turn evenly
    /// by the shorter way. For the way along a constant twist, take [`exp`](Self::exp) of the [`log`](Self::log) of the relative transform.
    #[must_use]
    pub fn interpolate(self, other: Self, t: f32) -> Self {
        let way = other.translation_m - self.translation_m;
        Self::new(self.rotation.interpolate(other.rotation, t), self.translation_m + way * t)
    }

    /// Returns the pose of a body after `dt_s` seconds at the constant `twist`, seen from its start: the exponential.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::geometry::{Body, Transform2, Twist, World};
    /// use core::f32::consts::FRAC_PI_2;
    ///
    /// // 1 m/s on a circle of 1 m, for a quarter of it.
    /// let end = Transform2::<Body, World>::exp(Twist::new(1.0, 0.0, 1.0), FRAC_PI_2);
    /// assert!((end.translation_m().x - 1.0).abs() < 1e-6 && (end.translation_m().y - 1.0).abs() < 1e-6);
    /// assert!((end.rotation().angle().as_degrees() - 90.0).abs() < 1e-4);
    /// ```
    #[must_use]
    pub const fn exp(twist: Twist<Body>, dt_s: f32) -> Self {
        let (line, turn) = twist.over(dt_s).chord();
        Self::new(turn, line)
    }

    /// Returns the constant twist that leads here in `dt_s` seconds, turning by at most half a revolution: the logarithm.
    ///
    /// With a `dt_s` of zero the twist is not finite.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::geometry::{Body, Transform2, Twist, World};
    ///
    /// let twist = Twist::new(1.0, -0.2, 0.7);
    /// let back = Transform2::<Body, World>::exp(twist, 0.5).log(0.5);
    /// assert!((back.vx_m_s - 1.0).abs() < 1e-6 && (back.vy_m_s + 0.2).abs() < 1e-6);
    /// assert!((back.wz_rad_s - 0.7).abs() < 1e-6);
    /// ```
    #[must_use]
    pub fn log(self, dt_s: f32) -> Twist<Body> {
        let arc = Arc::over_chord(self.translation_m, self.rotation.angle().as_radians());
        Twist::new(arc.x_m / dt_s, arc.y_m / dt_s, arc.theta_rad / dt_s)
    }

    /// Returns the same place as position and angle in `To`.
    #[must_use]
    pub fn to_pose(self) -> Pose2<To> {
        Pose2::new(self.translation_m.x, self.translation_m.y, self.rotation.angle())
    }

    /// Returns the homogeneous matrix, rows first.
    #[must_use]
    pub const fn to_matrix(self) -> [[f32; 3]; 3] {
        let (cos, sin) = (self.rotation.cos(), self.rotation.sin());
        [[cos, -sin, self.translation_m.x], [sin, cos, self.translation_m.y], [0.0, 0.0, 1.0]]
    }

    /// Takes a homogeneous matrix, rows first.
    ///
    /// # Errors
    /// [`ConfigError`] when a number is not finite, the upper left 2x2 is no rotation (to 1e-3) or the last row is not
    /// 0, 0, 1.
    pub fn from_matrix(matrix: [[f32; 3]; 3]) -> Result<Self, ConfigError> {
        let [[a, b, x], [c, d, y], last] = matrix;
        if !matrix.as_flattened().iter().all(|number| number.is_finite()) {
            return Err(ConfigError::NotFinite("matrix"));
        }
        let near = |is: f32, should: f32| (is - should).abs() <= TOLERANCE;
        if !(near(a, d) && near(b, -c) && near(a * a + c * c, 1.0)) {
            return Err(ConfigError::Unusable("rotation of the matrix"));
        }
        if !last.iter().zip([0.0, 0.0, 1.0]).all(|(&is, should)| near(is, should)) {
            return Err(ConfigError::Unusable("last row of the matrix"));
        }
        let rotation = Rotation2::from_parts(0.5 * (a + d), 0.5 * (c - b)).normalized();
        Ok(Self::new(rotation, Vec2::new(x, y)))
    }
}

impl<From, To> Default for Transform2<From, To> {
    fn default() -> Self {
        Self::IDENTITY
    }
}

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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Body, World};
    use crate::units::Angle;
    use core::f32::consts::TAU;
    use proptest::prelude::*;

    type BodyToWorld = Transform2<Body, World>;

    fn at(x: f32, y: f32, angle: f32) -> BodyToWorld {
        Transform2::new(Rotation2::new(Angle::from_radians(angle)), Vec2::new(x, y))
    }

    fn difference(a: BodyToWorld, b: BodyToWorld) -> f32 {
        let mut worst = 0.0_f32;
        for (left, right) in a.to_matrix().as_flattened().iter().zip(b.to_matrix().as_flattened()) {
            worst = worst.max((left - right).abs());
        }
        worst
    }

    #[test]
    fn a_quarter_turn_then_a_step_composes_in_that_order() {
        // Copy and compose in the first seed's system shared one matrix.
        let turn = at(0.0, 0.0, core::f32::consts::FRAC_PI_2);
        let step = Transform2::<Body, Body>::new(Rotation2::IDENTITY, Vec2::new(1.0, 0.0));
        let ahead = turn.compose(step).apply(Point2::ORIGIN);
        assert!(ahead.x_m.abs() < 1e-6 && (ahead.y_m - 1.0).abs() < 1e-6, "{ahead:?}");
        let copy = turn;
        assert_eq!(copy, turn);
    }

    #[test]
    fn a_quarter_of_a_circle_ends_beside_its_centre() {
        let quarter = core::f32::consts::FRAC_PI_2;
        let end = BodyToWorld::exp(Twist::new(quarter, 0.0, quarter), 1.0); // radius 1, to the left
        assert!(difference(end, at(1.0, 1.0, quarter)) < 1e-6, "{end:?}");
        let end = BodyToWorld::exp(Twist::new(quarter, 0.0, -quarter), 1.0);
        assert!(difference(end, at(1.0, -1.0, -quarter)) < 1e-6, "{end:?}");
    }

    #[test]
    fn a_tiny_turn_keeps_its_sideways_way() {
        let (line, _) = Arc::new(1.0, 0.0, 1e-5).chord();
        assert!((line.y - 5e-6).abs() < 1e-11, "1 - cos(theta) would cancel: {}", line.y);
    }

    #[test]
    fn a_circle_of_a_million_composed_steps_ends_at_its_start() {
        // 1 m radius; each step as rounded to f32, a million times: the last place of the turn
        // counts.
        let step = Transform2::<Body, Body>::exp(Twist::new(TAU * 1e-6, 0.0, TAU * 1e-6), 1.0);
        let mut end = BodyToWorld::IDENTITY;
        for count in 1..=1_000_000 {
            end = end.compose(step);
            if count % 1_000 == 0 {
                end = end.normalized();
            }
        }
        let (place, angle) = (end.translation_m(), end.rotation().angle());
        assert!(place.norm() < 0.01, "{place:?}");
        assert!(angle.as_radians().abs() < 1e-3, "{angle:?}");
    }

    #[test]
    fn matrices_that_are_no_transform_are_refused() {
        let matrix = at(1.0, 2.0, 0.5).to_matrix();
        let with = |row: usize, column: usize, value: f32| {
            let mut changed = matrix;
            changed[row][column] = value;
            BodyToWorld::from_matrix(changed)
        };
        assert_eq!(with(0, 2, f32::NAN), Err(ConfigError::NotFinite("matrix")));
        assert_eq!(with(0, 0, -0.5), Err(ConfigError::Unusable("rotation of the matrix")));
        assert_eq!(with(2, 2, 2.0), Err(ConfigError::Unusable("last row of the matrix")));
        assert!(
            BodyToWorld::from_matrix(matrix).is_ok_and(|t| difference(t, at(1.0, 2.0, 0.5)) < 1e-6)
        );
    }

    fn transforms() -> impl Strategy<Value = BodyToWorld> {
        (-10.0_f32..10.0, -10.0_f32..10.0, -7.0_f32..7.0).prop_map(|(x, y, a)| at(x, y, a))
    }

    fn loops() -> impl Strategy<Value = Transform2<Body, Body>> {
        transforms().prop_map(|t| Transform2::new(t.rotation(), t.translation_m()))
    }

    proptest! {
        #[test]
        fn a_transform_composed_with_its_inverse_in_either_order_changes_nothing(t in transforms()) {
            let nothing = t.inverse().compose(t);
            prop_assert!(nothing.translation_m().norm() < 1e-5);
            prop_assert!(nothing.rotation().angle().as_radians().abs() < 1e-6);
            prop_assert!(difference(t.compose(t.inverse()).compose(BodyToWorld::IDENTITY), BodyToWorld::IDENTITY) < 1e-5);
            prop_assert!(difference(t.inverse().inverse(), t) < 1e-5);
            prop_assert_eq!(t.compose(Transform2::<Body, Body>::IDENTITY), t);
        }

        #[test]
        fn a_chain_moves_a_point_as_its_links_in_turn(
            a in transforms(), b in loops(), x in -10.0_f32..10.0, y in -10.0_f32..10.0
        ) {
            let point = Point2::<Body>::new(x, y);
            let error = a.compose(b).apply(point) - a.apply(b.apply(point));
            prop_assert!(error.to_vec().norm() < 2e-5, "{error:?}");
        }

        #[test]
        fn composition_is_associative(a in transforms(), b in loops(), c in loops()) {
            let error = difference(a.compose(b).compose(c), a.compose(b.compose(c)));
            prop_assert!(error < 2e-5, "{error}");
        }

        #[test]
        fn the_inverse_of_a_chain_is_the_reversed_chain(a in transforms(), b in loops()) {
            let whole = a.compose(b).inverse();
            let parts = b.inverse().compose(a.inverse());
            prop_assert!((whole.translation_m() - parts.translation_m()).norm() < 2e-5);
        }

        #[test]
        fn exp_of_log_leads_back_also_near_half_a_turn(t in transforms(), near in -1e-3_f32..1e-3) {
            prop_assert!(difference(BodyToWorld::exp(t.log(1.0), 1.0), t) < 2e-5);
            let half = at(t.translation_m().x, t.translation_m().y, core::f32::consts::PI + near);
            prop_assert!(difference(BodyToWorld::exp(half.log(1.0), 1.0), half) < 2e-5);
        }

        #[test]
        fn log_of_exp_leads_back_for_the_smallest_turns(
            x in -5.0_f32..5.0, y in -5.0_f32..5.0, power in 0.0_f32..12.0, left in any::<bool>()
        ) {
            let theta = if left { 1.0 } else { -1.0 } * 10.0_f32.powf(-power);
            let error = BodyToWorld::exp(Twist::new(x, y, theta), 1.0).log(1.0) - Twist::new(x, y, theta);
            prop_assert!(error.vx_m_s.abs() < 3e-6 && error.vy_m_s.abs() < 3e-6, "{error:?}");
            prop_assert!(error.wz_rad_s.abs() < 1e-6 * theta.abs(), "{theta}: {error:?}");
        }

        #[test]
        fn log_of_exp_leads_back(x in -5.0_f32..5.0, y in -5.0_f32..5.0, theta in -3.0_f32..3.0) {
            let error = BodyToWorld::exp(Twist::new(x, y, theta), 1.0).log(1.0) - Twist::new(x, y, theta);
            prop_assert!(error.vx_m_s.abs() < 1e-5 && error.vy_m_s.abs() < 1e-5, "{error:?}");
            prop_assert!(error.wz_rad_s.abs() < 1e-6, "{error:?}");
        }

        #[test]
        fn a_relative_pose_leads_from_the_base_to_the_pose(a in transforms(), b in transforms()) {
            let seen: Transform2<Body, Body> = a.relative_to(b);
            prop_assert!(difference(b.compose(seen), a) < 2e-5);
        }
    }
}
