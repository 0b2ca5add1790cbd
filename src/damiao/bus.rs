//! The motor as an actuator: its claims, its frames, and their order.

use super::codec::{CLEAR_ERROR, Command, REGISTERS, inquiry, is_answer, refresh, value};
use super::config::Mode;
use super::{Feedback, Model, Register, Status};
use crate::control::PidConfig;
use crate::error::ConfigError;
use crate::frame::{CanFrame, standard_id};
use crate::motor::Impedance;
use crate::motor::{
    Capabilities, Capability, Claim, DriveProtocol, Goal, Ingest, Inquiry, MotorName, Order,
    Preparation, Settings, Shaft, TimeoutUnits, Vitals, WrongSetting, inside, register_questions,
};
use crate::time::Duration;
use crate::units::{Angle, AngularVelocity};
use crate::wire::mit;
use embedded_can::StandardId;

/// The largest share by which a range may differ from the range of the model: rounding of the drive's display.
const RANGE_TOLERANCE: f32 = 1e-4;

/// The registers compared with the configuration before arming.
const CHECKED: [Register; 4] = [
    Register::ControlMode,
    Register::PositionRange,
    Register::VelocityRange,
    Register::TorqueRange,
];

/// A motor of this family in a control mode: see the [module](super).
///
/// Costs 2738 instructions on a Cortex-M4F, for a tick of eight with our speed loops (`docs/figures.md`).
///
/// Costs 75 instructions on a Cortex-M4F, for a frame to one of eight (`docs/figures.md`).
///
/// # Examples
/// ```
/// use drivetrain::damiao::{Mode, Model, Motor};
/// use drivetrain::motor::{Claim, DriveProtocol};
/// use drivetrain::units::AngularVelocity;
///
/// let mode = Mode::velocity(AngularVelocity::from_rpm(60.0));
/// let motor = Motor::new(Model::H6215, 2, mode)?.with_master_id(0x010)?;
/// let claims: Vec<String> = motor.claims().into_iter().map(|claim| claim.to_string()).collect();
/// assert_eq!(claims, [
///     "command of DM-H6215 #2 on 0x202",
///     "command of DM-H6215 #2 on 0x2", // enabling and disabling
///     "command of DM-H6215 #2 on 0x7FF", // registers: shared by all drives
///     "feedback of DM-H6215 #2 on 0x10",
/// ]);
/// # Ok::<(), drivetrain::error::ConfigError>(())
/// ```
#[derive(Debug, Clone, Copy)]
pub struct Motor {
    model: Model,
    id: u8,
    command_id: StandardId,
    master_id: u16,
    timeout: TimeoutUnits,
    mode: Mode,
    /// Of the last feedback; `None` before the first.
    status: Option<Status>,
    /// The bytes of the last feedback.
    report: [u8; 8],
    settings: Settings<Register, { CHECKED.len() }>,
    /// Counts the frames to enable or disable the drive.
    specials: u8,
}

register_questions!();

impl Motor {
    /// Takes the model, the id of the drive, 1 to 15, and the control mode. The master id is `id + 0x10`, as the manual advises.
    ///
    /// # Errors
    /// Names the value outside its limits.
    pub fn new(model: Model, id: u8, mode: impl Into<Mode>) -> Result<Self, ConfigError> {
        ConfigError::check_range("id", id.into(), 1.0, 15.0)?;
        let mode = mode.into();
        mode.check(&model)?;
        Ok(Self {
            model,
            id,
            command_id: StandardId::new(mode.base() + u16::from(id)).unwrap_or(StandardId::MAX),
            master_id: u16::from(id) + 0x10,
            timeout: TimeoutUnits::USUAL,
            mode,
            status: None,
            report: [0; 8],
            settings: Settings::new(CHECKED),
            specials: 0,
        })
    }

    /// Sets the register `MST_ID` of the drive: the id of its feedback, 0 to 0x7FE, which several drives may share.
    ///
    /// # Errors
    /// [`ConfigError::Range`] for another id; [`ConfigError::Conflict`] for the id of the motor's own commands.
    pub fn with_master_id(self, master_id: u16) -> Result<Self, ConfigError> {
        ConfigError::check_range("master id", master_id.into(), 0.0, 2046.0)?;
        let is_taken = [self.command_id.as_raw(), self.id.into()].contains(&master_id);
        ConfigError::check_conflict(is_taken, "master id")?;
        Ok(Self { master_id, ..self })
    }

