//! Motions of a frame, and the arc of a motion.

use super::vector::{copy, linear};
use super::{Body, Gimbal, Heading, Rotation2, Vec2, World};
use crate::math::sin_cos;
use core::marker::PhantomData;

/// The velocity of a rigid body in the plane: two of translation, one of rotation, in the frame `F`.
///
/// # Examples
/// ```
/// use drivetrain::{geometry::{Heading, Twist, World}, units::Angle};
///
/// // Facing left, "world forward" is to the right of the chassis.
/// let facing_left = Heading::new(Angle::from_degrees(90.0));
/// let body = Twist::<World>::new(1.0, 0.0, 0.5).to_body(facing_left);
/// assert!(body.vx_m_s.abs() < 1e-6 && (body.vy_m_s + 1.0).abs() < 1e-6);
/// assert_eq!(body.wz_rad_s, 0.5);
/// ```
#[derive(Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(bound = ""))]
pub struct Twist<F> {
    /// Velocity along x in m/s: forward is positive.
    pub vx_m_s: f32,
    /// Velocity along y in m/s: left is positive.
    pub vy_m_s: f32,
    /// Velocity about z in rad/s: counter-clockwise is positive.
    pub wz_rad_s: f32,
    #[cfg_attr(feature = "serde", serde(skip))]
    frame: PhantomData<F>,
}

copy!(Twist<F>);
linear!(Twist<F>, vx_m_s, vy_m_s, wz_rad_s; frame);

impl<F> Twist<F> {
    /// Standing still.
    pub const ZERO: Self = Self::new(0.0, 0.0, 0.0);

    /// Takes the velocities along x and y in m/s and about z in rad/s.
    #[must_use]
    pub const fn new(vx_m_s: f32, vy_m_s: f32, wz_rad_s: f32) -> Self {
        Self { vx_m_s, vy_m_s, wz_rad_s, frame: PhantomData }
    }

    /// Returns the velocity of translation in m/s.
    #[must_use]
    pub const fn linear(self) -> Vec2 {
        Vec2::new(self.vx_m_s, self.vy_m_s)
    }

    /// Returns the same translation with another rotation, in rad/s.
    #[must_use]
    pub const fn with_wz(self, wz_rad_s: f32) -> Self {
        Self::new(self.vx_m_s, self.vy_m_s, wz_rad_s)
    }

    /// Returns whether no part is NaN or infinite.
    #[must_use]
    pub const fn is_finite(self) -> bool {
        self.vx_m_s.is_finite() && self.vy_m_s.is_finite() && self.wz_rad_s.is_finite()
    }

    const fn turned<G>(self, rotation: Rotation2) -> Twist<G> {
        let linear = rotation.apply(self.linear());
        Twist::new(linear.x, linear.y, self.wz_rad_s)
    }
}

impl<F> Default for Twist<F> {
    fn default() -> Self {
        Self::ZERO
    }
}

impl Twist<World> {
    /// Returns the same motion as seen by the chassis: turned by minus the heading.
    #[must_use]
    pub const fn to_body(self, heading: Heading) -> Twist<Body> {
        self.turned(heading.rotation().inverse())
    }
}

impl Twist<Gimbal> {
    /// Returns the same motion as seen by the chassis; `yaw` is the gimbal's turn against the chassis.
    #[must_use]
    pub const fn to_body_by_yaw(self, yaw: Heading) -> Twist<Body> {
        self.turned(yaw.rotation())
    }
}

impl Twist<Body> {
    /// Returns the same motion as seen in the world: turned by the heading.
    #[must_use]
    pub const fn to_world(self, heading: Heading) -> Twist<World> {
        self.turned(heading.rotation())
    }

    /// Returns the velocity in m/s of the point of the chassis at `point_m` from its origin.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::geometry::{Body, Twist, Vec2};
    ///
    /// // Turning left, the nose moves left and the left side moves back.
    /// let turning = Twist::<Body>::new(0.0, 0.0, 2.0);
    /// assert_eq!(turning.at(Vec2::new(0.5, 0.0)), Vec2::new(0.0, 1.0));
    /// assert_eq!(turning.at(Vec2::new(0.0, 0.5)), Vec2::new(-1.0, 0.0));
    /// ```
    #[must_use]
    pub const fn at(self, point_m: Vec2) -> Vec2 {
        Vec2::new(self.vx_m_s - self.wz_rad_s * point_m.y, self.vy_m_s + self.wz_rad_s * point_m.x)
    }

