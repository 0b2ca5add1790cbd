//! The motor as an actuator: its claims, its frames, and their order.

use super::codec::{HOST, SHORT_MESSAGE, extended, fault, question};
use super::config::{At, Mode, Rest};
use super::{Feedback, Model};
use crate::control::PidConfig;
use crate::encoder;
use crate::encoder::Tachometer;
use crate::error::ConfigError;
use crate::frame::CanFrame;
use crate::motor::{
    Capabilities, Capability, Claim, DriveProtocol, Ingest, MotorName, Order, Vitals, WrongSetting,
};
use crate::units::{Angle, AngularVelocity};
use embedded_can::{Frame, Id};

/// Packets of status 1, 4 and 5.
const MOTION: u8 = 9;
const TEMPERATURES: u8 = 16;
const TACHOMETER: u8 = 27;

/// Blocks of packets: the first packet, and the bits that differ within the block.
const COMMANDS: [(u8, u8); 4] = [(0, 3), (4, 0), (10, 1), (12, 1)];
const STATUSES: [(u8, u8); 5] = [(MOTION, 0), (14, 1), (TEMPERATURES, 0), (TACHOMETER, 0), (58, 0)];

/// Commands for one question.
const ORDERS: u8 = 50;

/// A motor on a VESC, in a control mode: see the [module](super).
///
/// Costs 3811 instructions on a Cortex-M4F, for a tick of eight with our speed loops (`docs/figures.md`).
///
/// Costs 145 instructions on a Cortex-M4F, for a frame to one of eight (`docs/figures.md`).
///
/// # Examples
/// ```
/// use drivetrain::encoder::GearRatio;
/// use drivetrain::frame::CanFrame;
/// use drivetrain::motor::DriveProtocol;
/// use drivetrain::units::AngularVelocity;
/// use drivetrain::vesc::{Mode, Model, Motor, Rest};
///
/// const WHEEL: Model = Model {
///     name: "hub",
///     pole_pairs: 15,
///     gear: GearRatio::DIRECT,
///     torque_constant_nm_per_a: 0.5,
///     current_limit_a: 20.0,
///     max_velocity: AngularVelocity::from_rpm(500.0),
/// };
/// let mut wheel = Motor::new(WHEEL, 1, Mode::velocity())?;
/// assert_eq!(format!("{:?}", wheel.rest()), "00000101 [4] 00 00 00 00"); // current 0
/// let mut wheel = wheel.with_rest(Rest::Brake(4.0))?;
/// assert_eq!(format!("{:?}", wheel.rest()), "00000201 [4] 00 00 0F A0"); // brake 4000 mA
/// # Ok::<(), drivetrain::error::ConfigError>(())
/// ```
#[derive(Debug, Clone, Copy)]
pub struct Motor {
    model: Model,
    id: u8,
    mode: Mode,
    rest: Rest,
    has_encoder: bool,
    has_fault_code: bool,
    feedback: Feedback,
    tachometer: Tachometer,
    /// Frames with the motion since the last one with the angle.
    angle_age: u8,
    /// Commands since the last question for the fault code.
    orders: u8,
    /// Questions since the last answer.
    unanswered: u8,
    /// The share of the last command; `None` where the drive controls the current by its own loop.
    effort: Option<f32>,
}

impl Motor {
    /// Takes the motor, the id of the drive, 0 to 253, and the control mode.
    ///
    /// # Errors
    /// Names the value outside its limits.
    pub fn new(model: Model, id: u8, mode: Mode) -> Result<Self, ConfigError> {
        ConfigError::check_range("id", id.into(), 0.0, f32::from(HOST - 1))?;
        model.check()?;
        mode.check(&model)?;
        Ok(Self {
            tachometer: model.tachometer(),
            model,
            id,
            mode,
            rest: Rest::Release,
            has_encoder: mode.has_position(),
            has_fault_code: true,
            feedback: Feedback::default(),
            angle_age: u8::MAX,
            orders: 0,
            unanswered: 0,
            effort: Some(0.0),
        })
    }

