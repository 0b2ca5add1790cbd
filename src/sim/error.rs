use super::{Model, MotorKey};

/// Why something cannot join a [`World`](super::World).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum AttachError {
    /// The world is full.
    Full,
    /// The ESC has no such id.
    Id {
        /// The model.
        model: Model,
        /// The id that was asked for.
        id: u8,
    },
    /// There is no joint with this id, or there are 12 joints already.
    Joint {
        /// The id that was asked for.
        id: u8,
    },
    /// A parameter of the chassis, by its name, makes no sense; see [`ChassisConfig::validate`](super::ChassisConfig::validate).
    Chassis(&'static str),
}

impl core::fmt::Display for AttachError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Full => write!(f, "a world holds {} motors", MotorKey::CAPACITY),
            Self::Id { model, id } => write!(f, "{model:?} has no id {id}"),
            Self::Joint { id } => write!(f, "no joint has the id {id}, or there are 12 already"),
            Self::Chassis(name) => write!(f, "{name} of the chassis makes no sense"),
        }
    }
}

impl core::error::Error for AttachError {}
