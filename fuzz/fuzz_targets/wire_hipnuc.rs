//! Any bytes from an IMU, in any split.
#![no_main]

use drivetrain::units::{Angle, AngularVelocity};
use drivetrain::wire::Protocol;
use drivetrain::wire::hipnuc::HipNuc;
use drivetrain_fuzz::{Input, any_split_gives_the_same};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| any_split_gives_the_same(HipNuc, data, imu));

/// Header, length, checksum, and a payload of a kind that is known or not, with any content.
fn imu(input: &mut Input) -> Vec<u8> {
    let (tag, length) = match input.byte() % 4 {
        0 | 1 => (0x91, 76),
        2 => (0x92, 48),
        _ => (input.byte(), input.byte() % 100 + 1),
    };
    let mut payload = vec![tag];
    payload.extend((1..length).map(|_| input.byte()));
    let head = [0x5A, 0xA5, length, 0];
    let [low, high] = crc(head.iter().chain(&payload)).to_le_bytes();
    let frame = [&head[..], &[low, high], &payload].concat();
    if let Ok(imu) = HipNuc.parse(&frame) {
        // What motion is computed from; pressure and magnetic field may be anything.
        let rates = imu.angular_velocity.map(AngularVelocity::as_rad_per_s);
        let angles = [imu.roll, imu.pitch, imu.yaw].map(Angle::as_radians);
        let motion = [imu.acceleration_m_s2, rates, angles];
        assert!(motion.as_flattened().iter().all(|value| value.is_finite()), "{imu:?}");
    }
    frame
}

/// CRC-16/XMODEM, bit by bit.
fn crc<'a>(bytes: impl Iterator<Item = &'a u8>) -> u16 {
    bytes.fold(0, |crc, byte| {
        (0..8).fold(crc ^ u16::from(*byte) << 8, |crc, _| {
            let shifted = crc << 1;
            if crc & 0x8000 == 0 { shifted } else { shifted ^ 0x1021 }
        })
    })
}
