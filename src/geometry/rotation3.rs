//! Rotations in space, and attitudes.

#[cfg(feature = "serde")]
use super::is_unit;
use super::rotation2::angle_of;
use super::{Heading, TOLERANCE, Vec3, unit_scale};
use crate::error::ConfigError;
use crate::math::{sin_cos, sqrt};
use crate::time::Instant;
use crate::units::{Angle, AngularVelocity};

/// A turn in space, kept as a unit quaternion; every composition brings its length back to 1, and so does reading with
/// `serde`, which refuses a quaternion without a length. After 10^6 compositions the length is right to 2e-7, the angle to
/// 3e-3 rad.
///
/// # Examples
/// ```
/// use drivetrain::{geometry::{Rotation3, Vec3}, units::Angle};
///
/// let left = Rotation3::from_roll_pitch_yaw(Angle::ZERO, Angle::ZERO, Angle::from_degrees(90.0));
/// let turned = left.apply(Vec3::new(1.0, 0.0, 0.0));
/// assert!(turned.x.abs() < 1e-6 && (turned.y - 1.0).abs() < 1e-6);
/// assert!((left.compose(left).roll_pitch_yaw()[2].as_degrees().abs() - 180.0).abs() < 1e-4);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(try_from = "StoredRotation3"))]
pub struct Rotation3 {
    w: f32,
    vector: Vec3,
}

/// The cosine of pitch below which the pitch counts as 90 degrees: rounding leaves up to 5e-7 there.
const LOCKED: f32 = 2e-6;

impl Rotation3 {
    /// No turn.
    pub const IDENTITY: Self = Self { w: 1.0, vector: Vec3::ZERO };

    /// Takes three angles: yaw about z, then pitch about the new y, then roll about the new x (Rz Ry Rx).
    ///
    /// Positive roll lowers the right side, positive pitch lowers the nose, positive yaw turns left.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::{geometry::{Rotation3, Vec3}, units::Angle};
    ///
    /// let nose_down = Rotation3::from_roll_pitch_yaw(Angle::ZERO, Angle::from_degrees(30.0), Angle::ZERO);
    /// let ahead = nose_down.apply(Vec3::new(1.0, 0.0, 0.0));
    /// assert!((ahead.z + 0.5).abs() < 1e-6); // -sin(30 degrees)
    /// ```
    #[must_use]
    pub fn from_roll_pitch_yaw(roll: Angle, pitch: Angle, yaw: Angle) -> Self {
        let half = |angle: Angle| sin_cos(0.5 * angle.as_radians());
        let ((sr, cr), (sp, cp), (sy, cy)) = (half(roll), half(pitch), half(yaw));
        Self {
            w: cy * cp * cr + sy * sp * sr,
            vector: Vec3::new(
                cy * cp * sr - sy * sp * cr,
                cy * sp * cr + sy * cp * sr,
                sy * cp * cr - cy * sp * sr,
            ),
        }
        .normalized()
    }

    /// Takes a quaternion of any length but zero; `w` is the real part.
    ///
    /// # Errors
    /// [`ConfigError::NotFinite`] for NaN and infinity, [`ConfigError::Unusable`] when the squared length is below
    /// 1e-12 or above 1e12.
    pub fn from_quaternion(w: f32, x: f32, y: f32, z: f32) -> Result<Self, ConfigError> {
        let vector = Vec3::new(x, y, z);
        if !(w.is_finite() && vector.is_finite()) {
            return Err(ConfigError::NotFinite("quaternion"));
        }
        let scale = unit_scale(w * w + vector.dot(vector))?;
        Ok(Self { w: w * scale, vector: vector * scale })
    }

    /// Returns the quaternion as w, x, y, z with w the real part.
    #[must_use]
    pub const fn to_quaternion(self) -> [f32; 4] {
        [self.w, self.vector.x, self.vector.y, self.vector.z]
    }

