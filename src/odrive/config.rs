//! The user's choices: the motor, its control mode, and the endpoints of its drive; and the state of the motor.

use super::codec::Endpoint;
use super::{Feedback, Firmware, Heartbeat, Model};
use crate::error::ConfigError;
use crate::motor::{ControlMode, Form, ImpedanceControl, Preparation, Settings, Told};
use crate::time::Duration;
use crate::units::AngularVelocity;

/// A motor of this family in a control mode: see the [module](super).
///
/// Costs 3936 instructions on a Cortex-M4F, for a tick of eight with our speed loops (`docs/figures.md`).
///
/// Costs 92 instructions on a Cortex-M4F, for a frame to one of eight (`docs/figures.md`).
///
/// # Examples
/// ```
/// use drivetrain::motor::{Claim, DriveProtocol};
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
    /// Turns of the motor for a turn of the output shaft, negative if motor and shaft turn in opposite directions.
    pub(super) gear: f32,
    pub(super) mode: Mode,
    pub(super) endpoints: Option<Preparations>,
    pub(super) settings: Settings<Endpoint, 0>,
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
    /// The code of a refused request, and the number of frames to disable the drive until the code is forgotten.
    pub(super) refused: (u8, u8),
    /// Since the last estimates, while driven.
    pub(super) age_s: f32,
    /// Since the last heartbeat.
    pub(super) silence_s: f32,
    /// The last command was a request for estimates.
    pub(super) has_polled: bool,
    /// Frames of rest since the last estimates.
    pub(super) rests: u8,
    /// The share in the last limits.
    pub(super) limits: Told,
    /// How often errors are still to be cleared.
    pub(super) clears: u8,
    pub(super) stops: bool,
}

