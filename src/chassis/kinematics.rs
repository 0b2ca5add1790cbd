//! Wheel layouts as a trait, and the least-squares fit of a motion to measurements along given directions.

use crate::geometry::{Body, Twist, Vec2};
use crate::math::sqrt;
use crate::units::AngularVelocity;
use core::fmt::Debug;

/// A layout of wheels: converts a motion of the body to wheel speeds, and wheel speeds to a motion.
///
/// Every layout has `inverse` and `forward` as its own functions; [`Chassis`](super::Chassis) works with all layouts
/// through this trait.
///
/// # Examples
/// ```
/// use drivetrain::error::ConfigError;
/// use drivetrain::chassis::{Kinematics, Omni};
/// use drivetrain::geometry::{Body, Twist};
///
/// /// How far the motion that is read back is from the one that was asked for, in m/s.
/// fn error_m_s<K: Kinematics>(layout: K, motion: Twist<Body>) -> f32 {
///     (layout.forward(layout.inverse(motion)) - motion).linear().norm()
/// }
///
/// let motion = Twist::new(1.0, -0.5, 2.0);
/// assert!(error_m_s(Omni::three(0.05, 0.2)?, motion) < 1e-5);
/// assert!(error_m_s(Omni::four(0.05, 0.2)?, motion) < 1e-5);
/// # Ok::<(), ConfigError>(())
/// ```
pub trait Kinematics {
    /// One `T` for each wheel, under the name of the wheel.
    type Wheels<T: Copy>: Copy;
    /// Motion of a wheel: its velocity, and for a steered wheel its angle too.
    type Speed: WheelSpeed;
    /// Memory of the wheels from tick to tick: `()`, or the commanded angles of steered wheels.
    type Steering: Copy + Debug + PartialEq;

    /// Nothing remembered: before the first tick, and after the motors were relaxed.
    const UNSTEERED: Self::Steering;

    /// Returns the motion of each wheel for the motion `twist` of the body.
    fn inverse(&self, twist: Twist<Body>) -> Self::Wheels<Self::Speed>;

    /// Returns the motion of the body that best fits the motion of the wheels.
    fn forward(&self, wheels: Self::Wheels<Self::Speed>) -> Twist<Body>;

    /// Returns the motion of the body from the known wheels; `None` when these do not determine the motion.
    fn forward_partial(&self, wheels: Self::Wheels<Option<Self::Speed>>) -> Option<Twist<Body>>;

    /// Returns the radius of the wheels in m.
    fn wheel_radius_m(&self) -> f32;

    /// Turns the value of every wheel into another.
    fn map<T: Copy, U: Copy>(wheels: Self::Wheels<T>, f: impl FnMut(T) -> U) -> Self::Wheels<U>;

    /// Pairs the values of every wheel.
    fn zip<T: Copy, U: Copy>(a: Self::Wheels<T>, b: Self::Wheels<U>) -> Self::Wheels<(T, U)>;

    /// Returns the commands for the motors, from the wanted and the measured motion of the wheels: the wanted motion,
    /// unless the wheels are steered.
    ///
    /// `None` stands for a wheel without feedback; of a steered wheel with a finite angle only, the angle counts.
    #[must_use]
    fn steer(
        &self,
        steering: &mut Self::Steering,
        wanted: Self::Wheels<Self::Speed>,
        measured: Self::Wheels<Option<Self::Speed>>,
    ) -> Self::Wheels<Self::Speed> {
        let _ = (steering, measured);
        wanted
    }

    /// Returns the commands for a chassis that resists being pushed: zero velocities, unless the wheels are steered.
    #[must_use]
    fn lock(
        &self,
        steering: &mut Self::Steering,
        measured: Self::Wheels<Option<Self::Speed>>,
    ) -> Self::Wheels<Self::Speed> {
        let _ = (steering, measured);
        Self::map(self.inverse(Twist::ZERO), WheelSpeed::stopped)
    }

