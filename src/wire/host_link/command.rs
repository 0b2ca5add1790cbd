use super::{JOINTS, PULSES_PER_TURN, check, seal};
use crate::wire::field::{Reader, Writer};
use crate::wire::{Decode, EncodeError, Reject};

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
    /// The targets of the 12 joints.
    pub joints: [JointTarget; JOINTS],
    /// Target of the gripper's GM6020, in the firmware's unit.
    pub gm6020_position: i16,
    /// Target of the gripper's C610, in the firmware's unit.
    pub c610_position: i16,
    /// Target of the gripper's STS3032 servo in degrees.
    pub sts3032_degrees: i16,
    /// Additional order.
    pub reset: Reset,
}

/// The target of one joint.
///
/// # Examples
/// ```
/// use drivetrain::wire::host_link::JointTarget;
///
/// let target = JointTarget { speed_rpm: 10, position_pulses: -65_536 };
/// assert_eq!(target.speed_pulses_per_s(), 10_922);
/// ```
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct JointTarget {
    /// How fast to go there, in rpm: the byte has no sign, the position gives the direction.
    pub speed_rpm: u8,
    /// Where to go, in pulses from the zero of the joint; 65536 a turn.
    pub position_pulses: i32,
}

impl JointTarget {
    /// Returns the speed in pulses per second, rounded down, as taken by the joint motors.
    #[must_use]
    pub const fn speed_pulses_per_s(&self) -> i32 {
        self.speed_rpm as i32 * PULSES_PER_TURN / 60
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
    /// Takes the present positions as zero, and enables: 1.
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
    /// Costs 545 instructions on a Cortex-M4F (`docs/figures.md`).
    ///
    /// # Errors
    /// [`EncodeError::BufferTooSmall`] when `out` has less than [`COMMAND_LENGTH`] bytes.
    pub fn encode<'a>(&self, out: &'a mut [u8]) -> Result<&'a [u8], EncodeError> {
        let mut writer = Writer::new(out, COMMAND_LENGTH)?;
        writer.put(&HEADER);
        for joint in &self.joints {
            writer.put(&[joint.speed_rpm]);
            writer.put(&joint.position_pulses.to_be_bytes());
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
    let joints = body.array(|body| {
        Some(JointTarget { speed_rpm: body.u8()?, position_pulses: body.i32_be()? })
    })?;
    let mut tagged = || {
        let _tag = body.u8()?;
        body.i16_be()
    };
    let (gm6020_position, c610_position, sts3032_degrees) = (tagged()?, tagged()?, tagged()?);
    let [_tag, reset] = body.take()?;
    let reset = Reset::from_raw(reset);
    Some(HostCommand { joints, gm6020_position, c610_position, sts3032_degrees, reset })
}
