use super::MotorName;

/// A setting of a drive that prevents arming: the setting differs from the expected value, or is not known.
///
/// # Examples
/// ```
/// use drivetrain::motor::{MotorName, WrongSetting};
///
/// let wrong = WrongSetting {
///     motor: MotorName::new("DM-J4310", 1),
///     setting: "CTRL_MODE",
///     expected: 1.0,
///     found: Some(2.0),
/// };
/// assert_eq!(wrong.to_string(), "DM-J4310 #1 has CTRL_MODE 2, the program needs 1: write it, or change the configuration");
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct WrongSetting {
    /// The motor.
    pub motor: MotorName,
    /// The name of the setting in the manual of the drive.
    pub setting: &'static str,
    /// The value in the configuration of the motor, in the unit of the manual.
    pub expected: f32,
    /// The value in the drive; `None` if the drive has not answered yet, NaN if the drive did not answer on the way to be enabled, or
    /// does not have the setting.
    pub found: Option<f32>,
}

impl WrongSetting {
    pub(crate) const fn new(
        motor: MotorName,
        setting: &'static str,
        expected: f32,
        found: Option<f32>,
    ) -> Self {
        Self { motor, setting, expected, found }
    }
}

impl core::fmt::Display for WrongSetting {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let Self { motor, setting, expected, found } = self;
        match found {
            Some(found) if found.is_nan() => write!(
                f,
                "{motor} does not report its {setting}, the program needs {expected}: set it with the tool of the drive, or change the configuration"
            ),
            Some(found) => write!(
                f,
                "{motor} has {setting} {found}, the program needs {expected}: write it, or change the configuration"
            ),
            None => write!(f, "{motor} has not answered yet what its {setting} is"),
        }
    }
}
