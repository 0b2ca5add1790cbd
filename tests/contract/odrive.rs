//! Motors at an ODrive in each control mode, with axes of both generations of firmware.

use super::*;
use drivetrain::motor::{AngleDrive, Impedance, ImpedanceControl};
use drivetrain::odrive::{Firmware, Heartbeat, Mode, Model, Motor};
use drivetrain::sim::{Drive as _, OdriveDrive};
use drivetrain::units::Angle;
use std::cell::{Cell, RefCell};

type Drive = fn(&mut Actuator<Motor>, f32) -> Result<(), TargetError>;

/// A motor, and an axis whose shaft stands.
struct Axle {
    motor: Actuator<Motor>,
    drive: RefCell<OdriveDrive>,
    /// From when a fault was played first, each heartbeat has it, but for those between feedback and the next frames of the motor.
    fails: Cell<bool>,
    is_well: Cell<bool>,
    set: Drive,
}

fn message(drive: &OdriveDrive, number: u16) -> Option<CanFrame> {
    let mut copy = *drive;
    copy.hear(&CanFrame::new_remote(id(0x60 | number), 8)?)
}

impl Axle {
    fn new(mode: impl Into<Mode>, firmware: Firmware, set: Drive) -> Self {
        let motor = Motor::new(Model::D6374, firmware, 3, velocity(10.0), mode).unwrap();
        let constant = Model::D6374.torque_constant();
        let drive = OdriveDrive::new(3, firmware == Firmware::V0_6, constant, 1.0);
        Self {
            motor: Actuator::new(motor),
            drive: RefCell::new(drive),
            fails: Cell::new(false),
            is_well: Cell::new(true),
            set,
        }
    }
}

impl Subject for Axle {
    type Device = Actuator<Motor>;
    /// A heartbeat has come before whatever is asked of the motor.
    fn device(&mut self) -> &mut Self::Device {
        let mut drive = *self.drive.borrow();
        if self.fails.get() && !self.is_well.get() {
            drive.fail(0x100);
        }
        if let Some(heartbeat) = message(&drive, 1) {
            self.motor.motor_mut().decode_answer(&heartbeat);
        }
        &mut self.motor
    }
    fn motors(&self) -> usize {
        1
    }
    fn feedback(&self, _motor: usize) -> Option<CanFrame> {
        self.is_well.set(true);
        message(&self.drive.borrow(), 9)
    }
    fn fault(&self, _motor: usize) -> Option<CanFrame> {
        self.fails.set(true);
        message(&self.drive.borrow(), 9)
    }
    fn drive(&mut self, share: f32) -> Result<(), TargetError> {
        (self.set)(&mut self.motor, share)
    }
    /// The drive hears what is sent. A frame that leaves it idle, or in torque mode without torque, asks for nothing.
    fn is_zero(&self, command: &CanFrame) -> bool {
        let mut drive = self.drive.borrow_mut();
        drive.hear(command);
        self.is_well.set(false);
        let mut turned = *drive;
        turned.step(1e-6);
        drive.state() == Heartbeat::IDLE || turned.shaft().torque_nm() == 0.0
    }
    fn preparation_ms(&self) -> u64 {
        100
    }
    fn opening_ms(&self) -> u64 {
        300
    }
}

fn kept(mode: impl Into<Mode>, set: Drive) {
    let mode = mode.into();
    for firmware in [Firmware::V0_5, Firmware::V0_6] {
        let made = || Axle::new(mode, firmware, set);
        assert_eq!(check_contract(made), Ok(RULES), "{firmware:?} {mode:?}");
    }
}

#[test]
fn motors_at_an_odrive_keep_the_contract_in_each_mode_with_each_kind_of_target() {
    let gains = ImpedanceControl::new(3.0).unwrap().with_gains(20.0, 0.6).unwrap();
    let position = PidConfig::new(10.0, 0.0, 0.0).with_output_limit(20.0);
    let loops = gains.with_loops(position, PidConfig::new(0.5, 2.0, 0.0)).unwrap();
    for mode in [gains, loops] {
        kept(mode, |motor, share| motor.set_torque(3.0 * share));
        kept(mode, |motor, share| motor.set_velocity((), velocity(share)));
        kept(mode, |motor, share| motor.set_angle((), Angle::from_turns(0.25 * share)));
        kept(mode, |motor, share| {
            let angle = Angle::from_turns(0.25 * share);
            motor.set_impedance(Impedance { angle, stiffness: 20.0, ..Impedance::FREE })
        });
    }
    kept(Mode::velocity(3.0), |motor, share| motor.set_velocity((), velocity(share)));
    let turn: Drive = |motor, share| motor.set_angle((), Angle::from_turns(0.25 * share));
    kept(Mode::position(3.0), turn);
}
