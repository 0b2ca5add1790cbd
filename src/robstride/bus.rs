//! The motor as an actuator: its claims, its frames, and their order.

use super::codec::{Command, FAULTS, VALUE, answer, is_feedback, operation, register};
use super::config::Mode;
use super::{Feedback, Model, Register, Status};
use crate::control::PidConfig;
use crate::encoder::Laps;
use crate::error::ConfigError;
use crate::frame::{CanFrame, extended_id};
use crate::motor::{
    Capabilities, Capability, Claim, DriveProtocol, Ingest, Inquiry, MotorName, Order, Preparation,
    Settings, TimeoutUnits, Vitals, WrongSetting, code_from, ingest_eight, register_questions,
};
use crate::time::Duration;
use crate::units::{Angle, AngularVelocity};

/// The bits of an id for the target of a command and for its type. Some bits of the type are left out: 1, 3, 17 and 19; 4 to 7; 18
/// and 22.
const COMMANDS: [(u32, u32); 3] =
    [(0x0100_0000, 0x0D00_00FF), (0x0400_0000, 0x1C00_00FF), (0x1200_0000, 0x1B00_00FF)];

/// A motor of this family in a run mode: see the [module](super).
///
/// Costs 3762 instructions on a Cortex-M4F, for a tick of eight with our speed loops (`docs/figures.md`).
///
/// Costs 139 instructions on a Cortex-M4F, for a frame to one of eight (`docs/figures.md`).
///
/// # Examples
/// ```
/// use drivetrain::motor::{Claim, ImpedanceControl, DriveProtocol};
/// use drivetrain::robstride::{Model, Motor};
///
/// let motor = Motor::new(Model::RS02, 1, ImpedanceControl::new(5.0)?)?; // at most 5 Nm
/// let claims: Vec<String> = motor.claims().into_iter().map(|claim| claim.to_string()).collect();
/// assert_eq!(claims, [
///     "feedback of RS02 #1 on 0x2000100", // whatever its state, to whichever host
///     "feedback of RS02 #1 on 0x110001FD", // parameters, and faults
///     "command of RS02 #1 on 0x1000001", // whatever the torque
///     "command of RS02 #1 on 0x4000001",
///     "command of RS02 #1 on 0x12000001",
/// ]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, Copy)]
pub struct Motor {
    model: Model,
    id: u8,
    host: u8,
    timeout: TimeoutUnits,
    mode: Mode,
    /// The last feedback, whose numbers are converted where they are read; `None` before the first.
    drive: Option<CanFrame>,
    /// The distance of the shaft from the reported turns, in ranges of the feedback.
    laps: Laps,
    /// The faults of the last report.
    reported: u32,
    /// Faults were cleared since then.
    has_cleared: bool,
    settings: Settings<Register, 3>,
    /// A command to be sent once at rest. The settings are unknown until then: the position changes with the zero, and all with the id.
    once: Option<Command>,
    /// The drive was told to run, and not to stop since.
    runs: bool,
    /// Counts questions.
    questions: u8,
    /// Counts the disabling frames since the drive reported a fault.
    turn: u8,
}

register_questions!();

impl Motor {
    /// Takes the model, the id of the drive, 1 to 127, and the run mode. The id of the host is 0xFD.
    ///
    /// # Errors
    /// Names the value outside its limits.
    pub fn new(model: Model, id: u8, mode: impl Into<Mode>) -> Result<Self, ConfigError> {
        ConfigError::check_range("id", id.into(), 1.0, 127.0)?;
        let mode = mode.into();
        mode.check(&model)?;
        let last = if model.has_timeout() { Register::Timeout } else { Register::RunMode };
        Ok(Self {
            model,
            id,
            host: 0xFD,
            timeout: TimeoutUnits::USUAL,
            mode,
            drive: None,
            laps: Laps::default(),
            reported: 0,
            has_cleared: false,
            settings: Settings::new([Register::RunMode, Register::MechanicalPosition, last]),
            once: None,
            runs: false,
            questions: 0,
            turn: 0,
        })
    }

