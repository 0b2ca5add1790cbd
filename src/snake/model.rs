//! Static facts of the drives.

use crate::motor::MotorName;
use core::f32::consts::TAU;

pub use crate::wire::host_link::PULSES_PER_TURN;

/// The highest id of a joint; the lowest is 1.
pub const IDS: u8 = 12;

pub(super) const SLOTS: usize = IDS as usize;

/// Value of the robot's firmware for [`Register::Current`].
pub(super) const CURRENT: i32 = 2_000;
/// Value of the robot's firmware for [`Register::Acceleration`] and [`Register::Deceleration`]: 1000 rpm a second.
pub(super) const ACCELERATION: i32 = 0x0010_AAAA;
/// Value of the robot's firmware for [`Register::Mode`]: the drive goes to [`Register::Position`].
pub(super) const POSITION_MODE: i32 = 1;
/// Highest speed of the robot's host, 255 rpm, in pulses a second.
pub(super) const FASTEST: i32 = 255 * PULSES_PER_TURN / 60;

/// A register of a drive.
///
/// # Examples
/// ```
/// use drivetrain::snake::Register;
///
/// assert_eq!(Register::Position.as_raw(), 0x0A);
/// assert_eq!(Register::from_raw(0x07), Some(Register::ActualPosition));
/// assert_eq!(Register::from_raw(0x0D), None);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[repr(u8)]
pub enum Register {
    /// The measured speed in pulses a second.
    ActualSpeed = 0x06,
    /// The measured position in pulses.
    ActualPosition = 0x07,
    /// The largest current of the drive, in a unit of its own.
    Current = 0x08,
    /// The speed of moves to the target, in pulses a second.
    Speed = 0x09,
    /// The target in pulses.
    Position = 0x0A,
    /// In pulses a second².
    Acceleration = 0x0B,
    /// In pulses a second².
    Deceleration = 0x0C,
    /// 1: position.
    Mode = 0x0F,
    /// 1: enabled, 0: disabled.
    Enable = 0x10,
}

impl Register {
    /// All registers, in the order of their numbers.
    pub const ALL: [Self; 9] = [
        Self::ActualSpeed,
        Self::ActualPosition,
        Self::Current,
        Self::Speed,
        Self::Position,
        Self::Acceleration,
        Self::Deceleration,
        Self::Mode,
        Self::Enable,
    ];

    /// The writable registers, in the order of a bring-up: enable last.
    pub(super) const SEQUENCE: [Self; 7] = [
        Self::Mode,
        Self::Current,
        Self::Acceleration,
        Self::Deceleration,
        Self::Speed,
        Self::Position,
        Self::Enable,
    ];

    /// Takes the number on the wire.
    #[must_use]
    pub fn from_raw(raw: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|register| register.as_raw() == raw)
    }

    /// Returns the number on the wire.
    #[must_use]
    pub const fn as_raw(self) -> u8 {
        self as u8
    }

    /// Tells whether the register can be written.
    #[must_use]
    pub const fn is_writable(self) -> bool {
        !matches!(self, Self::ActualSpeed | Self::ActualPosition)
    }
}

pub(super) const fn name(id: u8) -> MotorName {
    MotorName::new("snake joint", id)
}

/// Rounds rad or rad/s to pulses; saturates, NaN gives 0.
#[expect(clippy::cast_possible_truncation, reason = "saturates")]
pub(super) fn to_pulses(radians: f32) -> i32 {
    let pulses = radians * (PULSES_PER_TURN as f32 / TAU);
    (pulses + 0.5_f32.copysign(pulses)) as i32
}
