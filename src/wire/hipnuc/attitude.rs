//! Orientation: from the quaternion on the wire, and as the angles named roll, pitch and yaw by the firmware.

use super::Imu;
use crate::geometry::{Attitude, AttitudeSource, Rotation3};
use crate::math::{atan2, sqrt};
use crate::time::Instant;
use crate::units::Angle;
use crate::wire::Receiver;

/// Takes w, x, y, z; `None` when the length differs from 1 by more than 10 %, or is not finite.
pub(super) fn normalised(quaternion: [f32; 4]) -> Option<Rotation3> {
    let square: f32 = quaternion.iter().map(|part| part * part).sum();
    if !(0.9 * 0.9..=1.1 * 1.1).contains(&square) {
        return None; // NaN and infinity included
    }
    let [w, x, y, z] = quaternion;
    Rotation3::from_quaternion(w, x, y, z).ok()
}

/// The firmware determines the axis of roll, and so the order of the three rotations. Yaw is about z in both. The middle
/// angle, pitch, is in ±90°, the others are in ±180°. At a pitch of ±90° the other two are not determined. With `micromath`
/// the angles are up to 0.3° off.
impl Imu {
    /// Returns roll, pitch and yaw as `Rz(yaw) Ry(pitch) Rx(roll)`, the usual order in robotics: x points forward.
    ///
    /// Computed from the public frames: the older `CH0x0` manual 6.3.1 has roll about x.
    #[must_use]
    pub fn euler_roll_x(&self) -> (Angle, Angle, Angle) {
        let [w, x, y, z] = self.attitude.to_quaternion();
        angles(
            (2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)),
            2.0 * (w * y - z * x),
            (2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)),
        )
    }

    /// Returns roll, pitch and yaw as `Rz(yaw) Rx(pitch) Ry(roll)`: y points forward.
    ///
    /// Computed from the public frames: newer firmware (manual 7.34, CH010, the `92` frame) has pitch about x.
    #[must_use]
    pub fn euler_pitch_x(&self) -> (Angle, Angle, Angle) {
        let [w, x, y, z] = self.attitude.to_quaternion();
        angles(
            (2.0 * (w * y - z * x), 1.0 - 2.0 * (x * x + y * y)),
            2.0 * (w * x + y * z),
            (2.0 * (w * z - x * y), 1.0 - 2.0 * (x * x + z * z)),
        )
    }
}

impl<const N: usize> AttitudeSource for Receiver<Imu, N> {
    fn attitude(&self, now: Instant) -> Option<Attitude> {
        let imu = self.latest(now)?;
        Some(Attitude { rotation: imu.attitude, rates: imu.angular_velocity })
    }
}

/// Takes sine and cosine of roll and yaw, each times the cosine of pitch.
fn angles(roll: (f32, f32), pitch_sine: f32, yaw: (f32, f32)) -> (Angle, Angle, Angle) {
    let angle = |y, x| Angle::from_radians(atan2(y, x));
    let pitch_cosine = sqrt((1.0 - pitch_sine * pitch_sine).max(0.0));
    (angle(roll.0, roll.1), angle(pitch_sine, pitch_cosine), angle(yaw.0, yaw.1))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::AngularVelocity;
    use proptest::prelude::*;

    fn imu(quaternion: [f32; 4]) -> Imu {
        Imu {
            status: 0,
            temperature_c: 0,
            pressure_pa: 0.0,
            time_ms: None,
            acceleration_m_s2: [0.0; 3],
            angular_velocity: [AngularVelocity::ZERO; 3],
            magnetic_field_ut: [0.0; 3],
            roll: Angle::ZERO,
            pitch: Angle::ZERO,
            yaw: Angle::ZERO,
            attitude: normalised(quaternion).unwrap(),
        }
    }

    #[test]
    fn f63_a_quaternion_of_wrong_length_is_normalised_or_refused() {
        let close = normalised([0.95, 0.0, 0.0, 0.0]).unwrap();
        assert!((close.to_quaternion()[0] - 1.0).abs() < 1e-6);
        for bad in [0.0, 0.89, 1.11, f32::NAN, f32::INFINITY, f32::MAX] {
            assert_eq!(normalised([bad, 0.0, 0.0, 0.0]), None, "{bad}");
            assert_eq!(normalised([1.0, bad.max(f32::NAN), f32::NAN, 0.0]), None);
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
            let imu = imu(quaternion);
            for (angles, expected) in [(imu.euler_roll_x(), roll_x), (imu.euler_pitch_x(), pitch_x)]
            {
                let (roll, pitch, yaw) = angles;
                let off = [
                    roll.as_degrees() - expected.0,
                    pitch.as_degrees() - expected.1,
                    yaw.as_degrees() - expected.2,
                ];
                assert!(off.iter().all(|off| off.abs() < 0.5), "{quaternion:?} {off:?}");
            }
        }
    }

    proptest! {
        #[test]
        fn any_quaternion_is_refused_or_of_unit_length(parts: [f32; 4]) {
            if let Some(attitude) = normalised(parts) {
                let norm: f32 = attitude.to_quaternion().iter().map(|part| part * part).sum();
                prop_assert!((norm - 1.0).abs() < 1e-5);
            }
        }
    }
}