/// How far the drive has been enabled.
#[derive(Debug, Default, Clone, Copy, PartialEq)]
pub(super) enum Phase {
    #[default]
    Off,
    /// The number of the first frame to the idle drive.
    Starting(u8),
    /// The number of the request for closed loop.
    Requested(u8),
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
        let mode = mode.into().within(velocity_limit)?;
        Ok(Self {
            model,
            firmware,
            node,
            gear: 1.0,
            mode,
            endpoints: None,
            settings: Settings::new([]),
            state: State::default(),
        })
    }

    /// Sets the turns of the motor for one of the output shaft.
    ///
    /// # Errors
    /// [`ConfigError::Range`] for a ratio not between 0.001 and 100000.
    pub fn with_gear(self, ratio: f32) -> Result<Self, ConfigError> {
        ConfigError::check_range("gear ratio", ratio, 0.001, 100_000.0)?;
        Ok(Self { gear: ratio, ..self })
    }

    /// Has the drive's modes read back, and then its watchdog set, each time before the drive is enabled: 0.6 only. The drive disarms
    /// itself after `watchdog` without a frame, 10 ms to 10 s.
    ///
    /// # Errors
    /// [`ConfigError::Unsupported`] for firmware 0.5, whose watchdog is set by USB; [`ConfigError::Range`] for another time.
    pub fn with_endpoints(
        self,
        endpoints: Endpoints,
        watchdog: Duration,
    ) -> Result<Self, ConfigError> {
        let has_endpoints = self.firmware != Firmware::V0_5;
        ConfigError::check_support(has_endpoints, "endpoints over CAN (set the watchdog by USB)")?;
        let micros =
            ConfigError::check_micros("watchdog in us", watchdog.micros_u32(), 10_000, 10_000_000)?;
        let endpoints = endpoints.preparations(&self.mode, micros as f32 * 1e-6);
        Ok(Self { endpoints: Some(endpoints), ..self })
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

/// A control mode of the drive. An [`ImpedanceControl`] is also a mode: torque mode, where the drive follows a torque
/// computed here for each cycle by gains or loops.
#[must_use]
#[derive(Debug, Clone, Copy)]
pub struct Mode {
    pub(super) control: ControlMode,
    pub(super) input: u8,
    /// Of a trajectory, in rad/s².
    pub(super) acceleration: Option<f32>,
}

/// Control modes.
const TORQUE: u8 = 1;
const VELOCITY: u8 = 2;
const POSITION: u8 = 3;

/// Input modes.
const PASSTHROUGH: u8 = 1;
const FILTER: u8 = 3;
const TRAJECTORY: u8 = 5;

impl From<ImpedanceControl> for Mode {
    fn from(control: ImpedanceControl) -> Self {
        Self::of(ControlMode::impedance(TORQUE, control), PASSTHROUGH)
    }
}

impl Mode {
    const fn of(control: ControlMode, input: u8) -> Self {
        Self { control, input, acceleration: None }
    }

    /// Velocity mode: the drive's own loop follows a velocity, with at most this torque of the output shaft in Nm, above 0: the drive
    /// gets the current limit of this torque.
    pub const fn velocity(torque_limit_nm: f32) -> Self {
        Self::of(ControlMode::velocity(VELOCITY, None, Some(torque_limit_nm)), PASSTHROUGH)
    }

    /// Position mode: the drive's own loops go to an angle by the shortest way, with at most this torque of the output shaft in Nm,
    /// above 0. Each target is followed at once, up to the velocity limit of the motor.
    pub const fn position(torque_limit_nm: f32) -> Self {
        Self::of(ControlMode::angle(POSITION, None, Some(torque_limit_nm)), PASSTHROUGH)
    }

    /// As [`position`](Self::position), and the drive smooths each target with its second-order filter, whose `input_filter_bandwidth` is
    /// a setting of the drive.
    pub const fn position_with_filter(torque_limit_nm: f32) -> Self {
        Self { input: FILTER, ..Self::position(torque_limit_nm) }
    }

    /// As [`position`](Self::position), and the drive plans a trajectory to each target: at most as fast as the velocity limit of the
    /// motor, with this acceleration and deceleration of the output shaft in rad/s², above 0.
    pub const fn position_with_trajectory(torque_limit_nm: f32, acceleration: f32) -> Self {
        let acceleration = Some(acceleration);
        Self { input: TRAJECTORY, acceleration, ..Self::position(torque_limit_nm) }
    }

    /// Adds the velocity limit.
    ///
    /// # Errors
    /// A limit that is not above zero and finite.
    fn within(self, velocity_limit: AngularVelocity) -> Result<Self, ConfigError> {
        let control = self.control.within(velocity_limit);
        control.check(f32::MAX, 0.0, f32::MAX)?;
        if let Some(limit) = self.acceleration {
            ConfigError::check_limit("acceleration in rad/s^2", limit, f32::MAX)?;
        }
        Ok(Self { control, ..self })
    }
}

/// The endpoints to be confirmed before closed loop.
type Preparations = [Preparation<Endpoint>; 4];

/// The numbers of endpoints of a drive with firmware 0.6, from the `flat_endpoints.json` of exactly its version: the numbers differ from
/// version to version.
///
/// With them a motor reads the drive's modes back, and then sets its watchdog, before enabling the drive. If other values than the modes are
/// read, nothing is written.
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

impl Endpoints {
    /// The names of the [preparations](Self::preparations).
    pub(super) const NAMES: [&str; 4] =
        ["control_mode", "input_mode", "watchdog_timeout", "enable_watchdog"];

    /// Returns the settings to be confirmed before closed loop, for a mode and a watchdog in s. The modes are read first: numbers of another
    /// version are found before anything is written.
    const fn preparations(&self, mode: &Mode, watchdog_s: f32) -> Preparations {
        [
            Preparation::found((self.control_mode, Form::U8, 0), mode.control.number as f32),
            Preparation::found((self.input_mode, Form::U8, 1), mode.input as f32),
            Preparation::exact((self.watchdog_timeout, Form::F32, 2), watchdog_s),
            Preparation::exact((self.enable_watchdog, Form::U8, 3), 1.0),
        ]
    }
}
