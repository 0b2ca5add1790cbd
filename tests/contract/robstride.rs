//! Motors of RobStride in each run mode, with drives that are set up before they are enabled.

use super::*;
use drivetrain::control::PidConfig;
use drivetrain::motor::{AngleDrive, Impedance, ImpedanceControl};
use drivetrain::robstride::{Mode, Model, Motor};
use drivetrain::sim::{Drive as _, RobStrideDrive};
use drivetrain::units::Angle;
use embedded_can::ExtendedId;
use std::cell::{Cell, RefCell};

type Drive = fn(&mut Actuator<Motor>, f32) -> Result<(), TargetError>;

/// A motor, and a drive whose shaft stands.
struct Joint {
    motor: Actuator<Motor>,
    drive: RefCell<RobStrideDrive>,
    /// An answer about a parameter, which the motor takes before all else.
    answer: Cell<Option<CanFrame>>,
    set: Drive,
}

impl Joint {
    fn new(model: Model, mode: impl Into<Mode>, set: Drive) -> Self {
        Self {
            motor: Actuator::new(Motor::new(model, 1, mode).unwrap()),
            drive: RefCell::new(RobStrideDrive::of(model, 1)),
            answer: Cell::new(None),
            set,
        }
    }

    /// A write of a parameter that no mode uses: the drive answers with its feedback.
    fn refresh() -> CanFrame {
        let id = ExtendedId::new(0x1200_FD01).unwrap();
        CanFrame::of(id, [0x1E, 0x70, 0, 0, 0, 0, 0xF0, 0x41])
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
        let mut hot = *self.drive.borrow();
        hot.fail(1);
        hot.hear(&Self::refresh())
    }
    fn drive(&mut self, share: f32) -> Result<(), TargetError> {
        (self.set)(&mut self.motor, share)
    }
    /// The drive hears what is sent. A frame that leaves it disabled, or without a torque, asks for nothing.
    fn is_zero(&self, command: &CanFrame) -> bool {
        let mut drive = self.drive.borrow_mut();
        let answer = drive.hear(command);
        match command.header() >> 24 & 0x1F {
            17 => {
                self.answer.set(answer);
                true
            }
            3 => false,
            _ => {
                let mut turned = *drive;
                turned.step(1e-6);
                !drive.is_enabled() || turned.shaft().torque_nm().abs() <= 17.0 / 65_535.0
            }
        }
    }
    fn preparation_ms(&self) -> u64 {
        150
    }
    fn opening_ms(&self) -> u64 {
        400
    }
}

fn kept(model: Model, mode: impl Into<Mode>, set: Drive) {
    let mode = mode.into();
    assert_eq!(check_contract(|| Joint::new(model, mode, set)), Ok(RULES), "{mode:?}");
}

#[test]
fn motors_of_robstride_keep_the_contract_in_each_mode_with_each_kind_of_target() {
    let quick = AngularVelocity::from_rad_per_s(10.0);
    let operation = ImpedanceControl::new(3.0).unwrap().with_gains(20.0, 0.6).unwrap();
    let position = PidConfig::new(10.0, 0.0, 0.0).with_output_limit(20.0);
    let loops = operation.with_loops(position, PidConfig::new(0.5, 2.0, 0.0)).unwrap();
    for (model, mode) in
        [(Model::RS02, operation), (Model::RS02, loops), (Model::CYBERGEAR, operation)]
    {
        kept(model, mode, |motor, share| motor.set_torque(3.0 * share));
        kept(model, mode, |motor, share| motor.set_velocity((), velocity(share)));
        kept(model, mode, |motor, share| motor.set_angle((), Angle::from_turns(0.25 * share)));
        kept(model, mode, |motor, share| {
            let angle = Angle::from_turns(0.25 * share);
            motor.set_impedance(Impedance { angle, stiffness: 20.0, ..Impedance::FREE })
        });
    }
    for model in [Model::RS02, Model::CYBERGEAR] {
        kept(model, Mode::current(4.0, 1.0), |motor, share| motor.set_torque(3.0 * share));
        kept(model, Mode::velocity(quick, 8.0), |motor, share| {
            motor.set_velocity((), velocity(share))
        });
        let turn: Drive = |motor, share| motor.set_angle((), Angle::from_turns(0.25 * share));
        kept(model, Mode::position(quick, 8.0), turn);
    }
}
