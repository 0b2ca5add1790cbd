//! The fields of the two payloads, behind the tag. `None`: too short, or no usable quaternion.

use super::{Imu, attitude};
use crate::units::{Angle, AngularVelocity};
use crate::wire::field::Reader;

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

/// ```text
/// u16 status, i8 degrees C, f32 Pa, u32 ms, 3 f32 g, 3 f32 degrees/s, 3 f32 uT, f32 roll, pitch, yaw degrees, 4 f32 w x y z
/// ```
pub(super) fn read_91(mut fields: Reader<'_>) -> Option<Imu> {
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
        attitude: attitude::normalised(quaternion)?,
    })
}

/// ```text
/// u16 status, i8 degrees C, 2 bytes unknown, i16 Pa - 100000, 2 bytes unknown, 3 i16 rate, 3 i16 acceleration,
/// 3 i16 field, i32 roll, pitch, yaw, 4 i16 w x y z
/// ```
/// The vendor's C structure has a u32 time where its Python decoder has the pressure. In the public frame the pressure is
/// plausible (99841 Pa) and the time is not (6.8 days), so there is no time.
pub(super) fn read_92(mut fields: Reader<'_>) -> Option<Imu> {
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
        attitude: attitude::normalised(
            quaternion.map(|raw| f32::from(raw) * scale_92::QUATERNION),
        )?,
    })
}