    /// Turns a vector.
    #[must_use]
    pub fn apply(self, vector: Vec3) -> Vec3 {
        let twice = self.vector.cross(vector) * 2.0;
        vector + twice * self.w + self.vector.cross(twice)
    }

    /// Returns the turn by `first`, then by `self`.
    #[must_use]
    pub fn compose(self, first: Self) -> Self {
        let (a, b) = (self.vector, first.vector);
        Self { w: self.w * first.w - a.dot(b), vector: b * self.w + a * first.w + a.cross(b) }
            .normalized()
    }

    /// Returns the turn back.
    #[must_use]
    pub const fn inverse(self) -> Self {
        let Vec3 { x, y, z } = self.vector;
        Self { w: self.w, vector: Vec3::new(-x, -y, -z) }
    }

    /// Returns the angle of the whole turn, in 0..=180 degrees.
    #[must_use]
    pub fn angle(self) -> Angle {
        Angle::from_radians(2.0 * angle_of(self.vector.norm(), self.w.abs()))
    }

    /// Returns the turn at the fraction `t` of the shorter way from `self` to `other`, at constant speed.
    ///
    /// `t` = 0 gives `self`, 1 gives `other`. For half turns either way is the shorter one.
    #[must_use]
    pub fn interpolate(self, other: Self, t: f32) -> Self {
        let way = self.inverse().compose(other);
        let side = if way.w < 0.0 { -1.0 } else { 1.0 };
        let length = way.vector.norm();
        let half = angle_of(length, way.w * side);
        let (sin, cos) = sin_cos(half * t);
        // sin(half t) / sin(half), equal to t where both vanish.
        let share = if length < 1e-4 { t } else { sin / length };
        self.compose(Self { w: cos, vector: way.vector * (side * share) })
    }

    /// Returns the three angles: pitch in -90..=90 degrees, the others in -180..=180.
    ///
    /// At a pitch of ±90 degrees (to 2e-6 rad) roll and yaw turn about the same axis: the gimbal is locked. Roll is then 0
    /// and yaw takes all: yaw - roll when the nose points down (+90), yaw + roll when the nose points up.
    ///
    /// The three angles make the same turn again to 1e-6 rad, at the lock to 5e-6. Roll and yaw each are less exact near
    /// the lock, their errors cancel: at a distance of `d` rad, each is right to some 1e-6/`d` rad.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::{geometry::Rotation3, units::Angle};
    ///
    /// let degrees = Angle::from_degrees;
    /// let nose_down = Rotation3::from_roll_pitch_yaw(degrees(20.0), degrees(90.0), degrees(50.0));
    /// let [roll, _, yaw] = nose_down.roll_pitch_yaw();
    /// assert_eq!(roll, Angle::ZERO);
    /// assert!((yaw.as_degrees() - 30.0).abs() < 1e-3); // 50 - 20
    /// ```
    #[must_use]
    pub fn roll_pitch_yaw(self) -> [Angle; 3] {
        let [[r00, r01, r02], [r10, r11, r12], [r20, _, _]] = self.to_matrix();
        let level = sqrt(r00 * r00 + r10 * r10);
        let pitch = angle_of(-r20, level);
        let (roll, yaw) = if level < LOCKED {
            (0.0, angle_of(-r01, r11))
        } else {
            let yaw = angle_of(r10, r00);
            let (sin, cos) = (r10 / level, r00 / level);
            // Roll is the rest after yaw, so errors of yaw near the lock cancel in the whole.
            (angle_of(sin * r02 - cos * r12, cos * r11 - sin * r01), yaw)
        };
        [roll, pitch, yaw].map(Angle::from_radians)
    }