    /// Sets the time without a command until the drive disables itself: 1 ms to 60 s, 100 ms at first.
    ///
    /// # Errors
    /// [`ConfigError::Range`] for another time.
    pub fn with_timeout(self, timeout: Duration) -> Result<Self, ConfigError> {
        Ok(Self { timeout: TimeoutUnits::new(timeout, 60_000_000)?, ..self })
    }

    /// Returns the last feedback of the drive; `None` before the first.
    #[must_use]
    pub const fn feedback(&self) -> Option<Feedback> {
        match self.status {
            Some(_) => Feedback::decode(&self.report, &self.model.ranges),
            None => None,
        }
    }

    /// Has the drive keep all of its registers over a loss of the supply; while the motor is disarmed.
    /// The frame goes out once, for flash memory wears: a frame refused by the bus is lost.
    pub const fn store(&mut self) {
        self.settings.request(Inquiry::Store);
    }

    fn shaft(&self) -> Shaft {
        let is_heard = self.status.is_some();
        let unheard = (None, AngularVelocity::ZERO);
        if is_heard { Feedback::shaft(&self.report, &self.model.ranges) } else { unheard }
    }

    #[inline]
    fn frame_of(&self, data: [u8; 8]) -> CanFrame {
        CanFrame::of(self.command_id, data)
    }

    /// Returns the goal of an order; `None` to rest.
    #[inline]
    fn goal(&mut self, order: Order) -> Option<Goal> {
        let (report, ranges) = (self.status.map(|_| &self.report)?, &self.model.ranges);
        let shaft = || Feedback::shaft(report, ranges);
        self.mode.0.impedance_goal(order, shaft, ranges, 4_095)
    }

    /// Returns the command to the drive, within the share of its largest effort; `None` to rest.
    fn command(&mut self, goal: Goal, share: f32) -> Option<Command> {
        Some(match goal {
            Goal::Torque(torque_nm) => Command::Mit(Impedance::torque(torque_nm)),
            Goal::Impedance(command) => Command::Mit(command),
            Goal::Velocity(velocity) => Command::Velocity(velocity),
            Goal::Way(way) => {
                let ranges = &self.model.ranges;
                let position = Feedback::decode(&self.report, ranges)?.measured.position_rad;
                let position = inside(position, way, ranges.position_rad());
                self.mode.toward(position, share, &self.model)
            }
        })
    }

    /// Returns the configured value of a register.
    fn expected(&self, register: Register) -> f32 {
        match register {
            Register::PositionRange => self.model.pmax_rad(),
            Register::VelocityRange => self.model.vmax_rad_per_s(),
            Register::TorqueRange => self.model.tmax_nm(),
            _ => self.mode.0.number.into(),
        }
    }

    /// Tells whether a value in the drive is as configured.
    fn is_right(&self, register: Register, found: f32) -> bool {
        let expected = self.expected(register);
        (found - expected).abs() <= RANGE_TOLERANCE * expected
    }
}

impl DriveProtocol for Motor {
    fn name(&self) -> MotorName {
        MotorName::new(self.model.name(), self.id)
    }

    /// All drives of the family share the id of the registers.
    fn claims(&self) -> impl IntoIterator<Item = Claim> {
        let command = |id| Claim::command(standard_id(id), self.name());
        let bare = (self.mode.base() > 0).then(|| command(self.id.into()));
        let feedback = Claim::feedback(standard_id(self.master_id), self.name());
        let shared = [command(REGISTERS).shared(), feedback.shared()];
        [command(self.command_id.as_raw())].into_iter().chain(bare).chain(shared)
    }

    fn decode(&mut self, frame: &CanFrame) -> Ingest {
        if frame.length() != 8 {
            return Ingest::WrongLength(frame.length());
        }
        let data = frame.bytes();
        let [head, ..] = *data;
        if head & 0xF != self.id {
            return Ingest::Unrelated;
        }
        let Some(status) = Status::of(head >> 4) else {
            return Ingest::WrongField;
        };
        (self.status, self.report) = (Some(status), *data);
        Ingest::Taken
    }

    fn velocity(&self) -> AngularVelocity {
        self.shaft().1
    }

