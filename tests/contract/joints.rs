//! Joints that hold a position loop of their own.

use super::*;
use drivetrain::encoder::Position;
use drivetrain::motor::Claim;
use drivetrain::snake::{Command, Config as JointConfig, Joint, Joints, Register};
use drivetrain::units::Angle;

/// Joints that answer what they are asked.
struct Snake(Joints, Vec<Joint>);

impl Snake {
    fn new(ids: impl IntoIterator<Item = u8>, config: fn(JointConfig) -> JointConfig) -> Self {
        let mut joints = Joints::new();
        let ids = ids.into_iter();
        let handles = ids.map(|id| joints.attach(config(JointConfig::new(id))).unwrap()).collect();
        Self(joints, handles)
    }
}

impl Subject for Snake {
    type Device = Joints;
    fn device(&mut self) -> &mut Joints {
        &mut self.0
    }
    fn motors(&self) -> usize {
        self.1.len()
    }
    fn feedback(&self, motor: usize) -> Option<CanFrame> {
        let (joint, name) = self.0.joints().nth(motor)?;
        let register = self.0.awaited(joint).unwrap_or(Register::ActualPosition);
        let value = i32::from(register == Register::Enable);
        CanFrame::new(id(u16::from(name.id())), &register.reply(value))
    }
    fn drive(&mut self, share: f32) -> Result<(), TargetError> {
        let position = Position::from_angle(Angle::from_turns(share));
        let outcomes = self.1.iter().map(|joint| self.0.set_position(*joint, position));
        outcomes.fold(Ok(()), Result::and)
    }
    fn is_zero(&self, command: &CanFrame) -> bool {
        Command::decode(command.data()).is_some_and(Command::is_safe)
    }
    fn rival(&self, command: &Claim) -> Option<CanFrame> {
        Command::Read(Register::ActualPosition).frame(command.motor().id())
    }
    fn late_ms(&self) -> u64 {
        41
    }
    /// A joint that owes an answer is left alone for 2 ms.
    fn stop_ms(&self) -> u64 {
        3
    }
}

#[test]
fn joints_with_a_position_loop_of_their_own_keep_the_contract() {
    assert_eq!(check_contract(|| Snake::new(1..=12, |config| config)), Ok(RULES));
    assert_eq!(check_contract(|| Snake::new([3, 7], JointConfig::reversed)), Ok(RULES));
    assert_eq!(check_contract(|| Snake::new([12], |config| config)), Ok(RULES));
}