    /// Returns the rotation matrix, rows first.
    #[must_use]
    pub const fn to_matrix(self) -> [[f32; 3]; 3] {
        let Self { w, vector: Vec3 { x, y, z } } = self;
        let (x2, y2, z2) = (x + x, y + y, z + z);
        let (xx, yy, zz) = (x * x2, y * y2, z * z2);
        let (xy, xz, yz) = (x * y2, x * z2, y * z2);
        let (wx, wy, wz) = (w * x2, w * y2, w * z2);
        [
            [1.0 - (yy + zz), xy - wz, xz + wy],
            [xy + wz, 1.0 - (xx + zz), yz - wx],
            [xz - wy, yz + wx, 1.0 - (xx + yy)],
        ]
    }

    /// Takes a rotation matrix, rows first.
    ///
    /// # Errors
    /// [`ConfigError`] when a number is not finite, or the rows are not perpendicular and of length 1 (to 1e-3) or
    /// mirror.
    pub fn from_matrix(matrix: [[f32; 3]; 3]) -> Result<Self, ConfigError> {
        Self::check_rows(matrix.map(|[a, b, c]| Vec3::new(a, b, c)))?;
        Ok(Self::from_rows(matrix))
    }

    /// Accepts the rows of a rotation, to 1e-3.
    pub(super) fn check_rows([x, y, z]: [Vec3; 3]) -> Result<(), ConfigError> {
        if !(x.is_finite() && y.is_finite() && z.is_finite()) {
            return Err(ConfigError::NotFinite("matrix"));
        }
        // The third row is the cross product of the others exactly when nothing is skewed, scaled or mirrored.
        let third = x.cross(y) - z;
        let lengths = [x.dot(x) - 1.0, y.dot(y) - 1.0, x.dot(y), third.norm()];
        if lengths.iter().any(|error| error.abs() > 2.0 * TOLERANCE) {
            return Err(ConfigError::Unusable("rotation of the matrix"));
        }
        Ok(())
    }

    #[cfg(feature = "serde")]
    const fn from_parts(w: f32, vector: Vec3) -> Self {
        Self { w, vector }
    }

    /// Divides by the largest of w, x, y, z (Shepperd), so nothing cancels. The rows are trusted.
    pub(super) fn from_rows(matrix: [[f32; 3]; 3]) -> Self {
        let [[r00, r01, r02], [r10, r11, r12], [r20, r21, r22]] = matrix;
        let (w, x, y, z) = if r00 + r11 + r22 > 0.0 {
            (1.0 + r00 + r11 + r22, r21 - r12, r02 - r20, r10 - r01)
        } else if r00 >= r11 && r00 >= r22 {
            (r21 - r12, 1.0 + r00 - r11 - r22, r01 + r10, r02 + r20)
        } else if r11 >= r22 {
            (r02 - r20, r01 + r10, 1.0 - r00 + r11 - r22, r12 + r21)
        } else {
            (r10 - r01, r02 + r20, r12 + r21, 1.0 - r00 - r11 + r22)
        };
        let scale = 1.0 / sqrt(w * w + x * x + y * y + z * z);
        Self { w: w * scale, vector: Vec3::new(x, y, z) * scale }
    }

    /// One Newton step of 1/sqrt at 1: an error e of the length becomes 1.5 e^2.
    fn normalized(self) -> Self {
        let scale = 1.5 - 0.5 * (self.w * self.w + self.vector.dot(self.vector));
        Self { w: self.w * scale, vector: self.vector * scale }
    }
}

impl Default for Rotation3 {
    fn default() -> Self {
        Self::IDENTITY
    }
}

/// Orientation of a body, and how fast it turns.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Attitude {
    /// Turns the axes of the body into those of the world, z up.
    pub rotation: Rotation3,
    /// Angular velocity around x, y and z of the body; counter-clockwise is positive.
    pub rates: [AngularVelocity; 3],
}

