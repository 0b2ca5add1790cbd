//! The control modes and the endpoints, with what a user chooses for each.

use crate::motor::{Capabilities, Capability, Impedance, ImpedanceControl, Order, Target};
use crate::units::{Angle, AngularVelocity};

/// A control mode of the drive: [`ImpedanceControl`] for torque, [`Velocity`] or [`Position`].
pub trait Mode: sealed::Mode {}

impl<M: sealed::Mode> Mode for M {}

pub(super) mod sealed {
    use super::{Angle, AngularVelocity, Capabilities, Order};
    use crate::error::ConfigError;

    /// A command in units of the output shaft: Nm, rad/s, or rad.
    #[derive(Debug, Clone, Copy)]
    pub enum Wanted {
        Torque(f32),
        Velocity(f32),
        Angle(f32),
    }

    pub trait Mode: core::fmt::Debug + Copy {
        /// The control mode: 1 torque, 2 velocity, 3 position.
        const NUMBER: u8;

        /// Returns the input mode: 1 passthrough, 3 filter, 5 trajectory.
        fn input(&self) -> u8 {
            1
        }

        /// Returns the acceleration of a trajectory in rad/s².
        fn acceleration(&self) -> Option<f32> {
            None
        }

        fn torque_limit_nm(&self) -> f32;

        /// # Errors
        /// A limit that is not above zero and finite.
        fn check(&self) -> Result<(), ConfigError> {
            let limit = self.torque_limit_nm();
            ConfigError::check_limit("torque limit in Nm", limit, f32::MAX)
        }

        fn capabilities(&self) -> Capabilities;

        /// Returns what the drive is told; `None` to rest.
        fn command(
            &mut self,
            order: Order,
            angle: Angle,
            velocity: AngularVelocity,
        ) -> Option<Wanted>;

        /// Returns the torque of the last command as a share of the largest; 0 where it is not known.
        fn effort(&self) -> f32 {
            0.0
        }

        fn reset(&mut self) {}
    }
}

use sealed::Wanted;

/// Torque mode: the drive follows a torque, which our gains or loops compute for each cycle.
impl sealed::Mode for ImpedanceControl {
    const NUMBER: u8 = 1;

    fn torque_limit_nm(&self) -> f32 {
        Self::torque_limit_nm(self)
    }

    fn capabilities(&self) -> Capabilities {
        Self::capabilities(self)
    }

    fn command(&mut self, order: Order, angle: Angle, velocity: AngularVelocity) -> Option<Wanted> {
        const MOST: Impedance = Impedance {
            angle: Angle::from_radians(f32::MAX),
            velocity: AngularVelocity::from_rad_per_s(f32::MAX),
            stiffness: f32::MAX,
            damping: f32::MAX,
            torque_nm: f32::MAX,
        };
        let limit = Self::torque_limit_nm(self);
        let most = limit * order.share;
        self.step(order, Some(angle), velocity, &MOST, &Impedance::FREE)?;
        let torque_nm = (Self::effort(self) * limit).min(most).max(-most);
        Some(Wanted::Torque(torque_nm))
    }

    fn effort(&self) -> f32 {
        Self::effort(self)
    }

    fn reset(&mut self) {
        Self::reset(self);
    }
}

/// Velocity mode: the drive's own loop follows a velocity.
#[derive(Debug, Clone, Copy)]
pub struct Velocity {
    torque_limit_nm: f32,
}

impl Velocity {
    /// Limits the torque of the output shaft in Nm, above 0: the drive gets a current limit for it.
    #[must_use]
    pub const fn new(torque_limit_nm: f32) -> Self {
        Self { torque_limit_nm }
    }
}

impl sealed::Mode for Velocity {
    const NUMBER: u8 = 2;

    fn torque_limit_nm(&self) -> f32 {
        self.torque_limit_nm
    }

    fn capabilities(&self) -> Capabilities {
        Capabilities::of(&[Capability::Velocity])
    }

