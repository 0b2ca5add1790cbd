use super::vector::copy;
use super::{Point3, Rotation3, TOLERANCE, Vec3};
use crate::error::ConfigError;
use core::marker::PhantomData;

/// Place of the frame `From` in the frame `To`, in space; applied to a point in `From`, gives the point in `To`.
///
/// A transform is also the pose of a thing in space: [`rotation`](Self::rotation) is its orientation,
/// [`translation_m`](Self::translation_m) its position, [`relative_to`](Self::relative_to) the same as seen from another pose.
///
/// The turn is kept as a matrix, which is cheaper to apply than a quaternion. After 10^6 compositions its rows are some per
/// cent off. With [`normalized`](Self::normalized) once in a thousand they stay right, and 10^6 composed steps add up to
/// less than 0.04 rad and 5e-3 of the largest distance on the way; a [`Rotation3`] is ten times as exact. In reading with
/// `serde`, rows with an error above 1e-3 are refused.
///
/// # Examples
/// ```
/// use drivetrain::{geometry::{Body, Gimbal, Point3, Rotation3, Transform3, Vec3}, units::Angle};
///
/// let up = Rotation3::from_roll_pitch_yaw(Angle::ZERO, Angle::from_degrees(-90.0), Angle::ZERO);
/// let gimbal = Transform3::<Gimbal, Body>::new(up, Vec3::new(0.0, 0.0, 0.4));
/// let target: Point3<Body> = gimbal.apply(Point3::new(2.0, 0.0, 0.0)); // 2 m along the barrel
/// assert!(target.x_m.abs() < 1e-6 && (target.z_m - 2.4).abs() < 1e-6);
/// let back: Point3<Gimbal> = gimbal.inverse().apply(target);
/// assert!((back.x_m - 2.0).abs() < 1e-6);
/// ```
///
/// The first seed's camera, at (1, 2, 0.5), turned 90 degrees to the left:
/// ```
/// use drivetrain::{geometry::{Body, Point3, Rotation3, Transform3, Vec3, World}, units::Angle};
///
/// let yaw = Rotation3::from_roll_pitch_yaw(Angle::ZERO, Angle::ZERO, Angle::from_degrees(90.0));
/// let camera = Transform3::<Body, World>::new(yaw, Vec3::new(1.0, 2.0, 0.5));
/// let seen = camera.apply(Point3::new(0.0, 1.0, 0.0));
/// assert!(seen.x_m.abs() < 1e-6 && (seen.y_m - 2.0).abs() < 1e-6 && (seen.z_m - 0.5).abs() < 1e-6);
/// ```
///
/// A point of another frame is refused:
/// ```compile_fail
/// use drivetrain::geometry::{Body, Gimbal, Point3, Transform3, World};
///
/// Transform3::<Body, World>::IDENTITY.apply(Point3::<Gimbal>::ORIGIN);
/// ```
#[derive(Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(bound = ""))]
#[cfg_attr(feature = "serde", serde(try_from = "StoredTransform3"))]
pub struct Transform3<From, To> {
    rows: [Vec3; 3],
    translation_m: Vec3,
    #[cfg_attr(feature = "serde", serde(skip))]
    frames: PhantomData<(From, To)>,
}

copy!(Transform3<From, To>);

impl<From, To> Transform3<From, To> {
    /// Both frames in the same place.
    pub const IDENTITY: Self = Self::new(Rotation3::IDENTITY, Vec3::ZERO);

    /// Takes the turn of `From` against `To`, and where the origin of `From` stands in `To` in m.
    #[must_use]
    pub const fn new(rotation: Rotation3, translation_m: Vec3) -> Self {
        let [[a, b, c], [d, e, f], [g, h, i]] = rotation.to_matrix();
        let rows = [Vec3::new(a, b, c), Vec3::new(d, e, f), Vec3::new(g, h, i)];
        Self { rows, translation_m, frames: PhantomData }
    }

    #[cfg(feature = "serde")]
    const fn from_parts(rows: [Vec3; 3], translation_m: Vec3) -> Self {
        Self { rows, translation_m, frames: PhantomData }
    }

    /// Returns the turn of `From` against `To`.
    #[must_use]
    pub fn rotation(self) -> Rotation3 {
        Rotation3::from_rows(self.rows.map(|row| [row.x, row.y, row.z]))
    }

    /// Returns where the origin of `From` stands in `To`, in m.
    #[must_use]
    pub const fn translation_m(self) -> Vec3 {
        self.translation_m
    }

    /// Returns the point of `From` as seen in `To`.
    ///
    /// Costs 36 instructions on a Cortex-M4F (`docs/figures.md`).
    #[must_use]
    #[inline]
    pub const fn apply(self, point: Point3<From>) -> Point3<To> {
        let ([a, b, c], t, v) = (self.rows, self.translation_m, point.to_vec());
        Point3::new(a.dot(v) + t.x, b.dot(v) + t.y, c.dot(v) + t.z)
    }

