//! The serial protocol of the RoboMaster referee system: state of the robot, power, heat and shots. 115200 baud.
//!
//! ```text
//! A5 | data length u16 | sequence u8 | CRC-8 | command u16 | data | CRC-16        all little-endian
//! CRC-8: polynomial 31, reflected, from FF, over the four bytes before it
//! CRC-16/MCRF4XX over everything before it
//! ```
//!
//! | command | data | here |
//! |---|---|---|
//! | `0201` | 13 bytes, or 17 since version 2.0.0 of the protocol | [`RefereeMessage::Robot`] |
//! | `0202` | 16 bytes, or 14 since the season of 2026 | [`RefereeMessage::Power`] |
//! | `0207` | 7 bytes | [`RefereeMessage::Shot`] |
//! | others, and these with another length | up to [`MAX_DATA`] bytes | [`RefereeMessage::Raw`] |
//!
//! The layouts change with the seasons, and no field names the version: the length alone distinguishes the layouts. Layouts of
//! before 2024 (for example 27 bytes of `0201`) are [`RefereeMessage::Raw`].
//!
//! [`Referee`] reads the bytes, and returns the valid power limit and buffer energy for
//! [`chassis::PowerBuffer`](crate::chassis::PowerBuffer):
//!
//! ```
//! use drivetrain::chassis::PowerBuffer;
//! use drivetrain::control::PidConfig;
//! use drivetrain::time::{Duration, Instant};
//! use drivetrain::wire::referee::{Referee, encode};
//!
//! let mut referee = Referee::new(45); // W, while nothing is heard
//! let mut buffer = PowerBuffer::new(20.0, PidConfig::new(2.0, 0.0, 0.0))?;
//! let now = Instant::START;
//! assert_eq!(referee.power_limit_w(now), 45.0);
//!
//! // Robot 3, 80 W; a buffer of 60 J. Each counts from the second frame on.
//! let state = [3, 1, 200, 0, 200, 0, 40, 0, 100, 0, 80, 0, 0b111];
//! let power = [0, 0, 0, 0, 0, 0, 0, 0, 60, 0, 12, 0, 0, 0];
//! for (command, data) in [(0x0201, &state[..]), (0x0202, &power), (0x0201, &state), (0x0202, &power)] {
//!     let mut frame = [0; 32];
//!     let mut received = encode(command, 0, data, &mut frame)?; // from the serial port
//!     while let Some(message) = referee.read(&mut received, now) {}
//! }
//! assert_eq!((referee.power_limit_w(now), referee.buffer_energy_j(now)), (80.0, Some(60.0)));
//! let allowed_w = buffer.allowance_w(referee.power_limit_w(now), referee.buffer_energy_j(now), 0.001);
//! assert_eq!(allowed_w, 160.0); // 40 J to spend
//!
//! let later = now + Duration::from_millis(501); // silence
//! assert_eq!((referee.power_limit_w(later), referee.buffer_energy_j(later)), (45.0, None));
//! # Ok::<(), Box<dyn core::error::Error>>(())
//! ```
//!
//! Limits: a frame of more than [`MAX_DATA`] bytes of data is refused by its length, and its bytes are searched for shorter
//! frames. A robot receives none (`0301` between robots has 118); `0310`, of 300 bytes, goes from a robot to its custom client.
//! Among the bytes `A5` in noise, one in 131 000 is followed by a fitting length and CRC-8: the next frames then wait until so
//! many bytes have come. [`Referee::abandon`] in a pause of the line frees them.
//!
//! Source: frame and checksums: taproot (GPL, facts only), librm, the self-test of a public driver. Layouts: four public drivers
//! each of the versions before and since 2.0.0, agreeing in lengths and offsets. The structure of `0202` in the document of 2026
//! has two bytes less than its table; public drivers follow the table (buffer energy at byte 8, 14 bytes), and so does this
//! module. **Not known:** a captured frame of a match; whether the baud rate differs on the video link.

mod receiver;

use super::{Decode, EncodeError, Reader, Reject, Writer};

pub use receiver::Referee;

/// The longest data of a frame, in bytes.
pub const MAX_DATA: usize = 128;

/// A buffer size for every frame.
pub const MAX_FRAME: usize = MAX_DATA + OVERHEAD;

