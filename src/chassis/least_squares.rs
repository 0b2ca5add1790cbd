//! The motion that fits best to what is measured along some directions.

use crate::geometry::{Body, Twist, Vec2};

/// Below this the weakest direction counts as undetermined, in parts of the strongest possible determinant.
const SINGULAR: f32 = 1e-5;

/// What one measurement sees of a motion: `direction . (velocity of the body's origin) + yaw_m * wz`, in m/s.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Row {
    pub(super) direction: Vec2,
    pub(super) yaw_m: f32,
    /// The squared distance of the point: what `yaw_m` squared could be at most.
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
}

impl Normal {
    const fn new() -> Self {
        Self { xx: 0.0, xy: 0.0, xw: 0.0, yy: 0.0, yw: 0.0, ww: 0.0, reach_m2: 0.0 }
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
    }

    /// `None` when the rows leave some motion undetermined.
    pub(super) fn inverse(&self) -> Option<Inverse> {
        let Self { xx, xy, xw, yy, yw, ww, reach_m2 } = *self;
        let (a, b, c) = (yy * ww - yw * yw, xw * yw - xy * ww, xy * yw - xw * yy);
        let determinant = xx * a + xy * b + xw * c;
        // The determinant is never more than the product of the diagonal, nor a lever arm than its point's distance.
        let largest = 0.25 * (xx + yy) * (xx + yy) * reach_m2;
        let solvable = determinant > SINGULAR * largest && determinant.is_finite();
        let scale = 1.0 / determinant;
        solvable.then_some(Inverse {
            xx: a * scale,
            xy: b * scale,
            xw: c * scale,
            yy: (xx * ww - xw * xw) * scale,
            yw: (xy * xw - xx * yw) * scale,
            ww: (xx * yy - xy * xy) * scale,
        })
    }
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

/// Fits the motion to the measurements in m/s; `None` when they leave some of it undetermined.
pub(super) fn fit(measured: impl Iterator<Item = (Row, f32)> + Clone) -> Option<Twist<Body>> {
    let inverse = Normal::of(measured.clone().map(|(row, _)| row)).inverse()?;
    Some(measured.fold(Twist::ZERO, |sum, (row, speed)| sum + inverse.share(row) * speed))
}
