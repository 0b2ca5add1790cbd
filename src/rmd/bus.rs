//! The motor as an actuator: its claims, its frames, and their order.

use super::config::{Enabling, Track};
use super::model::AMPERES_PER_COUNT;
use super::{Command, Feedback, Motor, State};
use crate::control::PidConfig;
use crate::error::ConfigError;
use crate::frame::CanFrame;
use crate::lk::bus::{SILENT, whole};
use crate::lk::codec::{id_of, is_command};
use crate::lk::model::RAD_PER_DEGREE;
use crate::motor::{
    Capabilities, Capability, Claim, DriveProtocol, Goal, Ingest, MotorName, Order, Questions,
    Shaft, Vitals, WrongSetting, lowest_bit,
};
use crate::units::{Angle, AngularVelocity};

/// The ids of commands and of answers, without the id of the drive.
const IDS: (u16, u16) = (0x140, 0x240);

/// The places of the question for the angle among 32 commands.
const ANGLES: [u8; 2] = [8, 24];

/// Writes of the time-out until the drive counts as one without this setting: the memory of the drive wears.
const WRITES: u8 = 8;

/// The first byte of the report of an expired time-out.
const EXPIRED: u8 = 0xF1;

impl Motor {
    fn frame_of(&self, command: Command) -> CanFrame {
        CanFrame::of(id_of(IDS.0, self.id), command.encode())
    }

    /// Returns the command for a goal with a limit; `None` if the protocol has no such command.
    fn command(&self, goal: Goal, limit: u16) -> Option<Command> {
        let counts = 100.0 / RAD_PER_DEGREE;
        match goal {
            Goal::Torque(torque_nm) => {
                let counts = torque_nm / self.model.scale().torque_per_count;
                Some(Command::Torque(i16::try_from(whole(counts)).ok()?))
            }
            Goal::Velocity(velocity) => Some(Command::Velocity(whole(velocity * counts))),
            Goal::Way(way) => {
                let angle =
                    self.track?.counts(self.drive?.angle_deg) + i64::from(whole(way * counts));
                Some(Command::Position(i32::try_from(angle).ok()?, limit))
            }
            Goal::Impedance(_) => None,
        }
    }

    /// The frame that has to be answered before the drive may be driven: a torque does not release the holding brake, and a
    /// position counts from the angle.
    const fn preparation(&self) -> Option<Command> {
        match self.mode.0.number {
            0xA1 => Some(Command::ReleaseBrake),
            0xA4 => Some(Command::ReadAngle),
            _ => None,
        }
    }

    fn has_timeout(&self) -> bool {
        self.timeout.is_none() || self.timeout == self.timeout_found
    }

    /// The drive no longer follows, until it is enabled anew.
    fn doubt(&mut self) {
        self.enabling = Enabling::default();
    }

    /// Takes the answer to the question for the angle; an answer of 0 elsewhere is a question that is sent back. A drive whose angle
    /// differs from the last by more than half a turn has begun to count anew.
    fn take_angle(&mut self, angle: i32) {
        let Some(drive) = self.drive else { return };
        if angle == 0 && drive.angle_deg.unsigned_abs() > 2 {
            self.doubt();
            return;
        }
        if self.has_angle
            && self.track.is_some_and(|track| track.is_far_from(angle, drive.angle_deg))
        {
            self.doubt();
        } else {
            self.enabling.is_prepared |= self.mode.0.is_angle();
        }
        self.track = Some(Track::new(angle, drive.angle_deg));
        (self.has_angle, self.silent) = (true, 0);
    }
}

impl DriveProtocol for Motor {
    fn name(&self) -> MotorName {
        MotorName::new(self.model.name(), self.id)
    }

    fn claims(&self) -> impl IntoIterator<Item = Claim> {
        let (command, feedback) = (id_of(IDS.0, self.id), id_of(IDS.1, self.id));
        [Claim::command(command, self.name()), Claim::feedback(feedback, self.name())]
    }

