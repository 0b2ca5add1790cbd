//! The motor as an actuator: its claims, its frames, and their order.

use super::codec::{
    ASK_ENDPOINT, COMMANDS, Command, ENDPOINT, ERRORS, ESTIMATES, Endpoint, HEARTBEAT, endpoint,
    endpoint_value, id, number_of, request, words,
};
use super::config::Phase;
use super::{Endpoints, Feedback, Firmware, Heartbeat, Motor};
use crate::control::PidConfig;
use crate::error::ConfigError;
use crate::frame::CanFrame;
use crate::motor::{
    Capabilities, Capability, Claim, DriveProtocol, Goal, Ingest, MotorName, Order, Told, Vitals,
    WrongSetting, code_from, ingest_eight, lowest_bit,
};
use crate::units::{Angle, AngularVelocity};
use core::f32::consts::TAU;

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

/// The code of the first bit of the reason of a disarmed drive.
const DISARMED: u8 = 129;

/// The frames, 10 ms apart, until a drive must have become idle.
const MOST_FRAMES: u8 = 200;

/// The frames, 10 ms apart, from the request for closed loop until a drive must have followed.
const PATIENCE: u8 = 51;

/// Error codes beside those of a heartbeat: a drive that does not become idle; and a refused request, with the
/// procedure result added.
const NOT_IDLE: u8 = 63;
const REFUSED: u8 = 64;

impl DriveProtocol for Motor {
    fn name(&self) -> MotorName {
        MotorName::new(self.model.name(), self.node)
    }

    fn claims(&self) -> impl IntoIterator<Item = Claim> {
        let (node, name, has_endpoints) = (self.node, self.name(), self.endpoints.is_some());
        let feedback = move |number: &u8| Claim::feedback(id(node, *number), name);
        let command = move |number: &u8| Claim::command(id(node, *number), name);
        let sent = COMMANDS.iter().filter(move |number| has_endpoints || **number != ASK_ENDPOINT);
        let (heard, _) = self.firmware.facts();
        heard.iter().map(feedback).chain(sent.map(command))
    }

