//! The motor as an own motor: its claims, its frames, and their order.

use super::command::{
    ASK_ENDPOINT, COMMANDS, Command, ENDPOINT, ERRORS, ESTIMATES, HEARTBEAT, form_of, heard, id,
    request,
};
use super::config::{POSITION, TORQUE, VELOCITY};
use super::enabling::{NOT_SET, PARTS, Phase};
use super::feedback::endpoint_value;
use super::{Feedback, Firmware, Heartbeat, Motor};
use crate::frame::CanFrame;
use crate::motor::{
    Capabilities, Capability, Claim, Goal, Ingest, Inquiry, Malformed, MotorName, Order, OwnMotor,
    Role, Severity, Vitals, WrongSetting, lowest_bit,
};
use crate::units::{Angle, AngularVelocity};
use core::f32::consts::TAU;
use embedded_can::Frame;

/// Estimates older than this are asked for while the motor is driven.
const POLL_S: f32 = 0.005;

/// Each so many updates without estimates a motor at rest asks for them.
const POLL_UPDATES: u8 = 5;

/// Five heartbeats at the rate of delivery: without one for longer, the state of the axis is not known.
const HEARTBEAT_S: f32 = 0.5;

/// The time from one inquiry to the next.
const INQUIRY_S: f32 = 0.01;

/// The limits are sent again after so many commands, and the modes between.
const LIMITS_EACH: u8 = 100;

/// The frames, 10 ms apart, within which a drive is idle and has answered all that it is asked.
const MOST_FRAMES: u8 = 200;

/// Added to the bit of a reason for which the drive disarmed.
const DISARMED: u8 = 128;

impl OwnMotor for Motor {
    fn name(&self) -> MotorName {
        MotorName::new(self.model.name(), self.node)
    }

    fn claims(&self) -> impl IntoIterator<Item = Claim> {
        let (node, name) = (self.node, self.name());
        let feedback = heard(self.firmware).iter();
        let trajectory: &[u8] = if self.mode.acceleration.is_some() { &[0x11, 0x12] } else { &[] };
        let endpoints: &[u8] = if self.endpoints.is_some() { &[ASK_ENDPOINT] } else { &[] };
        let target: &[u8] = match self.mode.control.number {
            TORQUE => &[0x0E],
            VELOCITY => &[0x0D],
            _ => &[0x0C],
        };
        let commands = COMMANDS.iter().chain(target).chain(trajectory).chain(endpoints);
        let feedback = feedback.map(|number| (number, Role::Feedback));
        feedback
            .chain(commands.map(|number| (number, Role::Command)))
            .map(move |(number, role)| Claim::new(id(node, *number), role, name))
    }

    fn decode(&mut self, frame: &CanFrame) -> Ingest {
        if frame.length() != 8 {
            return Ingest::Malformed(Malformed::Length(frame.length()));
        }
        if frame.id() != id(self.node, ESTIMATES) {
            return Ingest::Malformed(Malformed::Field);
        }
        let Some(drive) = Feedback::decode(frame.bytes()) else {
            return Ingest::Malformed(Malformed::Field);
        };
        self.state.drive = Some(drive);
        (self.state.age_s, self.state.rests) = (0.0, 0);
        Ingest::Taken
    }

    fn velocity(&self) -> AngularVelocity {
        let turns_per_s = self.state.drive.map_or(0.0, |drive| drive.turns_per_s);
        AngularVelocity::from_rad_per_s(turns_per_s * TAU / self.gear)
    }

    fn angle(&self) -> Option<Angle> {
        self.state.drive.map(|drive| Angle::from_radians(drive.turns * TAU / self.gear))
    }

    /// Each fifth frame without estimates asks for them instead: the drive is at rest by the four before.
    fn rest(&mut self) -> CanFrame {
        if self.state.stops {
            return self.send(Command::Stop);
        }
        if self.asks() {
            return request(self.node, ESTIMATES);
        }
        match self.mode.control.number {
            TORQUE => self.send(Command::Torque(0.0)),
            _ => self.idle(),
        }
    }