    /// Sets the command of a motor at rest: [`Rest::Release`] at first.
    ///
    /// # Errors
    /// [`ConfigError::Limit`] for a current not above 0 or not within the limit of the model.
    pub fn with_rest(self, rest: Rest) -> Result<Self, ConfigError> {
        rest.check(&self.model)?;
        Ok(Self { rest, ..self })
    }

    /// Takes the angle from status 4, the position of the drive's encoder, instead of the tachometer in status 5. In the mode
    /// [`Mode::position`](super::Mode::position) the angle always comes from status 4.
    ///
    /// This angle is of the output shaft if the position angle division in VESC Tool is the gear ratio. Without an encoder,
    /// status 4 has the electrical angle.
    #[must_use]
    pub const fn with_encoder(self) -> Self {
        Self { has_encoder: true, ..self }
    }

    /// Never asks for the fault code, for firmware without an answer. A fault is then not seen: after a fault the drive ignores commands
    /// for a time, and follows them again.
    #[must_use]
    pub const fn without_fault_code(self) -> Self {
        Self { has_fault_code: false, ..self }
    }

    /// Returns the last values reported by the drive.
    #[must_use]
    pub const fn feedback(&self) -> &Feedback {
        &self.feedback
    }

    /// Returns the position of the output shaft with all turns since the drive has started, by its tachometer; `None` before the first
    /// status 5, and when 100 frames of status 1 have come since the last.
    #[must_use]
    pub fn position(&self) -> Option<encoder::Position> {
        self.feedback.tachometer.filter(|_| !self.has_encoder && self.has_fresh_angle())?;
        Some(self.tachometer.position())
    }

    const fn has_fresh_angle(&self) -> bool {
        self.angle_age < 100
    }

    /// Asks for the fault code. After four questions without an answer the code is unknown.
    fn ask(&mut self) -> CanFrame {
        if self.unanswered >= 4 {
            self.feedback.fault = None;
        }
        self.unanswered = self.unanswered.saturating_add(1);
        question(self.id)
    }

    /// Takes a status frame of this drive.
    #[inline]
    fn take(&mut self, packet: u8, data: &[u8]) -> bool {
        if !self.feedback.take(packet, data) {
            return false;
        }
        if packet == MOTION {
            self.angle_age = self.angle_age.saturating_add(1);
        } else if packet == TACHOMETER {
            self.tachometer.take(self.feedback.tachometer.unwrap_or_default());
        }
        if packet == if self.has_encoder { TEMPERATURES } else { TACHOMETER } {
            self.angle_age = 0;
        }
        true
    }
}

impl DriveProtocol for Motor {
    fn name(&self) -> MotorName {
        MotorName::new(self.model.name, self.id)
    }

    /// All commands of the drive are claimed, in each mode: another program with such commands is a second master. Tools may ask.
    fn claims(&self) -> impl IntoIterator<Item = Claim> {
        let (own, name) = (self.id, self.name());
        let mask = |bits: u8| !(u32::from(bits) << 8);
        let commands = COMMANDS.map(|(packet, bits)| {
            Claim::command(extended(packet, own), name).with_mask(mask(bits))
        });
        let statuses = STATUSES.map(|(packet, bits)| {
            Claim::feedback(extended(packet, own), name).with_mask(mask(bits))
        });
        let questions = self.has_fault_code.then(|| {
            let answer = Claim::feedback(extended(SHORT_MESSAGE, HOST), name);
            [Claim::command(extended(SHORT_MESSAGE, own), name).shared(), answer.shared()]
        });
        commands.into_iter().chain(statuses).chain(questions.into_iter().flatten())
    }

    fn decode(&mut self, frame: &CanFrame) -> Ingest {
        let (packet, id) = parts(frame.id());
        if id != self.id {
            return Ingest::Unrelated;
        }
        // What `decode_answer` has not taken: the motion, and damaged frames.
        if packet == MOTION && self.take(MOTION, frame.data()) {
            Ingest::Taken
        } else {
            Ingest::WrongLength(frame.length())
        }
    }

    fn velocity(&self) -> AngularVelocity {
        self.model.velocity_of(self.feedback.erpm.unwrap_or_default())
    }

