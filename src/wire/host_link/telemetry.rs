use super::{JOINTS, check, seal};
use crate::wire::{Decode, EncodeError, Reject};
use crate::wire::{Reader, Writer};

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
