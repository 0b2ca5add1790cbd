//! An ODrive: an axis whose heartbeat tells its state, and whose encoder estimates are the link.

use super::reference::{BadStep, Rules};
use super::subjects::Subject;
use drivetrain::frame::CanFrame;
use drivetrain::motor::{
    AngleDrive, ArmError, Condition, Devices, HealthConfig, ImpedanceControl, Link, Own, OwnMotor,
    Reaction, TargetError,
};
use drivetrain::odrive::{Firmware, Heartbeat, Mode, Model, Motor};
use drivetrain::sim::OdriveDrive;
use drivetrain::time::{Duration, Instant, Tick};
use drivetrain::units::{Angle, AngularVelocity};
use embedded_can::{Frame, StandardId};

static STANDS: HealthConfig =
    HealthConfig::new().with_reaction(Condition::Stalled, Reaction::Ignore);

pub(super) struct Odrive {
    motor: Own<Motor>,
    drive: OdriveDrive,
    set: fn(&mut Own<Motor>, f32) -> Result<(), TargetError>,
}

impl Odrive {
    pub(super) fn torque() -> Self {
        let mode = ImpedanceControl::new(3.0).unwrap();
        Self::new(mode, Firmware::V0_5, |motor, value| motor.set_torque(3.0 * value))
    }
}

impl Odrive {
    pub(super) fn position() -> Self {
        let set = |motor: &mut Own<Motor>, value| motor.set_angle((), Angle::from_radians(value));
        Self::new(Mode::position(3.0), Firmware::V0_6, set)
    }
}

impl Odrive {
    fn new(
        mode: impl Into<Mode>,
        firmware: Firmware,
        set: fn(&mut Own<Motor>, f32) -> Result<(), TargetError>,
    ) -> Self {
        let fastest = AngularVelocity::from_rad_per_s(10.0);
        let motor = Motor::new(Model::D6374, firmware, 3, fastest, mode).unwrap();
        let motor = Own::new(motor).with_health(&STANDS).unwrap().with_opening(Duration::ZERO);
        let constant = Model::D6374.torque_constant();
        let drive = OdriveDrive::new(3, firmware == Firmware::V0_6, constant, 1.0);
        Self { motor, drive, set }
    }

    fn message(&mut self, number: u16) -> CanFrame {
        let id = StandardId::new(0x60 | number).unwrap();
        self.drive.hear(&CanFrame::new_remote(id, 8).unwrap()).unwrap()
    }

    fn beat(&mut self) {
        let heartbeat = self.message(1);
        self.motor.motor_mut().decode_answer(&heartbeat);
    }
}

impl Subject<1> for Odrive {
    const RULES: [Rules; 1] = [Rules {
        late_us: Some(10_000),
        resumes: false,
        bad_step: BadStep::Ages,
        arms_later: false,
        arms_again: false,
        is_prepared: true,
    }];

    fn arm(&mut self, now: Instant) -> Result<(), ArmError> {
        Devices::arm(&mut self.motor, now)
    }
    fn disarm(&mut self) {
        Devices::disarm(&mut self.motor);
    }
    fn stop(&mut self) {
        Devices::emergency_stop(&mut self.motor);
    }
    fn clear_stop(&mut self) {
        Devices::clear_emergency_stop(&mut self.motor);
    }
    fn hear(&mut self, now: Instant) {
        self.beat();
        let estimates = self.message(9);
        _ = Devices::ingest(&mut self.motor, &estimates, now);
    }
    fn link(&self) -> [Link; 1] {
        [self.motor.guard().link()]
    }
    fn is_armed(&self) -> [bool; 1] {
        [self.motor.guard().is_armed()]
    }
    fn set(&mut self, value: f32) -> [Result<(), TargetError>; 1] {
        [(self.set)(&mut self.motor, value)]
    }
    fn relax(&mut self) -> [bool; 1] {
        [false]
    }
    /// The axis takes each frame; it is driven by one that leaves it in closed loop and with a torque.
    fn drives(&mut self, tick: Tick) -> [bool; 1] {
        Devices::update(&mut self.motor, tick);
        let mut is_driven = false;
        while let Some(frame) = Devices::next_frame(&mut self.motor, 0) {
            self.drive.hear(&frame);
            let mut turned = self.drive;
            turned.step(1e-6);
            is_driven |= turned.state() == Heartbeat::CLOSED_LOOP
                && frame.is_data_frame()
                && turned.shaft().torque_nm() != 0.0;
        }
        [is_driven]
    }
}
