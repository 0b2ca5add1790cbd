//! The motor as an own motor: its claims, its frames, and their order.

use super::command::{
    ASK_ENDPOINT, COMMANDS, Command, ENDPOINT, ERRORS, ESTIMATES, HEARTBEAT, heard, id, request,
};
use super::config::{POSITION, TORQUE};
use super::enabling::{NOT_SET, PARTS, Phase};
use super::feedback::{endpoint_value, words};
use super::{Feedback, Firmware, Heartbeat, Motor};
use crate::frame::CanFrame;
use crate::motor::{
    Capabilities, Capability, Claim, Goal, Ingest, Inquiry, MotorName, Order, OwnMotor, Role,
    Severity, Vitals, WrongSetting, code_from, ingest_eight, lowest_bit,
};
use crate::units::{Angle, AngularVelocity};
use core::f32::consts::TAU;
use embedded_can::Frame;

/// Estimates older than this are asked for while the motor is driven.
const POLL_S: f32 = 0.005;

/// Each so many updates without estimates a motor at rest asks for them.
const POLL_UPDATES: u8 = 5;

/// Five heartbeats at the rate of delivery: after a longer silence the state of the axis is unknown.
const HEARTBEAT_S: f32 = 0.5;

/// The time from one inquiry to the next.
const INQUIRY_S: f32 = 0.01;

/// The limits are sent again after so many commands, and the modes between.
const LIMITS_EACH: u8 = 100;

/// The frames, 10 ms apart, until a drive must be idle and must have answered all questions.
const MOST_FRAMES: u8 = 200;

/// The code of the first bit of the reason of a disarmed drive.
const DISARMED: u8 = 129;

impl OwnMotor for Motor {
    fn name(&self) -> MotorName {
        MotorName::new(self.model.name(), self.node)
    }

    fn claims(&self) -> impl IntoIterator<Item = Claim> {
        let (node, name, has_endpoints) = (self.node, self.name(), self.endpoints.is_some());
        let claim = move |role| move |number: &u8| Claim::new(id(node, *number), role, name);
        let sent = COMMANDS.iter().filter(move |number| has_endpoints || **number != ASK_ENDPOINT);
        heard(self.firmware).iter().map(claim(Role::Feedback)).chain(sent.map(claim(Role::Command)))
    }

    fn decode(&mut self, frame: &CanFrame) -> Ingest {
        ingest_eight(frame, |data| {
            let is_feedback = frame.id() == id(self.node, ESTIMATES);
            self.state.drive = Some(Feedback::decode(data).filter(|_| is_feedback)?);
            (self.state.age_s, self.state.rests) = (0.0, 0);
            Some(())
        })
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
        let follows = self.axis() == Some(Heartbeat::CLOSED_LOOP) && !self.state.stops;
        let Some(drive) = self.state.drive.filter(|_| follows) else { return self.rest() };
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
        match self.mode.control.goal(order, (self.angle(), self.velocity()), f32::MAX) {
            Some(goal) => self.follow(goal, &drive),
            None => self.rest(),
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
        let goal = self.mode.control.stay(self.velocity().as_rad_per_s());
        let stay = self.state.drive.filter(|_| !asks).map(|drive| self.follow(goal, &drive));
        Some(stay.unwrap_or_else(|| request(self.node, ESTIMATES)))
    }

    /// Unsent limits come before the next command.
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

    /// Heartbeats are answers too: a heartbeat has no value of the shaft.
    fn decode_answer(&mut self, frame: &CanFrame) -> bool {
        let data = frame.bytes();
        let mut numbers = heard(self.firmware).iter().copied();
        let number = numbers.find(|number| frame.id() == id(self.node, *number));
        match (number, frame.length()) {
            (Some(HEARTBEAT), 8) => {
                let Some(heartbeat) = Heartbeat::decode(data, self.firmware) else { return false };
                self.state.stops &= !heartbeat.is_stopped(self.firmware);
                (self.state.heartbeat, self.state.silence_s) = (Some(heartbeat), 0.0);
            }
            (Some(ERRORS), 8) => self.state.errors = words(data),
            (Some(ENDPOINT), length) => {
                if let Some(Inquiry::Read((number, form))) = self.settings.asked()
                    && let Some(bytes) = endpoint_value(data, length.into(), number)
                {
                    self.settings.take(Inquiry::Read((number, form)), form.value_of(bytes));
                }
            }
            _ => return false,
        }
        true
    }

    /// An axis in calibration or in an unknown state is not armed.
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
        let is_off = self.state.phase == Phase::Off;
        self.state.heartbeat.take_if(|_| is_off);
    }

    fn frames_per_answer(&self) -> u32 {
        2
    }

    fn capabilities(&self) -> Capabilities {
        self.mode.control.capabilities().with(Capability::ErrorCodes)
    }

    fn vitals(&self) -> Vitals {
        let told = self.state.heartbeat.map_or(0, |heartbeat| heartbeat.error_code());
        let refused = self.state.refused.map_or(0, |(code, _)| code);
        let faults = [told, lowest_bit(self.state.errors.0), refused];
        let reason = code_from(DISARMED, self.state.errors.1);
        let (error, error_code) = match (faults.into_iter().find(|code| *code > 0), reason) {
            (Some(fault), _) => (Some(Severity::Fault), fault),
            (None, 0) => (None, 0),
            (None, reason) => (Some(Severity::Warning), reason),
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
    /// Moves the time on. A heartbeat beyond the limit of age is discarded.
    fn wait(&mut self, time_s: f32) {
        self.state.silence_s += time_s;
        self.state.heartbeat = self.state.heartbeat.filter(|_| self.state.silence_s <= HEARTBEAT_S);
    }

    /// Counts a frame of rest, and tells whether estimates are to be asked for instead.
    fn asks(&mut self) -> bool {
        self.state.rests = (self.state.rests + 1) % POLL_UPDATES;
        self.state.rests == 0
    }

    /// Returns the command for a goal, within the velocity limit. A drive follows no impedance, so that goal is a torque of zero.
    fn follow(&self, goal: Goal, drive: &Feedback) -> CanFrame {
        let limit = self.velocity_limit.as_rad_per_s();
        self.send(match goal {
            Goal::Velocity(velocity) => {
                Command::Velocity(self.turns(velocity.min(limit).max(-limit)), 0.0)
            }
            Goal::Way(way) => Command::Position(drive.turns + self.turns(way), 0.0, 0.0),
            Goal::Torque(nm) => Command::Torque(nm / self.gear),
            Goal::Impedance(_) => Command::Torque(0.0),
        })
    }
}

/// Returns the whole parts of a share.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
fn parts_of(share: f32) -> f32 {
    f32::from((share * PARTS) as u8)
}
