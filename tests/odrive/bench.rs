//! A motor at an ODrive and its simulated drive.

use drivetrain::frame::CanFrame;
use drivetrain::motor::{Actuator, Devices, ImpedanceControl, Ingest};
use drivetrain::odrive::{Firmware, Mode, Model, Motor};
use drivetrain::sim::{Drive, OdriveDrive};
use drivetrain::time::{Instant, Tick};
use drivetrain::units::AngularVelocity;

/// Turns of the motor for one of the shaft.
pub(crate) const GEAR: f32 = 5.0;

/// A motor and its drive on a bus that loses nothing.
pub(crate) struct Bench {
    pub(crate) own: Actuator<Motor>,
    pub(crate) drive: OdriveDrive,
    pub(crate) now_us: u64,
    /// The frames of the last update.
    pub(crate) frames: Vec<CanFrame>,
    /// Nothing reaches the drive.
    pub(crate) is_cut: bool,
    /// Nothing with this number comes from the drive.
    pub(crate) lost: Option<u32>,
    /// The driver gives each frame with this number back.
    pub(crate) refused: Option<u32>,
}

pub(crate) fn motor(mode: impl Into<Mode>, firmware: Firmware) -> Motor {
    let fastest = AngularVelocity::from_rad_per_s(20.0);
    Motor::new(Model::D6374, firmware, 3, fastest, mode).unwrap().with_gear(GEAR).unwrap()
}

impl Bench {
    pub(crate) fn new(mode: impl Into<Mode>, firmware: Firmware) -> Self {
        Self::with(motor(mode, firmware), GEAR)
    }

    pub(crate) fn with(motor: Motor, gear: f32) -> Self {
        let is_0_6 = motor.claims_endpoints();
        let constant = Model::D6374.torque_constant();
        let drive = OdriveDrive::new(3, is_0_6, constant, gear).with_periods(0.1, 0.002);
        let own = Actuator::new(motor);
        Self {
            own,
            drive,
            now_us: 1_000,
            frames: Vec::new(),
            is_cut: false,
            lost: None,
            refused: None,
        }
    }

    pub(crate) fn now(&self) -> Instant {
        Instant::from_micros(self.now_us)
    }

    fn answer(&mut self, frame: Option<CanFrame>) {
        let Some(frame) = frame.filter(|frame| self.lost != Some(frame.header() & 0x1F)) else {
            return;
        };
        let now = self.now();
        assert_eq!(Devices::ingest(&mut self.own, &frame, now), Ingest::Taken, "{frame:?}");
    }

    pub(crate) fn step(&mut self) {
        self.now_us += 1_000;
        let now = self.now();
        self.own.update(Tick::new(now, 0.001));
        self.frames.clear();
        while let Some(frame) = self.own.next_frame(0) {
            self.frames.push(frame);
            if self.refused == Some(frame.header() & 0x1F) {
                assert!(self.own.requeue(&frame));
            } else if !self.is_cut {
                let answer = self.drive.hear(&frame);
                self.answer(answer);
            }
        }
        for _ in 0..10 {
            self.drive.step(1e-4);
        }
        while let Some(frame) = self.drive.next_frame() {
            self.answer(Some(frame));
        }
    }

    pub(crate) fn steps(&mut self, steps: u32, mut each: impl FnMut(&mut Self)) {
        for _ in 0..steps {
            self.step();
            each(self);
        }
    }

    /// Armed, with a heartbeat heard.
    pub(crate) fn armed(mode: impl Into<Mode>, firmware: Firmware) -> Self {
        let mut bench = Self::new(mode, firmware);
        bench.arm();
        bench
    }

    pub(crate) fn arm(&mut self) {
        self.steps(150, |_| {});
        self.own.arm(self.now()).unwrap();
    }

    /// Sent so far in the last update, by the number of the message.
    pub(crate) fn has_sent(&self, number: u32) -> bool {
        self.frames.iter().any(|frame| frame.header() == 0x60 | number)
    }
}

/// A drive of firmware 0.6 reports its errors when asked.
trait Generation {
    fn claims_endpoints(&self) -> bool;
}

impl Generation for Motor {
    fn claims_endpoints(&self) -> bool {
        use drivetrain::motor::DriveProtocol;
        self.claims()
            .into_iter()
            .any(|claim| claim.to_string().ends_with("feedback of D6374 #3 on 0x65"))
    }
}

/// Torque mode: 3 Nm at most, with gains.
pub(crate) fn torque() -> ImpedanceControl {
    ImpedanceControl::new(3.0).unwrap().with_gains(20.0, 0.6).unwrap()
}