    /// Slows all wheels by one common factor until none is faster than `limit`: the direction of travel stays.
    ///
    /// Returns the wheels and the factor, 0 to 1: a planner or a loop around the chassis multiplies its motion by the factor, and
    /// does not wind up. A limit below zero or NaN counts as zero; if any wheel is NaN or infinite, all stop and the factor is 0.
    #[must_use]
    fn desaturate(
        &self,
        wheels: Self::Wheels<Self::Speed>,
        limit: AngularVelocity,
    ) -> (Self::Wheels<Self::Speed>, f32) {
        let mut fastest = Fastest::default();
        let _: Self::Wheels<()> = Self::map(wheels, |wheel| fastest.include(wheel.velocity()));
        let scale = fastest.scale(limit);
        (Self::map(wheels, |wheel| slowed(wheel, scale)), scale)
    }

    /// Returns the largest difference in m/s between a wheel and the rigid motion of best fit.
    ///
    /// Zero when all wheels roll. For a lifted, slipping or blocked wheel of an over-determined layout, the result is a
    /// part of its error (a quarter with four wheels); with as few wheels as unknowns the result is always zero.
    fn slip_m_s(&self, wheels: Self::Wheels<Self::Speed>) -> f32 {
        let rolling = self.inverse(self.forward(wheels));
        let mut largest = 0.0_f32;
        let _: Self::Wheels<()> = Self::map(Self::zip(wheels, rolling), |(is, fits)| {
            let difference = is.distance(fits);
            if difference > largest || difference.is_nan() {
                largest = difference;
            }
        });
        largest * self.wheel_radius_m()
    }
}

/// The motion of a wheel, as needed for limiting and comparing.
///
/// # Examples
/// ```
/// use drivetrain::chassis::{ModuleState, WheelSpeed};
/// use drivetrain::units::{Angle, AngularVelocity};
///
/// let module = ModuleState::new(AngularVelocity::from_rad_per_s(8.0), Angle::from_degrees(30.0));
/// assert_eq!(module.scaled(0.5).velocity().as_rad_per_s(), 4.0);
/// assert!((module.stopped().angle.as_degrees() - 30.0).abs() < 1e-4); // it stands at its angle
/// assert!((module.distance(module.scaled(-1.0)) - 16.0).abs() < 1e-4);
/// ```
pub trait WheelSpeed: Copy {
    /// Returns the rolling velocity of the wheel, positive forward.
    fn velocity(self) -> AngularVelocity;

    /// Returns whether all values are finite: the velocity, and of a steered wheel the angle.
    fn is_finite(self) -> bool;

    /// Returns the same motion, faster by `factor`.
    #[must_use]
    fn scaled(self, factor: f32) -> Self;

    /// Returns the same wheel at rest, a steered wheel at its angle.
    #[must_use]
    fn stopped(self) -> Self;

    /// Returns the absolute difference to another motion of the same wheel in rad/s.
    fn distance(self, other: Self) -> f32;
}

impl WheelSpeed for AngularVelocity {
    fn velocity(self) -> AngularVelocity {
        self
    }

    fn is_finite(self) -> bool {
        Self::is_finite(self)
    }

    fn scaled(self, factor: f32) -> Self {
        self * factor
    }

    fn stopped(self) -> Self {
        Self::ZERO
    }

    fn distance(self, other: Self) -> f32 {
        (self - other).as_rad_per_s().abs()
    }
}

/// Finds the largest speed of some wheels, then brings each under a limit by the common factor.
#[derive(Debug, Default)]
pub(super) struct Fastest {
    rad_per_s: f32,
    broken: bool,
}

impl Fastest {
    pub(super) fn include(&mut self, velocity: AngularVelocity) {
        let speed = velocity.as_rad_per_s().abs();
        self.broken |= !speed.is_finite();
        if speed > self.rad_per_s {
            self.rad_per_s = speed;
        }
    }

    /// The factor for all wheels, 0..=1; zero when a wheel or the limit is broken.
    pub(super) fn scale(&self, limit: AngularVelocity) -> f32 {
        let limit = limit.as_rad_per_s();
        if self.broken || limit.is_nan() || limit <= 0.0 {
            0.0
        } else if self.rad_per_s > limit {
            limit / self.rad_per_s
        } else {
            1.0
        }
    }
}

