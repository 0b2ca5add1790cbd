//! Motors in MIT mode, whose drives are enabled and disabled by frames and rest by a frame of their own.

use super::*;
use drivetrain::motor::AngleDrive;
use drivetrain::units::Angle;
use drivetrain::wire::mit;

#[path = "../mit_motor/mod.rs"]
mod mit_motor;
use mit_motor::J4310;

type Drive = fn(&mut Actuator<J4310>, f32) -> Result<(), TargetError>;

/// Two motors whose drives always say that they are enabled.
struct Pair {
    motors: [Actuator<J4310>; 2],
    /// The ids of their answers: each its own, or one for both.
    masters: [u16; 2],
    drive: Drive,
}

impl Pair {
    fn new(masters: [u16; 2], drive: Drive) -> Self {
        let [first, second] = masters;
        let motors = [(1, first), (2, second)]
            .map(|(id, master)| Actuator::new(J4310::new(id, master).unwrap()));
        Self { motors, masters, drive }
    }

    fn answer(&self, motor: usize, status: u8) -> Option<CanFrame> {
        let number = u8::try_from(motor).ok()? + 1;
        let data = [status << 4 | number, 0x7F, 0xFF, 0x7F, 0xF7, 0xFF, 30, 30];
        Some(CanFrame::of(id(*self.masters.get(motor)?), data))
    }
}

impl Subject for Pair {
    type Device = [Actuator<J4310>; 2];
    fn device(&mut self) -> &mut Self::Device {
        &mut self.motors
    }
    fn motors(&self) -> usize {
        2
    }
    fn feedback(&self, motor: usize) -> Option<CanFrame> {
        self.answer(motor, 1)
    }
    /// An overload.
    fn fault(&self, motor: usize) -> Option<CanFrame> {
        self.answer(motor, 14)
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
        // At d71443a the check took the edges of the second of two that share an id for those of the first.
        for masters in [[0x011, 0x012], [0x010; 2]] {
            assert_eq!(check_contract(|| Pair::new(masters, drive)), Ok(RULES), "{masters:?}");
        }
    }
}
