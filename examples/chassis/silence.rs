//! The longest time without a command to the ESCs.

use super::scenario::{Sample, at, seconds_of};
use drivetrain::chassis::MecanumWheels;
use drivetrain::sim::{Sender, Transmission};
use drivetrain::time::{Duration, Instant};

/// Without a command for longer than this, the ESCs missed one: the controller sends one each millisecond.
const MISSED_MS: u64 = 2;

/// Looks for the longest time without a command that a fault brings.
pub(crate) struct CommandWatch {
    window: (Instant, Instant),
    last: Instant,
    longest: (Instant, Instant),
}

impl CommandWatch {
    pub(crate) fn new(from_s: f32, until_s: f32) -> Self {
        let start = Instant::START;
        Self { window: (at(from_s), at(until_s)), last: start, longest: (start, start) }
    }

    /// Takes a frame on the wire; the controller sends nothing but commands.
    pub(crate) fn note(&mut self, record: &Transmission) {
        if record.sender == Sender::Controller && record.delivered {
            self.command(record.at);
        }
    }

    fn command(&mut self, now: Instant) {
        let (from, until) = self.window;
        let is_longer = now - self.last > self.longest.1 - self.longest.0;
        if self.last < until && now > from && is_longer {
            self.longest = (self.last, now);
        }
        self.last = now;
    }

    /// Takes the end of the run for a command. `None` if no command was missed.
    pub(crate) fn finish(mut self, end: Instant, samples: &[Sample]) -> Option<Silence> {
        self.command(end);
        let (from, until) = self.longest;
        (until - from > Duration::from_millis(MISSED_MS))
            .then(|| Silence::new(from, until, samples))
    }
}

/// A time in which no command reached the ESCs.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Silence {
    pub(crate) from_s: f32,
    pub(crate) until_s: f32,
    /// The least and the most current of each motor meanwhile, in A; positive drives the wheel ahead.
    pub(crate) kept_a: MecanumWheels<(f32, f32)>,
    /// How far the robot went meanwhile.
    pub(crate) way_m: f32,
    /// For how long of it the robot was disarmed.
    pub(crate) disarmed_ms: usize,
}

impl Silence {
    fn new(from: Instant, until: Instant, samples: &[Sample]) -> Self {
        let (from_s, until_s) = (seconds_of(from), seconds_of(until));
        let within = || samples.iter().filter(|s| (from_s..until_s).contains(&s.time_s));
        let kept_a = within().fold(MecanumWheels::splat((f32::MAX, f32::MIN)), |kept, sample| {
            kept.zip(sample.current_a).map(|((least, most), a)| (least.min(a), most.max(a)))
        });
        let way = |pair: (&Sample, &Sample)| {
            let ((x, y), (next_x, next_y)) = (pair.0.position_m, pair.1.position_m);
            (next_x - x).hypot(next_y - y)
        };
        Self {
            from_s,
            until_s,
            kept_a,
            way_m: within().zip(within().skip(1)).map(way).sum(),
            disarmed_ms: within().filter(|sample| !sample.armed).count(),
        }
    }
}
