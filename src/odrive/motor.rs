//! The motor: configuration, reports and requests of a program.

use super::config::{Endpoint, Endpoints, Mode};
use super::enabling::Phase;
use super::{Feedback, Firmware, Heartbeat, Model};
use crate::error::ConfigError;
use crate::frame::CanFrame;
use crate::motor::{Form, Settings, Told};
use crate::time::Duration;
use crate::units::AngularVelocity;

/// A motor of this family in a control mode: see the [module](super).
///
/// # Examples
/// ```
/// use drivetrain::motor::{Claim, OwnMotor};
/// use drivetrain::odrive::{Firmware, Mode, Model, Motor};
/// use drivetrain::units::AngularVelocity;
///
/// let fastest = AngularVelocity::from_rpm(300.0); // of the output shaft
/// let motor = Motor::new(Model::D6374, Firmware::V0_5, 3, fastest, Mode::velocity(4.0))?.with_gear(8.0)?;
/// let claims: Vec<String> = motor.claims().into_iter().map(|claim| claim.to_string()).collect();
/// assert_eq!(claims.first().map(String::as_str), Some("feedback of D6374 #3 on 0x69"));
/// assert!(claims.contains(&"command of D6374 #3 on 0x6D".into()));
/// # Ok::<(), drivetrain::error::ConfigError>(())
/// ```
#[derive(Debug, Clone, Copy)]
pub struct Motor {
    pub(super) model: Model,
    pub(super) firmware: Firmware,
    pub(super) node: u8,
    pub(super) velocity_limit: AngularVelocity,
    /// Turns of the motor for a turn of the output shaft, negative if motor and shaft turn in opposite directions.
    pub(super) gear: f32,
    pub(super) mode: Mode,
    /// The endpoints, with their expected values.
    pub(super) endpoints: Option<[(Endpoint, f32); 4]>,
    pub(super) settings: Settings<Endpoint, 4>,
    pub(super) state: State,
}

/// The received and sent values of a motor.
#[derive(Debug, Default, Clone, Copy)]
pub(super) struct State {
    /// The last estimates; `None` before the first.
    pub(super) drive: Option<Feedback>,
    /// The last heartbeat; `None` before the first, and after half a second without another.
    pub(super) heartbeat: Option<Heartbeat>,
    /// 0.6: active errors and disarm reason.
    pub(super) errors: (u32, u32),
    pub(super) phase: Phase,
    /// The last enabling frame, with its number.
    pub(super) enabling: Option<(u8, CanFrame)>,
    /// A refused request: its code, and the number of frames to disable the drive until the code is forgotten.
    pub(super) refused: Option<(u8, u8)>,
    /// Since the last estimates, while driven.
    pub(super) age_s: f32,
    /// Since the last heartbeat.
    pub(super) silence_s: f32,
    pub(super) inquiries: u8,
    /// The last command was a request for estimates.
    pub(super) has_polled: bool,
    /// Frames of rest since the last estimates.
    pub(super) rests: u8,
    /// The share in the last limits, in parts.
    pub(super) limits: Told,
    /// How often errors are still to be cleared.
    pub(super) clears: u8,
    pub(super) stops: bool,
}

impl Motor {
    /// Takes the model, the firmware and the node id of the drive, 0 to 62, the velocity limit of the output shaft, and the control mode
    /// with the torque limit. The output shaft is the shaft of the motor.
    ///
    /// # Errors
    /// Names the value outside its limits.
    pub fn new(
        model: Model,
        firmware: Firmware,
        node: u8,
        velocity_limit: AngularVelocity,
        mode: impl Into<Mode>,
    ) -> Result<Self, ConfigError> {
        ConfigError::check_range("node id", node.into(), 0.0, 62.0)?;
        let mode = mode.into();
        mode.check()?;
        let limit = velocity_limit.as_rad_per_s();
        ConfigError::check_limit("velocity limit in rad/s", limit, f32::MAX)?;
        Ok(Self {
            model,
            firmware,
            node,
            velocity_limit,
            gear: 1.0,
            mode,
            endpoints: None,
            settings: Settings::new([(0, Form::U8); 4]),
            state: State::default(),
        })
    }

    /// Sets the turns of the motor for one of the output shaft.
    ///
    /// # Errors
    /// [`ConfigError::Range`] for a ratio not between 0.001 and 100000.
    pub fn with_gear(self, ratio: f32) -> Result<Self, ConfigError> {
        ConfigError::check_range("gear ratio", ratio, 0.001, 100_000.0)?;
        Ok(Self { gear: ratio.copysign(self.gear), ..self })
    }

    /// Has the output shaft turn clockwise when the position of the drive rises.
    #[must_use]
    pub fn reversed(self) -> Self {
        Self { gear: -self.gear, ..self }
    }

    /// Has the drive's watchdog set, and its modes read back, each time before the drive is enabled: 0.6 only. The drive disarms itself
    /// after `watchdog` without a frame, 10 ms to 10 s.
    ///
    /// # Errors
    /// [`ConfigError::Unsupported`] for firmware 0.5, whose watchdog is set by USB; [`ConfigError::Range`] for another time.
    pub fn with_endpoints(
        self,
        endpoints: Endpoints,
        watchdog: Duration,
    ) -> Result<Self, ConfigError> {
        if self.firmware == Firmware::V0_5 {
            return Err(ConfigError::Unsupported("endpoints over CAN (set the watchdog by USB)"));
        }
        let micros =
            ConfigError::check_micros("watchdog in us", watchdog.micros_u32(), 10_000, 10_000_000)?;
        let values = endpoints.values(&self.mode, micros as f32 * 1e-6);
        let settings = Settings::new(values.map(|(endpoint, _)| endpoint));
        Ok(Self { endpoints: Some(values), settings, ..self })
    }

    /// Returns the last encoder estimates; `None` before the first.
    #[must_use]
    pub const fn feedback(&self) -> Option<&Feedback> {
        self.state.drive.as_ref()
    }

    /// Returns the last heartbeat; `None` before the first, and after half a second without another.
    #[must_use]
    pub const fn heartbeat(&self) -> Option<&Heartbeat> {
        self.state.heartbeat.as_ref()
    }

    /// Returns the active errors of firmware 0.6 and the reason of the last disarming, a bit each, as read at rest.
    #[must_use]
    pub const fn errors(&self) -> (u32, u32) {
        self.state.errors
    }

    /// Has the drive clear its errors, in 0.5 the errors of both axes, while the motor is disarmed: three times, 10 ms apart. Nothing else
    /// clears errors, as a failed encoder may fail again. A driven motor forgets the request.
    pub const fn clear_errors(&mut self) {
        self.state.clears = 3;
    }

    /// Has the drive disarm with an error, beside the emergency stop of the bus: with each update, until a heartbeat has this error.
    /// The drive stays disarmed, and follows no command, until its errors are [cleared](Self::clear_errors).
    pub const fn stop(&mut self) {
        self.state.stops = true;
    }
}
