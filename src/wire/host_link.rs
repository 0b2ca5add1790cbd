//! The serial line between the snake robot and its computer: commands down, telemetry up, 115200 baud.
//!
//! ```text
//! command, 79 bytes                                   telemetry, 121 bytes
//!  0  AA 55 01 4B 31 10   header                       0  AA 55 or BB 66   header
//!  6  12 x { rpm u8, position i32 }                    2  74               length of the payload, 116
//! 66  0D  GM6020 i16                                   3  12 x position i32
//! 69  0E  C610 i16                                    51  12 x speed i8, rpm
//! 72  0F  STS3032 i16, degrees                        63  GM6020 i32, C610 i32
//! 75  10  reset: 1 re-zero, 6 disable, 9 enable       71  4 IMUs x 3 angles f32
//! 77  CRC                                            119  CRC
//! ```
//! Integers are big-endian. The CRC is that of Modbus over all bytes before, but its high byte comes first.
//!
//! Where the sources differ:
//!
//! | question | the robot's document | its newer firmware | here |
//! |---|---|---|---|
//! | header of telemetry | `AA 55` | `BB 66` | both; the firmware's is the default: the running firmware sends this header, and it differs from that of a command ([`TelemetryFormat`]) |
//! | byte order of the floats | not said | little-endian: memory of a Cortex-M | both; little-endian is the default, as the only one seen |
//! | `4B` in the command | up to the CRC | 75 bytes from the function code, CRC included | the firmware's, the only count that fits |
//! | the four tags | left out | skipped unread | written as 13 to 16, skipped when read |
//! | IMUs | USART 2, 7, 8, 6; pitch, roll, yaw | USART 6, 2, 7, 8 | in the order of the wire, without names |
//!
//! A silent host must not keep a robot going: read its commands with a [`Receiver`](super::Receiver), and relax the
//! motors while its `latest` is `None`.
//!
//! ```
//! use drivetrain::wire::Deframer;
//! use drivetrain::wire::host_link::*;
//!
//! let mut command = HostCommand::default();
//! (command.speeds_rpm[4], command.positions_pulses[4]) = (10, 2 * PULSES_PER_TURN);
//! command.reset = Reset::Enable;
//!
//! let mut buffer = [0; COMMAND_LENGTH];
//! let mut bytes = command.encode(&mut buffer)?;
//! let mut decoder = Deframer::<HostCommand, COMMAND_LENGTH>::new();
//! assert_eq!(decoder.read(&mut bytes), Some(command));
//! # Ok::<(), drivetrain::wire::EncodeError>(())
//! ```
//!
//! Source: the robot's data-flow document, and where the document is wrong or silent, its public firmware (`uart3.c`,
//! `chasis_task.c`).

use super::{Decode, EncodeError, Reader, Reject, Writer};

/// The number of joints of the robot.
pub const JOINTS: usize = 12;

/// Position pulses in one turn of a joint motor.
pub const PULSES_PER_TURN: i32 = 65_536;

static CRC: crc::Crc<u16, crc::Table<1>> = crc::Crc::<u16, crc::Table<1>>::new(&crc::CRC_16_MODBUS);

/// Compares the last two bytes with the CRC of the bytes before.
fn check(frame: &[u8]) -> Result<Reader<'_>, Reject> {
    let (body, crc) = frame.split_last_chunk().ok_or(Reject::Length)?;
    if CRC.checksum(body) == u16::from_be_bytes(*crc) {
        Ok(Reader(body))
    } else {
        Err(Reject::Checksum)
    }
}

/// Appends the CRC of the written bytes, and returns the frame.
fn seal(mut writer: Writer<'_>) -> &[u8] {
    let crc = CRC.checksum(writer.written());
    writer.put(&crc.to_be_bytes());
    writer.finish()
}

/// The length of a command frame in bytes.
pub const COMMAND_LENGTH: usize = 79;

/// Two marks, the controller's address, 75 bytes to follow, "move", 16 values: the firmware compares all six.
const HEADER: [u8; 6] = [0xAA, 0x55, 0x01, 0x4B, 0x31, 0x10];
/// The numbers of the four values behind the joints.
const TAGS: [u8; 4] = [13, 14, 15, 16];

/// Command of the computer to the robot.
///
/// # Examples
/// ```
/// use drivetrain::wire::host_link::{HostCommand, Reset, COMMAND_LENGTH};
///
/// let stop = HostCommand { reset: Reset::Disable, ..HostCommand::default() };
/// let mut buffer = [0; COMMAND_LENGTH];
/// assert_eq!(stop.encode(&mut buffer)?[76], 6);
/// # Ok::<(), drivetrain::wire::EncodeError>(())
/// ```
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct HostCommand {
    /// Where the joints go, in pulses from their zero; 65536 a turn.
    pub positions_pulses: [i32; JOINTS],
    /// How fast the joints go there, in rpm: the byte has no sign, the position gives the direction.
    pub speeds_rpm: [u8; JOINTS],
    /// Target of the gripper's GM6020, in the firmware's unit.
    pub gm6020_position: i16,
    /// Target of the gripper's C610, in the firmware's unit.
    pub c610_position: i16,
    /// Target of the gripper's STS3032 servo in degrees.
    pub sts3032_degrees: i16,
    /// Additional order.
    pub reset: Reset,
}

