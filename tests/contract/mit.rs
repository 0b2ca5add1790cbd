//! Motors in MIT mode, whose drives are enabled and disabled by frames and rest by a frame of their own.

use super::*;
use drivetrain::motor::AngleDrive;
use drivetrain::units::Angle;
use drivetrain::wire::mit;

#[expect(dead_code, reason = "the example's own main and simulation")]
#[path = "../../examples/mit_motor.rs"]
mod mit_motor;
use mit_motor::J4310;

type Drive = fn(&mut Own<J4310>, f32) -> Result<(), TargetError>;

/// Two motors whose drives always say that they are enabled.
struct Pair {
    motors: [Own<J4310>; 2],
    drive: Drive,
}

impl Pair {
    fn new(drive: Drive) -> Self {
        Self {
            motors: [1, 2].map(|id| Own::new(J4310::new(id, 0x010 + u16::from(id)).unwrap())),
            drive,
        }
    }

    fn answer(motor: usize, status: u8) -> Option<CanFrame> {
        let number = u8::try_from(motor).ok()? + 1;
        let data = [status << 4 | number, 0x7F, 0xFF, 0x7F, 0xF7, 0xFF, 30, 30];
        Some(CanFrame::of(id(0x010 + u16::from(number)), data))
    }
}

impl Subject for Pair {
    type Device = [Own<J4310>; 2];
    fn device(&mut self) -> &mut Self::Device {
        &mut self.motors
    }
    fn motors(&self) -> usize {
        2
    }
    fn feedback(&self, motor: usize) -> Option<CanFrame> {
        Self::answer(motor, 1)
    }
    /// An overload.
    fn fault(&self, motor: usize) -> Option<CanFrame> {
        Self::answer(motor, 14)
    }
    fn drive(&mut self, share: f32) -> Result<(), TargetError> {
        let outcomes = self.motors.each_mut().map(|motor| (self.drive)(motor, share));
        outcomes.into_iter().collect()
    }
    /// Rest, and what disables the drive or clears its error. A frame that enables it asks for something.
    fn is_zero(&self, command: &CanFrame) -> bool {
        const REST: [u8; 8] = [0x7F, 0xFF, 0x7F, 0xF0, 0x00, 0x00, 0x07, 0xFF];
        const CLEAR: [u8; 8] = [0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFB];
        [REST, CLEAR, mit::DISABLE].contains(command.bytes())
    }
}

#[test]
fn motors_in_mit_mode_keep_the_contract_with_each_kind_of_target() {
    let kinds: [Drive; 3] = [
        |motor, share| motor.set_torque(3.0 * share),
        |motor, share| motor.set_velocity((), velocity(share)),
        |motor, share| motor.set_angle((), Angle::from_turns(0.25 * share)),
    ];
    for drive in kinds {
        assert_eq!(check_contract(|| Pair::new(drive)), Ok(RULES));
    }
}
