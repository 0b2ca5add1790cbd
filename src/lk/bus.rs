//! The motor as an actuator: its claims, its frames, and their order.

use super::codec::{id_of, is_command};
use super::config::Mode;
use super::model::{MOST_COUNTS, RAD_PER_DEGREE};
use super::{Command, Feedback, Model, State};
use crate::control::PidConfig;
use crate::error::ConfigError;
use crate::frame::CanFrame;
use crate::motor::{
    Capabilities, Capability, Claim, DriveProtocol, Goal, Ingest, MotorName, Order, Questions,
    Shaft, Vitals, WrongSetting,
};
use crate::units::{Angle, AngularVelocity};

/// The ids of frames in both directions, without the id of the drive.
const FRAMES: u16 = 0x140;

/// The place of the question for the angle among 32 commands.
const HALF_WAY: u8 = 16;

/// After so many commands without feedback the drive may have lost its supply. A question may be among them.
pub(crate) const SILENT: u8 = 4;

/// A turn of the rotor in the unit of the drive, 0.01°.
const TURN: i64 = 36_000;

/// The state of a switched-off drive.
const OFF: u8 = 0x10;

/// How many echoes may be due at once.
const ECHOES: u8 = 3;

/// A motor of this family in a control mode: see the [module](super).
///
/// Costs 4282 instructions on a Cortex-M4F, for a tick of eight with our speed loops (`docs/figures.md`).
///
/// Costs 189 instructions on a Cortex-M4F, for a frame to one of eight (`docs/figures.md`).
///
/// # Examples
/// ```
/// use drivetrain::lk::{Mode, Model, Motor};
/// use drivetrain::motor::{Claim, DriveProtocol};
/// use drivetrain::units::AngularVelocity;
///
/// let mode = Mode::velocity(AngularVelocity::from_rpm(60.0));
/// let motor = Motor::new(Model::MG5010E_I10, 3, mode)?;
/// let claims: Vec<String> = motor.claims().into_iter().map(|claim| claim.to_string()).collect();
/// assert_eq!(claims, ["command of MG5010E-i10 #3 on 0x143", "feedback of MG5010E-i10 #3 on 0x143"]);
/// # Ok::<(), drivetrain::error::ConfigError>(())
/// ```
#[derive(Debug, Clone, Copy)]
pub struct Motor {
    model: Model,
    id: u8,
    mode: Mode,
    /// The last feedback; `None` before the first.
    drive: Option<Feedback>,
    /// The angle of the rotor in 1/65536 of a turn, with turns.
    rotor: i64,
    /// The last state; `None` if unknown.
    state: Option<State>,
    /// The drive was on by its last report, and no frame has switched the drive off since.
    is_on: bool,
    /// Angle counted by the drive minus angle of the rotor, in 0.01°; `None` if unknown.
    ahead: Option<i64>,
    /// How many commands were made since the last feedback or the last angle.
    silent: u8,
    /// The drive is to be on.
    is_wanted: bool,
    /// How many echoes of off and run are due.
    echoes: u8,
    questions: Questions<Command>,
    clears: bool,
}