    /// Returns the motion of the origin at which the point `center_m` has the velocity of `self`.
    ///
    /// With a pure rotation the chassis then turns about this point.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::geometry::{Body, Twist, Vec2};
    ///
    /// let nose = Vec2::new(0.5, 0.0);
    /// let about_nose = Twist::<Body>::new(0.0, 0.0, 2.0).about(nose);
    /// assert_eq!(about_nose, Twist::new(0.0, -1.0, 2.0)); // the origin swings to the right
    /// assert_eq!(about_nose.at(nose), Vec2::ZERO);
    /// ```
    #[must_use]
    pub const fn about(self, center_m: Vec2) -> Self {
        let origin = self.at(Vec2::new(-center_m.x, -center_m.y));
        Self::new(origin.x, origin.y, self.wz_rad_s)
    }
}

/// A stretch of motion at constant twist, in the frame of the body where the stretch begins.
///
/// This is the logarithm of a planar transform: `x_m` and `y_m` are the way along the body's own axes, which turn by
/// `theta_rad` on the way.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Arc {
    /// The way along the body's x axis in m: forward is positive.
    pub(crate) x_m: f32,
    /// The way along the body's y axis in m: left is positive.
    pub(crate) y_m: f32,
    /// The turn in rad: counter-clockwise is positive.
    pub(crate) theta_rad: f32,
}

impl Arc {
    pub(crate) const fn new(x_m: f32, y_m: f32, theta_rad: f32) -> Self {
        Self { x_m, y_m, theta_rad }
    }

    /// Returns the straight line in m from start to end, in the frame of the start, and the turn.
    ///
    /// Exact for any turn: the line is the way times `sin(h)/h`, turned by `h`, with `h` half the turn. Nothing
    /// cancels near zero.
    pub(crate) const fn chord(self) -> (Vec2, Rotation2) {
        let half = 0.5 * self.theta_rad;
        let (sin, cos) = sin_cos(half);
        // Below, 1 - h^2/6 is as exact as f32, and 0/0 is out of the way.
        let shrink = if half.abs() < 1e-2 { 1.0 - half * half * (1.0 / 6.0) } else { sin / half };
        let middle = Rotation2::from_parts(cos, sin);
        let line = middle.apply(Vec2::new(self.x_m * shrink, self.y_m * shrink));
        (line, Rotation2::from_parts(1.0 - 2.0 * sin * sin, 2.0 * sin * cos))
    }

    /// Returns the arc over the straight line `chord_m` with the turn `theta_rad`: undoes [`chord`](Self::chord).
    ///
    /// A turn of a whole number of revolutions has no chord to speak of; the result is then very long or not finite.
    pub(crate) const fn over_chord(chord_m: Vec2, theta_rad: f32) -> Self {
        let half = 0.5 * theta_rad;
        let (sin, cos) = sin_cos(half);
        let stretch = if half.abs() < 1e-2 { 1.0 + half * half * (1.0 / 6.0) } else { half / sin };
        let way = Rotation2::from_parts(cos, -sin).apply(chord_m);
        Self::new(way.x * stretch, way.y * stretch, theta_rad)
    }
}

impl Twist<Body> {
    /// Returns the stretch of this twist in `dt_s` seconds.
    pub(crate) const fn over(self, dt_s: f32) -> Arc {
        Arc::new(self.vx_m_s * dt_s, self.vy_m_s * dt_s, self.wz_rad_s * dt_s)
    }