    fn decode(&mut self, frame: &CanFrame) -> Ingest {
        ingest_eight(frame, |data| {
            let drive = Feedback::decode(data).filter(|_| number_of(frame) == ESTIMATES)?;
            (self.state.drive, self.state.age_s, self.state.rests) = (Some(drive), 0.0, 0);
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
        if !self.state.stops && self.asks() {
            return request(self.node, ESTIMATES);
        }
        let rest =
            if self.mode.control.is_impedance() { Command::Torque(0.0) } else { Command::IDLE };
        self.send(if self.state.stops { Command::Stop } else { rest })
    }

    fn control(&mut self, order: Order) -> CanFrame {
        self.wait(order.step.dt_s());
        let follows = self.axis() == Some(Heartbeat::CLOSED_LOOP) && !self.state.stops;
        let Some(drive) = self.state.drive.filter(|_| follows) else { return self.rest() };
        (self.state.rests, self.state.clears) = (0, 0);
        self.state.has_polled = self.state.age_s > POLL_S && !self.state.has_polled;
        if self.state.has_polled {
            return request(self.node, ESTIMATES);
        }
        let share = if self.mode.control.is_impedance() { 1.0 } else { order.share };
        if let Some(share) = self.state.limits.due(share, Told::COARSE, LIMITS_EACH) {
            return self.limits_of(share);
        }
        // In position mode firmware 0.5 would take the angle of the shaft for its target.
        if self.state.limits.since() == LIMITS_EACH / 2 && !self.mode.control.is_angle() {
            return self.modes();
        }
        let shaft = (self.angle(), self.velocity());
        match self.mode.control.goal(order, || shaft, f32::MAX) {
            Some(goal) => self.follow(goal, &drive),
            None => self.rest(),
        }
    }

    fn reset(&mut self) {
        self.mode.control.reset();
    }

    fn set_loops(&mut self, position: PidConfig, speed: PidConfig) -> Result<(), ConfigError> {
        self.mode.control.set_loops(position, speed)
    }

    fn enable(&mut self, sent: u8) -> Option<CanFrame> {
        Some(if self.state.stops { self.send(Command::IDLE) } else { self.starting(sent) })
    }

    fn disable(&mut self) -> Option<CanFrame> {
        (self.state.phase, self.state.rests) = (Phase::Off, 0);
        self.state.refused.1 = self.state.refused.1.saturating_sub(1);
        self.mode.control.is_impedance().then(|| self.send(Command::IDLE))
    }

    fn poll(&mut self) -> Option<CanFrame> {
        let goal = self.mode.control.stay(self.velocity().as_rad_per_s());
        let drive = self.state.drive.filter(|_| !self.asks());
        let stay = drive.map(|drive| self.follow(goal, &drive));
        Some(stay.unwrap_or_else(|| request(self.node, ESTIMATES)))
    }

    /// Unsent limits come before the next command.
    fn unsent(&mut self, frame: &CanFrame) {
        if *frame == self.limits_of(self.state.limits.share()) {
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
        if self.state.clears > 0 {
            self.state.clears -= 1;
            return Some(self.send(Command::ClearErrors));
        }
        let is_silent = self.state.silence_s > INQUIRY_S;
        if self.settings.has_missed() && !is_silent {
            let asked = self.settings.inquire_missed().and_then(|asked| endpoint(self.node, asked));
            return Some(asked.unwrap_or_else(|| self.modes()));
        }
        let number = if is_silent { HEARTBEAT } else { ERRORS };
        (self.firmware == Firmware::V0_6).then(|| request(self.node, number))
    }

    /// Heartbeats are answers too: a heartbeat has no value of the shaft.
    fn decode_answer(&mut self, frame: &CanFrame) -> bool {
        let data = frame.bytes();
        match (number_of(frame), frame.length()) {
            (HEARTBEAT, 8) => {
                let Some(heartbeat) = Heartbeat::decode(data, self.firmware) else { return false };
                let (_, stopped) = self.firmware.facts();
                self.state.stops &= heartbeat.axis_error & stopped == 0;
                (self.state.heartbeat, self.state.silence_s) = (Some(heartbeat), 0.0);
            }
            (ERRORS, 8) => self.state.errors = words(data),
            (ENDPOINT, length) => self.settings.hear(|asked| endpoint_value(data, length, asked)),
            _ => return false,
        }
        true
    }

    /// An axis in calibration or in an unknown state is not armed, nor a drive that did not confirm an endpoint.
    fn wrong_setting(&self) -> Option<WrongSetting> {
        let (motor, names) = (self.name(), Endpoints::NAMES);
        let name = |(_, _, place): Endpoint| names.get(usize::from(place)).copied();
        let name = |endpoint| name(endpoint).unwrap_or_default();
        let missed = self.settings.wrong_setting(motor, |_, _| true, name, |_| f32::NAN);
        let is_known = matches!(self.axis(), Some(Heartbeat::IDLE | Heartbeat::CLOSED_LOOP));
        let is_wrong = self.state.phase == Phase::Off && !is_known;
        let (expected, found) = (Heartbeat::IDLE.into(), self.axis().map(f32::from));
        let of_axis = || WrongSetting::new(motor, "axis state", expected, found);
        missed.or_else(|| is_wrong.then(of_axis))
    }

    fn forget_settings(&mut self) {
        self.state.heartbeat.take_if(|_| self.state.phase == Phase::Off);
        self.settings.forget();
    }

    fn frames_per_answer(&self) -> u32 {
        2
    }

    fn capabilities(&self) -> Capabilities {
        self.mode.control.capabilities().with(Capability::ErrorCodes)
    }

    #[inline]
    fn vitals(&self) -> Vitals {
        let told = self.state.heartbeat.map_or(0, |heartbeat| heartbeat.error_code());
        let (active, reason) = self.state.errors;
        let (refused, left) = self.state.refused;
        let faults = [told, lowest_bit(active), refused * u8::from(left > 0)];
        Vitals {
            effort: self.mode.control.effort(),
            speed: self.velocity().as_rad_per_s() / self.mode.control.most_velocity(),
            ..Vitals::of_errors(faults, code_from(DISARMED, reason))
        }
    }
}

impl Motor {
    /// Moves the ages on. A heartbeat beyond the limit of age is discarded.
    fn wait(&mut self, time_s: f32) {
        self.state.age_s += time_s;
        self.state.silence_s += time_s;
        self.state.heartbeat = self.state.heartbeat.filter(|_| self.state.silence_s <= HEARTBEAT_S);
    }

    /// Counts a frame of rest, and tells whether estimates are to be asked for instead.
    fn asks(&mut self) -> bool {
        self.state.rests = (self.state.rests + 1) % POLL_UPDATES;
        self.state.rests == 0
    }

    /// Returns the command for a goal. A drive follows no impedance, so that goal is a torque of zero.
    fn follow(&self, goal: Goal, drive: &Feedback) -> CanFrame {
        self.send(match goal {
            Goal::Velocity(velocity) => Command::Velocity(self.turns(velocity), 0.0),
            Goal::Way(way) => Command::Position(drive.turns + self.turns(way), 0.0, 0.0),
            Goal::Torque(nm) => Command::Torque(nm / self.gear),
            Goal::Impedance(_) => Command::Torque(0.0),
        })
    }

    pub(super) fn send(&self, command: Command) -> CanFrame {
        command.frame(self.node)
    }

    /// Returns the turns of the motor for radians of the output shaft.
    pub(super) fn turns(&self, radians: f32) -> f32 {
        radians * self.gear / TAU
    }

    /// Returns the limits for a share of the torque, above zero.
    pub(super) fn limits_of(&self, share: f32) -> CanFrame {
        let limit_nm = self.mode.control.torque_limit_nm().unwrap_or(0.0);
        let torque_nm = limit_nm * share.max(1.0 / Told::COARSE) / self.gear.abs();
        self.send(Command::Limits(self.most_turns(), torque_nm / self.model.torque_constant()))
    }

    /// Returns the velocity limit in turns/s of the motor.
    fn most_turns(&self) -> f32 {
        self.turns(self.mode.control.most_velocity()).abs()
    }

    /// Sets control mode and input mode.
    pub(super) fn modes(&self) -> CanFrame {
        self.send(Command::ControllerMode(self.mode.control.number.into(), self.mode.input.into()))
    }

    /// Returns the state of the axis; `None` if unknown.
    pub(super) fn axis(&self) -> Option<u8> {
        self.state.heartbeat.map(|heartbeat| heartbeat.state)
    }

    /// Returns a frame on the way to closed loop by its number, so that a frame given back by the bus comes again: the frames without an
    /// answer in their order, then a question, at last the request.
    pub(super) fn starting(&mut self, sent: u8) -> CanFrame {
        let first = match self.state.phase {
            Phase::Requested(first) => return self.requested(sent.saturating_sub(first)),
            _ if sent >= MOST_FRAMES => return self.refuse(NOT_IDLE),
            Phase::Starting(first) => first,
            Phase::Off => sent,
        };
        if self.axis() != Some(Heartbeat::IDLE) {
            self.state.phase = Phase::Starting(sent + 1);
            return self.send(Command::IDLE);
        }
        self.state.phase = Phase::Starting(first);
        let trajectory = self.mode.acceleration.map(|limit| self.turns(limit).abs());
        let frames = [
            Some(self.modes()),
            Some(self.limits_of(0.0)),
            trajectory.map(|_| self.send(Command::TrajectoryVelocity(self.most_turns()))),
            trajectory.map(|limit| self.send(Command::TrajectoryAcceleration(limit, limit))),
        ];
        if let Some(frame) = frames.into_iter().flatten().nth(sent.saturating_sub(first).into()) {
            self.settings.forget();
            return frame;
        }
        let asked = self.settings.prepare(sent, self.endpoints.into_iter().flatten());
        asked.and_then(|asked| endpoint(self.node, asked)).unwrap_or_else(|| {
            (self.state.phase, self.state.limits) = (Phase::Requested(sent), Told::ZERO);
            self.requested(0)
        })
    }

    /// Requests closed loop, once, and waits for a heartbeat: a second request would leave closed loop and begin anew. Modes and
    /// limits are repeated: the drive may have missed both.
    fn requested(&mut self, frames: u8) -> CanFrame {
        match frames {
            0 => self.send(Command::AxisState(Heartbeat::CLOSED_LOOP.into())),
            1 => self.modes(),
            2 => self.limits_of(0.0),
            PATIENCE.. => {
                let result = self.state.heartbeat.map_or(0, |heartbeat| heartbeat.procedure_result);
                self.refuse(REFUSED + result.min(63))
            }
            // In 0.5 a heartbeat comes only by itself.
            _ if self.firmware == Firmware::V0_5 => request(self.node, ESTIMATES),
            _ => request(self.node, HEARTBEAT),
        }
    }

    fn refuse(&mut self, code: u8) -> CanFrame {
        self.state.refused = (code, 4);
        self.state.phase = Phase::Off;
        self.send(Command::IDLE)
    }
}
