//! A motor on a VESC and its simulated drive.

use drivetrain::control::PidConfig;
use drivetrain::encoder::GearRatio;
use drivetrain::frame::CanFrame;
use drivetrain::motor::{Actuator, Devices, Ingest};
use drivetrain::sim::{Drive, VescDrive};
use drivetrain::time::{Instant, Tick};
use drivetrain::units::AngularVelocity;
use drivetrain::vesc::{Mode, Model, Motor};

pub(crate) const MODEL: Model = Model {
    name: "6374",
    pole_pairs: 7,
    gear: GearRatio::DIRECT,
    torque_constant_nm_per_a: 0.05,
    current_limit_a: 20.0,
    max_velocity: AngularVelocity::from_rad_per_s(300.0),
};

/// 7 pole pairs, no gear, 0.05 Nm/A; the drive has twice the current of the model.
pub(crate) fn drive(id: u8) -> VescDrive {
    VescDrive::of(MODEL, id).with_current_max(40.0)
}

/// A motor and its drive on a bus that loses nothing. The drive reports at 1 kHz.
pub(crate) struct Bench {
    pub(crate) own: Actuator<Motor>,
    pub(crate) drive: VescDrive,
    pub(crate) now_us: u64,
    /// The frames of the last update.
    pub(crate) frames: Vec<CanFrame>,
    /// The status frames that the drive sends each ms.
    pub(crate) reports: Vec<u8>,
    pub(crate) is_cut: bool,
}

impl Bench {
    pub(crate) fn of(motor: Motor) -> Self {
        Self {
            own: Actuator::new(motor),
            drive: drive(23),
            now_us: 1_000,
            frames: Vec::new(),
            reports: vec![27, 16, 9],
            is_cut: false,
        }
    }

    pub(crate) fn new(mode: Mode) -> Self {
        Self::of(Motor::new(MODEL, 23, mode).unwrap())
    }

    pub(crate) fn armed(mode: Mode) -> Self {
        let mut bench = Self::new(mode);
        bench.arm();
        bench
    }

    pub(crate) fn arm(&mut self) {
        self.steps(100, |_| {});
        self.own.arm(self.now()).unwrap();
    }

    pub(crate) fn now(&self) -> Instant {
        Instant::from_micros(self.now_us)
    }

    pub(crate) fn step(&mut self) {
        self.now_us += 1_000;
        let now = self.now();
        if !self.is_cut {
            for report in self.reports.clone() {
                let frame = self.drive.report(report).unwrap();
                assert_eq!(Devices::ingest(&mut self.own, &frame, now), Ingest::Taken, "{frame:?}");
            }
        }
        self.own.update(Tick::new(now, 0.001));
        self.frames.clear();
        while let Some(frame) = self.own.next_frame(0) {
            self.frames.push(frame);
            if self.is_cut {
                continue;
            }
            if let Some(answer) = self.drive.hear(&frame) {
                assert_eq!(Devices::ingest(&mut self.own, &answer, now), Ingest::Taken);
            }
        }
        for _ in 0..10 {
            self.drive.step(1e-4);
        }
    }

    pub(crate) fn steps(&mut self, steps: u32, mut each: impl FnMut(&mut Self)) {
        for _ in 0..steps {
            self.step();
            each(self);
        }
    }
}

/// rad/s to Nm: the shaft has 0.01 kg m².
pub(crate) const SPEED: PidConfig = PidConfig::new(0.3, 1.0, 0.0);
/// rad to rad/s.
pub(crate) const POSITION: PidConfig = PidConfig::new(10.0, 0.0, 0.0).with_output_limit(20.0);

pub(crate) fn looped() -> Mode {
    Mode::current_with_loops(POSITION, SPEED).unwrap()
}
