//! An ODrive: an axis whose heartbeat tells its state, and whose encoder estimates are the link.

use super::drives::{Output, own, rules};
use super::*;
use drivetrain::motor::{
    Actuator, AngleDrive, CanDevice, Devices, DriveProtocol, ImpedanceControl,
};
use drivetrain::odrive::{Firmware, Heartbeat, Mode, Model, Motor};
use drivetrain::sim::{Drive, OdriveDrive};
use drivetrain::units::{Angle, AngularVelocity};
use embedded_can::{Frame, StandardId};

pub(crate) struct Odrive<const FOLLOWS: bool> {
    motor: Actuator<Motor>,
    drive: OdriveDrive,
    output: Output,
    has_commanded: bool,
}

impl Odrive<false> {
    pub(crate) fn torque(setup: Setup) -> Self {
        Self::new(ImpedanceControl::new(3.0).unwrap(), Firmware::V0_5, setup)
    }
}

impl Odrive<true> {
    pub(crate) fn position(setup: Setup) -> Self {
        Self::new(Mode::position(3.0), Firmware::V0_6, setup)
    }
}

impl<const FOLLOWS: bool> Odrive<FOLLOWS> {
    fn new(mode: impl Into<Mode>, firmware: Firmware, setup: Setup) -> Self {
        let fastest = AngularVelocity::from_rad_per_s(10.0);
        let motor = Motor::new(Model::D6374, firmware, 3, fastest, mode).unwrap();
        let constant = Model::D6374.torque_constant();
        let drive = OdriveDrive::new(3, firmware == Firmware::V0_6, constant, 1.0);
        // Turns.
        let output = Output::new(|frame| {
            let [a, b, c, d, ..] = *frame.bytes();
            let turns = f32::from_le_bytes([a, b, c, d]);
            (frame.header() == 0x6C).then_some(turns * core::f32::consts::TAU)
        });
        Self { motor: own(motor, setup), drive, output, has_commanded: false }
    }

    fn message(&mut self, number: u16) -> CanFrame {
        let id = StandardId::new(0x60 | number).unwrap();
        self.drive.hear(&CanFrame::new_remote(id, 8).unwrap()).unwrap()
    }

    /// Returns what the axis does now.
    fn output(&self) -> f64 {
        let mut turned = self.drive;
        turned.step(1e-6);
        if turned.state() != Heartbeat::CLOSED_LOOP {
            return 0.0;
        }
        let torque_nm = turned.shaft().torque_nm().abs();
        if FOLLOWS { self.output.under(torque_nm) } else { f64::from(torque_nm) / 3.0 }
    }

    fn beat(&mut self) {
        let heartbeat = self.message(1);
        self.motor.motor_mut().decode_answer(&heartbeat);
    }
}

impl<const FOLLOWS: bool> Subject<1> for Odrive<FOLLOWS> {
    const RULES: [Rules; 1] = rules(FOLLOWS);

    own!(self => self.motor);

    fn hear(&mut self, now: Instant) {
        self.beat();
        let estimates = self.message(9);
        self.ingest(&estimates, now);
    }
    fn set(&mut self, value: f32) -> [Result<(), TargetError>; 1] {
        [if FOLLOWS {
            self.motor.set_angle((), Angle::from_radians(value))
        } else {
            self.motor.set_torque(3.0 * value)
        }]
    }
    /// The axis takes each frame; it is driven by one that leaves it in closed loop and with a torque.
    fn outputs(&mut self, tick: Tick) -> [f64; 1] {
        Devices::update(&mut self.motor, tick);
        let mut output = 0.0_f64;
        self.has_commanded = false;
        while let Some(frame) = Devices::next_frame(&mut self.motor, 0) {
            self.drive.hear(&frame);
            self.output.hear(&frame);
            // A position or a torque.
            self.has_commanded |= [0x6C, 0x6E].contains(&frame.header());
            if frame.is_data_frame() {
                output = output.max(self.output());
            }
        }
        self.has_commanded |= self.drive.state() != Heartbeat::CLOSED_LOOP;
        [output]
    }
    fn has_commanded(&self) -> bool {
        self.has_commanded
    }
    fn command(&self, _: usize) -> Option<CanFrame> {
        CanFrame::standard(0x6E, [0; 8])
    }
}