impl HostCommand {
    /// Returns the speeds of the joints in pulses per second, rounded down, as taken by the joint motors.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::wire::host_link::HostCommand;
    ///
    /// let command = HostCommand { speeds_rpm: [10; 12], ..HostCommand::default() };
    /// assert_eq!(command.speeds_pulses_per_s(), [10_922; 12]);
    /// ```
    #[must_use]
    pub fn speeds_pulses_per_s(&self) -> [i32; JOINTS] {
        self.speeds_rpm.map(|rpm| i32::from(rpm) * PULSES_PER_TURN / 60)
    }
}

/// The reset byte of a command.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Reset {
    /// Nothing: 0.
    #[default]
    None,
    /// Takes the present positions as zero, and enables: 1. A joint of [`snake`](crate::snake) that lost its zero takes targets only after this.
    Rezero,
    /// Disables all joint motors: 6.
    Disable,
    /// Enables all joint motors: 9.
    Enable,
    /// A value without a meaning; the firmware does nothing.
    Other(u8),
}

impl Reset {
    /// Takes the byte of the frame.
    #[must_use]
    pub const fn from_raw(raw: u8) -> Self {
        match raw {
            0 => Self::None,
            1 => Self::Rezero,
            6 => Self::Disable,
            9 => Self::Enable,
            other => Self::Other(other),
        }
    }

    /// Returns the byte of the frame.
    #[must_use]
    pub const fn as_raw(self) -> u8 {
        match self {
            Self::None => 0,
            Self::Rezero => 1,
            Self::Disable => 6,
            Self::Enable => 9,
            Self::Other(raw) => raw,
        }
    }
}

impl HostCommand {
    /// Writes the frame, and returns the filled part of `out`.
    ///
    /// Costs 540 instructions on a Cortex-M4F (`docs/figures.md`).
    ///
    /// # Errors
    /// [`EncodeError::BufferTooSmall`] when `out` has less than [`COMMAND_LENGTH`] bytes.
    pub fn encode<'a>(&self, out: &'a mut [u8]) -> Result<&'a [u8], EncodeError> {
        let mut writer = Writer::new(out, COMMAND_LENGTH)?;
        writer.put(&HEADER);
        for (speed_rpm, position_pulses) in self.speeds_rpm.iter().zip(&self.positions_pulses) {
            writer.put(&[*speed_rpm]);
            writer.put(&position_pulses.to_be_bytes());
        }
        let [gm6020, c610, sts3032, reset] = TAGS;
        for (tag, position) in [
            (gm6020, self.gm6020_position),
            (c610, self.c610_position),
            (sts3032, self.sts3032_degrees),
        ] {
            writer.put(&[tag]);
            writer.put(&position.to_be_bytes());
        }
        writer.put(&[reset, self.reset.as_raw()]);
        Ok(seal(writer))
    }
}

impl Decode for HostCommand {
    type Options = ();
    const PREFIX: usize = HEADER.len();

    fn header(_: &()) -> &[u8] {
        &HEADER
    }

    fn length(_: &(), _prefix: &[u8]) -> Option<usize> {
        Some(COMMAND_LENGTH)
    }

    fn decode(_: &(), frame: &[u8]) -> Result<Self, Reject> {
        read(check(frame)?).ok_or(Reject::Length)
    }
}

fn read(mut body: Reader<'_>) -> Option<HostCommand> {
    let _header: [u8; 6] = body.take()?;
    let joints: [_; JOINTS] = body.array(|body| Some((body.u8()?, body.i32_be()?)))?;
    let (speeds_rpm, positions_pulses) = (joints.map(|joint| joint.0), joints.map(|joint| joint.1));
    let mut tagged = || {
        let _tag = body.u8()?;
        body.i16_be()
    };
    let (gm6020_position, c610_position, sts3032_degrees) = (tagged()?, tagged()?, tagged()?);
    let [_tag, reset] = body.take()?;
    let reset = Reset::from_raw(reset);
    Some(HostCommand {
        positions_pulses,
        speeds_rpm,
        gm6020_position,
        c610_position,
        sts3032_degrees,
        reset,
    })
}

/// The length of a telemetry frame in bytes: 10.5 ms at 115200 baud, of the 50 ms between two frames.
pub const TELEMETRY_LENGTH: usize = 121;

/// The length byte: the payload without header, length and CRC.
const PAYLOAD: u8 = 116;