/// A source of attitude: an IMU that computes it itself, or a chip on the board with a filter.
///
/// A robot that is generic over this trait drives with either. `wire::Receiver<hipnuc::Imu, N>` implements it; for a BMI088 on the board
/// see the package `recipes/imu` of the repository.
///
/// # Examples
/// ```
/// use drivetrain::geometry::{Attitude, AttitudeSource, Rotation3};
/// use drivetrain::time::{Duration, Instant};
/// use drivetrain::units::{Angle, AngularVelocity};
///
/// /// The last attitude of a filter, and when it was computed.
/// struct Filter(Attitude, Instant);
///
/// impl AttitudeSource for Filter {
///     fn attitude(&self, now: Instant) -> Option<Attitude> {
///         (now.since(self.1) <= Duration::from_millis(20)).then_some(self.0)
///     }
/// }
///
/// let rotation = Rotation3::from_roll_pitch_yaw(Angle::ZERO, Angle::ZERO, Angle::from_degrees(30.0));
/// let filter = Filter(Attitude { rotation, rates: [AngularVelocity::ZERO; 3] }, Instant::START);
/// let heading = filter.heading(Instant::START).map(|heading| heading.angle().as_degrees());
/// assert!(heading.is_some_and(|degrees| (degrees - 30.0).abs() < 1e-3));
/// assert_eq!(filter.attitude(Instant::from_micros(20_001)), None); // too old
/// ```
pub trait AttitudeSource {
    /// Returns the attitude at `now`; `None` when the source was silent for longer than its limit, or cannot be trusted.
    fn attitude(&self, now: Instant) -> Option<Attitude>;

    /// Returns the yaw of the attitude: where x of the body points on the floor, counter-clockwise.
    fn heading(&self, now: Instant) -> Option<Heading> {
        let [_, _, yaw] = self.attitude(now)?.rotation.roll_pitch_yaw();
        Some(Heading::new(yaw))
    }
}

/// Takes a quaternion as [`Rotation3::from_quaternion`] does.
#[cfg(feature = "mint")]
impl TryFrom<mint::Quaternion<f32>> for Rotation3 {
    type Error = ConfigError;

    fn try_from(theirs: mint::Quaternion<f32>) -> Result<Self, ConfigError> {
        Self::from_quaternion(theirs.s, theirs.v.x, theirs.v.y, theirs.v.z)
    }
}

#[cfg(feature = "mint")]
impl From<Rotation3> for mint::Quaternion<f32> {
    fn from(ours: Rotation3) -> Self {
        let [s, x, y, z] = ours.to_quaternion();
        Self { s, v: mint::Vector3 { x, y, z } }
    }
}

/// The form in a file; reading checks it, or brings it into form.
#[cfg(feature = "serde")]
#[derive(serde::Deserialize)]
#[serde(rename = "Rotation3")]
struct StoredRotation3 {
    w: f32,
    vector: Vec3,
}

#[cfg(feature = "serde")]
impl TryFrom<StoredRotation3> for Rotation3 {
    type Error = ConfigError;

