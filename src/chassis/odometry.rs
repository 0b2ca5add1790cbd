use crate::geometry::{Body, Heading, Pose2, Twist, Vec2, World};
use crate::math::wrap_pi;
use crate::units::Angle;

/// Adds measured motion up to a pose.
///
/// Each step is an exact arc: the twist is taken as constant over the step. The turn of the step comes from the
/// gyroscope's heading if given, otherwise from the wheels. Rounding is carried along (Kahan), so 10^6 steps of a
/// millimetre lose nothing.
///
/// When the gyroscope returns after a gap, its heading is taken as given. The first heading sets the heading of the pose. A
/// gyroscope with another zero than the world has an [offset](Self::set_gyro_offset).
///
/// # Examples
/// ```
/// use drivetrain::{chassis::Odometry, geometry::Twist};
/// use core::f32::consts::FRAC_PI_2;
///
/// let mut odometry = Odometry::default();
/// odometry.advance(Twist::new(FRAC_PI_2, 0.0, FRAC_PI_2), None, 1.0); // a quarter of a circle of 1 m
/// let pose = odometry.pose();
/// assert!((pose.x_m - 1.0).abs() < 1e-6 && (pose.y_m - 1.0).abs() < 1e-6);
/// assert!((pose.angle.as_degrees() - 90.0).abs() < 1e-4);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Odometry {
    x_m: Sum,
    y_m: Sum,
    angle_rad: Sum,
    heading: Heading,
    /// The gyroscope's heading of the step before, if given.
    gyro: Option<Angle>,
    /// From the gyroscope's heading to the heading in the world.
    gyro_offset: Angle,
}

impl Odometry {
    /// The longest step in seconds that is integrated.
    pub const MAX_STEP_S: f32 = 1.0;

    /// Takes the start pose. Each value of NaN or infinity counts as zero.
    #[must_use]
    pub const fn new(pose: Pose2<World>) -> Self {
        let angle = Angle::from_radians(or_zero(pose.angle.as_radians()));
        Self {
            x_m: Sum::new(or_zero(pose.x_m)),
            y_m: Sum::new(or_zero(pose.y_m)),
            angle_rad: Sum::new(wrap_pi(angle.as_radians())),
            heading: Heading::new(angle),
            gyro: None,
            gyro_offset: Angle::ZERO,
        }
    }

    /// Sets the angle added to each heading of the gyroscope: the heading in the world less the heading of the gyroscope, when
    /// both are known.
    ///
    /// The pose changes with the next heading, which bends no arc, as after a gap. An angle that is NaN or infinite changes
    /// nothing.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::geometry::{Heading, Pose2, Twist};
    /// use drivetrain::{chassis::Odometry, units::Angle};
    ///
    /// // The gyroscope was switched on at 30 degrees; the robot starts at 90 degrees of the field.
    /// let (start, gyro) = (Angle::from_degrees(90.0), Angle::from_degrees(30.0));
    /// let mut odometry = Odometry::new(Pose2::new(0.0, 0.0, start));
    /// odometry.set_gyro_offset(start - gyro);
    /// odometry.advance(Twist::new(1.0, 0.0, 0.0), Some(Heading::new(gyro)), 0.5);
    /// let pose = odometry.pose();
    /// assert!((pose.y_m - 0.5).abs() < 1e-6 && (pose.angle.as_degrees() - 90.0).abs() < 1e-4);
    /// ```
    pub const fn set_gyro_offset(&mut self, offset: Angle) {
        if offset.is_finite() {
            self.gyro_offset = Angle::from_radians(wrap_pi(offset.as_radians()));
            self.gyro = None;
        }
    }