    /// Sets the id of the host: any id but those of motors.
    ///
    /// # Errors
    /// [`ConfigError::Conflict`] for the id of this motor. A conflict with another motor is found where both are attached.
    pub fn with_host_id(self, host: u8) -> Result<Self, ConfigError> {
        ConfigError::check_conflict(host == self.id, "host id")?;
        Ok(Self { host, ..self })
    }

    /// Sets the time without a command after which the drive disables itself: 1 ms to 5 s, 100 ms at first.
    ///
    /// # Errors
    /// [`ConfigError::Range`] for another time, [`ConfigError::Unsupported`] for a CyberGear, a drive without a time-out.
    pub fn with_timeout(self, timeout: Duration) -> Result<Self, ConfigError> {
        ConfigError::check_support(self.model.has_timeout(), "time-out")?;
        Ok(Self { timeout: TimeoutUnits::new(timeout, 5_000_000)?, ..self })
    }

    /// Returns the last feedback of the drive; `None` before the first.
    #[must_use]
    #[inline]
    pub fn feedback(&self) -> Option<Feedback> {
        self.drive.as_ref().map(|frame| Feedback::of(frame, &self.model))
    }

    /// Returns the faults of the drive's last report, as the manual counts their bits; 0 once cleared.
    #[must_use]
    pub const fn reported_faults(&self) -> u32 {
        self.reported
    }

    /// Has the drive keep its parameters over a loss of the supply; while the motor is disarmed.
    /// The frame goes out once, for flash memory wears: a frame refused by the bus is lost.
    ///
    /// # Errors
    /// [`ConfigError::Unsupported`] for a CyberGear, whose bit rate the frame would change.
    pub fn store(&mut self) -> Result<(), ConfigError> {
        ConfigError::check_support(self.model.can_store(), "frame to store parameters")?;
        self.settings.request(Inquiry::Store);
        Ok(())
    }

    /// Makes the present position zero, before the drive is enabled: a disarmed motor is not armed before the frame went out. The frame is
    /// sent again if no driver took it, so keep the shaft at its zero until the motor can be armed. A RobStride keeps the zero over a loss of
    /// the supply if [stored](Self::store), a CyberGear does not.
    ///
    /// # Errors
    /// [`ConfigError::Unsupported`] between the enabling frame and the first report of rest: the shaft would jump.
    pub fn set_zero(&mut self) -> Result<(), ConfigError> {
        self.request(Command::SetZero)
    }

    /// Gives the drive another id, 1 to 127, before the drive is enabled. The frame goes out once. This motor then hears no more of the
    /// drive: make another motor.
    ///
    /// # Errors
    /// [`ConfigError::Range`] for another id, [`ConfigError::Conflict`] for the id of the host, [`ConfigError::Unsupported`] as for
    /// [`set_zero`](Self::set_zero).
    pub fn set_id(&mut self, id: u8) -> Result<(), ConfigError> {
        ConfigError::check_range("id", id.into(), 1.0, 127.0)?;
        ConfigError::check_conflict(id == self.host, "id")?;
        self.request(Command::SetId(id))
    }

    fn request(&mut self, command: Command) -> Result<(), ConfigError> {
        let runs = self.runs || self.is_enabled() == Some(true);
        ConfigError::check_support(!runs, "zero or id of a running drive")?;
        self.once = Some(command);
        self.settings.forget();
        Ok(())
    }

    fn frame_of(&self, command: Command) -> CanFrame {
        command.encode(&self.model, self.host, self.id)
    }

    /// Returns the configured value of a parameter; for the position the end of its range.
    fn expected(&self, register: Register) -> f32 {
        match register {
            Register::RunMode => self.mode.number(&self.model).into(),
            Register::Timeout => self.timeout.value(),
            _ => self.model.pmax_rad(),
        }
    }

