//! Any bytes from an IMU, in any split.
#![no_main]

use core::array::from_fn;
use drivetrain::units::{Angle, AngularVelocity};
use drivetrain::wire::Decode;
use drivetrain::wire::hipnuc::Imu;
use drivetrain_fuzz::{Input, any_split_gives_the_same, refuses_a_flipped_bit};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| any_split_gives_the_same::<Imu>((), data, imu));

/// Header, length, checksum, and a payload of a kind that is known or not, with any content or such as a sensor sends.
fn imu(input: &mut Input) -> Vec<u8> {
    let (tag, length) = match input.byte() % 4 {
        0 => return sensible(input),
        1 => (0x91, 76),
        2 => (0x92, 48),
        _ => (input.byte(), input.byte() % 100 + 1),
    };
    let mut payload = vec![tag];
    payload.extend((1..length).map(|_| input.byte()));
    let frame = framed(&payload);
    if let Ok(imu) = Imu::decode(&(), &frame) {
        // What motion is computed from; pressure and magnetic field may be anything.
        let rates = imu.angular_velocity.map(AngularVelocity::as_rad_per_s);
        let angles = [imu.roll, imu.pitch, imu.yaw].map(Angle::as_radians);
        let motion = [imu.acceleration_m_s2, rates, angles];
        assert!(motion.as_flattened().iter().all(|value| value.is_finite()), "{imu:?}");
    }
    frame
}

/// A frame that has to be taken, with what it says.
fn sensible(input: &mut Input) -> Vec<u8> {
    let [status, time_low, time_high] = from_fn(|_| u16::from_le_bytes(input.bytes()));
    let temperature_c = input.byte();
    let time_ms = u32::from(time_high) << 16 | u32::from(time_low);
    // g, degrees/s, microtesla, degrees.
    let values: [f32; 12] = from_fn(|_| f32::from(i16::from_le_bytes(input.bytes())) / 64.0);
    let (sine, cosine) = f32::from(i16::from_le_bytes(input.bytes())).sin_cos();
    let mut quaternion = [0.0; 4];
    quaternion[0] = cosine;
    quaternion[usize::from(temperature_c % 3) + 1] = sine;
    let mut payload = vec![0x91];
    payload.extend(status.to_le_bytes());
    payload.push(temperature_c);
    payload.extend(101_325.0_f32.to_le_bytes());
    payload.extend(time_ms.to_le_bytes());
    let floats = values.iter().chain(&quaternion);
    payload.extend(floats.flat_map(|value| value.to_le_bytes()));
    let frame = framed(&payload);
    let imu = Imu::decode(&(), &frame).expect("a whole frame");
    assert_eq!((imu.status, imu.time_ms), (status, Some(time_ms)));
    assert_eq!((imu.temperature_c, imu.pressure_pa), (temperature_c.cast_signed(), 101_325.0));
    let near = |is: [f32; 3], sent: &[f32], unit: f32| {
        is.iter().zip(sent).all(|(is, sent)| (is - sent * unit).abs() <= 1e-5 * (sent * unit).abs())
    };
    let rates = imu.angular_velocity.map(AngularVelocity::as_degrees_per_s);
    let angles = [imu.roll, imu.pitch, imu.yaw].map(Angle::as_degrees);
    assert!(near(imu.acceleration_m_s2, &values[..3], 9.806_65), "{imu:?}");
    assert!(near(rates, &values[3..6], 1.0), "{imu:?}");
    assert!(near(imu.magnetic_field_ut, &values[6..9], 1.0), "{imu:?}");
    assert!(near(angles, &values[9..], 1.0), "{imu:?}");
    let attitude = imu.attitude.to_quaternion().into_iter().zip(quaternion);
    assert!(attitude.into_iter().all(|(is, sent): (f32, f32)| (is - sent).abs() < 1e-6), "{imu:?}");
    refuses_a_flipped_bit::<Imu>(&(), &frame);
    frame
}

fn framed(payload: &[u8]) -> Vec<u8> {
    let length = u8::try_from(payload.len()).expect("at most 100 bytes");
    let head = [0x5A, 0xA5, length, 0];
    let [low, high] = crc(head.iter().chain(payload)).to_le_bytes();
    [&head[..], &[low, high], payload].concat()
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