impl Motor {
    /// Takes the model, the id of the drive, 1 to 32, and the control mode.
    ///
    /// # Errors
    /// Names the value outside its limits.
    pub fn new(model: Model, id: u8, mode: impl Into<Mode>) -> Result<Self, ConfigError> {
        ConfigError::check_range("id", id.into(), 1.0, 32.0)?;
        let mode = mode.into();
        mode.check(&model.scale())?;
        Ok(Self {
            model,
            id,
            mode,
            drive: None,
            rotor: 0,
            state: None,
            is_on: false,
            ahead: None,
            silent: 0,
            is_wanted: false,
            echoes: 0,
            questions: Questions::new(Command::REST),
            clears: false,
        })
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

    fn frame_of(&self, command: Command) -> CanFrame {
        CanFrame::of(id_of(FRAMES, self.id), command.encode())
    }

    /// Returns the angle of the rotor in 0.01°, with turns.
    const fn rotor_angle(&self) -> i64 {
        (self.rotor * TURN) >> 16
    }

    /// Returns the command for a goal with a limit; `None` if the protocol has no such command.
    fn command(&self, goal: Goal, limit: u16) -> Option<Command> {
        let to_rotor = 100.0 * self.model.gear() / RAD_PER_DEGREE;
        match goal {
            Goal::Torque(torque_nm) => {
                let counts = torque_nm / self.model.torque_per_count();
                Some(Command::Torque(i16::try_from(whole(counts)).ok()?))
            }
            Goal::Velocity(velocity) => Some(Command::Velocity(whole(velocity * to_rotor), limit)),
            Goal::Way(way) => {
                let way = i64::from(whole(way * to_rotor));
                let angle = self.ahead? + self.rotor_angle() + way;
                Some(Command::Position(i32::try_from(angle).ok()?, limit))
            }
            Goal::Impedance(_) => None,
        }
    }

    /// Takes the angle counted by the drive. If the angle differs from the last by more than half a turn, the count has begun anew, so
    /// the drive had no supply, and counts as off.
    fn take_angle(&mut self, angle: i64) {
        let ahead = angle - self.rotor_angle();
        let is_other = |before: i64| (ahead - before).abs() > TURN / 2;
        if self.ahead.is_some_and(is_other) {
            self.doubt();
        } else if self.is_on {
            self.ahead = Some(ahead);
            self.silent = 0;
        }
    }

    /// Counts the drive as off, with an unknown angle, until the drive reports otherwise.
    const fn doubt(&mut self) {
        (self.is_on, self.ahead) = (false, None);
    }

    /// Switches the drive on or off; the drive echoes the frame.
    fn switch(&mut self, command: Command) -> CanFrame {
        self.echoes = (self.echoes + 1).min(ECHOES);
        self.frame_of(command)
    }
}

impl DriveProtocol for Motor {
    fn name(&self) -> MotorName {
        MotorName::new(self.model.name(), self.id)
    }

    fn claims(&self) -> impl IntoIterator<Item = Claim> {
        let id = id_of(FRAMES, self.id);
        [Claim::command(id, self.name()), Claim::feedback(id, self.name())]
    }

    fn decode(&mut self, frame: &CanFrame) -> Ingest {
        if frame.length() != 8 {
            return Ingest::WrongLength(frame.length());
        }
        let data = frame.bytes();
        let [code, ..] = *data;
        let is_answer = [0x9C, 0xA1, self.mode.0.number].contains(&code);
        if !is_answer || is_command(data, || self.mode.limit(1.0, &self.model.scale())) {
            return Ingest::Unrelated;
        }
        let Some(feedback) = Feedback::decode(data) else { return Ingest::Unrelated };
        let Some(phase) = feedback.phase(&self.model) else {
            return Ingest::WrongField;
        };
        // The low 16 bits are the phase before.
        let [low, high, ..] = self.rotor.to_le_bytes();
        let way = phase.wrapping_sub(u16::from_le_bytes([low, high])).cast_signed();
        self.rotor = if self.drive.is_some() { self.rotor + i64::from(way) } else { phase.into() };
        self.drive = Some(feedback);
        // An angle alone ends a silence that was long.
        self.silent = if self.silent < SILENT { 0 } else { SILENT };
        Ingest::Taken
    }

    fn velocity(&self) -> AngularVelocity {
        shaft(self.drive.as_ref(), self.rotor, &self.model).1
    }

    fn angle(&self) -> Option<Angle> {
        shaft(self.drive.as_ref(), self.rotor, &self.model).0
    }

    fn rest(&mut self) -> CanFrame {
        self.frame_of(Command::REST)
    }

    /// Some commands give way to questions: the drive goes on with the command before. A new command goes first. After a silence
    /// nothing counts from the angle until the angle has been read again.
    fn control(&mut self, order: Order) -> CanFrame {
        let needs_angle = self.mode.0.is_angle();
        let (drive, rotor, model) = (self.drive.as_ref(), self.rotor, &self.model);
        let scale = model.scale();
        let goal = self.mode.0.goal(order, || shaft(drive, rotor, model), scale.max_velocity);
        let limit = self.mode.limit(order.share, &scale);
        let command = goal.and_then(|goal| self.command(goal, limit)).unwrap_or(Command::REST);
        self.silent = if needs_angle { self.silent.saturating_add(1) } else { 0 };
        if self.silent > SILENT {
            return self.frame_of(Command::ReadAngle);
        }
        let next = self.questions.next(command, |place| match place {
            0 => Some(Command::ReadState),
            // Not beside the other question, so that no more than one answer in a row is no feedback.
            HALF_WAY if needs_angle => Some(Command::ReadAngle),
            _ => None,
        });
        self.frame_of(next)
    }