    /// Tells whether a value in the drive is right. Every finite time-out is right: the configured value is written later.
    fn is_right(&self, register: Register, found: f32) -> bool {
        let pmax_rad = self.model.pmax_rad();
        match register {
            Register::RunMode => found.to_bits() == self.expected(register).to_bits(),
            Register::MechanicalPosition if self.mode.control.is_angle() => found.abs() < pmax_rad,
            _ => found.is_finite(),
        }
    }

    /// Disables the drive. If the drive reports a fault, each second frame from then on clears the fault.
    fn off(&mut self) -> CanFrame {
        self.turn = if self.vitals().has_fault { self.turn.wrapping_add(1) } else { 0 };
        let clears = self.turn != 0 && self.turn.is_multiple_of(2);
        self.has_cleared |= clears;
        self.frame_of(if clears { Command::ClearFaults } else { Command::Disable })
    }
}

impl DriveProtocol for Motor {
    fn name(&self) -> MotorName {
        MotorName::new(self.model.name(), self.id)
    }

    /// The state of the drive is in the id of its feedback, and the torque in the id of the operation command.
    fn claims(&self) -> impl IntoIterator<Item = Claim> {
        let (motor, name) = (u32::from(self.id), self.name());
        let answer = 0x1100_0000 | motor << 8 | u32::from(self.host);
        let feedback = [(0x0200_0000 | motor << 8, 0x1F00_FF00), (answer, 0x1B00_FFFF)]
            .map(|(raw, mask)| Claim::feedback(extended_id(raw), name).with_mask(mask));
        let command = COMMANDS
            .map(|(raw, mask)| Claim::command(extended_id(raw | motor), name).with_mask(mask));
        feedback.into_iter().chain(command)
    }

    fn decode(&mut self, frame: &CanFrame) -> Ingest {
        ingest_eight(frame, |&[a, b, ..]| {
            is_feedback(frame).then_some(())?;
            self.laps.advance(u16::from_be_bytes([a, b]));
            self.drive = Some(*frame);
            if self.has_cleared && Feedback::of(frame, &self.model).faults == 0 {
                (self.reported, self.has_cleared) = (0, false);
            }
            Some(())
        })
    }

    fn velocity(&self) -> AngularVelocity {
        self.feedback().map_or(AngularVelocity::ZERO, |drive| drive.measured.velocity())
    }

    /// Beyond the range of the feedback the angle is unknown: a RobStride reports the rest of a lap then.
    fn angle(&self) -> Option<Angle> {
        self.feedback().filter(|_| self.laps.is_none())?.angle()
    }

    fn rest(&mut self) -> CanFrame {
        let rest = self.mode.rest().map(|rest| self.frame_of(rest));
        rest.unwrap_or_else(|| self.off())
    }

    fn control(&mut self, order: Order) -> CanFrame {
        let shaft = (self.angle(), self.velocity());
        match self.drive.and_then(|_| self.mode.command(order, shaft, &self.model)) {
            Some(Command::Operation(command)) => operation(&command, &self.model, self.id),
            Some(command) => self.frame_of(command),
            None => self.rest(),
        }
    }

    fn reset(&mut self) {
        self.mode.reset();
    }

    fn set_loops(&mut self, position: PidConfig, speed: PidConfig) -> Result<(), ConfigError> {
        self.mode.control.set_loops(position, speed)
    }

    /// Asks for unknown settings, then makes the preparations, each written and read back, then enables the drive:
    /// each time anew, for the drive may have lost its supply since.
    fn enable(&mut self, sent: u8) -> Option<CanFrame> {
        let [first, second] = self.mode.preparations();
        let timeout = Preparation::exact(Register::Timeout, self.timeout.value());
        let timeout = Some(timeout).filter(|_| self.model.has_timeout());
        let asked = self.settings.prepare(sent, [timeout, first, second].into_iter().flatten());
        if asked.is_none() {
            self.mode.reset();
            self.settings.forget();
        }
        let command = self.once.take().unwrap_or(asked.map_or(Command::Enable, Command::of));
        self.runs |= matches!(command, Command::Enable);
        Some(self.frame_of(command))
    }

