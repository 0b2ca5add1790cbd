//! Least-squares fit of a motion to measurements along given directions.

use crate::geometry::{Body, Twist, Vec2};
use crate::math::sqrt;

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
    pub(super) yaw_m: f32,
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
