//! Drives of LK, and those of MyActuator, whose frames are alike.

use super::drives::{Output, SPEED, Set, own, rules};
use super::*;
use drivetrain::lk;
use drivetrain::motor::{
    Actuator, AngleDrive, CanDevice, Devices, DriveProtocol, ImpedanceControl, VelocityDrive,
};
use drivetrain::rmd;
use drivetrain::sim::{self, Drive as _, LkDrive, RmdDrive};
use drivetrain::units::{Angle, AngularVelocity};

/// The value of the four last bytes of a command of LK or MyActuator, in rad or rad/s: a unit is 0.01 degree.
fn hundredths(frame: &CanFrame) -> Option<f32> {
    let [code, _, _, _, a, b, c, d] = *frame.bytes();
    let value = i32::from_le_bytes([a, b, c, d]) as f32;
    matches!(code, 0xA2 | 0xA4).then_some((0.01 * value).to_radians())
}

/// Tells whether a frame is a command with a target.
fn is_order(frame: &CanFrame) -> bool {
    matches!(frame.bytes()[0], 0xA1 | 0xA2 | 0xA4)
}

/// A simulated drive of either family.
pub(crate) trait Drive: sim::Drive + Copy {
    fn is_on(&self) -> bool;
    /// Returns the torque that the drive gives now, in Nm; `None` for a drive that is off.
    fn torque_nm(self) -> Option<f32>;
}

impl Drive for LkDrive {
    fn is_on(&self) -> bool {
        self.is_on()
    }
    fn torque_nm(mut self) -> Option<f32> {
        self.step(1e-6);
        self.is_on().then(|| self.shaft().torque_nm().abs())
    }
}

impl Drive for RmdDrive {
    fn is_on(&self) -> bool {
        self.is_on()
    }
    fn torque_nm(mut self) -> Option<f32> {
        self.step(1e-6);
        Some(self.shaft().torque_nm().abs())
    }
}

/// A motor of either family and its drive: their frames, and the answers to these, are alike.
pub(crate) struct Alike<M, D, const FOLLOWS: bool> {
    motor: Actuator<M>,
    drive: D,
    output: Output,
    has_commanded: bool,
    set: Set<M>,
}

/// The drive is asked for its state, switched on, and asked for its angle.
pub(crate) type Lk<const FOLLOWS: bool> = Alike<lk::Motor, LkDrive, FOLLOWS>;

/// The drive is asked for its state, confirms its time-out, and releases its brake or tells its angle.
pub(crate) type Rmd<const FOLLOWS: bool> = Alike<rmd::Motor, RmdDrive, FOLLOWS>;

fn torque<M: DriveProtocol>(motor: &mut Actuator<M>, value: f32) -> Result<(), TargetError> {
    motor.set_torque(2.0 * value)
}

fn velocity<M: DriveProtocol>(motor: &mut Actuator<M>, value: f32) -> Result<(), TargetError> {
    motor.set_velocity((), AngularVelocity::from_rad_per_s(value))
}

fn angle<M: DriveProtocol>(motor: &mut Actuator<M>, value: f32) -> Result<(), TargetError> {
    motor.set_angle((), Angle::from_radians(value))
}

impl<const FOLLOWS: bool> Lk<FOLLOWS> {
    fn of(mode: impl Into<lk::Mode>, set: Set<lk::Motor>, setup: Setup) -> Self {
        let motor = lk::Motor::new(lk::Model::MF9025_16T, 1, mode).unwrap();
        Self::new(motor, LkDrive::of(lk::Model::MF9025_16T, 1), set, setup)
    }
}

impl Lk<false> {
    pub(crate) fn torque(setup: Setup) -> Self {
        Self::of(ImpedanceControl::new(2.0).unwrap(), torque, setup)
    }
}

impl Lk<true> {
    pub(crate) fn velocity(setup: Setup) -> Self {
        Self::of(lk::Mode::velocity(SPEED), velocity, setup)
    }

    pub(crate) fn position(setup: Setup) -> Self {
        Self::of(lk::Mode::position_velocity(SPEED), angle, setup)
    }
}

impl<const FOLLOWS: bool> Rmd<FOLLOWS> {
    fn of(mode: impl Into<rmd::Mode>, set: Set<rmd::Motor>, setup: Setup) -> Self {
        let motor = rmd::Motor::new(rmd::Model::X8_120, 1, mode).unwrap();
        Self::new(motor, RmdDrive::new(1, 2.4), set, setup)
    }
}

impl Rmd<false> {
    pub(crate) fn torque(setup: Setup) -> Self {
        Self::of(ImpedanceControl::new(2.0).unwrap(), torque, setup)
    }
}

impl Rmd<true> {
    pub(crate) fn velocity(setup: Setup) -> Self {
        Self::of(rmd::Mode::velocity(SPEED), velocity, setup)
    }

    pub(crate) fn position(setup: Setup) -> Self {
        Self::of(rmd::Mode::position_velocity(SPEED), angle, setup)
    }
}

impl<M: DriveProtocol, D: Drive, const FOLLOWS: bool> Alike<M, D, FOLLOWS> {
    fn new(motor: M, drive: D, set: Set<M>, setup: Setup) -> Self {
        let output = Output::new(hundredths);
        Self { motor: own(motor, setup), drive, output, has_commanded: false, set }
    }

    /// Returns what the drive does now.
    fn output(&self) -> f64 {
        let Some(torque_nm) = self.drive.torque_nm() else { return 0.0 };
        if FOLLOWS { self.output.under(torque_nm) } else { f64::from(torque_nm) / 2.0 }
    }
}

impl<M: DriveProtocol, D: Drive, const FOLLOWS: bool> Subject<1> for Alike<M, D, FOLLOWS> {
    const RULES: [Rules; 1] = rules(FOLLOWS);

    own!(self => self.motor);

    fn hear(&mut self, now: Instant) {
        let question = CanFrame::standard(0x141, [0x9C, 0, 0, 0, 0, 0, 0, 0]).unwrap();
        let feedback = self.drive.hear(&question).unwrap();
        self.ingest(&feedback, now);
    }
    fn set(&mut self, value: f32) -> [Result<(), TargetError>; 1] {
        [(self.set)(&mut self.motor, value)]
    }
    /// The drive takes each frame, and the motor each answer that is no feedback.
    fn outputs(&mut self, tick: Tick) -> [f64; 1] {
        Devices::update(&mut self.motor, tick);
        let mut output = 0.0_f64;
        self.has_commanded = false;
        while let Some(frame) = Devices::next_frame(&mut self.motor, 0) {
            let answer = self.drive.hear(&frame);
            if let Some(answer) = answer.filter(|_| !is_order(&frame)) {
                self.motor.motor_mut().decode_answer(&answer);
            }
            self.output.hear(&frame);
            if is_order(&frame) {
                self.has_commanded = true;
                output = output.max(self.output());
            }
        }
        if !self.has_commanded {
            output = self.output();
        }
        self.has_commanded |= !self.drive.is_on();
        [output]
    }
    fn has_commanded(&self) -> bool {
        self.has_commanded
    }
    fn command(&self, _: usize) -> Option<CanFrame> {
        CanFrame::standard(0x141, [0xA1, 0, 0, 0, 10, 0, 0, 0])
    }
}
