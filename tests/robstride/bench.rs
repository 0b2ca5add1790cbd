//! A motor of RobStride and its simulated drive.

use drivetrain::frame::CanFrame;
use drivetrain::motor::{Actuator, Devices, ImpedanceControl, Ingest};
use drivetrain::robstride::{Mode, Model, Motor};
use drivetrain::sim::{Drive, RobStrideDrive};
use drivetrain::time::{Instant, Tick};

/// A motor and its drive on a bus that loses nothing unless told.
pub(crate) struct Bench {
    pub(crate) own: Actuator<Motor>,
    pub(crate) drive: RobStrideDrive,
    pub(crate) now_us: u64,
    /// The frames of the last update.
    pub(crate) frames: Vec<CanFrame>,
    /// Whether the drive hears a frame.
    pub(crate) passes: fn(&CanFrame) -> bool,
    pub(crate) is_cut: bool,
    /// The answers of the drive are lost.
    pub(crate) is_deaf: bool,
    /// The time step that an update is given.
    pub(crate) dt_s: f32,
}

impl Bench {
    pub(crate) fn new(mode: impl Into<Mode>) -> Self {
        Self::of(Model::RS02, mode)
    }

    pub(crate) fn of(model: Model, mode: impl Into<Mode>) -> Self {
        let own = Actuator::new(Motor::new(model, 1, mode).unwrap());
        Self {
            own,
            drive: RobStrideDrive::of(model, 1),
            now_us: 1_000,
            frames: Vec::new(),
            passes: |_| true,
            is_cut: false,
            is_deaf: false,
            dt_s: 0.001,
        }
    }

    pub(crate) fn armed(mode: impl Into<Mode>) -> Self {
        let mut bench = Self::new(mode);
        bench.steps(150, |_| {});
        bench.own.arm(bench.now()).unwrap();
        bench
    }

    pub(crate) fn now(&self) -> Instant {
        Instant::from_micros(self.now_us)
    }

    pub(crate) fn step(&mut self) {
        self.now_us += 1_000;
        let now = self.now();
        self.own.update(Tick::new(now, self.dt_s));
        self.frames.clear();
        while let Some(frame) = self.own.next_frame(0) {
            self.frames.push(frame);
            if self.is_cut || !(self.passes)(&frame) {
                continue;
            }
            if let Some(answer) = self.drive.hear(&frame).filter(|_| !self.is_deaf) {
                let outcome = Devices::ingest(&mut self.own, &answer, now);
                assert!(outcome == Ingest::Taken || kind(&answer) == 0, "{answer:?}");
            }
        }
        assert!(self.frames.len() <= 2, "{:?}", self.frames);
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

/// The type of a frame.
fn kind(frame: &CanFrame) -> u32 {
    frame.header() >> 24 & 0x1F
}

pub(crate) fn operation() -> ImpedanceControl {
    ImpedanceControl::new(3.0).unwrap().with_gains(20.0, 0.6).unwrap()
}
