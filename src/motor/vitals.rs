/// How bad it is what an ESC reports.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Severity {
    /// It goes on, and says so.
    Warning,
    /// It must not be driven.
    Fault,
}

/// What a motor of your own knows of itself beside its velocity: whatever is known is watched.
///
/// Shares are of what the motor can do: 0.5 of the largest command, current or speed without load; negative the other way
/// round.
///
/// # Examples
/// ```
/// use drivetrain::motor::{Severity, Vitals};
///
/// let vitals = Vitals { temperature_c: Some(35), effort: 0.8, speed: 0.01, ..Vitals::default() };
/// assert_eq!((vitals.error, vitals.current), (None::<Severity>, 0.0));
/// ```
#[derive(Debug, Default, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Vitals {
    /// Its temperature in °C. Watched when its [`HealthConfig`](super::HealthConfig) has temperatures.
    pub temperature_c: Option<i16>,
    /// What its ESC reports.
    pub error: Option<Severity>,
    /// The code behind that, for the log.
    pub error_code: u8,
    /// The command of the last [`control`](super::OwnMotor::control), as a share; 0 when it is not known, and then neither
    /// stall nor runaway is looked for.
    pub effort: f32,
    /// The speed as a share of that without load.
    pub speed: f32,
    /// The current as a share; 0 when it is not known.
    pub current: f32,
}
