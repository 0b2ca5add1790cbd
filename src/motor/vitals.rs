/// Severity of an error reported by an ESC.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Severity {
    /// The ESC continues, with a warning.
    Warning,
    /// The motor must not be driven.
    Fault,
}

/// Quantities known to an own motor beside its velocity: every known quantity is monitored.
///
/// Shares are relative to the largest command, current or speed without load: 0.5 is half; negative in the other
/// direction.
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
    /// Severity of the error reported by the ESC.
    pub error: Option<Severity>,
    /// The error code, for the log.
    pub error_code: u8,
    /// The command of the last [`control`](super::OwnMotor::control), as a share; 0 if not known, and then neither stall
    /// nor runaway is detected.
    pub effort: f32,
    /// The speed as a share of the speed without load.
    pub speed: f32,
    /// The current as a share; 0 if not known.
    pub current: f32,
}

impl Vitals {
    /// Returns vitals with the first of several codes of faults, or the code of a warning; 0 for none.
    pub(crate) fn of_errors<const N: usize>(faults: [u8; N], warning: u8) -> Self {
        let fault = faults.into_iter().find(|code| *code > 0).map(|code| (Severity::Fault, code));
        let warning = (warning > 0).then_some((Severity::Warning, warning));
        let (error, code) = fault.or(warning).unzip();
        Self { error, error_code: code.unwrap_or(0), ..Self::default() }
    }
}