    fn disable(&mut self) -> Option<CanFrame> {
        self.runs = false;
        self.settings.prepare_anew();
        self.mode.rest().is_some().then(|| self.off())
    }

    fn poll(&mut self) -> Option<CanFrame> {
        self.drive.map(|_| self.frame_of(self.mode.stay((self.angle(), self.velocity()))))
    }

    fn unsent(&mut self, frame: &CanFrame) {
        if self.once.is_none() && *frame == self.frame_of(Command::SetZero) {
            _ = self.request(Command::SetZero);
        }
    }

    fn is_enabled(&self) -> Option<bool> {
        self.feedback().map(|drive| drive.status == Status::Run)
    }

    /// Every fourth time a drive in another run mode gets the configured mode: a drive starts in the operation mode. A drive answers
    /// a write with its feedback, so a value written by the application is read back.
    fn inquire(&mut self) -> Option<CanFrame> {
        if let Some(command) = self.once.take() {
            return Some(self.frame_of(command));
        }
        self.questions = self.questions.wrapping_add(1);
        let mode = self.expected(Register::RunMode);
        let found = self.settings.found(Register::RunMode).map(f32::to_bits);
        if found.is_some_and(|it| it != mode.to_bits()) && self.questions.is_multiple_of(4) {
            return Some(self.frame_of(Command::Write(Register::RunMode, mode)));
        }
        let asked = self.settings.inquire().map(|asked| self.settings.reading_back(asked))?;
        Some(self.frame_of(Command::of(asked)))
    }

    fn decode_answer(&mut self, frame: &CanFrame) -> bool {
        let Some((kind, is_known, [a, b, c, d, value @ ..])) = answer(frame) else { return false };
        match kind {
            VALUE => {
                let Some(register) = register(u16::from_le_bytes([a, b])) else { return true };
                let value = if is_known { register.form().value_of(value) } else { f32::NAN };
                if register == Register::MechanicalPosition {
                    self.laps.set(value, self.model.pmax_rad());
                }
                self.settings.take_value(register, value);
            }
            FAULTS => (self.reported, self.has_cleared) = (u32::from_le_bytes([a, b, c, d]), false),
            _ => {}
        }
        true
    }

    fn wrong_setting(&self) -> Option<WrongSetting> {
        let is_right = |register, found| self.is_right(register, found);
        let expected = |register| self.expected(register);
        self.settings.wrong_setting(self.name(), is_right, Register::manual, expected)
    }

    fn forget_settings(&mut self) {
        self.settings.forget();
    }

    fn frames_per_answer(&self) -> u32 {
        1
    }

    fn capabilities(&self) -> Capabilities {
        let known = self.mode.control.capabilities().with(Capability::Temperature);
        let known = known.with(Capability::ErrorCodes);
        if self.model.knows_angle() { known.with(Capability::AbsoluteAngle) } else { known }
    }

    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "16 bits in tenths")]
    fn vitals(&self) -> Vitals {
        let reported = code_from(32, self.reported);
        let Some(drive) = self.feedback() else { return Vitals::of_errors([reported], 0) };
        // A drive in calibration has the code 1.
        let codes = [reported, drive.fault_code(), u8::from(drive.status == Status::Calibration)];
        Vitals {
            temperature_c: Some(drive.temperature_c as i16),
            effort: self.mode.control.effort(),
            speed: drive.measured.velocity_rad_per_s / self.model.vmax_rad_per_s(),
            current: drive.measured.torque_nm / self.model.tmax_nm(),
            ..Vitals::of_errors(codes, 0)
        }
    }
}