/// A scale of zero stops a wheel even at NaN.
pub(super) fn slowed<S: WheelSpeed>(wheel: S, scale: f32) -> S {
    if scale > 0.0 { wheel.scaled(scale) } else { wheel.stopped() }
}

/// Where the wheels' equations begin to be undetermined: the largest condition number of the normal equations.
///
/// The matrix is made free of units first: a turn is measured in m at the mean distance (root of the mean square) of the
/// wheels from the origin. Norms are Frobenius'. At the limit the wheels show the weakest motion with about 3 % of the
/// strongest, the square root of 1/1000, and rounding of `f32` is some 1e-4 of the motion read back.
pub(super) const MAX_CONDITION: f32 = 1000.0;

/// The part of a motion in one measurement: `direction . (velocity of the body's origin) + yaw_m * wz`, in m/s.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Row {
    pub(super) direction: Vec2,
    yaw_m: f32,
    /// The squared distance of the point: the upper bound of `yaw_m` squared.
    reach_m2: f32,
}

impl Row {
    /// The velocity along `direction`, of length 1, of the point at `point_m`.
    pub(super) const fn new(direction: Vec2, point_m: Vec2) -> Self {
        Self { direction, yaw_m: point_m.cross(direction), reach_m2: point_m.dot(point_m) }
    }

    pub(super) const fn of(self, twist: Twist<Body>) -> f32 {
        self.direction.x * twist.vx_m_s
            + self.direction.y * twist.vy_m_s
            + self.yaw_m * twist.wz_rad_s
    }
}

/// The normal equations of some rows: symmetric 3x3, filled row by row.
#[derive(Debug, Clone, Copy)]
pub(super) struct Normal {
    xx: f32,
    xy: f32,
    xw: f32,
    yy: f32,
    yw: f32,
    ww: f32,
    reach_m2: f32,
    rows: f32,
}

impl Normal {
    const fn new() -> Self {
        Self { xx: 0.0, xy: 0.0, xw: 0.0, yy: 0.0, yw: 0.0, ww: 0.0, reach_m2: 0.0, rows: 0.0 }
    }

    /// The normal equations of all these rows.
    pub(super) fn of(rows: impl IntoIterator<Item = Row>) -> Self {
        let mut normal = Self::new();
        for row in rows {
            normal.add(row);
        }
        normal
    }

    const fn add(&mut self, row: Row) {
        let Row { direction: Vec2 { x, y }, yaw_m: w, reach_m2 } = row;
        self.xx += x * x;
        self.xy += x * y;
        self.xw += x * w;
        self.yy += y * y;
        self.yw += y * w;
        self.ww += w * w;
        self.reach_m2 += reach_m2;
        self.rows += 1.0;
    }

    /// `None` when the rows leave some motion undetermined, or nearly: see [`MAX_CONDITION`].
    pub(super) fn inverse(&self) -> Option<Inverse> {
        let per_reach = sqrt(self.rows / self.reach_m2);
        let Self { xx, xy, yy, .. } = *self;
        let (xw, yw, ww) =
            (self.xw * per_reach, self.yw * per_reach, self.ww * per_reach * per_reach);
        let (a, b, c) = (yy * ww - yw * yw, xw * yw - xy * ww, xy * yw - xw * yy);
        let scale = 1.0 / (xx * a + xy * b + xw * c);
        let inverse = Inverse {
            xx: a * scale,
            xy: b * scale,
            xw: c * scale,
            yy: (xx * ww - xw * xw) * scale,
            yw: (xy * xw - xx * yw) * scale,
            ww: (xx * yy - xy * xy) * scale,
        };
        let condition = sqrt(square([xx, yy, ww], [xy, xw, yw]))
            * sqrt(square(
                [inverse.xx, inverse.yy, inverse.ww],
                [inverse.xy, inverse.xw, inverse.yw],
            ));
        // Not written the other way round: NaN is no condition either.
        (scale > 0.0 && condition <= MAX_CONDITION).then_some(Inverse {
            xw: inverse.xw * per_reach,
            yw: inverse.yw * per_reach,
            ww: inverse.ww * per_reach * per_reach,
            ..inverse
        })
    }
}

