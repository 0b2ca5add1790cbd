//! Drives of LK, and those of MyActuator, whose frames are alike.

use super::drives::{Output, SPEED, Set, own, rules};
use super::*;
use drivetrain::lk;
use drivetrain::motor::{
    AngleDrive, CanDevice, Devices, ImpedanceControl, Own, OwnMotor, VelocityDrive,
};
use drivetrain::rmd;
use drivetrain::sim::{LkDrive, RmdDrive};
use drivetrain::units::{Angle, AngularVelocity};

/// The value of the four last bytes of a command of LK or MyActuator, in rad or rad/s: a unit is 0.01 degree.
fn hundredths(frame: &CanFrame) -> Option<f32> {
    let [code, _, _, _, a, b, c, d] = *frame.bytes();
    let value = i32::from_le_bytes([a, b, c, d]) as f32;
    matches!(code, 0xA2 | 0xA4).then_some((0.01 * value).to_radians())
}

/// A torque, as another controller sends it.
fn torque_frame(data: [u8; 8]) -> Option<CanFrame> {
    CanFrame::standard(0x141, data)
}

/// Tells whether a frame is a command with a target.
fn is_order(frame: &CanFrame) -> bool {
    matches!(frame.bytes()[0], 0xA1 | 0xA2 | 0xA4)
}

/// The drive is asked for its state, switched on, and asked for its angle.
pub(crate) struct Lk<const FOLLOWS: bool> {
    motor: Own<lk::Motor>,
    drive: LkDrive,
    output: Output,
    has_commanded: bool,
    set: Set<lk::Motor>,
}

impl Lk<false> {
    pub(crate) fn torque(setup: Setup) -> Self {
        let mode = ImpedanceControl::new(2.0).unwrap();
        Self::new(mode, |motor, value| motor.set_torque(2.0 * value), setup)
    }
}

impl Lk<true> {
    pub(crate) fn velocity(setup: Setup) -> Self {
        let set: Set<_> =
            |motor, value| motor.set_velocity((), AngularVelocity::from_rad_per_s(value));
        Self::new(lk::Mode::velocity(SPEED), set, setup)
    }

    pub(crate) fn position(setup: Setup) -> Self {
        let set: Set<_> = |motor, value| motor.set_angle((), Angle::from_radians(value));
        Self::new(lk::Mode::position_velocity(SPEED), set, setup)
    }
}

impl<const FOLLOWS: bool> Lk<FOLLOWS> {
    fn new(mode: impl Into<lk::Mode>, set: Set<lk::Motor>, setup: Setup) -> Self {
        let motor = lk::Motor::new(lk::Model::MF9025_16T, 1, mode).unwrap();
        let drive = LkDrive::new(1, 33.0 / 4096.0, 0.32, 1.0, 16);
        Self {
            motor: own(motor, setup),
            drive,
            output: Output::new(hundredths),
            has_commanded: false,
            set,
        }
    }

    /// Returns what the drive does now.
    fn output(&self) -> f64 {
        let mut turned = self.drive;
        turned.step(1e-6);
        if !turned.is_on() {
            return 0.0;
        }
        let torque_nm = turned.shaft().torque_nm().abs();
        if FOLLOWS { self.output.under(torque_nm) } else { f64::from(torque_nm) / 2.0 }
    }
}

impl<const FOLLOWS: bool> Subject<1> for Lk<FOLLOWS> {
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
        torque_frame([0xA1, 0, 0, 0, 10, 0, 0, 0])
    }
}

/// The drive is asked for its state, confirms its time-out, and releases its brake or tells its angle.
pub(crate) struct Rmd<const FOLLOWS: bool> {
    motor: Own<rmd::Motor>,
    drive: RmdDrive,
    output: Output,
    has_commanded: bool,
    set: Set<rmd::Motor>,
}

impl Rmd<false> {
    pub(crate) fn torque(setup: Setup) -> Self {
        let mode = ImpedanceControl::new(2.0).unwrap();
        Self::new(mode, |motor, value| motor.set_torque(2.0 * value), setup)
    }
}

impl Rmd<true> {
    pub(crate) fn velocity(setup: Setup) -> Self {
        let set: Set<_> =
            |motor, value| motor.set_velocity((), AngularVelocity::from_rad_per_s(value));
        Self::new(rmd::Mode::velocity(SPEED), set, setup)
    }

    pub(crate) fn position(setup: Setup) -> Self {
        let set: Set<_> = |motor, value| motor.set_angle((), Angle::from_radians(value));
        Self::new(rmd::Mode::position_velocity(SPEED), set, setup)
    }
}

impl<const FOLLOWS: bool> Rmd<FOLLOWS> {
    fn new(mode: impl Into<rmd::Mode>, set: Set<rmd::Motor>, setup: Setup) -> Self {
        let motor = rmd::Motor::new(rmd::Model::X8_120, 1, mode).unwrap();
        let drive = RmdDrive::new(1, 2.4);
        Self {
            motor: own(motor, setup),
            drive,
            output: Output::new(hundredths),
            has_commanded: false,
            set,
        }
    }

    /// Returns what the drive does now.
    fn output(&self) -> f64 {
        let mut turned = self.drive;
        turned.step(1e-6);
        let torque_nm = turned.shaft().torque_nm().abs();
        if FOLLOWS { self.output.under(torque_nm) } else { f64::from(torque_nm) / 2.0 }
    }
}

impl<const FOLLOWS: bool> Subject<1> for Rmd<FOLLOWS> {
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
        torque_frame([0xA1, 0, 0, 0, 10, 0, 0, 0])
    }
}
