//! How the time of a session passes.

use crate::link::Link;
use crate::time::Time;
use drivetrain::time::{Duration, Instant};

/// How the time of a session passes.
#[derive(Debug)]
pub(crate) enum Pace {
    /// By the clock of the machine.
    Real(Time),
    /// A millisecond for each cycle: the pilot waits for what lets the next one begin. For tests on a real CAN stack.
    LockStep(Time),
    /// As fast as the machine is, on the simulator or from a recording.
    Fast(Time),
    /// A simulator by the clock of the machine.
    Simulated { time: Time, start: std::time::Instant, from: Instant },
    /// A simulator that stands, and moves on as far as it is allowed to.
    Held { time: Time, until: Instant },
}

impl Pace {
    pub(crate) fn simulated() -> Self {
        let time = Time::manual();
        let from = time.read();
        Self::Simulated { time, start: std::time::Instant::now(), from }
    }

    pub(crate) fn held() -> Self {
        let time = Time::manual();
        let until = time.read();
        Self::Held { time, until }
    }

    pub(crate) fn time(&self) -> Time {
        match self {
            Self::Real(time) | Self::LockStep(time) | Self::Fast(time) => time.clone(),
            Self::Simulated { time, .. } | Self::Held { time, .. } => time.clone(),
        }
    }

    pub(crate) fn is_lock_step(&self) -> bool {
        matches!(self, Self::LockStep(_))
    }

    /// Lets a simulator that stands move on.
    pub(crate) fn allow(&mut self, by: Duration) {
        if let Self::Held { until, .. } = self {
            *until = *until + by;
        }
    }

    /// Tells whether a simulator that stands has gone as far as it is allowed to.
    pub(crate) fn is_held(&self) -> bool {
        matches!(self, Self::Held { time, until } if time.read() >= *until)
    }

    /// Lets a simulator that stands run to its end.
    pub(crate) fn release(&mut self) {
        if let Self::Held { time, .. } = self {
            *self = Self::Fast(time.clone());
        }
    }

    /// Waits a little, or moves the simulator on; `false` if no time passed.
    pub(crate) fn pause(&mut self, link: &mut Link) -> bool {
        let is_behind = match self {
            Self::Real(_) => {
                std::thread::sleep(std::time::Duration::from_micros(200));
                return true;
            }
            Self::LockStep(time) => {
                time.advance(Duration::from_millis(1));
                return true;
            }
            Self::Fast(_) => true,
            Self::Simulated { time, start, from } => {
                let wanted = Duration::from(start.elapsed());
                let passed = time.read().since(*from);
                // A machine that slept does not make up for it.
                if wanted > passed + Duration::from_millis(100) {
                    *from = time.read();
                    *start = std::time::Instant::now();
                }
                wanted > passed
            }
            Self::Held { time, until } => time.read() < *until,
        };
        if !is_behind {
            std::thread::sleep(std::time::Duration::from_micros(500));
            return false;
        }
        let passed = match link {
            Link::Simulated(simulated) => simulated.advance(),
            _ => Duration::from_millis(1),
        };
        self.time().advance(passed);
        true
    }
}
