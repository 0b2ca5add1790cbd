//! The control mode and the endpoints, with what a user chooses for each.

use crate::error::ConfigError;
use crate::motor::{Capabilities, Capability, Impedance, ImpedanceControl, Order, Target};
use crate::units::{Angle, AngularVelocity};

/// A control mode of the drive. An [`ImpedanceControl`] is one too: torque mode, in which the drive follows a torque that our gains or
/// loops compute for each cycle.
#[derive(Debug, Clone, Copy)]
pub struct Mode(Kind);

#[derive(Debug, Clone, Copy)]
enum Kind {
    Torque(ImpedanceControl),
    /// The torque limit in Nm.
    Velocity(f32),
    Position {
        torque_limit_nm: f32,
        /// 1 passthrough, 3 filter, 5 trajectory.
        input: u8,
        /// Of a trajectory, in rad/s².
        acceleration: Option<f32>,
    },
}

impl From<ImpedanceControl> for Mode {
    fn from(control: ImpedanceControl) -> Self {
        Self(Kind::Torque(control))
    }
}

/// A command in units of the output shaft: Nm, rad/s, or rad.
#[derive(Debug, Clone, Copy)]
pub(super) enum Wanted {
    Torque(f32),
    Velocity(f32),
    Angle(f32),
}

impl Mode {
    /// Velocity mode: the drive's own loop follows a velocity, with at most this torque of the output shaft in Nm, above 0: the drive
    /// gets a current limit for it.
    #[must_use]
    pub const fn velocity(torque_limit_nm: f32) -> Self {
        Self(Kind::Velocity(torque_limit_nm))
    }

    /// Position mode: the drive's own loops go to an angle by the shortest way, with at most this torque of the output shaft in Nm,
    /// above 0. Each target is followed at once, up to the velocity limit of the motor.
    #[must_use]
    pub const fn position(torque_limit_nm: f32) -> Self {
        Self(Kind::Position { torque_limit_nm, input: 1, acceleration: None })
    }

    /// As [`position`](Self::position), and the drive smooths each target with its second-order filter, whose `input_filter_bandwidth` is
    /// a setting of the drive.
    #[must_use]
    pub const fn position_with_filter(torque_limit_nm: f32) -> Self {
        Self(Kind::Position { torque_limit_nm, input: 3, acceleration: None })
    }

    /// As [`position`](Self::position), and the drive plans a trajectory to each target: at most as fast as the velocity limit of the
    /// motor, with this acceleration and deceleration of the output shaft in rad/s², above 0.
    #[must_use]
    pub const fn position_with_trajectory(torque_limit_nm: f32, acceleration: f32) -> Self {
        Self(Kind::Position { torque_limit_nm, input: 5, acceleration: Some(acceleration) })
    }

    /// The control mode: 1 torque, 2 velocity, 3 position.
    pub(super) const fn number(&self) -> u8 {
        match self.0 {
            Kind::Torque(_) => 1,
            Kind::Velocity(_) => 2,
            Kind::Position { .. } => 3,
        }
    }

    /// Returns the input mode: 1 passthrough, 3 filter, 5 trajectory.
    pub(super) const fn input(&self) -> u8 {
        if let Kind::Position { input, .. } = self.0 { input } else { 1 }
    }

    /// Returns the acceleration of a trajectory in rad/s².
    pub(super) const fn acceleration(&self) -> Option<f32> {
        if let Kind::Position { acceleration, .. } = self.0 { acceleration } else { None }
    }

    pub(super) const fn torque_limit_nm(&self) -> f32 {
        match &self.0 {
            Kind::Torque(control) => control.torque_limit_nm(),
            Kind::Velocity(torque_limit_nm) | Kind::Position { torque_limit_nm, .. } => {
                *torque_limit_nm
            }
        }
    }

    /// # Errors
    /// A limit that is not above zero and finite.
    pub(super) fn check(&self) -> Result<(), ConfigError> {
        ConfigError::check_limit("torque limit in Nm", self.torque_limit_nm(), f32::MAX)?;
        self.acceleration().map_or(Ok(()), |limit| {
            ConfigError::check_limit("acceleration in rad/s^2", limit, f32::MAX)
        })
    }

    pub(super) fn capabilities(&self) -> Capabilities {
        match &self.0 {
            Kind::Torque(control) => control.capabilities(),
            Kind::Velocity(_) => Capabilities::of(&[Capability::Velocity]),
            Kind::Position { .. } => Capabilities::of(&[Capability::Angle]),
        }
    }

    /// Returns what the drive is told; `None` to rest.
    pub(super) fn command(
        &mut self,
        order: Order,
        angle: Angle,
        velocity: AngularVelocity,
    ) -> Option<Wanted> {
        const MOST: Impedance = Impedance {
            angle: Angle::from_radians(f32::MAX),
            velocity: AngularVelocity::from_rad_per_s(f32::MAX),
            stiffness: f32::MAX,
            damping: f32::MAX,
            torque_nm: f32::MAX,
        };
        match (&mut self.0, order.target) {
            (Kind::Torque(control), _) => {
                let limit = control.torque_limit_nm();
                let most = limit * order.share;
                control.step(order, Some(angle), velocity, &MOST, &Impedance::FREE)?;
                Some(Wanted::Torque((control.effort() * limit).min(most).max(-most)))
            }
            (Kind::Velocity(_), Target::Velocity(velocity)) => {
                Some(Wanted::Velocity(velocity.as_rad_per_s()))
            }
            (Kind::Position { .. }, Target::Angle(angle)) => {
                Some(Wanted::Angle(angle.as_radians()))
            }
            _ => None,
        }
    }

    /// Returns the torque of the last command as a share of the largest; 0 where it is not known.
    pub(super) fn effort(&self) -> f32 {
        if let Kind::Torque(control) = &self.0 { control.effort() } else { 0.0 }
    }

    pub(super) fn reset(&mut self) {
        if let Kind::Torque(control) = &mut self.0 {
            control.reset();
        }
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
