//! Drives with frames of their own, that are asked and enabled before they are driven.
//!
//! A drive that `FOLLOWS` has the loop of the target in itself: its output is the target in its last command, while the drive has a torque.
//! The output of another drive is its torque.

use super::*;
use drivetrain::damiao;
use drivetrain::encoder::GearRatio;
use drivetrain::motor::{
    Actuator, AngleDrive, CanDevice, Devices, DriveProtocol, ImpedanceControl,
};
use drivetrain::robstride;
use drivetrain::sim::{DamiaoDrive, Drive, RobStrideDrive};
use drivetrain::units::{Angle, AngularVelocity};
use drivetrain::vesc;
use embedded_can::{ExtendedId, Frame};

pub(super) type Set<M> = fn(&mut Actuator<M>, f32) -> Result<(), TargetError>;

pub(super) fn own<M: DriveProtocol>(motor: M, setup: Setup) -> Actuator<M> {
    Actuator::new(motor).with_health(health(setup)).unwrap().with_opening(setup.opening)
}

pub(super) const fn rules(follows: bool) -> [Rules; 1] {
    [if follows { FOLLOWING } else { PREPARED }]
}

pub(super) const SPEED: AngularVelocity = AngularVelocity::from_rad_per_s(10.0);

/// How a target is read from a command, in rad or rad/s, and the target in the last one.
pub(super) struct Output {
    read: fn(&CanFrame) -> Option<f32>,
    target: f64,
}

impl Output {
    pub(super) const fn new(read: fn(&CanFrame) -> Option<f32>) -> Self {
        Self { read, target: 0.0 }
    }

    pub(super) fn hear(&mut self, frame: &CanFrame) {
        if let Some(target) = (self.read)(frame) {
            self.target = target.abs().into();
        }
    }

    /// Returns the target while there is a torque.
    pub(super) fn under(&self, torque_nm: f32) -> f64 {
        if torque_nm == 0.0 { 0.0 } else { self.target }
    }
}

/// The output is a torque.
fn none(_: &CanFrame) -> Option<f32> {
    None
}

/// The drive is asked for its settings, and enabled.
pub(crate) struct Damiao<const FOLLOWS: bool> {
    motor: Actuator<damiao::Motor>,
    drive: DamiaoDrive,
    output: Output,
    set: Set<damiao::Motor>,
}

impl Damiao<false> {
    pub(crate) fn mit(setup: Setup) -> Self {
        let mode = ImpedanceControl::new(3.0).unwrap();
        Self::new(mode, 1.0, |motor, value| motor.set_torque(3.0 * value), none, setup)
    }
}

impl Damiao<true> {
    pub(crate) fn position(setup: Setup) -> Self {
        let mode = damiao::Mode::position_velocity(SPEED);
        let read = |frame: &CanFrame| {
            let [a, b, c, d, ..] = *frame.bytes();
            let is_command = frame.header() == 0x101 && frame.bytes()[..7] != [0xFF; 7];
            is_command.then_some(f32::from_le_bytes([a, b, c, d]))
        };
        let set: Set<_> = |motor, value| motor.set_angle((), Angle::from_radians(value));
        Self::new(mode, 2.0, set, read, setup)
    }
}

impl<const FOLLOWS: bool> Damiao<FOLLOWS> {
    fn new(
        mode: impl Into<damiao::Mode>,
        number: f32,
        set: Set<damiao::Motor>,
        read: fn(&CanFrame) -> Option<f32>,
        setup: Setup,
    ) -> Self {
        let motor = damiao::Motor::new(damiao::Model::J4310, 1, mode).unwrap();
        let drive = DamiaoDrive::of(damiao::Model::J4310, 1).with_register(10, number);
        Self { motor: own(motor, setup), drive, output: Output::new(read), set }
    }

    /// Gives the drive a frame, and the motor an answer about a register.
    fn tell(&mut self, frame: &CanFrame) {
        let answer = self.drive.hear(frame);
        if let Some(answer) = answer.filter(|_| frame.header() == 0x7FF) {
            self.motor.motor_mut().decode_answer(&answer);
        }
    }
}

impl<const FOLLOWS: bool> Subject<1> for Damiao<FOLLOWS> {
    const RULES: [Rules; 1] = rules(FOLLOWS);

    own!(self => self.motor);

    fn hear(&mut self, now: Instant) {
        let refresh = CanFrame::standard(0x7FF, [1, 0, 0xCC, 0, 0, 0, 0, 0]).unwrap();
        let feedback = self.drive.hear(&refresh).unwrap();
        self.ingest(&feedback, now);
    }
    fn set(&mut self, value: f32) -> [Result<(), TargetError>; 1] {
        [(self.set)(&mut self.motor, value)]
    }
    fn outputs(&mut self, tick: Tick) -> [f64; 1] {
        Devices::update(&mut self.motor, tick);
        let mut output = 0.0_f64;
        while let Some(frame) = Devices::next_frame(&mut self.motor, 0) {
            self.tell(&frame);
            self.output.hear(&frame);
            let mut turned = self.drive;
            turned.step(1e-6);
            let torque_nm = turned.shaft().torque_nm().abs();
            let is_driven = turned.is_enabled() && torque_nm > 10.0 / 4095.0;
            if frame.header() != 0x7FF && is_driven {
                let torque = f64::from(torque_nm) / 3.0;
                output = output.max(if FOLLOWS { self.output.under(torque_nm) } else { torque });
            }
        }
        [output]
    }
    fn command(&self, _: usize) -> Option<CanFrame> {
        CanFrame::standard(if FOLLOWS { 0x101 } else { 1 }, [0; 8])
    }
}

