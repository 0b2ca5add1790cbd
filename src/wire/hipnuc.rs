//! The serial protocol of HiPNUC IMUs: measurements and attitude, 115200 baud.
//!
//! ```text
//! 5A A5 | length u16 of the payload | CRC u16 | payload: tag, fields        all little-endian
//! CRC-16/XMODEM over the first four bytes and the payload
//! ```
//!
//! | tag | payload | here |
//! |---|---|---|
//! | `91` | 76 bytes, floats | read |
//! | `92` | 48 bytes, scaled integers; gone from the vendor's code since 2025-11 | read |
//! | others (`81`, `83`, ..) | | skipped, counted as [foreign](super::Counts::foreign_frames) |
//!
//! The 82 bytes of a `91` frame take 7.1 ms at 115200 baud: 100 Hz is the limit there, 400 Hz needs 460800 baud.
//!
//! **Use the quaternion.** It is normalised here (a live sensor was seen to send 0.99904), and a frame without a usable
//! quaternion is refused. The three Euler angles on the wire mean different rotations in different firmware, and no
//! field names the firmware; [`Imu::euler_roll_x`] and [`Imu::euler_pitch_x`] compute them from the quaternion, each in
//! its order.
//!
//! A heading that stands still may be a robot at rest or a dead sensor. Read the sensor with a [`Receiver`]:
//! frames with a standing time stamp do not count, and if no new frame comes in time, its `latest` is `None` and an edge is
//! latched.
//!
//! ```
//! use drivetrain::time::{Duration, Instant};
//! use drivetrain::wire::{Receiver, hipnuc::{Imu, MAX_FRAME}};
//!
//! let mut imu = Receiver::<Imu, MAX_FRAME>::new(Duration::from_millis(50));
//! let now = Instant::START;
//! let mut received: &[u8] = &[0x5A, 0xA5]; // from the serial port
//! while let Some(frame) = imu.read(&mut received, now) {
//!     let (roll, pitch, yaw) = frame.euler_pitch_x();
//! }
//! assert!(imu.latest(now).is_none()); // no heading to trust yet
//! ```
//!
//! Source: hipnuc/products (`hipnuc_dec.c`, Apache-2.0), `CH0x0` manual 6.3; their golden frames are in the tests.

use super::{Decode, Reader, Receiver, Reject};
use crate::geometry::{Attitude, AttitudeSource, Rotation3};
use crate::math::{atan2, sqrt};
use crate::time::Instant;
use crate::units::{Angle, AngularVelocity};

/// A buffer for every frame that the sensors send by themselves (the longest, `81`, has 110 bytes).
pub const MAX_FRAME: usize = 128;

/// The longest payload of the protocol in bytes: the vendor's decoder has room for no more.
const MAX_PAYLOAD: u16 = 512;

/// Header, length and CRC in bytes.
const OVERHEAD: usize = 6;

static CRC: crc::Crc<u16, crc::Table<1>> = crc::Crc::<u16, crc::Table<1>>::new(&crc::CRC_16_XMODEM);

/// One measurement of a HiPNUC IMU. Its numbers are finite, except pressure and magnetic field on sensors without them.
///
/// Axes are those printed on the sensor.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Imu {
    /// Status bits, as received.
    pub status: u16,
    /// Temperature of the sensor in degrees Celsius.
    pub temperature_c: i8,
    /// Air pressure in pascals, as received; anything, NaN included, on sensors without barometer.
    pub pressure_pa: f32,
    /// Milliseconds since the start of the sensor, wrapping; `None` in a `92` frame, whose sources disagree.
    pub time_ms: Option<u32>,
    /// Acceleration along x, y, z in m/s², gravity included: +9.8 upwards at rest.
    pub acceleration_m_s2: [f32; 3],
    /// Angular velocity around x, y, z; counter-clockwise is positive.
    pub angular_velocity: [AngularVelocity; 3],
    /// Magnetic field along x, y, z in microtesla, as received.
    pub magnetic_field_ut: [f32; 3],
    /// Roll as computed by the sensor; the axis depends on the firmware, see [`euler_pitch_x`](Self::euler_pitch_x).
    pub roll: Angle,
    /// Pitch as computed by the sensor; the axis depends on the firmware, see [`euler_pitch_x`](Self::euler_pitch_x).
    pub pitch: Angle,
    /// Yaw as computed by the sensor.
    pub yaw: Angle,
    /// The orientation, from the quaternion of the frame, normalised: turns the sensor's axes into the world's (z up).
    pub attitude: Rotation3,
}

impl Decode for Imu {
    type Options = ();
    const PREFIX: usize = 4;

    fn header(_: &()) -> &[u8] {
        &[0x5A, 0xA5]
    }

    fn length(_: &(), prefix: &[u8]) -> Option<usize> {
        let (_, length) = prefix.split_last_chunk()?;
        let length = u16::from_le_bytes(*length);
        matches!(length, 1..=MAX_PAYLOAD).then_some(usize::from(length) + OVERHEAD)
    }

    fn is_new(&self, previous: &Self) -> bool {
        self.time_ms.is_none() || self.time_ms != previous.time_ms
    }

