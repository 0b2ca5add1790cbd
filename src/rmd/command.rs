//! The codec of commands to a drive.

use crate::lk::command::data_of;

/// A command to a drive, in the units of the wire: currents in 0.01 A, angles and velocities of the output shaft.
///
/// # Examples
/// ```
/// use drivetrain::rmd::Command;
///
/// // The examples of the manual V4.2: -1 A; to -360° with at most 500°/s; a time-out of 1 s.
/// assert_eq!(Command::Torque(-100).encode(), [0xA1, 0, 0, 0, 0x9C, 0xFF, 0, 0]);
/// assert_eq!(Command::Position(-36_000, 500).encode(), [0xA4, 0, 0xF4, 0x01, 0x60, 0x73, 0xFF, 0xFF]);
/// assert_eq!(Command::SetTimeout(1_000).encode(), [0xB3, 0, 0, 0, 0xE8, 0x03, 0, 0]);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Command {
    /// Switches the output off and leaves each control mode.
    Off,
    /// Stops the shaft. The drive then holds the shaft: no rest.
    Stop,
    /// Releases the holding brake.
    ReleaseBrake,
    /// Applies the holding brake.
    LockBrake,
    /// Starts the program of the drive anew, which takes more than a second. The drive does not answer.
    Reset,
    /// A torque current in 0.01 A. A torque does not release the holding brake.
    Torque(i16),
    /// A velocity in 0.01°/s.
    Velocity(i32),
    /// To an angle in 0.01° from the zero of the drive, turns count, with at most so many °/s; 0 for no limit.
    Position(i32, u16),
    /// Asks for [`Feedback`](super::Feedback).
    ReadFeedback,
    /// Asks for the angle of the output shaft: [`Feedback::decode_angle`](super::Feedback::decode_angle).
    ReadAngle,
    /// Asks for the [`State`](super::State).
    ReadState,
    /// Sets the time without a frame in ms after which the drive switches itself off and locks its brake; 0 for never. The drive
    /// keeps the time in its flash memory, and flash memory wears.
    SetTimeout(u32),
}

impl Command {
    /// A current without torque: the command of a motor at rest.
    pub const REST: Self = Self::Torque(0);

    /// Writes the data of a frame.
    #[must_use]
    pub const fn encode(self) -> [u8; 8] {
        let (code, limit, value) = match self {
            Self::Off => (0x80, 0, 0),
            Self::Stop => (0x81, 0, 0),
            Self::ReleaseBrake => (0x77, 0, 0),
            Self::LockBrake => (0x78, 0, 0),
            Self::Reset => (0x76, 0, 0),
            Self::Torque(current) => (0xA1, 0, current.cast_unsigned() as i32),
            Self::Velocity(velocity) => (0xA2, 0, velocity),
            Self::Position(angle, limit) => (0xA4, limit, angle),
            Self::ReadFeedback => (0x9C, 0, 0),
            Self::ReadAngle => (0x92, 0, 0),
            Self::ReadState => (0x9A, 0, 0),
            Self::SetTimeout(ms) => (0xB3, 0, ms.cast_signed()),
        };
        data_of(code, limit, value)
    }
}