    /// Takes a quaternion of any length but zero.
    fn try_from(StoredRotation3 { w, vector }: StoredRotation3) -> Result<Self, ConfigError> {
        if is_unit(w * w + vector.dot(vector)) {
            return Ok(Self::from_parts(w, vector));
        }
        Self::from_quaternion(w, vector.x, vector.y, vector.z)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn turn(roll: f32, pitch: f32, yaw: f32) -> Rotation3 {
        let [roll, pitch, yaw] = [roll, pitch, yaw].map(Angle::from_degrees);
        Rotation3::from_roll_pitch_yaw(roll, pitch, yaw)
    }

    fn close(a: Vec3, b: Vec3) {
        assert!((a - b).norm() < 1e-6, "{a:?}, expected {b:?}");
    }

    const FORWARD: Vec3 = Vec3::new(1.0, 0.0, 0.0);
    const LEFT: Vec3 = Vec3::new(0.0, 1.0, 0.0);
    const UP: Vec3 = Vec3::new(0.0, 0.0, 1.0);

    #[test]
    fn yaw_turns_forward_to_left_pitch_to_down_and_roll_left_to_up() {
        close(turn(0.0, 0.0, 90.0).apply(FORWARD), LEFT);
        close(turn(0.0, 0.0, -90.0).apply(FORWARD), -LEFT);
        close(turn(0.0, 90.0, 0.0).apply(FORWARD), -UP);
        close(turn(0.0, -90.0, 0.0).apply(FORWARD), UP);
        close(turn(90.0, 0.0, 0.0).apply(LEFT), UP);
        close(turn(-90.0, 0.0, 0.0).apply(LEFT), -UP);
    }

    #[test]
    fn the_order_is_roll_first_then_pitch_then_yaw() {
        let stepwise =
            turn(0.0, 0.0, 30.0).compose(turn(0.0, 40.0, 0.0)).compose(turn(50.0, 0.0, 0.0));
        close(stepwise.apply(LEFT), turn(50.0, 40.0, 30.0).apply(LEFT));
    }

    type Quaternion = [f64; 4];

    /// The quaternion of three angles as given in `f32`, without rounding.
    fn exact(angles: [Angle; 3]) -> Quaternion {
        let half = |angle: Angle| (0.5 * f64::from(angle.as_radians())).sin_cos();
        let [(sr, cr), (sp, cp), (sy, cy)] = angles.map(half);
        [
            cy * cp * cr + sy * sp * sr,
            cy * cp * sr - sy * sp * cr,
            cy * sp * cr + sy * cp * sr,
            sy * cp * cr - cy * sp * sr,
        ]
    }

    fn in_f64(turn: Rotation3) -> Quaternion {
        turn.to_quaternion().map(f64::from)
    }

    /// The angle in rad between two turns, exact for small ones.
    fn between(a: Quaternion, b: Quaternion) -> f64 {
        let far = |sign: f64| a.iter().zip(b).map(|(a, b)| (a - sign * b).powi(2)).sum::<f64>();
        2.0 * far(1.0).min(far(-1.0)).sqrt()
    }

    /// Both sides, and a roll and a yaw in steps of some 15 degrees.
    fn grid() -> impl Iterator<Item = (f32, f32, f32)> {
        let steps = || (-12..12_i8).map(f32::from);
        let all = move |roll| steps().map(move |yaw| (roll, yaw));
        let all = steps().flat_map(all);
        all.flat_map(|(roll, yaw)| [(1.0, roll, yaw), (-1.0, roll, yaw)])
    }

    /// Eight roundings of half a place in a quaternion of length 1.
    const ROUNDING: f64 = 1e-6;

    #[test]
    fn at_gimbal_lock_roll_is_zero_and_yaw_takes_all_and_nearby_the_turn_is_the_same() {
        for away in [0.0, 1e-7, 1e-6, 2e-6, 3e-6, 1e-5, 1e-4, 1e-3, 1e-2, 0.1] {
            for (side, roll, yaw) in grid() {
                let (roll, yaw) = (0.2617 * roll, 0.2619 * yaw);
                let pitch = side * (core::f32::consts::FRAC_PI_2 - away);
                let wanted = [roll, pitch, yaw].map(Angle::from_radians);
                let [x, y, z] = wanted;
                let made = Rotation3::from_roll_pitch_yaw(x, y, z);
                assert!(between(exact(wanted), in_f64(made)) < ROUNDING, "{wanted:?}");
                let read = made.roll_pitch_yaw();
                let [read_roll, read_pitch, read_yaw] = read;
                // A rest of roll at the lock counts as none: twice the 2e-6 rad that count as lock.
                let bound = if read_roll == Angle::ZERO { 4e-6 } else { 0.0 } + ROUNDING;
                assert!(between(exact(read), in_f64(made)) < bound, "{wanted:?} {read:?}");
                assert!((read_pitch.as_radians() - pitch).abs() < 1e-6, "{wanted:?} {read:?}");
                if away <= 1e-6 {
                    assert_eq!(read_roll, Angle::ZERO, "{wanted:?}");
                    let off = crate::math::wrap_pi(read_yaw.as_radians() - (yaw - side * roll));
                    assert!(off.abs() < 2e-6, "{wanted:?} {read:?}");
                }
                if away >= 3e-6 && roll.abs() > 0.1 {
                    let off = crate::math::wrap_pi(read_roll.as_radians() - roll);
                    // Roll and yaw alone are only as exact as the axis is far from the lock.
                    assert!(off.abs() < 1e-6 / away, "{wanted:?} {read:?}");
                }
            }
        }
    }

    #[test]
    fn half_turns_about_each_axis_survive_the_matrix() {
        for half in [turn(180.0, 0.0, 0.0), turn(0.0, 180.0, 0.0), turn(0.0, 0.0, 180.0)] {
            let again = Rotation3::from_matrix(half.to_matrix()).unwrap();
            assert!(again.inverse().compose(half).angle().as_radians() < 1e-6);
        }
    }

    #[test]
    fn matrices_and_quaternions_that_are_no_rotation_are_refused() {
        let mirror = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]];
        assert_eq!(
            Rotation3::from_matrix(mirror),
            Err(ConfigError::Unusable("rotation of the matrix"))
        );
        let scaled = [[1.01, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.01]];
        assert_eq!(
            Rotation3::from_matrix(scaled),
            Err(ConfigError::Unusable("rotation of the matrix"))
        );
        let nan = [[f32::NAN, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        assert_eq!(Rotation3::from_matrix(nan), Err(ConfigError::NotFinite("matrix")));
        assert_eq!(
            Rotation3::from_quaternion(0.0, 0.0, 0.0, 0.0),
            Err(ConfigError::Unusable("quaternion"))
        );
        assert_eq!(
            Rotation3::from_quaternion(0.0, f32::NAN, 0.0, 0.0),
            Err(ConfigError::NotFinite("quaternion"))
        );
        let long = Rotation3::from_quaternion(2.0, 0.0, 0.0, 2.0).unwrap(); // F63: normalised
        close(long.apply(FORWARD), LEFT);
    }

    #[test]
    fn a_million_compositions_keep_length_and_angle() {
        let step = turn(0.0, 0.0, 0.05);
        let mut whole = Rotation3::IDENTITY;
        for _ in 0..1_000_000 {
            whole = step.compose(whole);
        }
        let length = sqrt(whole.w * whole.w + whole.vector.dot(whole.vector));
        assert!((length - 1.0).abs() < 2e-7, "{length}");
        // The real turn of the step, in f64: its rounding would otherwise be counted a million
        // times.
        let each = 2.0 * f64::from(step.vector.z).atan2(f64::from(step.w));
        let expected = (each * 1e6).rem_euclid(core::f64::consts::TAU);
        let is = f64::from(whole.roll_pitch_yaw()[2].as_radians());
        let error = (is - expected).rem_euclid(core::f64::consts::TAU);
        let error = error.min(core::f64::consts::TAU - error);
        assert!(error < 1e-4, "{error}");
    }

    fn rotations() -> impl Strategy<Value = Rotation3> {
        (-1.0_f32..1.0, -1.0_f32..1.0, -1.0_f32..1.0, -1.0_f32..1.0)
            .prop_filter_map("too short", |(w, x, y, z)| {
                Rotation3::from_quaternion(w, x, y, z).ok()
            })
    }

    fn vectors() -> impl Strategy<Value = Vec3> {
        (-1.0_f32..1.0, -1.0_f32..1.0, -1.0_f32..1.0).prop_map(|(x, y, z)| Vec3::new(x, y, z))
    }

    proptest! {
        #[test]
        fn angles_and_back_is_the_same_turn(turn in rotations(), vector in vectors()) {
            let [roll, pitch, yaw] = turn.roll_pitch_yaw();
            let again = Rotation3::from_roll_pitch_yaw(roll, pitch, yaw);
            prop_assert!((again.apply(vector) - turn.apply(vector)).norm() < 5e-6);
        }

        #[test]
        fn matrix_and_back_is_the_same_turn(turn in rotations(), vector in vectors()) {
            let again = Rotation3::from_matrix(turn.to_matrix()).unwrap();
            prop_assert!((again.apply(vector) - turn.apply(vector)).norm() < 2e-6);
        }

        #[test]
        fn turning_back_undoes_turning(turn in rotations(), vector in vectors()) {
            prop_assert!((turn.inverse().apply(turn.apply(vector)) - vector).norm() < 2e-6);
        }

        #[test]
        fn composition_is_one_turn_after_the_other(
            a in rotations(), b in rotations(), vector in vectors()
        ) {
            let error = a.compose(b).apply(vector) - a.apply(b.apply(vector));
            prop_assert!(error.norm() < 2e-6);
        }

        #[test]
        fn half_way_twice_is_the_whole_way(a in rotations(), b in rotations()) {
            let half = a.interpolate(b, 0.5);
            let there = a.inverse().compose(half).angle().as_radians();
            let rest = half.inverse().compose(b).angle().as_radians();
            // A few roundings of an angle of up to half of pi, also with the coarse arc tangent.
            prop_assert!((there - rest).abs() < 2e-6, "{there} {rest}");
            prop_assert!(there < core::f32::consts::FRAC_PI_2 + 1e-6);
            prop_assert!((2.0 * there - a.inverse().compose(b).angle().as_radians()).abs() < 2e-6);
        }
    }

    #[cfg(feature = "mint")]
    mod of_mint {
        use super::*;
        use crate::geometry::{Point2, Point3, Vec2};

        fn rotations() -> impl Strategy<Value = Rotation3> {
            let angle = || (-3.0_f32..3.0).prop_map(Angle::from_radians);
            (angle(), angle(), angle())
                .prop_map(|(r, p, y)| Rotation3::from_roll_pitch_yaw(r, p, y))
        }

        fn theirs(rotation: Rotation3) -> glam::Quat {
            mint::Quaternion::from(rotation).into()
        }

        proptest! {
            #[test]
            fn glam_turns_and_composes_as_we_do(
                [first, second] in [rotations(), rotations()],
                [x, y, z] in prop::array::uniform3(-10.0_f32..10.0),
            ) {
                let vector = Vec3::new(x, y, z);
                let turned = theirs(second) * theirs(first) * glam::Vec3::from(mint::Vector3::from(vector));
                let error = Vec3::from(mint::Vector3::from(turned)) - second.compose(first).apply(vector);
                prop_assert!(error.norm() < 2e-6 * (1.0 + vector.norm()), "{error:?}");
            }

            #[test]
            fn glam_gives_back_what_it_took(rotation in rotations(), x in any::<f32>(), y in any::<f32>(), z in any::<f32>()) {
                let back = Rotation3::try_from(mint::Quaternion::from(theirs(rotation))).unwrap();
                prop_assert!(back.compose(rotation.inverse()).angle().as_radians().abs() < 1e-3);
                prop_assume!(!x.is_nan() && !y.is_nan() && !z.is_nan());
                let point = Point3::<()>::new(x, y, z);
                let theirs = glam::Vec3::from(mint::Point3::from(point));
                prop_assert_eq!(Point3::from(mint::Point3::from(theirs)), point);
                let flat = glam::Vec2::from(mint::Point2::from(Point2::<()>::new(x, y)));
                prop_assert_eq!(Vec2::from(mint::Vector2::from(flat)), Vec2::new(x, y));
            }
        }

        #[test]
        fn a_quaternion_that_is_none_is_refused() {
            for s in [0.0, f32::NAN] {
                let theirs = mint::Quaternion { s, v: [0.0; 3].into() };
                assert!(Rotation3::try_from(theirs).is_err());
            }
        }
    }
}