    fn decode(_: &(), frame: &[u8]) -> Result<Self, Reject> {
        let (head, rest) = frame.split_first_chunk::<4>().ok_or(Reject::Length)?;
        let (crc, payload) = rest.split_first_chunk().ok_or(Reject::Length)?;
        let mut digest = CRC.digest();
        digest.update(head);
        digest.update(payload);
        if digest.finalize() != u16::from_le_bytes(*crc) {
            return Err(Reject::Checksum);
        }
        let (tag, fields) = payload.split_first().ok_or(Reject::Length)?;
        let imu = match (tag, payload.len()) {
            (0x91, 76) => read_91(Reader(fields)),
            (0x92, 48) => read_92(Reader(fields)),
            _ => return Err(Reject::Foreign),
        };
        imu.filter(Self::is_finite).ok_or(Reject::Content)
    }
}

impl Imu {
    /// Returns whether all inputs of the motion are finite.
    fn is_finite(&self) -> bool {
        self.acceleration_m_s2.iter().all(|acceleration| acceleration.is_finite())
            && self.angular_velocity.iter().all(|rate| rate.is_finite())
            && [self.roll, self.pitch, self.yaw].iter().all(|angle| angle.is_finite())
    }
}

/// Standard gravity, the sensor's unit g (the vendor's C code takes 9.8, its Python code this).
const G_M_S2: f32 = 9.806_65;

/// Scales of the `92` frame, by the vendor's decoder of that time.
mod scale_92 {
    pub(super) const RAD_S: f32 = 0.001;
    pub(super) const M_S2: f32 = 0.004_882_8;
    pub(super) const MICROTESLA: f32 = 0.030_517;
    pub(super) const DEGREES: f32 = 0.001;
    pub(super) const QUATERNION: f32 = 0.000_1;
    pub(super) const PRESSURE_ZERO_PA: f32 = 100_000.0;
}

/// Reads the fields behind the tag `91`; `None` when too short, or without a usable quaternion.
///
/// ```text
/// u16 status, i8 degrees C, f32 Pa, u32 ms, 3 f32 g, 3 f32 degrees/s, 3 f32 uT, f32 roll, pitch, yaw degrees, 4 f32 w x y z
/// ```
fn read_91(mut fields: Reader<'_>) -> Option<Imu> {
    let status = fields.u16_le()?;
    let temperature_c = fields.u8()?.cast_signed();
    let pressure_pa = fields.f32_le()?;
    let time_ms = fields.take().map(u32::from_le_bytes);
    let acceleration_g: [f32; 3] = fields.array(Reader::f32_le)?;
    let degrees_per_s: [f32; 3] = fields.array(Reader::f32_le)?;
    let magnetic_field_ut = fields.array(Reader::f32_le)?;
    let [roll, pitch, yaw] = fields.array::<f32, 3>(Reader::f32_le)?.map(Angle::from_degrees);
    let quaternion = fields.array(Reader::f32_le)?;
    Some(Imu {
        status,
        temperature_c,
        pressure_pa,
        time_ms,
        acceleration_m_s2: acceleration_g.map(|g| g * G_M_S2),
        angular_velocity: degrees_per_s.map(AngularVelocity::from_degrees_per_s),
        magnetic_field_ut,
        roll,
        pitch,
        yaw,
        attitude: normalised(quaternion)?,
    })
}

/// The same of the tag `92`.
///
/// ```text
/// u16 status, i8 degrees C, 2 bytes unknown, i16 Pa - 100000, 2 bytes unknown, 3 i16 rate, 3 i16 acceleration,
/// 3 i16 field, i32 roll, pitch, yaw, 4 i16 w x y z
/// ```
/// The vendor's C structure has a u32 time where its Python decoder has the pressure. In the public frame the pressure is
/// plausible (99841 Pa) and the time is not (6.8 days), so there is no time.
fn read_92(mut fields: Reader<'_>) -> Option<Imu> {
    let integers = |fields: &mut Reader<'_>| fields.array::<i16, 3>(Reader::i16_le);
    let status = fields.u16_le()?;
    let temperature_c = fields.u8()?.cast_signed();
    let _unknown: [u8; 2] = fields.take()?;
    let pressure_pa = f32::from(fields.i16_le()?) + scale_92::PRESSURE_ZERO_PA;
    let _unknown: [u8; 2] = fields.take()?;
    let rate = integers(&mut fields)?;
    let acceleration = integers(&mut fields)?;
    let field = integers(&mut fields)?;
    let angles = fields.array::<i32, 3>(Reader::i32_le)?;
    let [roll, pitch, yaw] = angles.map(|raw| Angle::from_degrees(raw as f32 * scale_92::DEGREES));
    let quaternion = fields.array::<i16, 4>(Reader::i16_le)?;
    Some(Imu {
        status,
        temperature_c,
        pressure_pa,
        time_ms: None,
        acceleration_m_s2: acceleration.map(|raw| f32::from(raw) * scale_92::M_S2),
        angular_velocity: rate
            .map(|raw| AngularVelocity::from_rad_per_s(f32::from(raw) * scale_92::RAD_S)),
        magnetic_field_ut: field.map(|raw| f32::from(raw) * scale_92::MICROTESLA),
        roll,
        pitch,
        yaw,
        attitude: normalised(quaternion.map(|raw| f32::from(raw) * scale_92::QUATERNION))?,
    })
}

/// Takes w, x, y, z; `None` when the length differs from 1 by more than 10 %, or is not finite.
fn normalised(quaternion: [f32; 4]) -> Option<Rotation3> {
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

    /// Vector `crc.hipnuc.check` of `tests/data/wire/vectors.json`.
    #[test]
    fn the_checksum_is_that_of_xmodem() {
        assert_eq!(super::CRC.checksum(b"123456789"), 0x31C3);
    }

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
