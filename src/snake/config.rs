use super::model::{ACCELERATION, CURRENT, IDS, POSITION_MODE};
use crate::motor::{Condition, HealthConfig, MotorName, Reaction};
use crate::time::Duration;
use crate::units::AngularVelocity;

/// Configuration of a joint for [`Joints::attach`](super::Joints::attach).
///
/// # Examples
/// ```
/// use drivetrain::snake::Config;
/// use drivetrain::units::AngularVelocity;
///
/// const HEAD: Config = Config::new(1)
///     .reversed()
///     .with_speed(AngularVelocity::from_rpm(20.0))
///     .with_current(1_000)
///     .with_acceleration(500_000);
/// assert_eq!((HEAD.id(), HEAD.current()), (1, 1_000));
/// assert_eq!((HEAD.acceleration(), HEAD.deceleration(), HEAD.mode()), (500_000, 0x0010_AAAA, 1));
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Config {
    id: u8,
    pub(super) reversed: bool,
    pub(super) speed: AngularVelocity,
    pub(super) settings: Settings,
    pub(super) stall: Stall,
}

/// Longest standstill of a joint away from its target, and the reaction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Stall {
    pub(super) window: Duration,
    pub(super) reaction: Reaction,
}

impl Stall {
    pub(super) const USUAL: Self =
        Self { window: Duration::from_secs(1), reaction: Reaction::Report };

    /// The reactions of the joint.
    pub(super) const fn health(&self) -> &'static HealthConfig {
        const USUAL: HealthConfig = HealthConfig::new();
        match self.reaction {
            Reaction::Ignore => {
                &const { USUAL.with_reaction(Condition::Stalled, Reaction::Ignore) }
            }
            Reaction::Report => &USUAL,
            Reaction::Relax => &const { USUAL.with_reaction(Condition::Stalled, Reaction::Relax) },
        }
    }
}

impl Config {
    /// Takes the id set on the joint, 1 to 12; 10 rpm, and the settings of the robot's firmware.
    #[must_use]
    pub const fn new(id: u8) -> Self {
        let speed = AngularVelocity::from_rpm(10.0);
        Self { id, reversed: false, speed, settings: Settings::USUAL, stall: Stall::USUAL }
    }

    /// Reverses the positive direction of position and speed.
    #[must_use]
    pub const fn reversed(self) -> Self {
        Self { reversed: !self.reversed, ..self }
    }

    /// Sets the speed of moves to a target, until [`set_speed`](super::Joints::set_speed) changes it; not negative, at most 255 rpm.
    #[must_use]
    pub const fn with_speed(self, speed: AngularVelocity) -> Self {
        Self { speed, ..self }
    }

    /// Sets the longest standstill of a joint that is more than a 64th of a turn away from its target, and the reaction. By default, a
    /// stall begins after 1 s and is reported. If relaxed, the joint is disabled and waits to be armed.
    ///
    /// A joint too slow for a visible motion within that time, a 64th of a turn, is not checked. A window of zero is refused by `attach`.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::motor::Reaction;
    /// use drivetrain::snake::{Config, Joints};
    /// use drivetrain::time::Duration;
    ///
    /// let jaw = Config::new(12).with_stall(Duration::from_millis(300), Reaction::Relax);
    /// assert!(Joints::new().attach(jaw).is_ok());
    /// ```
    #[must_use]
    pub const fn with_stall(self, window: Duration, reaction: Reaction) -> Self {
        Self { stall: Stall { window, reaction }, ..self }
    }

    /// Sets the current to write before the joint is enabled, in the drive's own unit: 2000 by default.
    #[must_use]
    pub const fn with_current(self, current: i32) -> Self {
        Self { settings: Settings { current, ..self.settings }, ..self }
    }

    /// Sets the acceleration to write before the joint is enabled, in pulses a second².
    #[must_use]
    pub const fn with_acceleration(self, acceleration: i32) -> Self {
        Self { settings: Settings { acceleration, ..self.settings }, ..self }
    }

    /// Sets the deceleration to write before the joint is enabled, in pulses a second².
    #[must_use]
    pub const fn with_deceleration(self, deceleration: i32) -> Self {
        Self { settings: Settings { deceleration, ..self.settings }, ..self }
    }

    /// Sets the work mode to write before the joint is enabled; only 1, position, is documented.
    #[must_use]
    pub const fn with_mode(self, mode: i32) -> Self {
        Self { settings: Settings { mode, ..self.settings }, ..self }
    }

    /// Returns the id.
    #[must_use]
    pub const fn id(&self) -> u8 {
        self.id
    }

    /// Returns the current, in the drive's own unit.
    #[must_use]
    pub const fn current(&self) -> i32 {
        self.settings.current
    }

    /// Returns the acceleration in pulses a second².
    #[must_use]
    pub const fn acceleration(&self) -> i32 {
        self.settings.acceleration
    }

    /// Returns the deceleration in pulses a second².
    #[must_use]
    pub const fn deceleration(&self) -> i32 {
        self.settings.deceleration
    }

    /// Returns the work mode.
    #[must_use]
    pub const fn mode(&self) -> i32 {
        self.settings.mode
    }
}

/// Registers for the set-up of a drive, as on the wire: their units are not documented.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Settings {
    pub(super) current: i32,
    pub(super) acceleration: i32,
    pub(super) deceleration: i32,
    pub(super) mode: i32,
}

impl Settings {
    /// Values of the robot's firmware.
    pub(super) const USUAL: Self = Self {
        current: CURRENT,
        acceleration: ACCELERATION,
        deceleration: ACCELERATION,
        mode: POSITION_MODE,
    };

    /// Names the first unusable parameter.
    pub(super) const fn refused(&self) -> Option<&'static str> {
        if self.current <= 0 {
            Some("current")
        } else if self.acceleration <= 0 {
            Some("acceleration")
        } else if self.deceleration <= 0 {
            Some("deceleration")
        } else {
            None
        }
    }
}

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