    fn control(&mut self, order: Order) -> CanFrame {
        self.state.age_s += order.step.dt_s();
        self.wait(order.step.dt_s());
        let (Some(drive), Some(angle), false) = (self.state.drive, self.angle(), self.state.stops)
        else {
            return self.rest();
        };
        if self.axis() != Some(Heartbeat::CLOSED_LOOP) {
            return self.rest();
        }
        (self.state.rests, self.state.clears) = (0, 0);
        self.state.has_polled = self.state.age_s > POLL_S && !self.state.has_polled;
        if self.state.has_polled {
            return request(self.node, ESTIMATES);
        }
        let is_torque = self.mode.control.number == TORQUE;
        let parts = if is_torque { PARTS } else { parts_of(order.share).min(PARTS) };
        if self.state.limits.is_due(parts, LIMITS_EACH) {
            return self.limits_of(parts);
        }
        // In position mode firmware 0.5 would take the angle of the shaft for its target.
        if self.state.limits.since() == LIMITS_EACH / 2 && self.mode.control.number != POSITION {
            return self.modes();
        }
        let limit = self.velocity_limit.as_rad_per_s();
        let shaft = (Some(angle), self.velocity());
        match self.mode.control.goal(order, shaft, f32::MAX) {
            Some(Goal::Torque(nm)) => self.send(Command::Torque(nm / self.gear)),
            Some(Goal::Velocity(velocity)) => {
                self.send(Command::Velocity(self.turns(velocity.min(limit).max(-limit)), 0.0))
            }
            Some(Goal::Way(way)) => {
                self.send(Command::Position(drive.turns + self.turns(way), 0.0, 0.0))
            }
            Some(Goal::Impedance(_)) | None => self.rest(),
        }
    }

    fn reset(&mut self) {
        self.mode.control.reset();
    }

    fn enable(&mut self, sent: u8) -> Option<CanFrame> {
        let frame = match self.state.enabling {
            // The bus gave it back.
            Some((number, frame)) if number == sent && sent < u8::MAX => frame,
            _ if self.state.stops => self.idle(),
            _ if sent >= MOST_FRAMES && !matches!(self.state.phase, Phase::Requested(_)) => {
                self.refuse(NOT_SET)
            }
            _ => self.starting(),
        };
        self.state.enabling = Some((sent, frame));
        Some(frame)
    }

    fn disable(&mut self) -> Option<CanFrame> {
        (self.state.phase, self.state.enabling, self.state.rests) = (Phase::Off, None, 0);
        self.state.refused =
            self.state.refused.and_then(|(code, left)| Some((code, left.checked_sub(1)?)));
        (self.mode.control.number == TORQUE).then(|| self.idle())
    }

    fn poll(&mut self) -> Option<CanFrame> {
        let asks = self.asks();
        let stay = self.state.drive.filter(|_| !asks).map(|drive| self.stay(&drive));
        Some(stay.unwrap_or_else(|| request(self.node, ESTIMATES)))
    }

    /// Limits that were not sent come before the next command.
    fn unsent(&mut self, frame: &CanFrame) {
        if *frame == self.limits_of(self.state.limits.value()) {
            self.state.limits.repeat();
        }
    }

    /// While the drive is being enabled, only a heartbeat after the request counts.
    fn is_enabled(&self) -> Option<bool> {
        let is_starting = matches!(self.state.phase, Phase::Starting(_));
        Some(!is_starting && self.axis() == Some(Heartbeat::CLOSED_LOOP))
    }

    fn inquire(&mut self) -> Option<CanFrame> {
        self.wait(INQUIRY_S);
        self.state.inquiries = self.state.inquiries.wrapping_add(1);
        if self.state.clears > 0 {
            self.state.clears -= 1;
            return Some(self.send(Command::ClearErrors));
        }
        let number = if self.state.inquiries.is_multiple_of(2) { ERRORS } else { HEARTBEAT };
        (self.firmware == Firmware::V0_6).then(|| request(self.node, number))
    }

