//! A joint of a snake.

use super::*;
use drivetrain::encoder::Position;
use drivetrain::motor::{CanDevice, Devices};
use drivetrain::snake::{self, Command, Joint, Joints, Register};
use drivetrain::time::Duration;
use drivetrain::units::Angle;
use embedded_can::Frame;

pub(crate) struct Snake(Joints, Joint);

impl Snake {
    pub(crate) fn new(_: Setup) -> Self {
        let mut joints = Joints::new();
        let config = snake::Config::new(5).with_stall(Duration::from_secs(1), Reaction::Ignore);
        let joint = joints.attach(config).unwrap();
        Self(joints, joint)
    }
}

impl Subject<1> for Snake {
    const RULES: [Rules; 1] = [Rules {
        late_us: Some(40_000),
        room: 48,
        loses_zero: true,
        opens: Opens::Never,
        rivals: Rivals::Reported,
        ..OWN
    }];

    stops!(self => self.0);

    fn hear(&mut self, now: Instant) {
        let id = embedded_can::StandardId::new(5).unwrap();
        let reply = Register::ActualPosition.reply(0);
        _ = self.0.ingest(&CanFrame::new(id, &reply).unwrap(), now);
    }
    fn link(&self) -> [Link; 1] {
        [self.0.link(self.1).unwrap()]
    }
    fn is_armed(&self) -> [bool; 1] {
        [self.0.is_joint_armed(self.1)]
    }
    fn set(&mut self, value: f32) -> [Result<(), TargetError>; 1] {
        [self.0.set_position(self.1, Position::from_angle(Angle::from_degrees(5.0 * value)))]
    }
    fn relax(&mut self) -> [bool; 1] {
        self.0.relax(self.1);
        [true]
    }
    fn outputs(&mut self, tick: Tick) -> [f64; 1] {
        self.0.update(tick);
        let is_safe =
            |frame: &CanFrame| Command::decode(frame.data()).is_some_and(Command::is_safe);
        let unsafe_frames =
            core::iter::from_fn(|| self.0.next_frame()).filter(|frame| !is_safe(frame));
        let asks = unsafe_frames.count() > 0;
        let is_driven = asks || self.0.state(self.1).is_some_and(|state| state.is_driven);
        [f64::from(u8::from(is_driven))]
    }
    fn conditions(&self) -> [Conditions; 1] {
        [self.0.conditions(self.1)]
    }
    fn next_edge(&mut self) -> Option<(usize, Edge<Condition, MotorName>)> {
        self.0.next_edge().map(|edge| (0, edge))
    }
    fn command(&self, _: usize) -> Option<CanFrame> {
        let id = embedded_can::StandardId::new(5).unwrap();
        CanFrame::new(id, &[1, 0x0A, 0, 0, 1, 0])
    }
    fn second_master(&self) -> [Option<Claim>; 1] {
        [CanDevice::second_master(&self.0)]
    }
    fn counted(&self) -> Option<u32> {
        Some(self.0.counters().foreign_commands)
    }
}
