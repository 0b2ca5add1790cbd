//! The motor and its settings; the control mode is shared with `lk`, with the scales of the output shaft.

use super::{Command, Feedback, Model, State};
use crate::error::ConfigError;
pub use crate::lk::Mode;
use crate::lk::bus::whole;
use crate::math::limited;
use crate::motor::Questions;
use crate::time::Duration;

/// The time-out of the drive, in ms, unless the program sets another one.
const TIMEOUT_MS: u32 = 100;

/// A motor of this family, in one control mode: see the [module](super).
///
/// Costs 4109 instructions on a Cortex-M4F, for a tick of eight with our speed loops (`docs/figures.md`).
///
/// Costs 149 instructions on a Cortex-M4F, for a frame to one of eight (`docs/figures.md`).
///
/// # Examples
/// ```
/// use drivetrain::motor::{Claim, DriveProtocol};
/// use drivetrain::rmd::{Mode, Model, Motor};
/// use drivetrain::units::AngularVelocity;
///
/// let mode = Mode::velocity(AngularVelocity::from_rpm(60.0));
/// let motor = Motor::new(Model::X8_120, 3, mode)?;
/// let claims: Vec<String> = motor.claims().into_iter().map(|claim| claim.to_string()).collect();
/// assert_eq!(claims, ["command of RMD-X8-120 #3 on 0x143", "feedback of RMD-X8-120 #3 on 0x243"]);
/// # Ok::<(), drivetrain::error::ConfigError>(())
/// ```
#[derive(Debug, Clone, Copy)]
pub struct Motor {
    pub(super) model: Model,
    pub(super) id: u8,
    pub(super) mode: Mode,
    /// In ms; `None` to leave the drive's as it is.
    pub(super) timeout: Option<u32>,
    /// The time-out by the drive's answer.
    pub(super) timeout_found: Option<u32>,
    /// The number of writes without an answer.
    pub(super) writes: u8,
    pub(super) drive: Option<Feedback>,
    pub(super) track: Option<Track>,
    pub(super) state: Option<State>,
    /// The angle was read since the settings were forgotten.
    pub(super) has_angle: bool,
    pub(super) enabling: Enabling,
    /// How many commands were made since the last feedback or the last angle.
    pub(super) silent: u8,
    pub(super) questions: Questions<Command>,
    /// The last control command or rest.
    pub(super) last: Command,
    pub(super) resets: bool,
    /// The holding brake may be open: released, maybe before this program began, and not confirmed to be locked since.
    pub(super) is_open: bool,
    pub(super) asks_angle: bool,
}

impl Motor {
    /// Takes the model, the id of the drive, 1 to 32, and the control mode.
    ///
    /// # Errors
    /// Names the value outside its limits: [`ConfigError::Unsupported`] for a velocity with a torque limit.
    pub fn new(model: Model, id: u8, mode: impl Into<Mode>) -> Result<Self, ConfigError> {
        ConfigError::check_range("id", id.into(), 1.0, 32.0)?;
        let mode = mode.into();
        mode.check(&model.scale())?;
        Ok(Self {
            model,
            id,
            mode,
            timeout: Some(TIMEOUT_MS),
            timeout_found: None,
            writes: 0,
            drive: None,
            track: None,
            state: None,
            has_angle: false,
            enabling: Enabling::default(),
            silent: 0,
            questions: Questions::new(Command::REST),
            last: Command::REST,
            resets: false,
            is_open: true,
            asks_angle: false,
        })
    }

    /// Sets the time without a frame after which the drive switches itself off and locks its brake: 10 ms to 60 s, 100 ms at first.
    ///
    /// # Errors
    /// Names the time outside its limits.
    pub fn with_timeout(self, timeout: Duration) -> Result<Self, ConfigError> {
        let micros =
            ConfigError::check_micros("time-out", timeout.micros_u32(), 10_000, 60_000_000)?;
        Ok(Self { timeout: Some(micros / 1_000), ..self })
    }

    /// Leaves the time-out of the drive as it is: a drive without one goes on with its last command when the cable is cut.
    #[must_use]
    pub const fn without_timeout(self) -> Self {
        Self { timeout: None, ..self }
    }

    /// Returns the last feedback of the drive, in the units of the drive; `None` before the first.
    #[must_use]
    pub const fn feedback(&self) -> Option<&Feedback> {
        self.drive.as_ref()
    }

    /// Returns the last state of the drive; `None` before the first, and after its feedback was lost.
    #[must_use]
    pub const fn state(&self) -> Option<&State> {
        self.state.as_ref()
    }

    /// Asks the drive to start anew, once, when it has been switched off: some errors go away by that alone. It is silent for more
    /// than a second then, and may count its angle from another zero. A holding brake is locked meanwhile. A driven motor forgets the request.
    pub const fn reset_drive(&mut self) {
        self.resets = true;
    }
}

/// How far a drive is on its way to be driven.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Enabling {
    /// The drive is to be driven.
    pub(super) is_wanted: bool,
    /// The state was read since then.
    pub(super) is_sound: bool,
    /// The brake was released, or the angle read, since then.
    pub(super) is_prepared: bool,
    /// All of this has been so, and nothing told otherwise since.
    pub(super) is_on: bool,
    /// The drive is not to be driven, and has confirmed to be off.
    pub(super) is_off: bool,
    /// Feedback came since then: the drive follows frames. A drive whose time-out has expired sends the first frame back, and
    /// the second one has to be rest.
    pub(super) is_heard: bool,
}

impl Enabling {
    /// Takes whether the mode has to be prepared, and whether the drive has confirmed its time-out.
    pub(super) const fn confirm(&mut self, prepares: bool, has_timeout: bool) {
        let is_prepared = self.is_prepared || !prepares;
        self.is_on |= self.is_wanted && self.is_sound && is_prepared && has_timeout;
    }
}

/// The angle of the output shaft between two answers, in 0.01°.
#[derive(Debug, Clone, Copy)]
pub(super) struct Track {
    /// The last answer, and the angle of the feedback then, in °.
    read: i32,
    degrees: i16,
    /// The way since, by the velocity.
    way: f32,
}

impl Track {
    pub(super) const fn new(read: i32, degrees: i16) -> Self {
        Self { read, degrees, way: 0.0 }
    }

    /// Moves on by a way, within a degree of the feedback in °.
    pub(super) fn advance(&mut self, way: f32, degrees: i16) {
        self.way = self.way_by(way, degrees);
    }

    fn way_by(&self, way: f32, degrees: i16) -> f32 {
        let moved = 100.0 * f32::from(degrees.wrapping_sub(self.degrees));
        limited(self.way + way, moved - 100.0, moved + 100.0)
    }

    /// Tells whether an angle is more than half a turn away.
    pub(super) fn is_far_from(&self, angle: i32, degrees: i16) -> bool {
        (i64::from(angle) - self.counts(degrees)).abs() > 18_000
    }

    pub(super) fn counts(&self, degrees: i16) -> i64 {
        i64::from(self.read) + i64::from(whole(self.way_by(0.0, degrees)))
    }

    pub(super) fn turns(&self, degrees: i16) -> f32 {
        (self.read as f32 + self.way_by(0.0, degrees)) / 36_000.0
    }
}
