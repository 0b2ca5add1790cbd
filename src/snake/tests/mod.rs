//! Rules of the joints, driven through their public face.

mod answers;
mod attaching;
mod commanding;
mod conversions;
mod health;
mod polling;
mod receiving;
mod safety;

use super::*;
use crate::encoder::{Homing, Position};
use crate::frame::CanFrame;
use crate::motor::{ArmError, Devices, Ingest, Link, TargetError, Timeouts};
use crate::time::{Duration, Instant, Tick};
use crate::units::{Angle, AngularVelocity};
use embedded_can::{Frame, StandardId};
use std::string::ToString;
use std::vec::Vec;

fn at_ms(ms: u64) -> Instant {
    Instant::START + Duration::from_millis(ms)
}

fn frame(id: u8, data: &[u8]) -> CanFrame {
    CanFrame::new(StandardId::new(u16::from(id)).unwrap(), data).unwrap()
}

fn reply(id: u8, register: Register, value: i32) -> CanFrame {
    frame(id, &register.reply(value))
}

/// Joints with simulated drives: each drive stands at a set place, and answers at once.
struct Bench {
    joints: Joints,
    handles: Vec<Joint>,
    /// By the index of the id.
    raw: [i32; 12],
    enabled: [i32; 12],
    silent: Vec<u8>,
    ms: u64,
}

impl Bench {
    fn new(ids: &[u8]) -> Self {
        Self::of(Joints::new(), ids.iter().map(|id| Config::new(*id)))
    }

    fn of(mut joints: Joints, configs: impl IntoIterator<Item = Config>) -> Self {
        let handles = configs.into_iter().map(|config| joints.attach(config).unwrap()).collect();
        Self { joints, handles, raw: [0; 12], enabled: [0; 12], silent: Vec::new(), ms: 0 }
    }

    /// Some milliseconds; returns all that was sent.
    fn run(&mut self, ms: u64) -> Vec<(u8, Command)> {
        let mut sent = Vec::new();
        for _ in 0..ms {
            self.ms += 1;
            self.joints.update(Tick::new(at_ms(self.ms), 0.001));
            sent.extend(self.take());
        }
        sent
    }

    /// All that waits to be sent.
    fn take(&mut self) -> Vec<(u8, Command)> {
        let mut sent = Vec::new();
        while let Some(frame) = self.joints.next_frame() {
            let id = u8::try_from(frame.header()).unwrap();
            let command = Command::decode(frame.data()).unwrap();
            sent.push((id, command));
            self.answer(id, command);
        }
        sent
    }

    /// Takes frames as a driver with room for so many, and has them answered. The first frame without room comes back, or all of them.
    fn take_some(&mut self, room: usize, all_come_back: bool) -> Vec<(u8, Command)> {
        let mut taken = Vec::new();
        let mut refused = Vec::new();
        while let Some(frame) = self.joints.next_frame() {
            if taken.len() == room {
                refused.push(frame);
                if !all_come_back {
                    break;
                }
                continue;
            }
            let id = u8::try_from(frame.header()).unwrap();
            let command = Command::decode(frame.data()).unwrap();
            self.answer(id, command);
            taken.push((id, command));
        }
        assert!(refused.iter().all(|frame| self.joints.requeue(frame)));
        taken
    }

    /// Joint 1 says something.
    fn hear(&mut self, register: Register, value: i32) {
        self.hear_of(1, register, value);
    }

    fn hear_of(&mut self, id: u8, register: Register, value: i32) {
        let outcome = self.joints.ingest(&reply(id, register, value), at_ms(self.ms));
        assert_eq!(outcome, Ingest::Taken);
    }

    fn answer(&mut self, id: u8, command: Command) {
        let index = usize::from(id - 1);
        match command {
            Command::Write(Register::Enable, value) => self.enabled[index] = value,
            Command::Write(..) => {}
            Command::Read(_) if self.silent.contains(&id) => {}
            Command::Read(register) => {
                let value = match register {
                    Register::ActualPosition => self.raw[index],
                    Register::ActualSpeed => 65_536,
                    Register::Enable => self.enabled[index],
                    _ => 77,
                };
                let outcome = self.joints.ingest(&reply(id, register, value), at_ms(self.ms));
                assert_eq!(outcome, Ingest::Taken);
            }
        }
    }

    /// The same with targets in each millisecond.
    fn drive(&mut self, ms: u64) -> Vec<(u8, Command)> {
        let mut sent = Vec::new();
        for _ in 0..ms {
            for joint in self.handles.clone() {
                _ = self.joints.set_pulses(joint, 1_000);
            }
            sent.extend(self.run(1));
        }
        sent
    }

    fn armed(ids: &[u8]) -> Self {
        Self::new(ids).armed_after(30)
    }

    fn armed_after(mut self, ms: u64) -> Self {
        self.run(ms);
        self.joints.arm(at_ms(self.ms)).unwrap();
        self
    }

    /// Milliseconds in which a joint does not answer.
    fn run_silent(&mut self, id: u8, ms: u64) {
        self.silent = std::vec![id];
        self.run(ms);
        self.silent.clear();
    }

    fn state(&self, joint: usize) -> State {
        self.joints.state(self.handles[joint]).unwrap()
    }
}

const ALL: [u8; 12] = [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12];

fn writes(sent: &[(u8, Command)]) -> Vec<Command> {
    sent.iter().map(|(_, command)| *command).filter(|c| matches!(c, Command::Write(..))).collect()
}