    /// Heartbeats are answers too: they tell nothing of the shaft.
    fn decode_answer(&mut self, frame: &CanFrame) -> bool {
        let (data, length) = (frame.bytes(), frame.length());
        let is = |number| frame.id() == id(self.node, number);
        if is(HEARTBEAT) && length == 8 {
            let Some(heartbeat) = Heartbeat::decode(data, self.firmware) else { return false };
            self.state.stops &= !heartbeat.is_stopped(self.firmware);
            self.state.heartbeat = Some(heartbeat);
            self.state.silence_s = 0.0;
            return true;
        }
        if is(ERRORS) && length == 8 {
            let [a, b, c, d, e, f, g, h] = *data;
            self.state.errors =
                (u32::from_le_bytes([a, b, c, d]), u32::from_le_bytes([e, f, g, h]));
            return true;
        }
        if !is(ENDPOINT) {
            return false;
        }
        if let (Some(Inquiry::Read(number)), Some(values)) = (self.settings.asked(), self.endpoints)
            && let Some(bytes) = endpoint_value(data, length.into(), number)
        {
            let value = form_of(number, &values).value_of(bytes);
            self.settings.take(Inquiry::Read(number), value);
        }
        true
    }

    /// An axis that calibrates, or whose state is not known, is not armed.
    fn wrong_setting(&self) -> Option<WrongSetting> {
        let is_known = matches!(self.axis(), Some(Heartbeat::IDLE | Heartbeat::CLOSED_LOOP));
        (self.state.phase == Phase::Off && !is_known).then(|| WrongSetting {
            motor: self.name(),
            setting: "axis state",
            expected: Heartbeat::IDLE.into(),
            found: self.axis().map(f32::from),
        })
    }

    fn forget_settings(&mut self) {
        self.settings.forget();
        if self.state.phase == Phase::Off {
            self.state.heartbeat = None;
        }
    }

    fn capabilities(&self) -> Capabilities {
        self.mode.control.capabilities().with(Capability::ErrorCodes)
    }

    fn vitals(&self) -> Vitals {
        let (fault, reason) = (self.fault_code(), lowest_bit(self.state.errors.1));
        let (error, error_code) = match (fault, reason) {
            (0, 0) => (None, 0),
            (0, reason) => (Some(Severity::Warning), DISARMED + reason),
            (fault, _) => (Some(Severity::Fault), fault),
        };
        Vitals {
            error,
            error_code,
            effort: self.mode.control.effort(),
            speed: self.velocity().as_rad_per_s() / self.velocity_limit.as_rad_per_s(),
            ..Vitals::default()
        }
    }
}

impl Motor {
    /// Moves the time on. A heartbeat that is too old is none.
    fn wait(&mut self, time_s: f32) {
        self.state.silence_s += time_s;
        self.state.heartbeat = self.state.heartbeat.filter(|_| self.state.silence_s <= HEARTBEAT_S);
    }

    /// Counts a frame of rest, and tells whether estimates are to be asked for instead.
    fn asks(&mut self) -> bool {
        self.state.rests = (self.state.rests + 1) % POLL_UPDATES;
        self.state.rests == 0
    }

    /// Returns a command that leaves the shaft as it is.
    fn stay(&self, drive: &Feedback) -> CanFrame {
        self.send(match self.mode.control.number {
            VELOCITY => Command::Velocity(drive.turns_per_s, 0.0),
            POSITION => Command::Position(drive.turns, 0.0, 0.0),
            _ => Command::Torque(0.0),
        })
    }

    /// Returns the code of an error that forbids to drive, 0 for none.
    fn fault_code(&self) -> u8 {
        let refused = self.state.refused.map_or(0, |(code, _)| code);
        let told = self.state.heartbeat.map_or(0, |heartbeat| heartbeat.error_code());
        [told, lowest_bit(self.state.errors.0), refused]
            .into_iter()
            .find(|code| *code > 0)
            .unwrap_or(0)
    }
}

/// Returns the whole parts of a share.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
fn parts_of(share: f32) -> f32 {
    f32::from((share * PARTS) as u8)
}
