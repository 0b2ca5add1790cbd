use super::motor::MOTORS;
use embedded_can::ErrorKind;

/// Why a [`Simulation`](super::Simulation) refuses something, or a call of its driver failed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum SimError {
    /// There are 16 motors already.
    Full,
    /// The ESC has no such id.
    Id {
        /// The name of the model.
        model: &'static str,
        /// The requested id.
        id: u8,
    },
    /// There is no joint with this id, or there are 12 joints already.
    Joint {
        /// The requested id.
        id: u8,
    },
    /// A parameter of the chassis, by its name, is invalid; see [`ChassisConfig::validate`](super::ChassisConfig::validate).
    Chassis(&'static str),
    /// There are already 16 faults that are not over.
    TooManyFaults,
    /// The fault belongs to an ESC, and the motor is a joint: a joint can be silent or without supply.
    NoFaultOfJoint,
    /// The controller is bus-off.
    BusOff,
    /// Frames were missed because the receive queue was full. Reported once; the frames before are still there.
    Overrun,
    /// [`Fault::DriverErrors`](super::Fault::DriverErrors) makes the call of the driver fail.
    Scripted,
    /// A blocking call waited for a second.
    TimedOut,
}

impl core::fmt::Display for SimError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Full => write!(f, "the simulation holds {MOTORS} motors and has no place left"),
            Self::Id { model, id } => write!(f, "{model} has no id {id}"),
            Self::Joint { id } => write!(f, "no joint has the id {id}, or there are 12 already"),
            Self::Chassis(name) => {
                write!(f, "{name} of the chassis is out of its range, see ChassisConfig::validate")
            }
            Self::TooManyFaults => f.write_str(
                "the simulation holds 16 faults at a time: schedule more when some have ended",
            ),
            Self::NoFaultOfJoint => {
                f.write_str("a joint can be silent or without supply, and has no other fault")
            }
            Self::BusOff => f.write_str("the controller is bus-off"),
            Self::Overrun => f.write_str("frames were missed: the receive queue was full"),
            Self::Scripted => f.write_str("the driver failed by Fault::DriverErrors"),
            Self::TimedOut => f.write_str("a blocking call timed out after a simulated second"),
        }
    }
}

impl core::error::Error for SimError {}

impl embedded_can::Error for SimError {
    fn kind(&self) -> ErrorKind {
        match self {
            Self::Overrun => ErrorKind::Overrun,
            Self::Scripted => ErrorKind::Acknowledge,
            _ => ErrorKind::Other,
        }
    }
}