    fn command(&mut self, order: Order, _: Angle, _: AngularVelocity) -> Option<Wanted> {
        let Target::Velocity(velocity) = order.target else { return None };
        Some(Wanted::Velocity(velocity.as_rad_per_s()))
    }
}

/// Position mode: the drive's own loops go to an angle by the shortest way.
#[derive(Debug, Clone, Copy)]
pub struct Position {
    torque_limit_nm: f32,
    input: u8,
    acceleration: Option<f32>,
}

impl Position {
    /// Limits the torque of the output shaft in Nm, above 0. Each target is followed at once, up to the velocity limit of the motor.
    #[must_use]
    pub const fn new(torque_limit_nm: f32) -> Self {
        Self { torque_limit_nm, input: 1, acceleration: None }
    }

    /// Has the drive smooth each target with its second-order filter, whose `input_filter_bandwidth` is a setting of the drive.
    #[must_use]
    pub const fn with_filter(self) -> Self {
        Self { input: 3, acceleration: None, ..self }
    }

    /// Has the drive plan a trajectory to each target: at most as fast as the velocity limit of the motor, with this acceleration and
    /// deceleration of the output shaft in rad/s², above 0.
    #[must_use]
    pub const fn with_trajectory(self, acceleration: f32) -> Self {
        Self { input: 5, acceleration: Some(acceleration), ..self }
    }
}

impl sealed::Mode for Position {
    const NUMBER: u8 = 3;

    fn input(&self) -> u8 {
        self.input
    }

    fn acceleration(&self) -> Option<f32> {
        self.acceleration
    }

    fn torque_limit_nm(&self) -> f32 {
        self.torque_limit_nm
    }

    fn capabilities(&self) -> Capabilities {
        Capabilities::of(&[Capability::Angle])
    }

    fn command(&mut self, order: Order, _: Angle, _: AngularVelocity) -> Option<Wanted> {
        let Target::Angle(angle) = order.target else { return None };
        Some(Wanted::Angle(angle.as_radians()))
    }
}

/// The numbers of endpoints of a drive with firmware 0.6, from the `flat_endpoints.json` of exactly its version: they differ from
/// version to version.
///
/// With them a motor sets the drive's watchdog and reads its modes back before it enables the drive.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Endpoints {
    /// `axis0.controller.config.control_mode`, one byte.
    pub control_mode: u16,
    /// `axis0.controller.config.input_mode`, one byte.
    pub input_mode: u16,
    /// `axis0.config.watchdog_timeout`, a float in s.
    pub watchdog_timeout: u16,
    /// `axis0.config.enable_watchdog`, a bool.
    pub enable_watchdog: u16,
}

/// A setting of the drive that is read back.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Setting {
    ControlMode,
    InputMode,
    WatchdogTimeout,
    EnableWatchdog,
}

impl Setting {
    pub(super) const ALL: [Self; 4] =
        [Self::ControlMode, Self::InputMode, Self::WatchdogTimeout, Self::EnableWatchdog];

    pub(super) const fn number(self, endpoints: &Endpoints) -> u16 {
        match self {
            Self::ControlMode => endpoints.control_mode,
            Self::InputMode => endpoints.input_mode,
            Self::WatchdogTimeout => endpoints.watchdog_timeout,
            Self::EnableWatchdog => endpoints.enable_watchdog,
        }
    }

    /// Returns how many bytes the value has, and its bytes.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "small counts")]
    pub(super) const fn bytes(self, value: f32) -> (usize, [u8; 4]) {
        match self {
            Self::WatchdogTimeout => (4, value.to_le_bytes()),
            _ => (1, [value as u8, 0, 0, 0]),
        }
    }

    pub(super) fn value(self, bytes: [u8; 4]) -> f32 {
        match self {
            Self::WatchdogTimeout => f32::from_le_bytes(bytes),
            _ => bytes[0].into(),
        }
    }
}
