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
//! A heading that stands still may be a robot at rest or a dead sensor. Read the sensor with a [`Receiver`](super::Receiver):
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

mod attitude;
mod payload;

use super::field::Reader;
use super::{Decode, Reject};
use crate::geometry::Rotation3;
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
            (0x91, 76) => payload::read_91(Reader(fields)),
            (0x92, 48) => payload::read_92(Reader(fields)),
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

#[cfg(test)]
mod tests {
    /// Vector `crc.hipnuc.check` of `tests/data/wire/vectors.json`.
    #[test]
    fn the_checksum_is_that_of_xmodem() {
        assert_eq!(super::CRC.checksum(b"123456789"), 0x31C3);
    }
}
