//! Vectors, points and rotations of other crates, by `mint` (feature `mint`).

use super::{Point2, Point3, Rotation3, Vec2, Vec3};
use crate::error::ConfigError;

macro_rules! conversions {
    ($([$($frame:ident)?] $ours:ty, $theirs:ty: $($field:ident = $part:ident)+;)+) => {$(
        impl$(<$frame>)? From<$theirs> for $ours {
            fn from(theirs: $theirs) -> Self {
                Self::new($(theirs.$part),+)
            }
        }

        impl$(<$frame>)? From<$ours> for $theirs {
            fn from(ours: $ours) -> Self {
                Self { $($part: ours.$field),+ }
            }
        }
    )+};
}

conversions! {
    [] Vec2, mint::Vector2<f32>: x = x y = y;
    [] Vec3, mint::Vector3<f32>: x = x y = y z = z;
    [F] Point2<F>, mint::Point2<f32>: x_m = x y_m = y;
    [F] Point3<F>, mint::Point3<f32>: x_m = x y_m = y z_m = z;
}

/// Takes a quaternion as [`Rotation3::from_quaternion`] does.
impl TryFrom<mint::Quaternion<f32>> for Rotation3 {
    type Error = ConfigError;

    fn try_from(theirs: mint::Quaternion<f32>) -> Result<Self, ConfigError> {
        Self::from_quaternion(theirs.s, theirs.v.x, theirs.v.y, theirs.v.z)
    }
}

impl From<Rotation3> for mint::Quaternion<f32> {
    fn from(ours: Rotation3) -> Self {
        let [s, x, y, z] = ours.to_quaternion();
        Self { s, v: mint::Vector3 { x, y, z } }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::Angle;
    use proptest::prelude::*;

    fn rotations() -> impl Strategy<Value = Rotation3> {
        let angle = || (-3.0_f32..3.0).prop_map(Angle::from_radians);
        (angle(), angle(), angle()).prop_map(|(r, p, y)| Rotation3::from_roll_pitch_yaw(r, p, y))
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