    fn reset(&mut self) {
        self.mode.0.reset();
        (self.questions, self.silent) = (Questions::new(Command::REST), 0);
    }

    fn set_loops(&mut self, position: PidConfig, speed: PidConfig) -> Result<(), ConfigError> {
        self.mode.0.set_loops(position, speed)
    }

    /// Sends run and the question for the state in turn, then the question for the angle if commands count from the angle.
    fn enable(&mut self, sent: u8) -> Option<CanFrame> {
        (self.is_wanted, self.clears) = (true, false);
        if sent == 0 {
            self.doubt();
        }
        Some(if self.is_on {
            self.frame_of(Command::ReadAngle)
        } else if sent.is_multiple_of(2) {
            self.switch(Command::Run)
        } else {
            self.frame_of(Command::ReadState)
        })
    }

    /// Switches the drive off; the drive counts as off unless a later report differs. If the drive reports an error, clears the error
    /// in turn.
    fn disable(&mut self) -> Option<CanFrame> {
        self.is_wanted = false;
        self.doubt();
        let has_error = self.state.is_some_and(|state| state.errors != 0);
        self.clears = has_error && !self.clears;
        // Off goes first.
        Some(if has_error && !self.clears {
            self.frame_of(Command::ClearErrors)
        } else {
            self.switch(Command::Off)
        })
    }

    /// No error is cleared before Off was sent.
    fn unsent(&mut self, frame: &CanFrame) {
        let [is_off, is_run] = [Command::Off, Command::Run].map(|it| it.encode() == *frame.bytes());
        self.echoes = self.echoes.saturating_sub((is_off || is_run).into());
        self.clears &= !is_off;
        self.questions.unsent();
    }

    fn is_enabled(&self) -> Option<bool> {
        let lacks_angle = self.mode.0.is_angle() && self.is_wanted && self.ahead.is_none();
        Some(self.is_on && !lacks_angle)
    }

    fn inquire(&mut self) -> Option<CanFrame> {
        Some(self.frame_of(Command::ReadState))
    }

    fn decode_answer(&mut self, frame: &CanFrame) -> bool {
        let data = frame.bytes();
        if frame.length() != 8 {
            return false;
        }
        if let Some(state) = State::decode(data) {
            self.is_on = state.is_on;
            self.state = Some(state);
            return true;
        }
        if let Some(angle) = Feedback::decode_angle(data).filter(|_| self.mode.0.is_angle()) {
            self.take_angle(angle);
            return true;
        }
        let is_echo = [Command::Off, Command::Run].map(Command::encode).contains(data);
        let is_due = is_echo && self.echoes > 0;
        self.echoes -= u8::from(is_due);
        is_due
    }

    fn wrong_setting(&self) -> Option<WrongSetting> {
        let is_unknown = self.state.is_none();
        is_unknown.then(|| WrongSetting::new(self.name(), "motorState", OFF.into(), None))
    }

    fn forget_settings(&mut self) {
        self.state = None;
    }

    fn frames_per_answer(&self) -> u32 {
        1
    }

    fn capabilities(&self) -> Capabilities {
        let capabilities = self.mode.0.capabilities().with(Capability::Temperature);
        capabilities.with(Capability::ErrorCodes)
    }

    #[inline]
    fn vitals(&self) -> Vitals {
        let Some(drive) = self.drive else { return Vitals::default() };
        let errors = self.state.map_or(0, |state| state.errors);
        Vitals {
            temperature_c: Some(drive.temperature_c.into()),
            effort: self.mode.0.effort(),
            speed: self.model.speed_share(self.velocity().as_rad_per_s()),
            current: f32::from(drive.current) / MOST_COUNTS,
            ..Vitals::of_errors([errors], 0)
        }
    }
}

/// Returns angle and velocity of the output shaft; its turns count.
#[inline]
fn shaft(drive: Option<&Feedback>, rotor: i64, model: &Model) -> Shaft {
    let Some(drive) = drive else { return (None, AngularVelocity::ZERO) };
    let angle = Angle::from_turns(rotor as f32 / 65_536.0 / model.gear());
    (Some(angle), AngularVelocity::from_rad_per_s(drive.velocity_rad_per_s(model)))
}

/// Truncates, so that a limit holds; NaN is zero.
#[expect(clippy::cast_possible_truncation, reason = "saturates")]
pub(crate) const fn whole(value: f32) -> i32 {
    value as i32
}
