use super::model::{ACCELERATION, CURRENT, POSITION_MODE};
use crate::motor::Reaction;
use crate::time::Duration;
use crate::units::AngularVelocity;

/// What [`Joints::attach`](super::Joints::attach) needs to know of a joint.
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

/// For how long a joint may stand although it has a way to go, and what follows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Stall {
    pub(super) window: Duration,
    pub(super) reaction: Reaction,
}

impl Stall {
    pub(super) const USUAL: Self =
        Self { window: Duration::from_secs(1), reaction: Reaction::Report };
}

impl Config {
    /// Takes the id that is set on the joint, 1 to 12; 10 rpm, and the settings of the robot's firmware.
    #[must_use]
    pub const fn new(id: u8) -> Self {
        let speed = AngularVelocity::from_rpm(10.0);
        Self { id, reversed: false, speed, settings: Settings::USUAL, stall: Stall::USUAL }
    }

    /// Turns the positive direction around, for position and speed alike.
    #[must_use]
    pub const fn reversed(self) -> Self {
        Self { reversed: !self.reversed, ..self }
    }

    /// Sets the speed with which the joint goes to its targets, until
    /// [`set_speed`](super::Joints::set_speed) changes it; not negative, at most 255 rpm.
    #[must_use]
    pub const fn with_speed(self, speed: AngularVelocity) -> Self {
        Self { speed, ..self }
    }

    /// Sets for how long a joint may stand although it is told to move, by more than a 64th of a turn, and what follows: a
    /// stall after 1 s at first, which is reported. Relaxed, it is disabled and waits to be armed.
    ///
    /// A joint that is too slow to be seen to move in that time, by a 64th of a turn, is not looked at. A window of zero is
    /// refused when it is attached.
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

    /// Sets the current that is written before the joint is enabled, in the drive's own unit: 2000 at first.
    #[must_use]
    pub const fn with_current(self, current: i32) -> Self {
        Self { settings: Settings { current, ..self.settings }, ..self }
    }

    /// Sets the acceleration that is written before the joint is enabled, in pulses a second².
    #[must_use]
    pub const fn with_acceleration(self, acceleration: i32) -> Self {
        Self { settings: Settings { acceleration, ..self.settings }, ..self }
    }

    /// Sets the deceleration that is written before the joint is enabled, in pulses a second².
    #[must_use]
    pub const fn with_deceleration(self, deceleration: i32) -> Self {
        Self { settings: Settings { deceleration, ..self.settings }, ..self }
    }

    /// Sets the work mode that is written before the joint is enabled; only 1, position, is documented.
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

/// The registers that a drive is set up with, as on the wire: their units are not documented.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Settings {
    pub(super) current: i32,
    pub(super) acceleration: i32,
    pub(super) deceleration: i32,
    pub(super) mode: i32,
}

impl Settings {
    /// What the robot's firmware writes.
    pub(super) const USUAL: Self = Self {
        current: CURRENT,
        acceleration: ACCELERATION,
        deceleration: ACCELERATION,
        mode: POSITION_MODE,
    };

    /// Names the first that makes no sense.
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
