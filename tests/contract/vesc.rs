//! Motors on VESC drives in each control mode, with drives that are asked for their fault code before they are armed.

use super::*;
use drivetrain::encoder::GearRatio;
use drivetrain::motor::AngleDrive;
use drivetrain::sim::{Drive as _, VescDrive};
use drivetrain::units::Angle;
use drivetrain::vesc::{Mode, Model, Motor, Rest};
use std::cell::{Cell, RefCell};

type Drive = fn(&mut Actuator<Motor>, f32) -> Result<(), TargetError>;

const MODEL: Model = Model {
    name: "6374",
    pole_pairs: 7,
    gear: GearRatio::DIRECT,
    torque_constant_nm_per_a: 0.05,
    current_limit_a: 20.0,
    max_velocity: AngularVelocity::from_rad_per_s(300.0),
};

/// A motor, and a drive whose shaft stands.
struct Station {
    motor: Actuator<Motor>,
    drive: RefCell<VescDrive>,
    /// An answer about the fault code, which the motor takes before all else.
    answer: Cell<Option<CanFrame>>,
    set: Drive,
    rest: Rest,
}

impl Station {
    fn new(mode: Mode, rest: Rest, set: Drive) -> Self {
        let drive = VescDrive::of(MODEL, 23).with_current_max(40.0);
        let motor = Motor::new(MODEL, 23, mode).unwrap().with_rest(rest).unwrap();
        Self {
            motor: Actuator::new(motor),
            drive: drive.into(),
            answer: Cell::new(None),
            set,
            rest,
        }
    }
}

impl Subject for Station {
    type Device = Actuator<Motor>;
    fn device(&mut self) -> &mut Self::Device {
        if let Some(answer) = self.answer.take() {
            self.motor.motor_mut().decode_answer(&answer);
        }
        for status in [16, 27] {
            let status = self.drive.borrow().report(status).unwrap();
            self.motor.motor_mut().decode_answer(&status);
        }
        &mut self.motor
    }
    fn motors(&self) -> usize {
        1
    }
    fn feedback(&self, _motor: usize) -> Option<CanFrame> {
        self.drive.borrow().report(9)
    }
    /// A fault is no feedback but an answer beside it, each 50 ms: `tests/vesc` has the fault while resting and while driven.
    fn fault(&self, _motor: usize) -> Option<CanFrame> {
        None
    }
    fn drive(&mut self, share: f32) -> Result<(), TargetError> {
        (self.set)(&mut self.motor, share)
    }
    /// The configured rest, and a question for the fault code, which the drive answers. A speed below the drive's least is rest too.
    fn is_zero(&self, command: &CanFrame) -> bool {
        if let Some(answer) = self.drive.borrow_mut().hear(command) {
            self.answer.set(Some(answer));
            return true;
        }
        let data = i32::from_be_bytes(command.data().try_into().unwrap());
        let is_near = |data: i32, current: f32| (data as f32 - current * 1e3).abs() < 0.5;
        match (self.rest, command.header() & 0xFFFF) {
            (Rest::Brake(current), 0x217) => is_near(data, current),
            (Rest::Handbrake(current), 0xC17) => is_near(data, current),
            (Rest::Release, 0x117) => data == 0,
            _ => false,
        }
    }
    /// Tools may ask.
    fn rival(&self, command: &Claim) -> Option<CanFrame> {
        (command.id() != extended(0x817)).then(|| CanFrame::of(command.id(), [0; 8]))
    }
    fn preparation_ms(&self) -> u64 {
        100
    }
    fn opening_ms(&self) -> u64 {
        260
    }
}

fn extended(raw: u32) -> embedded_can::Id {
    embedded_can::Id::Extended(embedded_can::ExtendedId::new(raw).unwrap())
}

fn kept(mode: Mode, set: Drive) {
    for rest in [Rest::Release, Rest::Brake(4.0), Rest::Handbrake(3.0)] {
        assert_eq!(
            check_contract(|| Station::new(mode, rest, set)),
            Ok(RULES),
            "{mode:?} {rest:?}"
        );
    }
}

#[test]
fn motors_on_vesc_drives_keep_the_contract_in_each_mode_with_each_kind_of_target() {
    let position = PidConfig::new(10.0, 0.0, 0.0).with_output_limit(20.0);
    let speed = PidConfig::new(0.3, 1.0, 0.0);
    let loops = Mode::current_with_loops(position, speed).unwrap();
    kept(Mode::current(), |motor, share| motor.set_torque(share));
    kept(loops, |motor, share| motor.set_torque(share));
    kept(loops, |motor, share| motor.set_velocity((), velocity(share)));
    kept(loops, |motor, share| motor.set_angle((), Angle::from_turns(0.25 * share)));
    let wheel = Mode::current_with_speed_loop(speed).unwrap();
    kept(wheel, |motor, share| motor.set_velocity((), velocity(share)));
    kept(Mode::velocity(), |motor, share| motor.set_velocity((), velocity(20.0 * share)));
    kept(Mode::position(), |motor, share| motor.set_angle((), Angle::from_turns(0.25 * share)));
    let duty = Mode::duty(0.8, PidConfig::new(0.01, 0.02, 0.0)).unwrap();
    kept(duty, |motor, share| motor.set_velocity((), velocity(share)));
}

/// Two claims of one motor have the question and the answer; all others are its own.
#[test]
fn only_questions_and_answers_are_shared_with_others() {
    let motor = |id| Motor::new(MODEL, id, Mode::position()).unwrap();
    let (first, second) = (motor(1), motor(2));
    for claim in first.claims() {
        let clashes = second.claims().into_iter().any(|other| claim.clashes_with(&other));
        assert!(!clashes, "{claim}");
        let again = motor(1).claims().into_iter().any(|other| claim.clashes_with(&other));
        let is_message = claim.id() == extended(0x801) || claim.id() == extended(0x8FE);
        assert_eq!(again, !is_message, "{claim}");
    }
    let shared = first.claims().into_iter().filter(|claim| claim.is_feedback());
    assert_eq!(shared.count(), 6);
}