/// Header, command and CRC-16 in bytes.
const OVERHEAD: usize = 9;

const START: u8 = 0xA5;

static HEADER_CRC: crc::Crc<u8, crc::Table<1>> = crc::Crc::<u8, crc::Table<1>>::new(&CRC_8);
static CRC: crc::Crc<u16, crc::Table<1>> =
    crc::Crc::<u16, crc::Table<1>>::new(&crc::CRC_16_MCRF4XX);

const CRC_8: crc::Algorithm<u8> = crc::Algorithm {
    width: 8,
    poly: 0x31,
    init: 0xFF,
    refin: true,
    refout: true,
    xorout: 0x00,
    check: 0x0B,
    residue: 0x00,
};

/// Checks that the last two bytes are the CRC-16 of the bytes before, and returns the bytes before.
pub(super) fn checked(frame: &[u8]) -> Result<&[u8], Reject> {
    let (body, crc) = frame.split_last_chunk().ok_or(Reject::Length)?;
    if CRC.checksum(body) == u16::from_le_bytes(*crc) { Ok(body) } else { Err(Reject::Checksum) }
}

/// A message of the referee system.
///
/// # Examples
/// ```
/// use drivetrain::wire::Deframer;
/// use drivetrain::wire::referee::{MAX_FRAME, RefereeMessage};
///
/// let mut decoder = Deframer::<RefereeMessage, MAX_FRAME>::new();
/// let mut bytes: &[u8] = &[
///     0xA5, 0x0B, 0x00, 0x01, 0x5C, 0x01, 0x00, 0xAA, 0x2C, 0x01, 0x88, 0x77, 0x66, 0x55, 0x44, 0x33, 0x22, 0x11,
///     0xEF, 0x74,
/// ];
/// let message = decoder.read(&mut bytes).ok_or("no message")?;
/// let (command, data) = message.as_raw().ok_or("another message")?;
/// assert_eq!(command, 0x0001); // status of the game
/// assert_eq!(data[1..3], 300_u16.to_le_bytes()); // seconds left
/// # Ok::<(), &str>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum RefereeMessage {
    /// Performance and state of the robot: message `0201`, ten times a second.
    ///
    /// ```text
    /// u8 id, u8 level, u16 HP, u16 HP at most, u16 cooling, u16 heat at most, u16 W, (f32 m/s since 2.0.0), u8 outputs
    /// ```
    Robot {
        /// Number of the robot: 1 to 9 red, 101 to 109 blue.
        robot_id: u8,
        /// Level.
        level: u8,
        /// Hit points now.
        hp: u16,
        /// Hit points at most.
        max_hp: u16,
        /// Heat by which the barrel cools each second.
        barrel_cooling_per_s: u16,
        /// Heat limit of the barrel.
        barrel_heat_limit: u16,
        /// Power limit of the chassis in W, as received. Use [`Referee::power_limit_w`] instead.
        chassis_power_limit_w: u16,
        /// Limit of the muzzle velocity in m/s; `None` in the layout of before version 2.0.0.
        muzzle_velocity_limit_m_s: Option<f32>,
        /// Whether the output of the gimbal has 24 V.
        gimbal_is_powered: bool,
        /// Whether the output of the chassis has 24 V.
        chassis_is_powered: bool,
        /// Whether the output of the shooter has 24 V.
        shooter_is_powered: bool,
    },
    /// Energy of the chassis' buffer, and heat of the barrels: message `0202`, ten to fifty times a second.
    ///
    /// ```text
    /// 8 bytes reserved, u16 J, u16 heat 17 mm, (u16 heat of the second 17 mm until 2025), u16 heat 42 mm
    /// ```
    ///
    /// The reserved bytes were voltage, current and power of the chassis until 2024. No field of the frame confirms these values, so
    /// they are not read.
    Power {
        /// Charge of the buffer in J, as received. Use [`Referee::buffer_energy_j`] instead.
        buffer_energy_j: u16,
        /// Heat of the 17 mm barrel; of the first barrel if there are two.
        heat_17mm: u16,
        /// Heat of the second 17 mm barrel; `None` in the layout of 2026.
        heat_17mm_second: Option<u16>,
        /// Heat of the 42 mm barrel.
        heat_42mm: u16,
    },
    /// A shot: message `0207`, after each shot.
    ///
    /// ```text
    /// u8 projectile, u8 shooter, u8 shots per second, f32 m/s
    /// ```
    Shot {
        /// Type of the projectile, as received: 1 is 17 mm, 2 is 42 mm.
        projectile: u8,
        /// Number of the shooter, as received: 1 is 17 mm, 3 is 42 mm; 2 was the second 17 mm until 2025.
        shooter: u8,
        /// Rate of fire in 1/s.
        rate_hz: u8,
        /// Muzzle velocity in m/s: finite, zero or more.
        muzzle_velocity_m_s: f32,
    },
    /// Any other, not serialized: see [`as_raw`](Self::as_raw).
    #[cfg_attr(feature = "serde", serde(skip))]
    Raw {
        /// Number of the command.
        command: u16,
        /// Number of bytes of data.
        length: u8,
        /// The data, and zeros up to [`MAX_DATA`] bytes.
        data: [u8; MAX_DATA],
    },
}

