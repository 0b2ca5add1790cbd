//! The motor as an own motor: its claims, its frames, and their order.

use super::command::{
    COMMANDS, Command, ENDPOINT, ERRORS, ESTIMATES, HEARTBEAT, heard, id, request,
};
use super::config::Wanted;
use super::enabling::{NOT_SET, PARTS, Phase};
use super::feedback::{bit_of, endpoint_value};
use super::{Feedback, Firmware, Heartbeat, Motor};
use crate::frame::CanFrame;
use crate::math::wrap_pi;
use crate::motor::{
    Capabilities, Capability, Claim, Ingest, Inquiry, Malformed, MotorName, Order, OwnMotor, Role,
    Severity, Vitals, WrongSetting,
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

/// The same in inquiries, of which there is one each 10 ms.
const HEARTBEAT_INQUIRIES: u8 = 50;

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
        let extra: &[u8] = match (self.mode.acceleration(), self.endpoints) {
            (Some(_), None) => &[0x11, 0x12],
            (Some(_), Some(_)) => &[0x11, 0x12, 0x04],
            (None, Some(_)) => &[0x04],
            (None, None) => &[],
        };
        let target: &[u8] = match self.mode.number() {
            1 => &[0x0E],
            2 => &[0x0D],
            _ => &[0x0C],
        };
        let commands = COMMANDS.iter().chain(target).chain(extra);
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
        self.drive = Some(drive);
        (self.age_s, self.rests) = (0.0, 0);
        Ingest::Taken
    }

    fn velocity(&self) -> AngularVelocity {
        let turns_per_s = self.drive.map_or(0.0, |drive| drive.turns_per_s);
        AngularVelocity::from_rad_per_s(turns_per_s * TAU / self.gear)
    }

    fn angle(&self) -> Option<Angle> {
        self.drive.map(|drive| Angle::from_radians(drive.turns * TAU / self.gear))
    }

    /// Each fifth frame without estimates asks for them instead: the drive is at rest by the four before.
    fn rest(&mut self) -> CanFrame {
        if self.stops {
            return self.send(Command::Stop);
        }
        if self.asks() {
            return request(self.node, ESTIMATES);
        }
        match self.mode.number() {
            1 => self.send(Command::Torque(0.0)),
            _ => self.idle(),
        }
    }

    fn control(&mut self, order: Order) -> CanFrame {
        self.age_s += order.step.dt_s();
        self.silence_s += order.step.dt_s();
        if self.silence_s > HEARTBEAT_S {
            self.heartbeat = None;
        }
        let (Some(drive), Some(angle), false) = (self.drive, self.angle(), self.stops) else {
            return self.rest();
        };
        if self.state() != Some(Heartbeat::CLOSED_LOOP) {
            return self.rest();
        }
        (self.rests, self.clears) = (0, 0);
        self.has_polled = self.age_s > POLL_S && !self.has_polled;
        if self.has_polled {
            return request(self.node, ESTIMATES);
        }
        let (sent, since) = self.limits;
        let parts = if self.mode.number() == 1 { PARTS } else { parts_of(order.share).min(PARTS) };
        self.limits = (sent, since.saturating_add(1));
        if parts != sent || since >= LIMITS_EACH {
            self.limits = (parts, 0);
            return self.limits_of(parts);
        }
        // In position mode firmware 0.5 would take the angle of the shaft for its target.
        if since == LIMITS_EACH / 2 && self.mode.number() < 3 {
            return self.modes();
        }
        let velocity = self.velocity();
        let limit = self.velocity_limit.as_rad_per_s();
        match self.mode.command(order, angle, velocity) {
            Some(Wanted::Torque(nm)) => self.send(Command::Torque(nm / self.gear)),
            Some(Wanted::Velocity(rad_per_s)) => {
                let turns_per_s = self.turns(rad_per_s.min(limit).max(-limit));
                self.send(Command::Velocity(turns_per_s, 0.0))
            }
            Some(Wanted::Angle(target)) => {
                let way = self.turns(wrap_pi(target - angle.as_radians()));
                self.send(Command::Position(drive.turns + way, 0.0, 0.0))
            }
            None => self.rest(),
        }
    }

    fn reset(&mut self) {
        self.mode.reset();
    }

    fn enable(&mut self, sent: u8) -> Option<CanFrame> {
        let frame = match self.enabling {
            // The bus gave it back.
            Some((number, frame)) if number == sent && sent < u8::MAX => frame,
            _ if self.stops => self.idle(),
            _ if sent >= MOST_FRAMES && !matches!(self.phase, Phase::Requested(_)) => {
                self.refuse(NOT_SET)
            }
            _ => self.starting(),
        };
        self.enabling = Some((sent, frame));
        Some(frame)
    }

    fn disable(&mut self) -> Option<CanFrame> {
        (self.phase, self.enabling, self.rests) = (Phase::Off, None, 0);
        self.refused = self.refused.and_then(|(code, left)| Some((code, left.checked_sub(1)?)));
        (self.mode.number() == 1).then(|| self.idle())
    }

    fn poll(&mut self) -> Option<CanFrame> {
        let asks = self.asks();
        let stay = self.drive.filter(|_| !asks).map(|drive| self.stay(&drive));
        Some(stay.unwrap_or_else(|| request(self.node, ESTIMATES)))
    }

    /// Limits that were not sent come before the next command.
    fn unsent(&mut self, frame: &CanFrame) {
        if *frame == self.limits_of(self.limits.0) {
            self.limits.1 = LIMITS_EACH;
        }
    }

    /// While the drive is being enabled, only a heartbeat after the request counts.
    fn is_enabled(&self) -> Option<bool> {
        let is_starting = matches!(self.phase, Phase::Starting(_));
        Some(!is_starting && self.state() == Some(Heartbeat::CLOSED_LOOP))
    }

    fn inquire(&mut self) -> Option<CanFrame> {
        self.inquiries = self.inquiries.saturating_add(1);
        if self.inquiries > HEARTBEAT_INQUIRIES {
            self.heartbeat = None;
        }
        if self.clears > 0 {
            self.clears -= 1;
            return Some(self.send(Command::ClearErrors));
        }
        let number = if self.inquiries.is_multiple_of(2) { ERRORS } else { HEARTBEAT };
        (self.firmware == Firmware::V0_6).then(|| request(self.node, number))
    }

    /// Heartbeats are answers too: they tell nothing of the shaft.
    fn decode_answer(&mut self, frame: &CanFrame) -> bool {
        let (data, length) = (frame.bytes(), frame.length());
        let is = |number| frame.id() == id(self.node, number);
        if is(HEARTBEAT) && length == 8 {
            let Some(heartbeat) = Heartbeat::decode(data, self.firmware) else { return false };
            self.stops &= !heartbeat.is_stopped(self.firmware);
            self.heartbeat = Some(heartbeat);
            (self.silence_s, self.inquiries) = (0.0, 0);
            return true;
        }
        if is(ERRORS) && length == 8 {
            let [a, b, c, d, e, f, g, h] = *data;
            self.errors = (u32::from_le_bytes([a, b, c, d]), u32::from_le_bytes([e, f, g, h]));
            return true;
        }
        if !is(ENDPOINT) {
            return false;
        }
        if let (Some(Inquiry::Read(setting)), Some((endpoints, _))) =
            (self.settings.asked(), self.endpoints)
            && let Some(bytes) = endpoint_value(data, length.into(), setting.number(&endpoints))
        {
            self.settings.take(Inquiry::Read(setting), setting.value(bytes));
        }
        true
    }

    /// An axis that calibrates, or whose state is not known, is not armed.
    fn wrong_setting(&self) -> Option<WrongSetting> {
        let is_known = matches!(self.state(), Some(Heartbeat::IDLE | Heartbeat::CLOSED_LOOP));
        (self.phase == Phase::Off && !is_known).then(|| WrongSetting {
            motor: self.name(),
            setting: "axis state",
            expected: Heartbeat::IDLE.into(),
            found: self.state().map(f32::from),
        })
    }

    fn forget_settings(&mut self) {
        self.settings.forget();
        if self.phase == Phase::Off {
            self.heartbeat = None;
        }
    }

    fn capabilities(&self) -> Capabilities {
        self.mode.capabilities().with(Capability::Feedback).with(Capability::ErrorCodes)
    }

    fn vitals(&self) -> Vitals {
        let (fault, reason) = (self.fault_code(), bit_of(self.errors.1));
        let (error, error_code) = match (fault, reason) {
            (0, 0) => (None, 0),
            (0, reason) => (Some(Severity::Warning), DISARMED + reason),
            (fault, _) => (Some(Severity::Fault), fault),
        };
        Vitals {
            error,
            error_code,
            effort: self.mode.effort(),
            speed: self.velocity().as_rad_per_s() / self.velocity_limit.as_rad_per_s(),
            ..Vitals::default()
        }
    }
}

impl Motor {
    /// Counts a frame of rest, and tells whether estimates are to be asked for instead.
    fn asks(&mut self) -> bool {
        self.rests = (self.rests + 1) % POLL_UPDATES;
        self.rests == 0
    }

    /// Returns a command that leaves the shaft as it is.
    fn stay(&self, drive: &Feedback) -> CanFrame {
        self.send(match self.mode.number() {
            2 => Command::Velocity(drive.turns_per_s, 0.0),
            3 => Command::Position(drive.turns, 0.0, 0.0),
            _ => Command::Torque(0.0),
        })
    }

    /// Returns the code of an error that forbids to drive, 0 for none.
    fn fault_code(&self) -> u8 {
        let refused = self.refused.map_or(0, |(code, _)| code);
        let told = self.heartbeat.map_or(0, |heartbeat| heartbeat.error_code());
        [told, bit_of(self.errors.0), refused].into_iter().find(|code| *code > 0).unwrap_or(0)
    }
}

/// Returns the whole parts of a share.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
fn parts_of(share: f32) -> u8 {
    (share * f32::from(PARTS)) as u8
}