    fn angle(&self) -> Option<Angle> {
        self.shaft().0
    }

    fn rest(&mut self) -> CanFrame {
        if self.mode.0.is_impedance() {
            let rest = self.model.ranges.encode(&Impedance::FREE);
            CanFrame::of(standard_id(self.id.into()), rest)
        } else {
            self.off()
        }
    }

    fn control(&mut self, order: Order) -> CanFrame {
        let goal = self.goal(order);
        if let Some(Goal::Torque(torque_nm)) = goal {
            return self.frame_of(self.model.ranges.encode_torque(torque_nm));
        }
        match goal.and_then(|goal| self.command(goal, order.share)) {
            Some(command) => self.frame_of(command.encode(&self.model.ranges)),
            None => self.rest(),
        }
    }

    fn reset(&mut self) {
        self.mode.0.reset();
    }

    fn set_loops(&mut self, position: PidConfig, speed: PidConfig) -> Result<(), ConfigError> {
        self.mode.0.set_loops(position, speed)
    }

    /// Asks for unknown settings, then writes the time-out and reads the register back, then enables the drive: each time
    /// anew, for the drive may have lost its supply since.
    fn enable(&mut self, sent: u8) -> Option<CanFrame> {
        let timeout = Preparation::exact(Register::Timeout, self.timeout.value());
        let asked = self.settings.prepare(sent, [timeout]);
        Some(match asked {
            Some(asked) => inquiry(self.id, asked),
            None => {
                self.settings.forget();
                self.special(mit::ENABLE)
            }
        })
    }

    fn disable(&mut self) -> Option<CanFrame> {
        self.settings.prepare_anew();
        self.mode.0.is_impedance().then(|| self.off())
    }

    fn poll(&mut self) -> Option<CanFrame> {
        let stay = self.feedback().and_then(|drive| self.mode.stay(&drive));
        let frame = |stay: Command| self.frame_of(stay.encode(&self.model.ranges));
        Some(stay.map_or_else(|| refresh(self.id), frame))
    }

    fn is_enabled(&self) -> Option<bool> {
        self.status.map(|status| status == Status::Enabled)
    }

    fn inquire(&mut self) -> Option<CanFrame> {
        self.settings.inquire().map(|asked| inquiry(self.id, asked))
    }

    #[inline]
    fn decode_answer(&mut self, frame: &CanFrame) -> bool {
        let data = frame.bytes();
        if frame.length() != 8 || !is_answer(data, self.id) {
            return false;
        }
        self.settings.hear(|asked| value(data, self.id, asked));
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
        const FEEDBACK: Capabilities = Capabilities::of(&[
            Capability::Temperature,
            Capability::ErrorCodes,
            Capability::AbsoluteAngle,
        ]);
        self.mode.0.capabilities().and(FEEDBACK)
    }

    fn vitals(&self) -> Vitals {
        let Some(status) = self.status else { return Vitals::default() };
        let [_, a, b, c, d, e, driver_c, rotor_c] = self.report;
        let measured = self.model.ranges.decode_feedback(&[a, b, c, d, e]);
        Vitals {
            temperature_c: Some(driver_c.max(rotor_c).into()),
            has_fault: status.is_error(),
            has_warning: false,
            error_code: status.error_code(),
            effort: self.mode.0.effort(),
            speed: measured.velocity_rad_per_s / self.model.ranges.velocity_rad_per_s(),
            current: measured.torque_nm / self.model.ranges.torque_nm(),
        }
    }
}

impl Motor {
    /// Disables the drive. If the drive reports an error, each second pair of frames clears the error, and the drive stays disabled.
    fn off(&mut self) -> CanFrame {
        let has_error = self.status.is_some_and(Status::is_error);
        let clears = has_error && self.specials & 2 != 0;
        self.special(if clears { CLEAR_ERROR } else { mit::DISABLE })
    }

    /// Sends a frame to enable or disable to the id of the mode and to the bare id in turn: programs of the vendor use the first,
    /// three public packages the other.
    fn special(&mut self, data: [u8; 8]) -> CanFrame {
        self.specials = self.specials.wrapping_add(1);
        let is_bare = self.specials & 1 == 0;
        let id = if is_bare { standard_id(self.id.into()) } else { self.command_id.into() };
        CanFrame::of(id, data)
    }
}
