//! How a drive is brought into closed loop, step by step.

use super::command::{Command, ESTIMATES, HEARTBEAT, endpoint, request};
use super::{Firmware, Heartbeat, Motor};
use crate::frame::CanFrame;
use crate::motor::{Inquiry, Preparation, Told};
use core::f32::consts::TAU;

/// The calls, 10 ms apart, until a drive must have followed a request for closed loop.
const PATIENCE: u8 = 50;

/// The parts in which the share of the torque limit is counted.
pub(super) const PARTS: f32 = 16.0;

/// Error codes beside those of a heartbeat: settings not taken by the drive; and a refused request, with the
/// procedure result added.
pub(super) const NOT_SET: u8 = 63;
const REFUSED: u8 = 64;

/// How far the drive has been enabled.
#[derive(Debug, Default, Clone, Copy, PartialEq)]
pub(super) enum Phase {
    #[default]
    Off,
    /// The number of the next frame.
    Starting(u8),
    /// Closed loop was requested, so many calls ago.
    Requested(u8),
}

/// Frames of several steps.
impl Motor {
    pub(super) fn send(&self, command: Command) -> CanFrame {
        command.frame(self.node)
    }

    /// Returns the turns of the motor for radians of the output shaft.
    pub(super) fn turns(&self, radians: f32) -> f32 {
        radians * self.gear / TAU
    }

    /// Returns the limits for a share of the torque: at least one part.
    pub(super) fn limits_of(&self, parts: f32) -> CanFrame {
        let limit_nm = self.mode.control.torque_limit_nm().unwrap_or(0.0);
        let torque_nm = limit_nm * parts.max(1.0) / PARTS / self.gear.abs();
        self.send(Command::Limits(self.most_turns(), torque_nm / self.model.torque_constant()))
    }

    /// Returns the velocity limit in turns/s of the motor.
    fn most_turns(&self) -> f32 {
        self.turns(self.velocity_limit.as_rad_per_s()).abs()
    }

    /// Sets control mode and input mode.
    pub(super) fn modes(&self) -> CanFrame {
        self.send(Command::ControllerMode(self.mode.control.number.into(), self.mode.input.into()))
    }

    pub(super) fn idle(&self) -> CanFrame {
        self.send(Command::AxisState(Heartbeat::IDLE.into()))
    }

    /// Returns the state of the axis; `None` if unknown.
    pub(super) fn axis(&self) -> Option<u8> {
        self.state.heartbeat.map(|heartbeat| heartbeat.state)
    }
}

/// How the drive is enabled.
impl Motor {
    /// Returns the next frame on the way to closed loop: the frames without an answer in their order, then a question, at last the
    /// request.
    pub(super) fn starting(&mut self) -> CanFrame {
        let place = match self.state.phase {
            Phase::Off => 0,
            Phase::Starting(place) => place,
            Phase::Requested(calls) => return self.requested(calls),
        };
        self.state.phase = Phase::Starting(place);
        if self.axis() != Some(Heartbeat::IDLE) {
            return self.idle();
        }
        let frame = match (place, self.mode.acceleration) {
            (0, _) => self.modes(),
            (1, _) => self.limits_of(1.0),
            (2, Some(_)) => self.send(Command::TrajectoryVelocity(self.most_turns())),
            (3, Some(limit)) => {
                let limit = self.turns(limit).abs();
                self.send(Command::TrajectoryAcceleration(limit, limit))
            }
            _ => return self.asking(),
        };
        self.state.phase = Phase::Starting(place + 1);
        self.settings.forget();
        frame
    }

    /// Writes the watchdog and reads all settings. When all are right, requests closed loop.
    fn asking(&mut self) -> CanFrame {
        let Some(values) = self.endpoints else { return self.request_closed_loop() };
        let [.., timeout, enable] = values;
        let watchdog = [timeout, enable].map(|(setting, value)| Preparation::exact(setting, value));
        let is_right = |setting, found| values.contains(&(setting, found));
        match self.settings.prepare(0, watchdog) {
            Some(Inquiry::Write(setting, value)) => endpoint(self.node, setting, Some(value)),
            Some(Inquiry::Read(setting)) => endpoint(self.node, setting, None),
            _ if self.settings.wrong(is_right).is_some() => self.refuse(NOT_SET),
            _ => self.request_closed_loop(),
        }
    }

    fn request_closed_loop(&mut self) -> CanFrame {
        self.state.phase = Phase::Requested(0);
        self.state.limits = Told::new(1.0);
        self.send(Command::AxisState(Heartbeat::CLOSED_LOOP.into()))
    }

    /// Waits for a heartbeat. A second request would leave closed loop and begin anew, so the request is sent once. Modes and
    /// limits are repeated: the drive may have missed both.
    fn requested(&mut self, calls: u8) -> CanFrame {
        if calls >= PATIENCE {
            let result = self.state.heartbeat.map_or(0, |heartbeat| heartbeat.procedure_result);
            return self.refuse(REFUSED + result.min(63));
        }
        self.state.phase = Phase::Requested(calls + 1);
        match calls {
            0 => self.modes(),
            1 => self.limits_of(1.0),
            // In 0.5 a heartbeat comes only by itself.
            _ if self.firmware == Firmware::V0_5 => request(self.node, ESTIMATES),
            _ => request(self.node, HEARTBEAT),
        }
    }

    pub(super) fn refuse(&mut self, code: u8) -> CanFrame {
        self.state.refused = Some((code, 3));
        self.state.phase = Phase::Off;
        self.idle()
    }
}