impl RefereeMessage {
    fn raw(command: u16, data: &[u8]) -> Option<Self> {
        let length = u8::try_from(data.len()).ok()?;
        let mut padded = [0; MAX_DATA];
        padded.get_mut(..data.len())?.copy_from_slice(data);
        Some(Self::Raw { command, length, data: padded })
    }

    /// Returns the number of the command and the data, 0 to [`MAX_DATA`] bytes, of a message whose data is not read here; `None` for any
    /// other message.
    #[must_use]
    pub fn as_raw(&self) -> Option<(u16, &[u8])> {
        match self {
            Self::Raw { command, length, data } => {
                Some((*command, data.get(..usize::from(*length)).unwrap_or(&[])))
            }
            _ => None,
        }
    }
}

impl Decode for RefereeMessage {
    type Options = ();
    /// The header with its CRC-8: a frame with a damaged length is refused before its bytes are waited for.
    const PREFIX: usize = 5;

    fn header(_: &()) -> &[u8] {
        &[START]
    }

    fn length(_: &(), prefix: &[u8]) -> Option<usize> {
        let (header, rest) = prefix.split_first_chunk::<4>()?;
        let [_, low, high, _] = *header;
        let data = usize::from(u16::from_le_bytes([low, high]));
        let is_whole = rest.first() == Some(&HEADER_CRC.checksum(header));
        (is_whole && data <= MAX_DATA).then_some(data + OVERHEAD)
    }

    fn decode(_: &(), frame: &[u8]) -> Result<Self, Reject> {
        let mut fields = Reader(checked(frame)?);
        let _header: [u8; 5] = fields.take().ok_or(Reject::Length)?;
        let command = fields.u16_le().ok_or(Reject::Length)?;
        let data = fields.0;
        let message = match (command, data.len()) {
            (0x0201, 13 | 17) => robot_state(fields),
            (0x0202, 14 | 16) => power_heat(fields),
            (0x0207, 7) => shot(fields),
            _ => Self::raw(command, data),
        };
        message.ok_or(Reject::Content)
    }
}

/// Writes a frame with this command, sequence number and data, and returns the filled part of `out`.
///
/// For messages to the referee system (drawings of the client, messages between robots) and for a simulated referee
/// system.
///
/// # Examples
/// ```
/// use drivetrain::wire::referee::encode;
///
/// let mut buffer = [0; 9];
/// let frame = encode(0x0002, 123, &[], &mut buffer)?;
/// assert_eq!(frame, [0xA5, 0x00, 0x00, 0x7B, 0x1B, 0x02, 0x00, 0x61, 0x63]);
/// # Ok::<(), drivetrain::wire::EncodeError>(())
/// ```
///
/// # Errors
/// [`EncodeError::BufferTooSmall`] when `out` has less than 9 bytes more than `data`; [`EncodeError::DataTooLong`] when `data` is
/// longer than 65535 bytes.
pub fn encode<'a>(
    command: u16,
    sequence: u8,
    data: &[u8],
    out: &'a mut [u8],
) -> Result<&'a [u8], EncodeError> {
    let too_long = EncodeError::DataTooLong { given: data.len(), most: usize::from(u16::MAX) };
    let length = u16::try_from(data.len()).map_err(|_| too_long)?;
    let mut frame = Writer::new(out, usize::from(length) + OVERHEAD)?;
    let [low, high] = length.to_le_bytes();
    let header = [START, low, high, sequence];
    frame.put(&header);
    frame.put(&[HEADER_CRC.checksum(&header)]);
    frame.put(&command.to_le_bytes());
    frame.put(data);
    let crc = CRC.checksum(frame.written());
    frame.put(&crc.to_le_bytes());
    Ok(frame.finish())
}