    /// Returns the transform that goes through `first` and then through `self`.
    ///
    /// Costs 101 instructions on a Cortex-M4F (`docs/figures.md`).
    #[must_use]
    #[inline]
    pub const fn compose<Start>(self, first: Transform3<Start, From>) -> Transform3<Start, To> {
        let [a, b, c] = self.rows;
        let first_rows = &first.rows;
        Transform3 {
            rows: [combine(a, first_rows), combine(b, first_rows), combine(c, first_rows)],
            translation_m: self.apply(Point3::from_vec(first.translation_m)).to_vec(),
            frames: PhantomData,
        }
    }

    /// Returns the transform back.
    ///
    /// Costs 42 instructions on a Cortex-M4F (`docs/figures.md`).
    #[must_use]
    #[inline]
    pub const fn inverse(self) -> Transform3<To, From> {
        let ([a, b, c], t) = (self.rows, self.translation_m);
        let origin = combine(t, &self.rows);
        Transform3 {
            rows: [Vec3::new(a.x, b.x, c.x), Vec3::new(a.y, b.y, c.y), Vec3::new(a.z, b.z, c.z)],
            translation_m: Vec3::new(-origin.x, -origin.y, -origin.z),
            frames: PhantomData,
        }
    }

    /// Returns where `From` stands as seen from `base`, both given in `To`.
    #[must_use]
    pub const fn relative_to<Base>(self, base: Transform3<Base, To>) -> Transform3<From, Base> {
        base.inverse().compose(self)
    }

    /// Returns the transform with its rows brought back to right angles and length 1.
    #[must_use]
    pub fn normalized(self) -> Self {
        Self::new(self.rotation(), self.translation_m)
    }

    /// Returns the transform at the fraction `t` of the way to `other`: the origin on the straight line, the turn evenly
    /// by the shorter way.
    #[must_use]
    pub fn interpolate(self, other: Self, t: f32) -> Self {
        let way = other.translation_m - self.translation_m;
        let turn = self.rotation().interpolate(other.rotation(), t);
        Self::new(turn, self.translation_m + way * t)
    }

    /// Returns the homogeneous matrix, rows first.
    #[must_use]
    pub const fn to_matrix(self) -> [[f32; 4]; 4] {
        let ([a, b, c], t) = (self.rows, self.translation_m);
        [[a.x, a.y, a.z, t.x], [b.x, b.y, b.z, t.y], [c.x, c.y, c.z, t.z], [0.0, 0.0, 0.0, 1.0]]
    }

    /// Takes a homogeneous matrix, rows first.
    ///
    /// # Errors
    /// [`ConfigError`] when a number is not finite, the upper left 3x3 is no rotation (to 1e-3) or the last row is not
    /// 0, 0, 0, 1.
    pub fn from_matrix(matrix: [[f32; 4]; 4]) -> Result<Self, ConfigError> {
        let [[a, b, c, x], [d, e, f, y], [g, h, i, z], last] = matrix;
        if !matrix.as_flattened().iter().all(|number| number.is_finite()) {
            return Err(ConfigError::NotFinite("matrix"));
        }
        let rotation = Rotation3::from_matrix([[a, b, c], [d, e, f], [g, h, i]])?;
        let bottom = [0.0, 0.0, 0.0, 1.0];
        if !last.iter().zip(bottom).all(|(is, should)| (is - should).abs() <= TOLERANCE) {
            return Err(ConfigError::Unusable("last row of the matrix"));
        }
        Ok(Self::new(rotation, Vec3::new(x, y, z)))
    }
}

/// A row vector times a matrix.
const fn combine(row: Vec3, [a, b, c]: &[Vec3; 3]) -> Vec3 {
    Vec3::new(
        row.x * a.x + row.y * b.x + row.z * c.x,
        row.x * a.y + row.y * b.y + row.z * c.y,
        row.x * a.z + row.y * b.z + row.z * c.z,
    )
}

impl<From, To> Default for Transform3<From, To> {
    fn default() -> Self {
        Self::IDENTITY
    }
}

/// The form in a file; reading checks it, or brings it into form.
#[cfg(feature = "serde")]
#[derive(serde::Deserialize)]
#[serde(rename = "Transform3")]
struct StoredTransform3 {
    rows: [Vec3; 3],
    translation_m: Vec3,
}

#[cfg(feature = "serde")]
impl<From, To> TryFrom<StoredTransform3> for Transform3<From, To> {
    type Error = ConfigError;

    fn try_from(stored: StoredTransform3) -> Result<Self, ConfigError> {
        let StoredTransform3 { rows, translation_m } = stored;
        Rotation3::check_rows(rows)?;
        Ok(Self::from_parts(rows, translation_m))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Body, World};
    use proptest::prelude::*;

