use super::{Body, Rotation2, Twist, Vec2};
use crate::math::sin_cos;

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
