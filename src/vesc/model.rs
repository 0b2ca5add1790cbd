//! Facts of a motor, stated by the program: a VESC drives any motor.

use crate::encoder::{GearRatio, Tachometer};
use crate::error::ConfigError;
use crate::units::AngularVelocity;
use core::f32::consts::TAU;

/// A motor with its gear, as a program states them. There is no table of models, as the drive is sold without a motor.
///
/// # Examples
/// ```
/// use drivetrain::encoder::GearRatio;
/// use drivetrain::units::AngularVelocity;
/// use drivetrain::vesc::Model;
///
/// let joint = Model {
///     name: "6374",
///     pole_pairs: 7,
///     gear: GearRatio::new(9, 1)?,
///     torque_constant_nm_per_a: 0.05,
///     current_limit_a: 40.0,
///     max_velocity: AngularVelocity::from_rpm(400.0),
/// };
/// assert_eq!(joint.torque_limit_nm(), 18.0); // 40 A of 0.05 Nm/A through a gear of 9
/// assert_eq!(joint.erpm_of(AngularVelocity::from_rpm(100.0)).round(), 6_300.0); // times 9, times 7
/// # Ok::<(), drivetrain::error::ConfigError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Model {
    /// The name, as errors print it.
    pub name: &'static str,
    /// Pole pairs of the rotor, above 0: electrical turns for one turn of the rotor.
    pub pole_pairs: u8,
    /// Turns of the rotor for turns of the output shaft.
    pub gear: GearRatio,
    /// Torque of the rotor for a current, in Nm/A, above 0 and at most 1000000: 9.55 divided by the rpm for a volt.
    pub torque_constant_nm_per_a: f32,
    /// The largest current of each command, in A, above 0 and at most 1000. The drive has a limit of its own beside it.
    pub current_limit_a: f32,
    /// The velocity of the output shaft without load, above 0: targets are kept within, and health takes it for the whole.
    pub max_velocity: AngularVelocity,
}

impl Model {
    /// Returns the largest torque of the output shaft, in Nm, without losses of the gear.
    #[must_use]
    pub const fn torque_limit_nm(&self) -> f32 {
        self.current_limit_a * self.torque_constant_nm_per_a * self.gear.as_f32()
    }

    /// Returns the current in A for a torque of the output shaft in Nm.
    #[must_use]
    pub const fn current_of(&self, torque_nm: f32) -> f32 {
        torque_nm / (self.torque_constant_nm_per_a * self.gear.as_f32())
    }

    /// Returns the electrical rpm of a velocity of the output shaft.
    #[must_use]
    pub const fn erpm_of(&self, velocity: AngularVelocity) -> f32 {
        velocity.as_rad_per_s() * self.electrical() * (60.0 / TAU)
    }

    /// Returns the velocity of the output shaft for electrical rpm.
    #[must_use]
    pub const fn velocity_of(&self, erpm: i32) -> AngularVelocity {
        AngularVelocity::from_rad_per_s(erpm as f32 / self.electrical() * (TAU / 60.0))
    }

    /// Electrical turns for one turn of the output shaft.
    const fn electrical(&self) -> f32 {
        self.pole_pairs as f32 * self.gear.as_f32()
    }

    /// Takes a model that has been checked.
    pub(super) fn tachometer(&self) -> Tachometer {
        let turn = TACHO * u32::from(self.pole_pairs) * u32::from(self.gear.rotor());
        let output = i32::from(self.gear.output());
        Tachometer::new(turn.cast_signed(), output)
    }

    pub(super) fn check(&self) -> Result<(), ConfigError> {
        ConfigError::check_limit("pole_pairs", self.pole_pairs.into(), 255.0)?;
        ConfigError::check_limit("torque_constant_nm_per_a", self.torque_constant_nm_per_a, 1e6)?;
        ConfigError::check_limit("current_limit_a", self.current_limit_a, MOST_AMPERES)?;
        ConfigError::check_limit("torque limit in Nm", self.torque_limit_nm(), f32::MAX)?;
        let fastest = self.max_velocity.as_rad_per_s();
        ConfigError::check_limit("max_velocity in rad/s", fastest, f32::MAX)?;
        let speed = self.erpm_of(self.max_velocity).abs();
        ConfigError::check_limit("max_velocity in electrical rpm", speed, MOST_ERPM)?;
        // Counts of the tachometer are divided by this product in 32 bits.
        let turn = TACHO * u32::from(self.pole_pairs) * u32::from(self.gear.rotor());
        let product = turn.saturating_mul(u32::from(self.gear.output()));
        let most = f32::from_bits(0x4E7F_FFFF); // the last below 2^30
        let name = "pole_pairs times 6 times both numbers of gear";
        ConfigError::check_limit(name, product as f32, most)
    }
}

/// Counts of the tachometer for one electrical turn.
const TACHO: u32 = 6;

/// The largest current of a configuration, in A: far beyond any drive, and exact in mA.
const MOST_AMPERES: f32 = 1_000.0;

/// The largest speed of a configuration, in electrical rpm: an `f32` has each whole number up to here.
const MOST_ERPM: f32 = 16_777_216.0;
