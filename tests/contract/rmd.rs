//! Motors of MyActuator in each control mode, with drives that confirm their time-out before they are driven.

use super::*;
use drivetrain::control::PidConfig;
use drivetrain::motor::{AngleDrive, Impedance, ImpedanceControl};
use drivetrain::rmd::{Mode, Model, Motor};
use drivetrain::sim::{Drive as _, RmdDrive};
use drivetrain::units::Angle;
use std::cell::{Cell, RefCell};

type Drive = fn(&mut Actuator<Motor>, f32) -> Result<(), TargetError>;

/// A motor, and a drive whose shaft stands.
struct Wheel {
    motor: Actuator<Motor>,
    drive: RefCell<RmdDrive>,
    /// An answer that is no feedback, which the motor takes before all else.
    answer: Cell<Option<CanFrame>>,
    set: Drive,
}

impl Wheel {
    fn new(mode: impl Into<Mode>, set: Drive) -> Self {
        Self {
            motor: Actuator::new(Motor::new(Model::X8_120, 1, mode).unwrap()),
            drive: RefCell::new(RmdDrive::new(1, 2.4)),
            answer: Cell::new(None),
            set,
        }
    }

    fn hear(&self, code: u8) -> Option<CanFrame> {
        self.drive.borrow_mut().hear(&CanFrame::of(id(0x141), [code, 0, 0, 0, 0, 0, 0, 0]))
    }
}

impl Subject for Wheel {
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
        self.hear(0x9C)
    }
    /// The state has the errors, which is no feedback, so no single frame is both: `tests/rmd` has what follows.
    fn fault(&self, _motor: usize) -> Option<CanFrame> {
        None
    }
    fn drive(&mut self, share: f32) -> Result<(), TargetError> {
        (self.set)(&mut self.motor, share)
    }
    /// The drive hears what is sent. A frame that leaves it without a torque asks for nothing; that which releases its brake does.
    fn is_zero(&self, command: &CanFrame) -> bool {
        let mut drive = self.drive.borrow_mut();
        let answer = drive.hear(command);
        let [code, ..] = *command.bytes();
        if [0x77, 0x78, 0x80, 0x92, 0x9A, 0xB3].contains(&code) {
            self.answer.set(answer);
            return code != 0x77;
        }
        let mut turned = *drive;
        turned.step(1e-6);
        turned.shaft().torque_nm() == 0.0
    }
    fn rival(&self, command: &Claim) -> Option<CanFrame> {
        Some(CanFrame::of(command.id(), [0xA1, 0, 0, 0, 100, 0, 0, 0]))
    }
    fn preparation_ms(&self) -> u64 {
        100
    }
    fn opening_ms(&self) -> u64 {
        OPENING_MS.get()
    }
}

thread_local! {
    /// Questions take the place of some commands: the check meets each of their places.
    static OPENING_MS: Cell<u64> = const { Cell::new(290) };
}

fn kept(mode: impl Into<Mode>, set: Drive) {
    let mode = mode.into();
    assert_eq!(check_contract(|| Wheel::new(mode, set)), Ok(RULES), "{mode:?}");
}

#[test]
fn no_question_takes_the_place_of_a_new_command() {
    let quick = AngularVelocity::from_rad_per_s(10.0);
    for later_ms in 0..34 {
        OPENING_MS.set(290 + later_ms);
        kept(ImpedanceControl::new(3.0).unwrap(), |motor, share| motor.set_torque(3.0 * share));
        let turn: Drive = |motor, share| motor.set_angle((), Angle::from_turns(0.25 * share));
        kept(Mode::position_velocity(quick), turn);
    }
}

#[test]
fn motors_of_rmd_keep_the_contract_in_each_mode_with_each_kind_of_target() {
    let quick = AngularVelocity::from_rad_per_s(10.0);
    let torque = ImpedanceControl::new(3.0).unwrap().with_gains(20.0, 0.6).unwrap();
    let position = PidConfig::new(10.0, 0.0, 0.0).with_output_limit(20.0);
    let loops = torque.with_loops(position, PidConfig::new(0.5, 2.0, 0.0)).unwrap();
    for mode in [torque, loops] {
        kept(mode, |motor, share| motor.set_torque(3.0 * share));
        kept(mode, |motor, share| motor.set_velocity((), velocity(share)));
        kept(mode, |motor, share| motor.set_angle((), Angle::from_turns(0.25 * share)));
        kept(mode, |motor, share| {
            let angle = Angle::from_turns(0.25 * share);
            motor.set_impedance(Impedance { angle, stiffness: 20.0, ..Impedance::FREE })
        });
    }
    kept(Mode::velocity(quick), |motor, share| motor.set_velocity((), velocity(share)));
    let turn: Drive = |motor, share| motor.set_angle((), Angle::from_turns(0.25 * share));
    kept(Mode::position_velocity(quick), turn);
}