/// Report of the robot.
#[derive(Debug, Default, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Telemetry {
    /// Positions of the joints in pulses from their zero; 65536 a turn.
    pub positions_pulses: [i32; JOINTS],
    /// Speeds of the joints in rpm.
    pub speeds_rpm: [i8; JOINTS],
    /// Multi-turn position of the gripper's GM6020, in the firmware's unit.
    pub gm6020_position: i32,
    /// Multi-turn position of the gripper's C610, in the firmware's unit.
    pub c610_position: i32,
    /// Euler angles of the four IMUs in degrees, in the order of the wire, as received: the document calls them pitch,
    /// roll and yaw, without confirmation. May be NaN.
    pub imu_angles_deg: [[f32; 3]; 4],
}

/// The format of [`Telemetry`] frames: the two points in which the sources differ.
///
/// # Examples
/// ```
/// use drivetrain::wire::Deframer;
/// use drivetrain::wire::host_link::*;
///
/// let format = TelemetryFormat::new().with_document_header();
/// let telemetry = Telemetry { speeds_rpm: [-3; JOINTS], ..Telemetry::default() };
/// let mut buffer = [0; TELEMETRY_LENGTH];
/// let mut bytes = format.encode(&telemetry, &mut buffer)?;
/// assert_eq!(bytes[..3], [0xAA, 0x55, 116]);
///
/// let mut decoder = Deframer::<Telemetry, TELEMETRY_LENGTH>::with_options(format);
/// assert_eq!(decoder.read(&mut bytes), Some(telemetry));
/// # Ok::<(), drivetrain::wire::EncodeError>(())
/// ```
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct TelemetryFormat {
    /// `AA 55` instead of `BB 66`.
    document_header: bool,
    big_endian_floats: bool,
}

impl TelemetryFormat {
    /// Header `BB 66`, floats low byte first: the format of the newer firmware.
    #[must_use]
    pub const fn new() -> Self {
        Self { document_header: false, big_endian_floats: false }
    }

    /// Makes the first two bytes `AA 55`, as the robot's document has them: the same as of a command.
    #[must_use]
    pub const fn with_document_header(self) -> Self {
        Self { document_header: true, ..self }
    }

    /// Puts the high byte of the Euler angles first. The integers and the CRC always have their high byte first.
    #[must_use]
    pub const fn with_big_endian_floats(self) -> Self {
        Self { big_endian_floats: true, ..self }
    }

    /// Writes the frame, and returns the filled part of `out`.
    ///
    /// Costs 706 instructions on a Cortex-M4F (`docs/figures.md`).
    ///
    /// # Errors
    /// [`EncodeError::BufferTooSmall`] when `out` has less than [`TELEMETRY_LENGTH`] bytes.
    pub fn encode<'a>(
        &self,
        telemetry: &Telemetry,
        out: &'a mut [u8],
    ) -> Result<&'a [u8], EncodeError> {
        let mut writer = Writer::new(out, TELEMETRY_LENGTH)?;
        writer.put(Telemetry::header(self));
        for position in telemetry.positions_pulses {
            writer.put(&position.to_be_bytes());
        }
        for speed in telemetry.speeds_rpm {
            writer.put(&speed.to_be_bytes());
        }
        writer.put(&telemetry.gm6020_position.to_be_bytes());
        writer.put(&telemetry.c610_position.to_be_bytes());
        for angle in telemetry.imu_angles_deg.as_flattened() {
            writer.put(&if self.big_endian_floats {
                angle.to_be_bytes()
            } else {
                angle.to_le_bytes()
            });
        }
        Ok(seal(writer))
    }

    fn read(&self, mut body: Reader<'_>) -> Option<Telemetry> {
        let _header: [u8; 3] = body.take()?;
        let float = |body: &mut Reader<'_>| {
            let bytes = body.take()?;
            Some(if self.big_endian_floats {
                f32::from_be_bytes(bytes)
            } else {
                f32::from_le_bytes(bytes)
            })
        };
        Some(Telemetry {
            positions_pulses: body.array(Reader::i32_be)?,
            speeds_rpm: body.take()?.map(u8::cast_signed),
            gm6020_position: body.i32_be()?,
            c610_position: body.i32_be()?,
            imu_angles_deg: body.array(|body| body.array(float))?,
        })
    }
}

impl Decode for Telemetry {
    type Options = TelemetryFormat;
    const PREFIX: usize = 3;

    fn header(format: &TelemetryFormat) -> &[u8] {
        if format.document_header { &[0xAA, 0x55, PAYLOAD] } else { &[0xBB, 0x66, PAYLOAD] }
    }

    fn length(_: &TelemetryFormat, _prefix: &[u8]) -> Option<usize> {
        Some(TELEMETRY_LENGTH)
    }

    fn decode(format: &TelemetryFormat, frame: &[u8]) -> Result<Self, Reject> {
        format.read(check(frame)?).ok_or(Reject::Length)
    }
}

#[cfg(test)]
mod tests {
    /// Vectors `crc.modbus.*` of `tests/data/wire/vectors.json`.
    #[test]
    fn the_checksum_is_that_of_modbus() {
        for (bytes, sum) in [(&[][..], 0xFFFF), (&[0], 0x40BF), (&[1, 3, 0, 0, 0, 10], 0xCDC5)] {
            assert_eq!(super::CRC.checksum(bytes), sum);
        }
    }
}