    /// Returns the twist that, held for `dt_s`, ends at the pose of `self` with its direction fixed in space.
    ///
    /// A command to go forward and turn means: straight ahead in the present direction of the body. Held for a period,
    /// the command bends into an arc, and the robot skews off by half the turn of a period. This function removes the
    /// bend. Turns of more than half a revolution in a period, and a `dt_s` that is not finite, leave the twist
    /// unchanged.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::geometry::{Body, Transform2, Twist};
    ///
    /// let command = Twist::<Body>::new(2.0, 0.0, 5.0);
    /// let line_m = |twist| Transform2::<Body, Body>::exp(twist, 0.02).translation_m();
    /// let straight = line_m(command.discretized(0.02));
    /// assert!((straight.x - 0.04).abs() < 1e-6 && straight.y.abs() < 1e-6); // straight ahead
    /// assert!(line_m(command).y > 0.001); // without: off to the left
    /// ```
    #[must_use]
    pub const fn discretized(self, dt_s: f32) -> Self {
        let theta_rad = self.wz_rad_s * dt_s;
        if theta_rad.abs() <= core::f32::consts::PI {
            let arc = Arc::over_chord(self.linear(), theta_rad);
            Self::new(arc.x_m, arc.y_m, self.wz_rad_s)
        } else {
            self
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::Angle;
    use proptest::prelude::*;

    fn close(a: Vec2, x: f32, y: f32) {
        assert!((a - Vec2::new(x, y)).norm() < 1e-6, "{a:?}, expected ({x}, {y})");
    }

    #[test]
    fn facing_left_world_forward_is_body_right_and_back_again() {
        // The third seed turns by R(theta) here; world to body is R(-theta).
        let heading = Heading::new(Angle::from_degrees(90.0));
        let body = Twist::<World>::new(1.0, 0.0, 0.0).to_body(heading);
        close(body.linear(), 0.0, -1.0);
        close(body.to_world(heading).linear(), 1.0, 0.0);
        close(Twist::<Body>::new(1.0, 0.0, 0.0).to_world(heading).linear(), 0.0, 1.0);
    }

    #[test]
    fn gimbal_looking_left_its_forward_is_body_left() {
        let yaw = Heading::new(Angle::from_degrees(90.0));
        close(Twist::<Gimbal>::new(1.0, 0.0, 0.0).to_body_by_yaw(yaw).linear(), 0.0, 1.0);
    }

    #[test]
    fn ninety_degrees_turns_forward_to_left_and_left_to_back() {
        // The first seed's transform turned by 90 * pi / 180 / 57: its sine took radians for degrees.
        let quarter = Rotation2::new(Angle::from_degrees(90.0));
        close(quarter.apply(Vec2::new(1.0, 0.0)), 0.0, 1.0);
        close(quarter.apply(Vec2::new(0.0, 1.0)), -1.0, 0.0);
        close(quarter.inverse().apply(Vec2::new(1.0, 0.0)), 0.0, -1.0);
    }

    #[test]
    fn interpolation_takes_the_shorter_way_over_the_seam() {
        let at = |degrees| Rotation2::new(Angle::from_degrees(degrees));
        let middle = at(170.0).interpolate(at(-170.0), 0.5).angle().as_degrees();
        assert!((middle.abs() - 180.0).abs() < 1e-3, "{middle}");
        let half = at(10.0).interpolate(at(-30.0), 0.5).angle().as_degrees();
        assert!((half + 10.0).abs() < 1e-3, "{half}");
    }

    #[test]
    fn a_million_compositions_keep_the_angle_and_nearly_the_length() {
        let step = Rotation2::new(Angle::from_radians(0.001));
        let (mut bare, mut kept) = (Rotation2::IDENTITY, Rotation2::IDENTITY);
        for _ in 0..1_000_000 {
            bare = bare.compose(step);
            kept = kept.compose(step).normalized();
        }
        let length = |r: Rotation2| Vec2::new(r.cos(), r.sin()).norm();
        assert!((length(bare) - 1.0).abs() < 0.03, "{}", length(bare));
        assert!((length(kept) - 1.0).abs() < 2e-7, "{}", length(kept));
        let expected = 1000.0 - 159.0 * core::f64::consts::TAU;
        assert!((f64::from(kept.angle().as_radians()) - expected).abs() < 1e-4);
    }

    proptest! {
        #[test]
        fn to_body_undoes_to_world(
            vx in -10.0_f32..10.0, vy in -10.0_f32..10.0, wz in -20.0_f32..20.0, yaw in -100.0_f32..100.0
        ) {
            let heading = Heading::new(Angle::from_radians(yaw));
            let there = Twist::<Body>::new(vx, vy, wz);
            let error = there.to_world(heading).to_body(heading) - there;
            prop_assert!(error.linear().norm() < 1e-5 && error.wz_rad_s == 0.0);
        }

        #[test]
        fn the_centre_of_rotation_keeps_the_velocity_given(
            x in -2.0_f32..2.0, y in -2.0_f32..2.0, vx in -5.0_f32..5.0, wz in -10.0_f32..10.0
        ) {
            let center = Vec2::new(x, y);
            let at_center = Twist::<Body>::new(vx, 0.0, wz).about(center).at(center);
            prop_assert!((at_center - Vec2::new(vx, 0.0)).norm() < 1e-4);
        }
    }
}
