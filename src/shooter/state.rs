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
    /// The wheels turn, and nothing is shot.
    Spin,
    /// The wheels turn, and the shooter lets this number of shots go: 1 for a single shot, 255 for long fire.
    ///
    /// A burst begins when the order changes to `Fire`. While the order stays, no further shot follows. When the order changes back,
    /// the rest of the burst is dropped. If the trigger was held while the robot was armed, it has to be released first.
    Fire(u8),
}

/// State of a shooter.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub enum ShooterState {
    /// Everything stands.
    Rest,
    /// The wheels are not at their speed yet, or no longer.
    SpinningUp,
    /// The wheels are at their speed.
    Ready,
    /// A shot is on its way through the loader.
    Feeding,
    /// The loader turns back, because it stood.
    Clearing,
    /// A shot waits until the barrel is cool enough, or until its heat is known.
    Cooling,
    /// Everything stands until the order is [`ShooterOrder::Rest`], or the robot is disarmed.
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
    /// The loader stood again after all tries to clear it.
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
    /// Turns and angle, from any zero; the direction that feeds is positive.
    pub position: Position,
    /// Speed.
    pub velocity: AngularVelocity,
}

/// Feedback that a shooter takes in each tick. The default is a robot that is disarmed and has no feedback.
#[derive(Debug, Default, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ShooterFeedback {
    /// Whether all three motors may be driven.
    pub is_armed: bool,
    /// Speeds of the friction wheels; `None` without fresh feedback. The direction that shoots is positive.
    pub wheels: [Option<AngularVelocity>; 2],
    /// The loader; `None` without fresh feedback.
    pub loader: Option<LoaderFeedback>,
    /// Heat of the barrel; `None` while the referee system is silent.
    pub heat: Option<BarrelHeat>,
}

/// The target speeds of a shooter's motors.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ShooterTargets {
    /// Of both friction wheels; the direction that shoots is positive.
    pub wheels: AngularVelocity,
    /// Of the loader; the direction that feeds is positive.
    pub loader: AngularVelocity,
}

impl ShooterTargets {
    /// Everything stands.
    pub const REST: Self = Self { wheels: AngularVelocity::ZERO, loader: AngularVelocity::ZERO };
}