/// A wheel on a VESC that turns by torque, without a question for the fault code, which has a time of its own.
pub(crate) struct Vesc(Actuator<vesc::Motor>);

impl Vesc {
    pub(crate) fn new(setup: Setup) -> Self {
        let model = vesc::Model {
            name: "wheel",
            pole_pairs: 7,
            gear: GearRatio::DIRECT,
            torque_constant_nm_per_a: 0.05,
            current_limit_a: 20.0,
            max_velocity: AngularVelocity::from_rad_per_s(300.0),
        };
        let motor = vesc::Motor::new(model, 23, vesc::Mode::current()).unwrap();
        Self(own(motor.without_fault_code(), setup))
    }
}

impl Subject<1> for Vesc {
    const RULES: [Rules; 1] = [ACTUATOR];

    own!(self => self.0);

    fn hear(&mut self, now: Instant) {
        let status = CanFrame::new(ExtendedId::new(0x917).unwrap(), &[0; 8]).unwrap();
        self.ingest(&status, now);
    }
    fn set(&mut self, value: f32) -> [Result<(), TargetError>; 1] {
        [self.0.set_torque(value)]
    }
    /// The four bytes of a current are mA, of 20 A.
    fn outputs(&mut self, tick: Tick) -> [f64; 1] {
        Devices::update(&mut self.0, tick);
        let mut output = 0.0_f64;
        while let Some(frame) = Devices::next_frame(&mut self.0, 0) {
            let [a, b, c, d, ..] = *frame.bytes();
            let current = i32::from_be_bytes([a, b, c, d]);
            output = output.max(f64::from(current.unsigned_abs()) / 20_000.0);
        }
        [output]
    }
    fn command(&self, _: usize) -> Option<CanFrame> {
        CanFrame::new(ExtendedId::new(0x117)?, &[0; 4])
    }
}

/// The drive is asked for its settings, and enabled.
pub(crate) struct RobStride {
    motor: Actuator<robstride::Motor>,
    drive: RobStrideDrive,
    has_commanded: bool,
    /// The torque limit.
    full_nm: f32,
}

impl RobStride {
    pub(crate) fn operation(setup: Setup) -> Self {
        Self::new(ImpedanceControl::new(3.0).unwrap(), 3.0, setup)
    }

    pub(crate) fn current(setup: Setup) -> Self {
        Self::new(robstride::Mode::current(4.0, 1.0), 4.0, setup)
    }

    fn new(mode: impl Into<robstride::Mode>, full_nm: f32, setup: Setup) -> Self {
        let motor = robstride::Motor::new(robstride::Model::RS02, 1, mode).unwrap();
        let drive = RobStrideDrive::of(robstride::Model::RS02, 1);
        Self { motor: own(motor, setup), drive, has_commanded: false, full_nm }
    }

    /// Gives the drive a frame, and the motor an answer about a parameter.
    fn tell(&mut self, frame: &CanFrame) {
        if let Some(answer) = self.drive.hear(frame) {
            self.motor.motor_mut().decode_answer(&answer);
        }
    }
}

impl Subject<1> for RobStride {
    const RULES: [Rules; 1] = rules(false);

    own!(self => self.motor);

    /// A write of a parameter that no mode uses is answered with feedback.
    fn hear(&mut self, now: Instant) {
        let id = ExtendedId::new(0x1200_FD01).unwrap();
        let refresh = CanFrame::of(id, [0x1E, 0x70, 0, 0, 0, 0, 0xF0, 0x41]);
        let feedback = self.drive.hear(&refresh).unwrap();
        self.ingest(&feedback, now);
    }
    fn set(&mut self, value: f32) -> [Result<(), TargetError>; 1] {
        [self.motor.set_torque(self.full_nm * value)]
    }
    fn outputs(&mut self, tick: Tick) -> [f64; 1] {
        Devices::update(&mut self.motor, tick);
        let mut output = 0.0_f64;
        self.has_commanded = false;
        while let Some(frame) = Devices::next_frame(&mut self.motor, 0) {
            self.tell(&frame);
            // A write of the current, or all fields at once.
            let kind = frame.header() >> 24 & 0x1F;
            self.has_commanded |=
                kind == 1 || kind == 18 && frame.bytes().starts_with(&[0x06, 0x70]);
            let mut turned = self.drive;
            turned.step(1e-6);
            let torque_nm = turned.shaft().torque_nm().abs();
            if kind != 17 && turned.is_enabled() && torque_nm > 17.0 / 65_535.0 {
                output = output.max(f64::from(torque_nm / self.full_nm));
            }
        }
        self.has_commanded |= !self.drive.is_enabled();
        [output]
    }
    fn has_commanded(&self) -> bool {
        self.has_commanded
    }
    fn command(&self, _: usize) -> Option<CanFrame> {
        CanFrame::new(ExtendedId::new(0x0180_0001)?, &[0; 8])
    }
}
