use crate::math::{atan2, sqrt};
use crate::units::Angle;

/// An orientation: a unit quaternion w, x, y, z that turns the sensor's axes into the world's (z up).
///
/// # Examples
/// ```
/// use drivetrain::wire::hipnuc::{Attitude, EulerOrder};
///
/// let half = std::f32::consts::FRAC_1_SQRT_2;
/// let left = Attitude::new([half, 0.0, 0.0, half]).ok_or("no rotation")?; // a quarter turn to the left
/// let (roll, pitch, yaw) = left.euler(EulerOrder::RollX);
/// assert!((yaw.as_degrees() - 90.0).abs() < 1e-4);
/// assert!(Attitude::new([0.0; 4]).is_none());
/// # Ok::<(), &str>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Attitude {
    w: f32,
    x: f32,
    y: f32,
    z: f32,
}

/// Which axis is called roll, and with it the order of the three rotations. Yaw is about z in both.
///
/// Computed from the public frames: newer firmware (manual 7.34, CH010, the `92` frame) has pitch about x, the older
/// `CH0x0` manual 6.3.1 has roll about x.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum EulerOrder {
    /// `Rz(yaw) Ry(pitch) Rx(roll)`, the usual one in robotics: x points forward.
    RollX,
    /// `Rz(yaw) Rx(pitch) Ry(roll)`: y points forward.
    PitchX,
}

impl Attitude {
    /// Takes w, x, y, z and normalises them; `None` when they are further than 10 % from length 1, or not finite.
    #[must_use]
    pub fn new(quaternion: [f32; 4]) -> Option<Self> {
        let norm = sqrt(quaternion.iter().map(|part| part * part).sum());
        if !(0.9..=1.1).contains(&norm) {
            return None; // NaN and infinity included
        }
        let [w, x, y, z] = quaternion.map(|part| part / norm);
        Some(Self { w, x, y, z })
    }

    /// Returns w, x, y, z of length 1.
    #[must_use]
    pub const fn as_array(self) -> [f32; 4] {
        [self.w, self.x, self.y, self.z]
    }

    /// Returns roll, pitch and yaw in the order that `order` names. The middle angle, pitch, is in ±90°, the
    /// others are in ±180°. Where pitch is ±90° the other two are not determined.
    ///
    /// With `micromath` the angles are up to 0.3° off.
    #[must_use]
    pub fn euler(self, order: EulerOrder) -> (Angle, Angle, Angle) {
        let Self { w, x, y, z } = self;
        let angle = |y, x| Angle::from_radians(atan2(y, x));
        let (roll, pitch_sine, yaw) = match order {
            EulerOrder::RollX => (
                angle(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)),
                2.0 * (w * y - z * x),
                angle(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)),
            ),
            EulerOrder::PitchX => (
                angle(2.0 * (w * y - z * x), 1.0 - 2.0 * (x * x + y * y)),
                2.0 * (w * x + y * z),
                angle(2.0 * (w * z - x * y), 1.0 - 2.0 * (x * x + z * z)),
            ),
        };
        let pitch_cosine = sqrt((1.0 - pitch_sine * pitch_sine).max(0.0));
        (roll, angle(pitch_sine, pitch_cosine), yaw)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn f63_a_quaternion_of_wrong_length_is_normalised_or_refused() {
        let close = Attitude::new([0.95, 0.0, 0.0, 0.0]).unwrap();
        assert!((close.as_array()[0] - 1.0).abs() < 1e-6);
        for bad in [0.0, 0.89, 1.11, f32::NAN, f32::INFINITY, f32::MAX] {
            assert_eq!(Attitude::new([bad, 0.0, 0.0, 0.0]), None, "{bad}");
            assert_eq!(Attitude::new([1.0, bad.max(f32::NAN), f32::NAN, 0.0]), None);
        }
    }

    #[test]
    fn each_order_gives_a_single_rotation_back_on_its_axis() {
        let (sine, cosine) = (0.5_f32, 0.75_f32.sqrt()); // 60 degrees
        for (quaternion, roll_x, pitch_x) in [
            ([cosine, sine, 0.0, 0.0], (60.0, 0.0, 0.0), (0.0, 60.0, 0.0)),
            ([cosine, 0.0, sine, 0.0], (0.0, 60.0, 0.0), (60.0, 0.0, 0.0)),
            ([cosine, 0.0, 0.0, -sine], (0.0, 0.0, -60.0), (0.0, 0.0, -60.0)),
        ] {
            let attitude = Attitude::new(quaternion).unwrap();
            for (order, expected) in [(EulerOrder::RollX, roll_x), (EulerOrder::PitchX, pitch_x)] {
                let (roll, pitch, yaw) = attitude.euler(order);
                let off = [
                    roll.as_degrees() - expected.0,
                    pitch.as_degrees() - expected.1,
                    yaw.as_degrees() - expected.2,
                ];
                assert!(off.iter().all(|off| off.abs() < 0.5), "{quaternion:?} {order:?} {off:?}");
            }
        }
    }

    proptest! {
        #[test]
        fn any_quaternion_is_refused_or_of_unit_length(parts: [f32; 4]) {
            if let Some(attitude) = Attitude::new(parts) {
                let norm: f32 = attitude.as_array().iter().map(|part| part * part).sum();
                prop_assert!((norm - 1.0).abs() < 1e-5);
            }
        }
    }
}