/// The sum of squares of a symmetric matrix, from its diagonal and the upper rest.
fn square(diagonal: [f32; 3], upper: [f32; 3]) -> f32 {
    let sum = |values: [f32; 3]| values.iter().fold(0.0, |sum, value| sum + value * value);
    sum(diagonal) + 2.0 * sum(upper)
}

/// The inverse of [`Normal`].
#[derive(Debug, Clone, Copy)]
pub(super) struct Inverse {
    xx: f32,
    xy: f32,
    xw: f32,
    yy: f32,
    yw: f32,
    ww: f32,
}

impl Inverse {
    /// The share of one measurement in the motion: its column of the pseudo-inverse.
    pub(super) const fn share(&self, row: Row) -> Twist<Body> {
        let Row { direction: Vec2 { x, y }, yaw_m: w, .. } = row;
        Twist::new(
            self.xx * x + self.xy * y + self.xw * w,
            self.xy * x + self.yy * y + self.yw * w,
            self.xw * x + self.yw * y + self.ww * w,
        )
    }
}

/// Fits the motion to the measurements in m/s; `None` when these leave a part of the motion undetermined.
pub(super) fn fit(measured: impl Iterator<Item = (Row, f32)> + Clone) -> Option<Twist<Body>> {
    let inverse = Normal::of(measured.clone().map(|(row, _)| row)).inverse()?;
    Some(measured.fold(Twist::ZERO, |sum, (row, speed)| sum + inverse.share(row) * speed))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chassis::{Omni, Swerve};
    use crate::error::ConfigError;
    use crate::geometry::Pose2;
    use crate::units::Angle;

    /// Three wheels at 0.2 m from a centre `ahead_m` before the origin of the body.
    fn three(ahead_m: f32) -> Result<Omni<3>, ConfigError> {
        let wheel = |degrees| {
            let wheel = Pose2::<Body>::tangential(Angle::from_degrees(degrees), 0.2);
            Pose2::new(wheel.x_m + ahead_m, wheel.y_m, wheel.angle)
        };
        Omni::new(0.05, [60.0, -60.0, 180.0].map(wheel))
    }

    // These were accepted: the determinant alone does not see the weak motion.
    #[test]
    fn wheels_whose_centre_is_ten_metres_off_are_refused() {
        assert!(three(0.0).is_ok() && three(0.5).is_ok() && three(3.0).is_ok());
        assert_eq!(three(10.0), Err(ConfigError::Singular("every motion")));
        let far = |y| Vec2::new(10.0, y);
        assert!(Swerve::new(0.05, [far(3.0), far(-3.0)]).is_ok());
        let near = Swerve::new(0.05, [far(0.3), far(-0.3)]);
        assert_eq!(near, Err(ConfigError::Singular("the rotation")));
    }

    #[test]
    fn the_unit_of_length_does_not_matter() {
        for scale in [1e-3, 1.0, 1e3] {
            let places = |y: f32| [Vec2::new(1.0, y) * scale, Vec2::new(1.0, -y) * scale];
            assert!(Swerve::new(0.05, places(0.1)).is_ok(), "{scale}");
            assert!(Swerve::new(0.05, places(0.01)).is_err(), "{scale}");
        }
    }

    #[test]
    fn the_worst_accepted_geometry_is_read_back() {
        let omni = [4.5, 4.0, 3.5, 3.0].map(three).into_iter().find_map(Result::ok);
        let omni = omni.unwrap();
        let motion = Twist::new(0.5, -0.25, 1.0);
        let error = omni.forward(omni.inverse(motion)) - motion;
        let error_m_s = error.linear().norm() + 4.0 * error.wz_rad_s.abs();
        assert!(error_m_s < 1e-4 * 4.5, "{error:?}");
    }

    #[test]
    fn places_beyond_all_numbers_are_refused() {
        let far = [Vec2::new(1e20, 0.0), Vec2::new(-1e20, 0.0)];
        assert!(Swerve::new(0.05, far).is_err());
        let there = Pose2::tangential(Angle::ZERO, 1e-25);
        assert!(Omni::new(0.05, [there; 3]).is_err());
    }
}
