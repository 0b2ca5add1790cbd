use crate::encoder::Position;
use crate::units::AngularVelocity;
use crate::wire::referee::BarrelHeat;

/// Order of the pilot to a shooter, given in each tick.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum ShooterOrder {
    /// Wheels and loader stand. Clears a fault.
    #[default]
    Rest,
    /// The wheels turn, and the loader stands.
    Spin,
    /// The wheels turn, and the shooter releases this number of shots: 1 for a single shot, 255 for continuous fire.
    ///
    /// A burst begins when the order changes to `Fire`. While the order stays, no further shot follows. When the order changes back, the
    /// rest of the burst is dropped. If the trigger was held while the robot was armed, release the trigger first.
    Fire(u8),
}

/// State of a shooter.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub enum ShooterState {
    /// All motors stand.
    Rest,
    /// The wheels are not yet at their speed, or no longer.
    SpinningUp,
    /// The wheels are at their speed.
    Ready,
    /// A shot moves through the loader.
    Feeding,
    /// The loader turns back after a jam.
    Clearing,
    /// A shot waits until the barrel is cool enough, or until its heat is known.
    Cooling,
    /// All motors stand until the order is [`ShooterOrder::Rest`], or the robot is disarmed.
    Fault(ShooterFault),
}

/// Cause of a stop.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub enum ShooterFault {
    /// A friction wheel has no fresh feedback.
    WheelLost,
    /// A friction wheel is not within the tolerance after 3 s of spinning up.
    WheelSlow,
    /// The loader has no fresh feedback.
    LoaderLost,
    /// The loader stood again after the last attempt to clear it.
    Jammed,
}

impl core::fmt::Display for ShooterFault {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Self::WheelLost => "a friction wheel has no fresh feedback",
            Self::WheelSlow => "a friction wheel did not reach its speed in 3 s",
            Self::LoaderLost => "the loader has no fresh feedback",
            Self::Jammed => "the loader is jammed: clear it, then order rest",
        })
    }
}

/// Feedback of the loader's motor, at its output shaft.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct LoaderFeedback {
    /// Turns and angle, from any zero; positive in the feeding direction.
    pub position: Position,
    /// Speed, positive in the feeding direction.
    pub velocity: AngularVelocity,
}

/// Feedback for one tick of a shooter. The default is a disarmed robot without feedback.
#[derive(Debug, Default, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ShooterFeedback {
    /// Whether all three motors may be driven.
    pub is_armed: bool,
    /// Speeds of the friction wheels, positive in the shooting direction; `None` without fresh feedback.
    pub wheels: [Option<AngularVelocity>; 2],
    /// The loader; `None` without fresh feedback.
    pub loader: Option<LoaderFeedback>,
    /// Heat of the barrel; `None` while the referee system is silent.
    pub heat: Option<BarrelHeat>,
}

/// Target speeds of a shooter's motors.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ShooterTargets {
    /// Both friction wheels, positive in the shooting direction.
    pub wheels: AngularVelocity,
    /// The loader, positive in the feeding direction.
    pub loader: AngularVelocity,
}

impl ShooterTargets {
    /// All motors stand.
    pub const REST: Self = Self { wheels: AngularVelocity::ZERO, loader: AngularVelocity::ZERO };
}
