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
//! command.joints[4] = JointTarget { speed_rpm: 10, position_pulses: 2 * PULSES_PER_TURN };
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

mod command;
mod telemetry;

pub use command::{COMMAND_LENGTH, HostCommand, JointTarget, Reset};
pub use telemetry::{TELEMETRY_LENGTH, Telemetry, TelemetryFormat};

use super::Reject;
use super::field::{Reader, Writer};

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