/// Length of the data of `0201` with the limit of the muzzle velocity; behind the twelve bytes shared by both versions.
const WITH_SPEED_LIMIT: usize = 5;
/// Length of the heats of `0202` with a second 17 mm barrel, behind the buffer energy.
const WITH_SECOND_BARREL: usize = 6;

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

/// Reads the data of a message; `None` when too short, or with an impossible value.
fn robot_state(mut data: Reader<'_>) -> Option<RefereeMessage> {
    let (robot_id, level) = (data.u8()?, data.u8()?);
    let (hp, max_hp) = (data.u16_le()?, data.u16_le()?);
    let (barrel_cooling_per_s, barrel_heat_limit) = (data.u16_le()?, data.u16_le()?);
    let chassis_power_limit_w = data.u16_le()?;
    let has_limit = data.0.len() == WITH_SPEED_LIMIT;
    let muzzle_velocity_limit_m_s = if has_limit { Some(velocity(&mut data)?) } else { None };
    let outputs = data.u8()?;
    Some(RefereeMessage::Robot {
        robot_id,
        level,
        hp,
        max_hp,
        barrel_cooling_per_s,
        barrel_heat_limit,
        chassis_power_limit_w,
        muzzle_velocity_limit_m_s,
        gimbal_is_powered: outputs & 1 != 0,
        chassis_is_powered: outputs & 2 != 0,
        shooter_is_powered: outputs & 4 != 0,
    })
}

fn power_heat(mut data: Reader<'_>) -> Option<RefereeMessage> {
    let _reserved: [u8; 8] = data.take()?;
    let buffer_energy_j = data.u16_le()?;
    let has_second = data.0.len() == WITH_SECOND_BARREL;
    let heat_17mm = data.u16_le()?;
    let heat_17mm_second = if has_second { Some(data.u16_le()?) } else { None };
    let heat_42mm = data.u16_le()?;
    Some(RefereeMessage::Power { buffer_energy_j, heat_17mm, heat_17mm_second, heat_42mm })
}

fn shot(mut data: Reader<'_>) -> Option<RefereeMessage> {
    Some(RefereeMessage::Shot {
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

#[cfg(test)]
mod tests {
    use super::*;

    /// The checks of the sources; the second is vector `crc.rm_referee.crc16.check` of `tests/data/wire/vectors.json`.
    #[test]
    fn the_checksums_are_those_of_the_referee_system() {
        assert_eq!(HEADER_CRC.checksum(b"123456789"), 0x0B);
        assert_eq!(CRC.checksum(b"123456789"), 0x6F91);
    }

    #[test]
    fn each_output_of_24_v_is_its_own_bit() {
        for outputs in 0..=7 {
            let data = [3, 1, 200, 0, 200, 0, 40, 0, 100, 0, 80, 0, outputs | 0xF8];
            let Some(RefereeMessage::Robot {
                gimbal_is_powered,
                chassis_is_powered,
                shooter_is_powered,
                ..
            }) = robot_state(Reader(&data))
            else {
                panic!("{outputs}: refused")
            };
            let powered = [gimbal_is_powered, chassis_is_powered, shooter_is_powered];
            assert_eq!(powered, [1, 2, 4].map(|bit| outputs & bit != 0), "{outputs}");
        }
    }

    #[test]
    fn data_too_long_for_the_length_field_is_refused() {
        let data = std::vec![0; 65_536];
        let error = encode(1, 0, &data, &mut []).unwrap_err();
        assert_eq!(error, EncodeError::DataTooLong { given: 65_536, most: 65_535 });
        let error = encode(1, 0, &data[1..], &mut []).unwrap_err();
        assert_eq!(error, EncodeError::BufferTooSmall { needed: 65_544, given: 0 });
    }
}
