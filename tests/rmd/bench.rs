//! A motor of MyActuator and its simulated drive.

use drivetrain::frame::CanFrame;
use drivetrain::motor::{Actuator, Devices, ImpedanceControl, Ingest};
use drivetrain::rmd::{Mode, Model, Motor};
use drivetrain::sim::{Drive, RmdDrive};
use drivetrain::time::{Instant, Tick};

/// A motor and its drive on a bus that loses nothing.
pub(crate) struct Bench {
    pub(crate) own: Actuator<Motor>,
    pub(crate) drive: RmdDrive,
    pub(crate) now_us: u64,
    /// The frames of the last update.
    pub(crate) frames: Vec<CanFrame>,
    pub(crate) is_cut: bool,
    /// The driver gives each frame with this code back.
    pub(crate) refused: Option<u8>,
}

impl Bench {
    pub(crate) fn new(model: Model, mode: impl Into<Mode>) -> Self {
        let own = Actuator::new(Motor::new(model, 1, mode).unwrap());
        let drive = RmdDrive::new(1, model.torque_constant());
        Self { own, drive, now_us: 1_000, frames: Vec::new(), is_cut: false, refused: None }
    }

    pub(crate) fn now(&self) -> Instant {
        Instant::from_micros(self.now_us)
    }

    pub(crate) fn step(&mut self) {
        self.now_us += 1_000;
        let now = self.now();
        self.own.update(Tick::new(now, 0.001));
        self.frames.clear();
        while let Some(frame) = self.own.next_frame(0) {
            self.frames.push(frame);
            let is_refused = self.refused == Some(frame.bytes()[0]);
            if is_refused {
                assert!(self.own.requeue(&frame));
            }
            if self.is_cut || is_refused {
                continue;
            }
            if let Some(answer) = self.drive.hear(&frame) {
                let outcome = Devices::ingest(&mut self.own, &answer, now);
                assert_eq!(outcome, Ingest::Taken, "{answer:?}");
            }
        }
        for _ in 0..10 {
            self.drive.step(1e-4);
        }
        if let Some(report) = self.drive.next_frame().filter(|_| !self.is_cut) {
            assert_eq!(Devices::ingest(&mut self.own, &report, now), Ingest::Taken);
        }
    }

    pub(crate) fn steps(&mut self, steps: u32, mut each: impl FnMut(&mut Self)) {
        for _ in 0..steps {
            self.step();
            each(self);
        }
    }

    pub(crate) fn armed(model: Model, mode: impl Into<Mode>) -> Self {
        let mut bench = Self::new(model, mode);
        bench.steps(100, |_| {});
        bench.own.arm(bench.now()).unwrap();
        bench
    }
}

pub(crate) fn torque() -> ImpedanceControl {
    ImpedanceControl::new(4.0).unwrap().with_gains(20.0, 0.4).unwrap()
}
