//! Static facts of the drives, and the rates and counters of a bus.

use crate::motor::{BusLoad, MotorName};

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

    /// Tells whether the register can be written.
    #[must_use]
    pub const fn is_writable(self) -> bool {
        !matches!(self, Self::ActualSpeed | Self::ActualPosition)
    }
}

pub(super) const fn name(id: u8) -> MotorName {
    MotorName::new("snake joint", id)
}

/// Number of frames in an update, and the rates for the load.
#[derive(Debug, Clone, Copy)]
pub(super) struct Budget {
    pub(super) reads: u8,
    pub(super) writes: u8,
    pub(super) bit_rate: u32,
    pub(super) tick_hz: u32,
}

impl Budget {
    pub(super) const fn new() -> Self {
        Self { reads: 1, writes: 1, bit_rate: 1_000_000, tick_hz: 1_000 }
    }

    /// Returns the load of requests, replies and writes, while all joints move.
    pub(super) const fn load(&self) -> BusLoad {
        let Self { reads, writes, bit_rate, tick_hz } = *self;
        BusLoad::new(bit_rate).with_frames_of(2, reads as u32, tick_hz).with_frames_of(
            6,
            reads as u32 + writes as u32,
            tick_hz,
        )
    }
}

/// Returns a number of frames in an update, 1 to 12.
pub(super) const fn limited(frames: u8) -> u8 {
    match frames {
        0 => 1,
        1..=12 => frames,
        _ => 12,
    }
}

/// Counters of a bus. All saturate, except `packed` and `superseded`, which wrap at 2^32.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Counters {
    /// Accepted replies.
    pub replies: u32,
    /// Frames with a joint's id and another length than 6.
    pub bad_length: u32,
    /// Frames with a joint's id that are no reply, or that name an unknown register.
    pub bad_field: u32,
    /// Frames with a joint's id that only a controller sends: there is a second controller on the bus.
    pub foreign_commands: u32,
    /// Frames with the id of a joint that is not attached.
    pub unattached: u32,
    /// Requests sent, less requests given back.
    pub requests: u32,
    /// Requests not answered in time, including requests given back after that.
    pub unanswered: u32,
    /// Updates with a time step of zero, negative, infinite or NaN, or with a time that stood still.
    pub bad_steps: u32,
    /// Frames that were ready: chosen by an update, or disables, whenever due; wraps.
    pub packed: u32,
    /// Frames replaced by newer ones before they were taken, or after they were given back; wraps.
    pub superseded: u32,
}

impl Counters {
    pub(super) const NONE: Self = Self {
        replies: 0,
        bad_length: 0,
        bad_field: 0,
        foreign_commands: 0,
        unattached: 0,
        requests: 0,
        unanswered: 0,
        bad_steps: 0,
        packed: 0,
        superseded: 0,
    };
}
