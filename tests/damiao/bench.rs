//! A motor of Damiao and its simulated drive.

use drivetrain::damiao::{Mode, Model, Motor};
use drivetrain::frame::CanFrame;
use drivetrain::motor::{Actuator, Devices, ImpedanceControl, Ingest};
use drivetrain::sim::{DamiaoDrive, Drive};
use drivetrain::time::{Instant, Tick};

/// A motor and its drive on a bus that loses nothing.
pub(crate) struct Bench {
    pub(crate) own: Actuator<Motor>,
    pub(crate) drive: DamiaoDrive,
    pub(crate) now_us: u64,
    /// The frames of the last update.
    pub(crate) frames: Vec<CanFrame>,
    pub(crate) is_cut: bool,
    /// Whether the drive hears a frame.
    pub(crate) passes: fn(&CanFrame) -> bool,
}

impl Bench {
    pub(crate) fn new(mode: impl Into<Mode>, number: f32) -> Self {
        let own = Actuator::new(Motor::new(Model::J4310, 1, mode).unwrap());
        let drive = DamiaoDrive::of(Model::J4310, 1).with_register(10, number);
        Self { own, drive, now_us: 1_000, frames: Vec::new(), is_cut: false, passes: |_| true }
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
            if self.is_cut || !(self.passes)(&frame) {
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
    }

    pub(crate) fn steps(&mut self, steps: u32, mut each: impl FnMut(&mut Self)) {
        for _ in 0..steps {
            self.step();
            each(self);
        }
    }

    pub(crate) fn armed(mode: impl Into<Mode>, number: f32) -> Self {
        let mut bench = Self::new(mode, number);
        bench.steps(100, |_| {});
        bench.own.arm(bench.now()).unwrap();
        bench
    }
}

pub(crate) fn mit() -> ImpedanceControl {
    ImpedanceControl::new(3.0).unwrap().with_gains(20.0, 0.6).unwrap()
}
