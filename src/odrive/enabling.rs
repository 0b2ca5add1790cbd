//! How a drive is brought into closed loop, step by step.

use super::command::{Command, ESTIMATES, HEARTBEAT, endpoint, request};
use super::config::{Endpoints, Setting};
use super::{Firmware, Heartbeat, Motor};
use crate::frame::CanFrame;
use crate::motor::Inquiry;
use core::f32::consts::TAU;

/// The calls, 10 ms apart, that a drive has to follow a request for closed loop.
const PATIENCE: u8 = 50;

/// The parts in which the share of the torque limit is counted.
pub(super) const PARTS: u8 = 16;

/// Error codes beside those of a heartbeat: settings that the drive did not take; and a request that it refused, to which the
/// procedure result is added.
pub(super) const NOT_SET: u8 = 63;
const REFUSED: u8 = 64;

/// How far the drive has been enabled.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Phase {
    Off,
    /// The frame whose turn it is.
    Starting(u8),
    /// Closed loop was requested, so many calls ago.
    Requested(u8),
}

/// Frames that several steps send.
impl Motor {
    pub(super) fn send(&self, command: Command) -> CanFrame {
        command.frame(self.node)
    }

    /// Returns the turns of the motor for radians of the output shaft.
    pub(super) fn turns(&self, radians: f32) -> f32 {
        radians * self.gear / TAU
    }

    /// Returns the limits for a share of the torque: never less than one part.
    pub(super) fn limits_of(&self, parts: u8) -> CanFrame {
        let share = f32::from(parts.max(1)) / f32::from(PARTS);
        let torque_nm = self.mode.torque_limit_nm() * share / self.gear.abs();
        let velocity = self.turns(self.velocity_limit.as_rad_per_s()).abs();
        self.send(Command::Limits(velocity, torque_nm / self.model.torque_constant()))
    }

    /// Sets control mode and input mode.
    pub(super) fn modes(&self) -> CanFrame {
        let (control, input) = (self.mode.number(), self.mode.input());
        self.send(Command::ControllerMode(control.into(), input.into()))
    }

    pub(super) fn idle(&self) -> CanFrame {
        self.send(Command::AxisState(Heartbeat::IDLE.into()))
    }

    pub(super) fn state(&self) -> Option<u8> {
        self.heartbeat.map(|heartbeat| heartbeat.state)
    }
}

/// How the drive is enabled.
impl Motor {
    /// Returns the next frame on the way to closed loop.
    pub(super) fn starting(&mut self) -> CanFrame {
        let turn = match self.phase {
            Phase::Off => 0,
            Phase::Starting(turn) => turn,
            Phase::Requested(calls) => return self.requested(calls),
        };
        self.phase = Phase::Starting(turn);
        if self.state() != Some(Heartbeat::IDLE) {
            return self.idle();
        }
        self.phase = Phase::Starting(turn.saturating_add(1));
        match (turn, self.endpoints) {
            (0, _) => self.modes(),
            (1, _) => {
                self.limits = (1, 0);
                self.limits_of(1)
            }
            (2, _) if self.mode.acceleration().is_some() => {
                let limit = self.turns(self.velocity_limit.as_rad_per_s()).abs();
                self.send(Command::TrajectoryVelocity(limit))
            }
            (3, _) if self.mode.acceleration().is_some() => {
                let limit = self.turns(self.mode.acceleration().unwrap_or(0.0)).abs();
                self.send(Command::TrajectoryAcceleration(limit, limit))
            }
            (..=4, Some((endpoints, _))) => {
                self.phase = Phase::Starting(5);
                self.write(&endpoints, Setting::WatchdogTimeout)
            }
            (5, Some((endpoints, _))) => {
                self.settings.forget();
                self.write(&endpoints, Setting::EnableWatchdog)
            }
            (_, Some((endpoints, _))) => self.verified(&endpoints),
            _ => self.request_closed_loop(),
        }
    }

    fn write(&self, endpoints: &Endpoints, setting: Setting) -> CanFrame {
        let (length, bytes) = setting.bytes(self.expected(setting));
        endpoint(self.node, setting.number(endpoints), Some(&bytes), length)
    }

    /// Reads what is not known of the settings. When all are right, requests closed loop.
    fn verified(&mut self, endpoints: &Endpoints) -> CanFrame {
        if let Some(Inquiry::Read(setting)) = self.settings.complete() {
            return endpoint(self.node, setting.number(endpoints), None, 0);
        }
        let is_right = |setting, found: f32| found.to_bits() == self.expected(setting).to_bits();
        match self.settings.wrong(is_right) {
            Some(_) => self.refuse(NOT_SET),
            None => self.request_closed_loop(),
        }
    }

    fn request_closed_loop(&mut self) -> CanFrame {
        self.phase = Phase::Requested(0);
        self.send(Command::AxisState(Heartbeat::CLOSED_LOOP.into()))
    }

    /// Waits for a heartbeat. A second request would leave closed loop and begin it anew, so none is sent. Modes and limits are: the drive
    /// may have missed them.
    fn requested(&mut self, calls: u8) -> CanFrame {
        if calls >= PATIENCE {
            let result = self.heartbeat.map_or(0, |heartbeat| heartbeat.procedure_result);
            return self.refuse(REFUSED + result.min(63));
        }
        self.phase = Phase::Requested(calls + 1);
        match calls {
            0 => self.modes(),
            1 => self.limits_of(1),
            _ => self.ask_for_state(),
        }
    }

    /// Asks for a heartbeat; in 0.5 it comes only by itself.
    pub(super) fn ask_for_state(&self) -> CanFrame {
        request(self.node, if self.firmware == Firmware::V0_6 { HEARTBEAT } else { ESTIMATES })
    }

    /// Returns the value that a setting has to have.
    fn expected(&self, setting: Setting) -> f32 {
        match setting {
            Setting::ControlMode => self.mode.number().into(),
            Setting::InputMode => self.mode.input().into(),
            Setting::WatchdogTimeout => self.endpoints.map_or(0.0, |(_, watchdog)| watchdog),
            Setting::EnableWatchdog => 1.0,
        }
    }

    pub(super) fn refuse(&mut self, code: u8) -> CanFrame {
        self.refused = Some((code, 3));
        self.phase = Phase::Off;
        self.idle()
    }
}