    type BodyToWorld = Transform3<Body, World>;

    fn difference(a: BodyToWorld, b: BodyToWorld) -> f32 {
        let mut worst = 0.0_f32;
        for (left, right) in a.to_matrix().as_flattened().iter().zip(b.to_matrix().as_flattened()) {
            worst = worst.max((left - right).abs());
        }
        worst
    }

    fn transforms() -> impl Strategy<Value = BodyToWorld> {
        let number = || -1.0_f32..1.0;
        (number(), number(), number(), number(), number(), number(), number()).prop_filter_map(
            "too short",
            |(w, x, y, z, a, b, c)| {
                let turn = Rotation3::from_quaternion(w, x, y, z).ok()?;
                Some(Transform3::new(turn, Vec3::new(a, b, c) * 10.0))
            },
        )
    }

    fn loops() -> impl Strategy<Value = Transform3<Body, Body>> {
        transforms().prop_map(|t| Transform3::new(t.rotation(), t.translation_m()))
    }

    #[test]
    fn a_million_compositions_with_normalizing_every_thousand_stay_rigid() {
        let turn = Rotation3::from_quaternion(1.0, 1e-4, 2e-4, 5e-4).unwrap();
        let step = Transform3::<Body, Body>::new(turn, Vec3::ZERO);
        let (mut bare, mut kept) = (BodyToWorld::IDENTITY, BodyToWorld::IDENTITY);
        for count in 0..1_000_000 {
            bare = bare.compose(step);
            kept = kept.compose(step);
            if count % 1_000 == 999 {
                kept = kept.normalized();
            }
        }
        let length = |t: BodyToWorld| t.rows[0].norm();
        assert!((length(bare) - 1.0).abs() < 0.03, "{}", length(bare));
        assert!((length(kept) - 1.0).abs() < 1e-4, "{}", length(kept));
    }

    #[test]
    fn a_last_row_that_scales_is_refused() {
        let mut matrix = BodyToWorld::IDENTITY.to_matrix();
        matrix[3][3] = 2.0;
        assert_eq!(
            BodyToWorld::from_matrix(matrix),
            Err(ConfigError::Unusable("last row of the matrix"))
        );
    }

    proptest! {
        #[test]
        fn a_transform_composed_with_its_inverse_in_either_order_changes_nothing(t in transforms()) {
            let nothing = t.inverse().compose(t);
            prop_assert!(nothing.translation_m().norm() < 2e-5);
            prop_assert!(nothing.rotation().angle().as_radians() < 5e-6);
            prop_assert!(difference(t.compose(t.inverse()).compose(BodyToWorld::IDENTITY), BodyToWorld::IDENTITY) < 2e-5);
            prop_assert!(difference(t.inverse().inverse(), t) < 2e-5);
            prop_assert_eq!(t.compose(Transform3::<Body, Body>::IDENTITY), t);
        }

        #[test]
        fn the_inverse_of_a_chain_is_the_reversed_chain(a in transforms(), b in loops()) {
            let whole = a.compose(b).inverse();
            let parts = b.inverse().compose(a.inverse());
            prop_assert!((whole.translation_m() - parts.translation_m()).norm() < 4e-5);
            prop_assert!(whole.rotation().inverse().compose(parts.rotation()).angle().as_radians() < 5e-6);
        }

        #[test]
        fn a_chain_moves_a_point_as_its_links_in_turn(
            a in transforms(), b in loops(), x in -10.0_f32..10.0, y in -10.0_f32..10.0, z in -10.0_f32..10.0
        ) {
            let point = Point3::<Body>::new(x, y, z);
            let error = a.compose(b).apply(point) - a.apply(b.apply(point));
            prop_assert!(error.to_vec().norm() < 4e-5, "{error:?}");
        }

        #[test]
        fn composition_is_associative(a in transforms(), b in loops(), c in loops()) {
            prop_assert!(difference(a.compose(b).compose(c), a.compose(b.compose(c))) < 2e-5);
        }

        #[test]
        fn the_matrix_leads_back(t in transforms()) {
            prop_assert!(difference(BodyToWorld::from_matrix(t.to_matrix()).unwrap(), t) < 2e-6);
        }

        #[test]
        fn a_relative_pose_leads_from_the_base_to_the_pose(a in transforms(), b in transforms()) {
            let seen: Transform3<Body, Body> = a.relative_to(b);
            prop_assert!(difference(b.compose(seen), a) < 3e-5);
        }

        #[test]
        fn the_ends_of_an_interpolation_are_its_ends(a in transforms(), b in transforms()) {
            prop_assert!(difference(a.interpolate(b, 0.0), a) < 5e-6);
            prop_assert!(difference(a.interpolate(b, 1.0), b) < 2e-5);
        }
    }
}