    fn decode(&mut self, frame: &CanFrame) -> Ingest {
        if frame.length() != 8 {
            return Ingest::WrongLength(frame.length());
        }
        let data = frame.bytes();
        let is_answer = [0x9C, 0xA1, self.mode.0.number].contains(&data[0]);
        if !is_answer || is_command(data, || self.mode.limit(1.0, &self.model.scale())) {
            return Ingest::Unrelated;
        }
        let Some(feedback) = Feedback::decode(data) else { return Ingest::Unrelated };
        self.drive = Some(feedback);
        self.enabling.is_heard = true;
        // An angle alone ends a silence that was long.
        self.silent = if self.silent < SILENT { 0 } else { SILENT };
        Ingest::Taken
    }

    fn velocity(&self) -> AngularVelocity {
        shaft(self.drive.as_ref(), self.track.as_ref()).1
    }

    fn angle(&self) -> Option<Angle> {
        shaft(self.drive.as_ref(), self.track.as_ref()).0
    }

    fn rest(&mut self) -> CanFrame {
        self.last = Command::REST;
        self.frame_of(self.last)
    }

    /// Some commands give way to questions: the drive goes on with the command before. A new command goes first. After a silence
    /// nothing counts from the angle until the angle has been read again.
    fn control(&mut self, order: Order) -> CanFrame {
        self.resets = false;
        if let (Some(track), Some(drive)) = (&mut self.track, &self.drive) {
            let way = 100.0 * f32::from(drive.velocity_dps) * order.step.dt_s();
            track.advance(way, drive.angle_deg);
        }
        let (drive, track, scale) = (self.drive.as_ref(), self.track.as_ref(), self.model.scale());
        let goal = self.mode.0.goal(order, || shaft(drive, track), scale.max_velocity);
        let limit = self.mode.limit(order.share, &scale);
        self.last = goal.and_then(|goal| self.command(goal, limit)).unwrap_or(Command::REST);
        self.silent = self.silent.saturating_add(self.mode.0.is_angle().into());
        if self.silent > SILENT {
            return self.frame_of(Command::ReadAngle);
        }
        let next = self.questions.next(self.last, |place| match place {
            0 => Some(Command::ReadState),
            place => ANGLES.contains(&place).then_some(Command::ReadAngle),
        });
        self.frame_of(next)
    }

    fn reset(&mut self) {
        self.mode.0.reset();
        (self.questions, self.silent) = (Questions::new(Command::REST), 0);
    }

    fn set_loops(&mut self, position: PidConfig, speed: PidConfig) -> Result<(), ConfigError> {
        self.mode.0.set_loops(position, speed)
    }

    /// Sends the question for the state, the time-out unless confirmed, and the preparation of the mode.
    fn enable(&mut self, sent: u8) -> Option<CanFrame> {
        if sent == 0 {
            self.doubt();
        }
        self.enabling.is_wanted = true;
        let timeout = self.timeout.filter(|_| !self.has_timeout() && self.writes < WRITES);
        let command = match (timeout, self.preparation()) {
            _ if !self.enabling.is_sound => Command::ReadState,
            (Some(ms), _) => {
                self.writes += 1;
                Command::SetTimeout(ms)
            }
            (None, Some(command)) if !self.enabling.is_prepared => {
                self.is_open |= command == Command::ReleaseBrake;
                command
            }
            _ => Command::ReadState,
        };
        Some(self.frame_of(command))
    }

    /// Switches the drive off; the frame counts as followed. A requested reset goes out afterwards, and so does the lock of a
    /// released brake.
    fn disable(&mut self) -> Option<CanFrame> {
        let command = match self.enabling.is_off {
            true if core::mem::take(&mut self.resets) => Command::Reset,
            true if self.is_open => Command::LockBrake,
            _ => Command::Off,
        };
        self.doubt();
        Some(self.frame_of(command))
    }

    /// An unsent reset or time-out is sent again.
    fn unsent(&mut self, frame: &CanFrame) {
        let command = *frame.bytes();
        self.resets |= command == Command::Reset.encode();
        let timeout = self.timeout.map(|ms| Command::SetTimeout(ms).encode());
        self.writes -= u8::from(self.writes > 0 && timeout == Some(command));
        self.questions.unsent();
    }

