//! How a drive is brought into closed loop, step by step.

use super::command::{Command, ESTIMATES, HEARTBEAT, endpoint, request};
use super::{Firmware, Heartbeat, Motor};
use crate::frame::CanFrame;
use crate::motor::{Inquiry, Told};
use core::f32::consts::TAU;

/// The frames, 10 ms apart, until a drive must be idle and must have answered all questions.
const MOST_FRAMES: u8 = 200;

/// The frames, 10 ms apart, from the request for closed loop until a drive must have followed.
const PATIENCE: u8 = 51;

/// Error codes beside those of a heartbeat: settings not taken by the drive; and a refused request, with the
/// procedure result added.
const NOT_SET: u8 = 63;
const REFUSED: u8 = 64;

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

/// Frames of several steps, and their order.
impl Motor {
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
            _ if sent >= MOST_FRAMES => return self.refuse(NOT_SET),
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
        match self.settings.prepare(0, self.endpoints.into_iter().flatten()) {
            Some(Inquiry::Write(setting, value)) => endpoint(self.node, setting, Some(value)),
            Some(Inquiry::Read(setting)) => endpoint(self.node, setting, None),
            _ => {
                self.state.phase = Phase::Requested(sent);
                self.state.limits = Told::ZERO;
                self.requested(0)
            }
        }
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