    fn angle(&self) -> Option<Angle> {
        if !self.has_encoder {
            return self.position().map(encoder::Position::angle);
        }
        let degrees = self.feedback.position_deg.filter(|_| self.has_fresh_angle())?;
        Some(Angle::from_degrees(degrees))
    }

    fn rest(&mut self) -> CanFrame {
        self.effort = Some(0.0);
        self.rest.command(1.0).frame(self.id)
    }

    fn control(&mut self, order: Order) -> CanFrame {
        let at = At {
            model: &self.model,
            velocity: self.velocity(),
            angle: self.angle(),
            duty: self.feedback.duty.unwrap_or_default(),
        };
        let command = self.mode.command(order, &at);
        let Some((command, effort)) = command else { return self.rest() };
        self.effort = effort;
        self.orders = self.orders.wrapping_add(1);
        if self.has_fault_code && self.orders >= ORDERS {
            self.orders = 0;
            return self.ask();
        }
        command.frame(self.id)
    }

    fn reset(&mut self) {
        self.mode.reset();
        self.effort = Some(0.0);
    }

    fn set_loops(&mut self, position: PidConfig, speed: PidConfig) -> Result<(), ConfigError> {
        self.mode.set_loops(position, speed)
    }

    fn inquire(&mut self) -> Option<CanFrame> {
        self.has_fault_code.then(|| self.ask())
    }

    /// Takes all frames but the motion: the other status frames, and fault codes. A motor whose targets need an angle takes
    /// the motion without an angle here too, so feedback is late when motion or angle is late.
    fn decode_answer(&mut self, frame: &CanFrame) -> bool {
        let (packet, id) = parts(frame.id());
        if packet == SHORT_MESSAGE {
            let Some(fault) = fault(frame.data(), self.id) else { return false };
            (self.feedback.fault, self.unanswered) = (Some(fault), 0);
            return true;
        }
        let lacks_angle = self.mode.needs_angle() && self.angle_age > 0;
        id == self.id && (packet != MOTION || lacks_angle) && self.take(packet, frame.data())
    }

    fn wrong_setting(&self) -> Option<WrongSetting> {
        let is_unknown = self.has_fault_code && self.feedback.fault.is_none();
        is_unknown.then(|| WrongSetting::new(self.name(), "fault code", 0.0, None))
    }

    fn forget_settings(&mut self) {
        (self.feedback.fault, self.feedback.tachometer) = (None, None);
        self.feedback.position_deg = None;
        self.angle_age = u8::MAX;
    }

    fn frames_per_answer(&self) -> u32 {
        2
    }

    fn capabilities(&self) -> Capabilities {
        let mut capabilities =
            self.mode.capabilities().with(Capability::Feedback).with(Capability::Temperature);
        if self.has_fault_code {
            capabilities = capabilities.with(Capability::ErrorCodes);
        }
        if self.has_encoder { capabilities.with(Capability::AbsoluteAngle) } else { capabilities }
    }

    #[inline]
    fn vitals(&self) -> Vitals {
        let drive = &self.feedback;
        let celsius = match (drive.driver_c, drive.motor_c) {
            (Some(driver), Some(motor)) => Some(whole(driver.max(motor))),
            _ => None,
        };
        let current = drive.current_a.unwrap_or_default() / self.model.current_limit_a;
        Vitals {
            temperature_c: celsius,
            effort: self.effort.unwrap_or(current),
            speed: self.velocity().as_rad_per_s() / self.model.max_velocity.as_rad_per_s(),
            current,
            ..Vitals::of_errors([drive.fault.unwrap_or_default()], 0)
        }
    }
}

/// Returns packet and id of a drive; for a standard id, or an id with more bits, values of no drive.
fn parts(id: Id) -> (u8, u8) {
    match id {
        Id::Extended(id) => match id.as_raw().to_be_bytes() {
            [0, 0, packet, id] => (packet, id),
            _ => (u8::MAX, u8::MAX),
        },
        Id::Standard(_) => (u8::MAX, u8::MAX),
    }
}

#[expect(clippy::cast_possible_truncation, reason = "a tenth of an i16")]
const fn whole(celsius: f32) -> i16 {
    celsius as i16
}
