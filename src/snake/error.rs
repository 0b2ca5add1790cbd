use super::model::IDS;
use crate::motor::MotorName;

/// Reason for a refused joint. The other joints stay as before.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum AttachError {
    /// The id is not 1 to 12.
    Id(MotorName),
    /// A joint with this id is attached already.
    Taken(MotorName),
    /// A parameter of the configuration is not usable.
    Parameter {
        /// The refused joint.
        joint: MotorName,
        /// The name of the parameter.
        parameter: &'static str,
    },
    /// This place was attached and detached 16 times; a further handle could be confused with an old one.
    WornOut(MotorName),
}

impl core::fmt::Display for AttachError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Id(joint) => write!(f, "{joint}: the id is not within 1..={IDS}"),
            Self::Taken(joint) => write!(f, "{joint} is attached already"),
            Self::Parameter { joint, parameter } => write!(f, "{joint}: {parameter} is not usable"),
            Self::WornOut(joint) => write!(f, "{joint}: attached and detached too often"),
        }
    }
}

impl core::error::Error for AttachError {}
