//! Quantities of a motor that its health is judged by.

use super::{HealthConfig, Sample, elapsed};
use crate::motor::Severity;
use crate::time::Duration;

/// Quantities known to an actuator beside its velocity: every known quantity is monitored.
///
/// Shares are relative to the largest command, current or speed without load: 0.5 is half; negative in the other
/// direction.
///
/// # Examples
/// ```
/// use drivetrain::motor::Vitals;
///
/// let vitals = Vitals { temperature_c: Some(35), effort: 0.8, speed: 0.01, ..Vitals::default() };
/// assert_eq!((vitals.has_fault, vitals.current), (false, 0.0));
/// ```
#[derive(Debug, Default, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Vitals {
    /// Its temperature in °C. Watched when its [`HealthConfig`] has temperatures.
    pub temperature_c: Option<i16>,
    /// Whether the ESC reports a fault: the motor must not be driven.
    pub has_fault: bool,
    /// Whether the ESC reports a warning, and continues. During a fault, no warning counts.
    pub has_warning: bool,
    /// The error code, for the log.
    pub error_code: u8,
    /// The command of the last [`control`](crate::motor::DriveProtocol::control), as a share; 0 if not known, and then neither stall
    /// nor runaway is detected.
    pub effort: f32,
    /// The speed as a share of the speed without load.
    pub speed: f32,
    /// The current as a share; 0 if not known.
    pub current: f32,
}

impl Vitals {
    pub(crate) const fn error(&self) -> Option<Severity> {
        match (self.has_fault, self.has_warning) {
            (true, _) => Some(Severity::Fault),
            (false, true) => Some(Severity::Warning),
            (false, false) => None,
        }
    }

    /// Returns the slow quantities, so long after the last check.
    #[inline]
    pub(crate) fn sample(&self, since: Duration, config: &HealthConfig) -> Sample {
        Sample {
            elapsed: elapsed(since.micros_u32()),
            fresh: false,
            effort: self.effort,
            speed: self.speed,
            current: self.current,
            word: 0,
            word_change: u8::MAX,
            angle: 0,
            rest: 0,
            temperature: self.temperature_c.zip(config.temperatures_c()),
        }
    }

    /// Returns vitals with the first of several codes of faults, or the code of a warning; 0 for none.
    pub(crate) fn of_errors<const N: usize>(faults: [u8; N], warning: u8) -> Self {
        let fault = faults.into_iter().find(|code| *code > 0);
        let (has_fault, has_warning) = (fault.is_some(), fault.is_none() && warning > 0);
        Self { has_fault, has_warning, error_code: fault.unwrap_or(warning), ..Self::default() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vitals_have_the_first_code_of_a_fault_or_the_code_of_a_warning() {
        let of = |vitals: Vitals| (vitals.has_fault, vitals.has_warning, vitals.error_code);
        assert_eq!(of(Vitals::of_errors([0, 7, 9], 3)), (true, false, 7));
        assert_eq!(of(Vitals::of_errors([0, 0], 3)), (false, true, 3));
        assert_eq!(of(Vitals::of_errors([0, 0], 0)), (false, false, 0));
    }
}