    /// Adds a step of `dt_s` seconds at the measured `twist`, with the gyroscope's heading at its end.
    ///
    /// A heading that is not finite counts as missing. A twist that is not finite adds no way and no turn, nor does a
    /// step that is not above zero, NaN, or longer than [`MAX_STEP_S`](Self::MAX_STEP_S): the result is then `false`.
    ///
    /// Costs 249 instructions on a Cortex-M4F, with a gyro (`docs/figures.md`).
    pub fn advance(&mut self, twist: Twist<Body>, gyro: Option<Heading>, dt_s: f32) -> bool {
        let gyro = gyro.filter(|heading| heading.is_finite()).map(|heading| {
            // Most steps have none, and a heading has its sine and cosine already.
            let has_offset = self.gyro_offset != Angle::ZERO;
            if has_offset { Heading::new(heading.angle() + self.gyro_offset) } else { heading }
        });
        let counts = dt_s > 0.0 && dt_s <= Self::MAX_STEP_S && twist.is_finite();
        let wheels = if counts { twist.over(dt_s) } else { Twist::ZERO.over(0.0) };
        let mut arc = wheels;
        if let (Some(now), Some(before)) = (gyro, self.gyro) {
            arc.theta_rad = wrap_pi(now.angle().as_radians() - before.as_radians());
        }
        if counts {
            // The heading at the start is the heading of the sum: the gyroscope's of the step
            // before.
            let way = self.heading.rotation().apply(arc.chord().0);
            self.x_m.add(way.x);
            self.y_m.add(way.y);
        }
        match gyro {
            Some(now) => {
                self.angle_rad = Sum::new(wrap_pi(now.angle().as_radians()));
                self.heading = now;
            }
            None if counts => {
                self.angle_rad.add(arc.theta_rad);
                self.angle_rad.value = wrap_pi(self.angle_rad.value);
                self.heading = Heading::new(Angle::from_radians(self.angle_rad.value));
            }
            None => {}
        }
        self.gyro = gyro.map(Heading::angle);
        counts
    }

    /// Returns the pose; the angle is in -π..π.
    #[must_use]
    pub const fn pose(&self) -> Pose2<World> {
        Pose2::new(self.x_m.value, self.y_m.value, Angle::from_radians(self.angle_rad.value))
    }

    /// Returns the heading with its sine and cosine.
    #[must_use]
    pub const fn heading(&self) -> Heading {
        self.heading
    }

    pub(super) const fn gyro_offset(&self) -> Angle {
        self.gyro_offset
    }

    pub(super) const fn has_gyro(&self) -> bool {
        self.gyro.is_some()
    }

    /// Sets the position and keeps the heading. A position that is NaN or infinite changes nothing.
    pub const fn set_position_m(&mut self, position_m: Vec2) {
        if !position_m.is_finite() {
            return;
        }
        self.x_m = Sum::new(position_m.x);
        self.y_m = Sum::new(position_m.y);
    }
}

impl Default for Odometry {
    fn default() -> Self {
        Self::new(Pose2::ORIGIN)
    }
}

const fn or_zero(value: f32) -> f32 {
    if value.is_finite() { value } else { 0.0 }
}

/// A sum that keeps the rounding error of each addition for the next.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
struct Sum {
    value: f32,
    rest: f32,
}

impl Sum {
    const fn new(value: f32) -> Self {
        Self { value, rest: 0.0 }
    }

