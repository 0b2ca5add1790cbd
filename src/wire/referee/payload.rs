//! The data of decoded messages. `None`: too short, or an impossible value.

use crate::wire::field::Reader;

/// Length of the data of `0201` with the limit of the muzzle velocity; behind the twelve bytes shared by both versions.
const WITH_SPEED_LIMIT: usize = 5;
/// Length of the heats of `0202` with a second 17 mm barrel, behind the buffer energy.
const WITH_SECOND_BARREL: usize = 6;

/// Performance and state of the robot: message `0201`.
///
/// ```text
/// u8 id, u8 level, u16 HP, u16 HP at most, u16 cooling, u16 heat at most, u16 W, (f32 m/s since 2.0.0), u8 outputs
/// ```
#[derive(Debug, Default, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct RobotState {
    /// Number of the robot: 1 to 9 red, 101 to 109 blue.
    pub robot_id: u8,
    /// Level.
    pub level: u8,
    /// Hit points now.
    pub hp: u16,
    /// Hit points at most.
    pub max_hp: u16,
    /// Heat by which the barrel cools each second.
    pub barrel_cooling_per_s: u16,
    /// Heat limit of the barrel.
    pub barrel_heat_limit: u16,
    /// Power limit of the chassis in W, as received. Use [`Referee::power_limit_w`](super::Referee::power_limit_w) instead.
    pub chassis_power_limit_w: u16,
    /// Limit of the muzzle velocity in m/s; `None` in the layout of before version 2.0.0.
    pub muzzle_velocity_limit_m_s: Option<f32>,
    /// Whether the output of the gimbal has 24 V.
    pub gimbal_is_powered: bool,
    /// Whether the output of the chassis has 24 V.
    pub chassis_is_powered: bool,
    /// Whether the output of the shooter has 24 V.
    pub shooter_is_powered: bool,
}

/// Energy of the chassis' buffer, and heat of the barrels: message `0202`.
///
/// ```text
/// 8 bytes reserved, u16 J, u16 heat 17 mm, (u16 heat of the second 17 mm until 2025), u16 heat 42 mm
/// ```
///
/// The reserved bytes were voltage, current and power of the chassis until 2024. No field of the frame confirms these values, so
/// they are not read.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct PowerHeat {
    /// Charge of the buffer in J, as received. Use [`Referee::buffer_energy_j`](super::Referee::buffer_energy_j) instead.
    pub buffer_energy_j: u16,
    /// Heat of the 17 mm barrel; of the first barrel if there are two.
    pub heat_17mm: u16,
    /// Heat of the second 17 mm barrel; `None` in the layout of 2026.
    pub heat_17mm_second: Option<u16>,
    /// Heat of the 42 mm barrel.
    pub heat_42mm: u16,
}

/// Heat of a barrel, with the limit and the cooling that hold for it.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct BarrelHeat {
    /// Heat now.
    pub heat: u16,
    /// Heat above which the robot is punished.
    pub limit: u16,
    /// Heat by which the barrel cools each second.
    pub cooling_per_s: u16,
}

/// A shot: message `0207`.
///
/// ```text
/// u8 projectile, u8 shooter, u8 shots per second, f32 m/s
/// ```
#[derive(Debug, Default, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ShotData {
    /// Type of the projectile, as received: 1 is 17 mm, 2 is 42 mm.
    pub projectile: u8,
    /// Number of the shooter, as received: 1 is 17 mm, 3 is 42 mm; 2 was the second 17 mm until 2025.
    pub shooter: u8,
    /// Rate of fire in 1/s.
    pub rate_hz: u8,
    /// Muzzle velocity in m/s: finite, zero or more.
    pub muzzle_velocity_m_s: f32,
}

pub(super) fn robot_state(mut data: Reader<'_>) -> Option<RobotState> {
    let mut state = RobotState {
        robot_id: data.u8()?,
        level: data.u8()?,
        hp: data.u16_le()?,
        max_hp: data.u16_le()?,
        barrel_cooling_per_s: data.u16_le()?,
        barrel_heat_limit: data.u16_le()?,
        chassis_power_limit_w: data.u16_le()?,
        ..RobotState::default()
    };
    if data.0.len() == WITH_SPEED_LIMIT {
        state.muzzle_velocity_limit_m_s = Some(velocity(&mut data)?);
    }
    let outputs = data.u8()?;
    state.gimbal_is_powered = outputs & 1 != 0;
    state.chassis_is_powered = outputs & 2 != 0;
    state.shooter_is_powered = outputs & 4 != 0;
    Some(state)
}

pub(super) fn power_heat(mut data: Reader<'_>) -> Option<PowerHeat> {
    let _reserved: [u8; 8] = data.take()?;
    let buffer_energy_j = data.u16_le()?;
    let has_second = data.0.len() == WITH_SECOND_BARREL;
    let heat_17mm = data.u16_le()?;
    let heat_17mm_second = if has_second { Some(data.u16_le()?) } else { None };
    Some(PowerHeat { buffer_energy_j, heat_17mm, heat_17mm_second, heat_42mm: data.u16_le()? })
}

pub(super) fn shot(mut data: Reader<'_>) -> Option<ShotData> {
    Some(ShotData {
        projectile: data.u8()?,
        shooter: data.u8()?,
        rate_hz: data.u8()?,
        muzzle_velocity_m_s: velocity(&mut data)?,
    })
}

/// A finite velocity in m/s, zero or more.
fn velocity(data: &mut Reader<'_>) -> Option<f32> {
    data.f32_le().filter(|velocity| velocity.is_finite() && *velocity >= 0.0)
}