    fn is_enabled(&self) -> Option<bool> {
        Some(self.enabling.is_on)
    }

    fn inquire(&mut self) -> Option<CanFrame> {
        if !self.enabling.is_heard {
            return None;
        }
        self.asks_angle = !self.asks_angle;
        let question = if self.asks_angle { Command::ReadAngle } else { Command::ReadState };
        Some(self.frame_of(question))
    }

    fn decode_answer(&mut self, frame: &CanFrame) -> bool {
        let data = frame.bytes();
        let [code, _, _, _, a, b, c, d] = *data;
        if frame.length() != 8 && code != EXPIRED {
            return false;
        }
        match code {
            EXPIRED => self.doubt(),
            0x9A => match State::decode(data) {
                Some(state) => (self.state, self.enabling.is_sound) = (Some(state), true),
                None => self.doubt(),
            },
            0x92 => {
                Feedback::decode_angle(data).into_iter().for_each(|angle| self.take_angle(angle))
            }
            0x77 => self.enabling.is_prepared |= self.mode.0.number == 0xA1,
            0xB3 => self.timeout_found = Some(u32::from_le_bytes([a, b, c, d])),
            0x78 => self.is_open = false,
            0x80 => self.enabling.is_off = !self.enabling.is_wanted,
            // The first frame after the time-out of the drive is sent back, and not followed.
            _ if *data == self.last.encode() => self.doubt(),
            _ => return false,
        }
        self.enabling.confirm(self.preparation().is_some(), self.has_timeout());
        true
    }

    fn wrong_setting(&self) -> Option<WrongSetting> {
        let wrong = |setting, expected, found| {
            Some(WrongSetting::new(self.name(), setting, expected, found))
        };
        match (self.timeout, self.timeout_found) {
            _ if self.state.is_none() => wrong("errorState", 0.0, None),
            _ if !self.has_angle => wrong("motorAngle", 0.0, None),
            (Some(expected), found)
                if found.map_or(self.writes >= WRITES, |found| found != expected) =>
            {
                let found = found.unwrap_or(0) as f32;
                wrong("CanRecvTime_MS", expected as f32, Some(found))
            }
            _ => None,
        }
    }

    fn forget_settings(&mut self) {
        (self.state, self.has_angle) = (None, false);
        (self.timeout_found, self.writes) = (None, 0);
        self.enabling.is_heard = false;
    }

    fn frames_per_answer(&self) -> u32 {
        1
    }

    fn capabilities(&self) -> Capabilities {
        let capabilities = self.mode.0.capabilities().with(Capability::Temperature);
        capabilities.with(Capability::ErrorCodes)
    }

    #[inline]
    fn vitals(&self) -> Vitals {
        let Some(drive) = self.drive else { return Vitals::default() };
        let (errors, supply_v) =
            self.state.map_or((0, 0.0), |state| (state.errors, state.supply_v));
        let current = f32::from(drive.current) * AMPERES_PER_COUNT;
        // Of an estimated speed without load.
        let speed = self.velocity().as_rad_per_s() * self.model.torque_constant();
        Vitals {
            temperature_c: Some(drive.temperature_c.into()),
            effort: self.mode.0.effort(),
            speed: if supply_v > 0.0 { speed / supply_v } else { 0.0 },
            current: current / self.model.max_current_a(),
            ..Vitals::of_errors([lowest_bit(errors.into())], 0)
        }
    }
}

/// Returns angle and velocity of the output shaft; its turns count from the zero of the drive.
#[inline]
fn shaft(drive: Option<&Feedback>, track: Option<&Track>) -> Shaft {
    let Some(drive) = drive else { return (None, AngularVelocity::ZERO) };
    let angle = track.map(|track| Angle::from_turns(track.turns(drive.angle_deg)));
    let velocity = f32::from(drive.velocity_dps) * RAD_PER_DEGREE;
    (angle, AngularVelocity::from_rad_per_s(velocity))
}