    /// Adds a term; leaves out a term with which the sum would overflow.
    const fn add(&mut self, term: f32) {
        let term = term + self.rest;
        let sum = self.value + term;
        if !sum.is_finite() {
            return;
        }
        self.rest = term - (sum - self.value);
        self.value = sum;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f32::consts::TAU;
    use proptest::prelude::*;

    fn degrees(angle: f32) -> Option<Heading> {
        Some(Heading::new(Angle::from_degrees(angle)))
    }

    fn near(odometry: &Odometry, x: f32, y: f32, tolerance: f32) {
        let pose = odometry.pose();
        let error = Vec2::new(pose.x_m - x, pose.y_m - y).norm();
        assert!(error < tolerance, "{pose:?}, expected ({x}, {y})");
    }

    #[test]
    fn facing_left_forward_is_along_world_y() {
        let mut odometry = Odometry::new(Pose2::new(1.0, 2.0, Angle::from_degrees(90.0)));
        odometry.advance(Twist::new(1.0, 0.0, 0.0), None, 0.5);
        near(&odometry, 1.0, 2.5, 1e-6);
        odometry.advance(Twist::new(0.0, 1.0, 0.0), None, 0.5);
        near(&odometry, 0.5, 2.5, 1e-6);
    }

    #[test]
    fn the_gyroscope_is_believed_before_the_wheels() {
        let mut odometry = Odometry::default();
        odometry.advance(Twist::ZERO, degrees(0.0), 0.001);
        odometry.advance(Twist::new(1.0, 0.0, 3.0), degrees(0.0), 0.5); // the wheels slip: no turn
        near(&odometry, 0.5, 0.0, 1e-6);
        assert_eq!(odometry.pose().angle, Angle::ZERO);
    }

    /// The exact chord of an arc, in f64: from `from` degrees on, with a turn in degrees, over a way of the body.
    fn chord(from: f64, turn: f64, forward: f64, left: f64) -> (f64, f64) {
        let half = turn.to_radians() / 2.0;
        let shrink = if half == 0.0 { 1.0 } else { half.sin() / half };
        let (sin, cos) = (from.to_radians() + half).sin_cos();
        (shrink * (forward * cos - left * sin), shrink * (forward * sin + left * cos))
    }

    // With a chord of 0.98 of the gyroscope's turn every other test passed: the heading is right all the same.
    #[test]
    fn the_way_of_a_step_bends_by_the_whole_turn_of_the_gyroscope() {
        for from in [0.0_f32, 30.0, 170.0, -100.0] {
            for turn in [-120.0_f32, -90.0, -10.0, -0.5, 0.0, 0.5, 10.0, 90.0, 120.0] {
                // The turn from the wheels does not count.
                for wheels in [-2.0, 0.0, 2.0] {
                    let mut odometry = Odometry::default();
                    odometry.advance(Twist::ZERO, degrees(from), 0.001);
                    odometry.advance(Twist::new(3.0, -1.0, wheels), degrees(from + turn), 1.0);
                    let (x, y) = chord(from.into(), turn.into(), 3.0, -1.0);
                    #[expect(clippy::cast_possible_truncation, reason = "some metres")]
                    near(&odometry, x as f32, y as f32, 2e-5);
                }
            }
        }
    }

    /// The same circle in steps of any size: each chord adds its part of the bend.
    #[test]
    fn a_circle_of_the_gyroscope_is_closed_in_steps_of_any_size() {
        for steps in [4_u16, 12, 36, 360] {
            let mut odometry = Odometry::default();
            odometry.advance(Twist::ZERO, degrees(0.0), 0.001);
            let turn = 360.0 / f32::from(steps);
            let mut furthest = 0.0_f32;
            for step in 1..=steps {
                // A circumference of 1 m; the wheels slip and say nothing of the turn.
                let twist = Twist::new(10.0 / f32::from(steps), 0.0, 0.0);
                odometry.advance(twist, degrees(f32::from(step) * turn), 0.1);
                furthest = furthest.max(odometry.pose().y_m);
            }
            near(&odometry, 0.0, 0.0, 1e-5);
            assert!((furthest - 1.0 / core::f32::consts::PI).abs() < 1e-4, "{steps}: {furthest}");
        }
    }

    #[test]
    fn the_seam_of_the_gyroscope_is_no_turn() {
        let mut odometry = Odometry::default();
        odometry.advance(Twist::ZERO, degrees(179.9), 0.001);
        odometry.advance(Twist::new(1.0, 0.0, 0.0), degrees(-179.9), 0.5);
        near(&odometry, -0.5, 0.0, 1e-3);
    }

    #[test]
    fn the_gyroscopes_return_after_a_gap_bends_no_arc() {
        let mut odometry = Odometry::default();
        odometry.advance(Twist::new(1.0, 0.0, 0.0), None, 0.5);
        odometry.advance(Twist::new(1.0, 0.0, 0.0), degrees(90.0), 0.5);
        near(&odometry, 1.0, 0.0, 1e-6);
        odometry.advance(Twist::new(1.0, 0.0, 0.0), None, 0.5);
        near(&odometry, 1.0, 0.5, 1e-6);
    }

    #[test]
    fn a_gyroscope_with_an_offset_is_one_without_that_started_elsewhere() {
        for offset in [-400.0_f32, -90.0, 0.0, 30.0, 179.0] {
            let (mut with, mut without) = (Odometry::default(), Odometry::default());
            with.set_gyro_offset(Angle::from_degrees(offset));
            with.set_gyro_offset(Angle::from_radians(f32::NAN));
            for step in 0..200_u8 {
                let (gyro, twist) = (f32::from(step) * 7.0, Twist::new(1.0, 0.3, 0.1));
                with.advance(twist, degrees(gyro), 0.01);
                without.advance(twist, degrees(gyro + offset), 0.01);
            }
            near(&with, without.pose().x_m, without.pose().y_m, 1e-4);
            let apart = with.pose().angle.as_radians() - without.pose().angle.as_radians();
            assert!(wrap_pi(apart).abs() < 1e-4, "{offset}: {apart}");
        }
    }

    #[test]
    fn a_new_offset_turns_the_pose_and_bends_no_arc() {
        let mut odometry = Odometry::default();
        odometry.advance(Twist::new(1.0, 0.0, 0.0), degrees(0.0), 0.5);
        odometry.set_gyro_offset(Angle::from_degrees(90.0));
        odometry.advance(Twist::new(1.0, 0.0, 0.0), degrees(0.0), 0.5);
        near(&odometry, 1.0, 0.0, 1e-6);
        odometry.advance(Twist::new(1.0, 0.0, 0.0), degrees(0.0), 0.5);
        near(&odometry, 1.0, 0.5, 1e-6);
    }

    #[test]
    fn a_step_of_nan_zero_or_minutes_adds_nothing() {
        let mut odometry = Odometry::default();
        for dt in [f32::NAN, 0.0, -0.1, 60.0, f32::INFINITY] {
            assert!(!odometry.advance(Twist::new(1.0, 0.0, 1.0), None, dt));
        }
        assert!(!odometry.advance(Twist::new(f32::NAN, 0.0, 1.0), None, 0.001));
        assert_eq!(odometry, Odometry::default());
    }

    #[test]
    fn a_circle_in_a_million_steps_ends_at_its_start() {
        let mut odometry = Odometry::default();
        for _ in 0..1_000_000 {
            odometry.advance(Twist::new(TAU, 0.0, TAU), None, 1e-6);
        }
        near(&odometry, 0.0, 0.0, 1e-4);
        assert!(odometry.pose().angle.as_radians().abs() < 1e-4);
    }

    #[test]
    fn a_kilometre_in_millimetres_loses_no_millimetre() {
        let mut odometry = Odometry::default();
        for _ in 0..1_000_000 {
            odometry.advance(Twist::new(1.0, 0.0, 0.0), None, 0.001);
        }
        near(&odometry, 1000.0, 0.0, 1e-4);
    }

    proptest! {
        #[test]
        fn a_closed_path_returns_to_the_start(
            vx in -3.0_f32..3.0, vy in -3.0_f32..3.0, turns in 3_u8..12, side in any::<bool>()
        ) {
            // A polygon: the same straight leg after each turn in place by a whole part of the circle.
            let mut odometry = Odometry::default();
            let turn = if side { TAU } else { -TAU } / f32::from(turns);
            for _ in 0..turns {
                for _ in 0..100 {
                    odometry.advance(Twist::new(vx, vy, 0.0), None, 0.01);
                }
                for _ in 0..100 {
                    odometry.advance(Twist::new(0.0, 0.0, turn), None, 0.01);
                }
            }
            near(&odometry, 0.0, 0.0, 1e-4);
            let angle = odometry.pose().angle.as_radians().abs();
            prop_assert!(angle < 1e-4 || (angle - TAU).abs() < 1e-4);
        }
    }

    #[test]
    fn a_way_that_overflows_is_left_out_and_the_position_stays_a_number() {
        let mut odometry = Odometry::default();
        for _ in 0..4 {
            odometry.advance(Twist::new(f32::MAX, 0.0, 0.0), None, 0.5);
            odometry.advance(Twist::new(f32::MAX, f32::MIN, 1e38), None, 0.5);
        }
        let pose = odometry.pose();
        assert!(pose.x_m.is_finite() && pose.y_m.is_finite() && pose.angle.is_finite(), "{pose:?}");
        odometry.set_position_m(Vec2::new(f32::NAN, 0.0));
        assert_eq!(odometry.pose(), pose);
        let nowhere = Pose2::new(f32::NAN, f32::INFINITY, Angle::from_radians(f32::NAN));
        assert_eq!(Odometry::new(nowhere), Odometry::default());
        odometry.set_position_m(Vec2::new(0.0, 0.0));
        odometry.advance(Twist::new(1.0, 0.0, 0.0), degrees(0.0), 0.5);
        assert!(odometry.pose().x_m.is_finite());
    }
}
