//! Motors of Damiao in each control mode, with drives that are asked for their registers before they are armed.

use super::*;
use drivetrain::control::PidConfig;
use drivetrain::damiao::{Mode, Model, Motor};
use drivetrain::motor::{AngleDrive, Impedance, ImpedanceControl};
use drivetrain::sim::{DamiaoDrive, Drive as _};
use drivetrain::units::Angle;
use std::cell::{Cell, RefCell};

type Drive = fn(&mut Actuator<Motor>, f32) -> Result<(), TargetError>;

/// A motor, and a drive whose shaft stands.
struct Joint {
    motor: Actuator<Motor>,
    drive: RefCell<DamiaoDrive>,
    /// An answer about a register, which the motor takes before all else.
    answer: Cell<Option<CanFrame>>,
    set: Drive,
}

impl Joint {
    fn new(mode: impl Into<Mode>, number: f32, set: Drive) -> Self {
        let drive = DamiaoDrive::of(Model::J4310, 1).with_register(10, number);
        Self {
            motor: Actuator::new(Motor::new(Model::J4310, 1, mode).unwrap()),
            drive: RefCell::new(drive),
            answer: Cell::new(None),
            set,
        }
    }

    fn refresh() -> CanFrame {
        CanFrame::of(id(0x7FF), [1, 0, 0xCC, 0, 0, 0, 0, 0])
    }
}

impl Subject for Joint {
    type Device = Actuator<Motor>;
    fn device(&mut self) -> &mut Self::Device {
        if let Some(answer) = self.answer.take() {
            self.motor.motor_mut().decode_answer(&answer);
        }
        &mut self.motor
    }
    fn motors(&self) -> usize {
        1
    }
    fn feedback(&self, _motor: usize) -> Option<CanFrame> {
        self.drive.borrow_mut().hear(&Self::refresh())
    }
    fn fault(&self, _motor: usize) -> Option<CanFrame> {
        let mut overloaded = *self.drive.borrow();
        overloaded.fail(14);
        overloaded.hear(&Self::refresh())
    }
    fn drive(&mut self, share: f32) -> Result<(), TargetError> {
        (self.set)(&mut self.motor, share)
    }
    /// The drive hears what is sent. A frame that leaves it disabled, or in MIT mode without gains and torque, asks for nothing.
    fn is_zero(&self, command: &CanFrame) -> bool {
        let mut drive = self.drive.borrow_mut();
        let answer = drive.hear(command);
        if command.header() == 0x7FF {
            self.answer.set(answer);
            return true;
        }
        let mut turned = *drive;
        turned.step(1e-6);
        let is_enabling = command.bytes() == &[0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFC];
        !is_enabling && (!drive.is_enabled() || turned.shaft().torque_nm().abs() <= 10.0 / 4095.0)
    }
    /// The torque of the drive at rest at zero, of the limit of 3 Nm that the motors in MIT mode have.
    fn effort(&self, command: &CanFrame) -> Option<f32> {
        let mut turned = *self.drive.borrow();
        let is_mit = command.header() == 1;
        turned.hear(command);
        turned.step(1e-6);
        is_mit.then(|| turned.shaft().torque_nm() / 3.0)
    }
    /// What others send about registers may be for another drive.
    fn rival(&self, command: &Claim) -> Option<CanFrame> {
        (command.id() != embedded_can::Id::from(id(0x7FF)))
            .then(|| CanFrame::of(command.id(), [0; 8]))
    }
    fn preparation_ms(&self) -> u64 {
        100
    }
    fn opening_ms(&self) -> u64 {
        260
    }
}

fn kept(mode: impl Into<Mode>, number: f32, set: Drive) {
    let mode = mode.into();
    assert_eq!(check_contract(|| Joint::new(mode, number, set)), Ok(RULES), "{mode:?}");
}

#[test]
fn motors_of_damiao_keep_the_contract_in_each_mode_with_each_kind_of_target() {
    let quick = AngularVelocity::from_rad_per_s(10.0);
    let mit = ImpedanceControl::new(3.0).unwrap().with_gains(20.0, 0.6).unwrap();
    let position = PidConfig::new(10.0, 0.0, 0.0).with_output_limit(20.0);
    let loops = mit.with_loops(position, PidConfig::new(0.5, 2.0, 0.0)).unwrap();
    for mode in [mit, loops] {
        kept(mode, 1.0, |motor, share| motor.set_torque(3.0 * share));
        kept(mode, 1.0, |motor, share| motor.set_velocity((), velocity(share)));
        kept(mode, 1.0, |motor, share| motor.set_angle((), Angle::from_turns(0.25 * share)));
        kept(mode, 1.0, |motor, share| {
            let angle = Angle::from_turns(0.25 * share);
            motor.set_impedance(Impedance { angle, stiffness: 20.0, ..Impedance::FREE })
        });
    }
    kept(Mode::velocity(quick), 3.0, |motor, share| motor.set_velocity((), velocity(share)));
    let turn: Drive = |motor, share| motor.set_angle((), Angle::from_turns(0.25 * share));
    kept(Mode::position_velocity(quick), 2.0, turn);
    let push: Drive = |motor, share| motor.set_angle((), Angle::from_turns(0.25 * share));
    kept(Mode::force_position(quick, 2.0), 4.0, push);
}
