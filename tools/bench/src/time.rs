//! The clock of a session: that of the machine, or one that is moved on by hand.

use drivetrain::time::{Clock, Duration, Instant};
use std::cell::Cell;
use std::rc::Rc;

/// A clock whose copies are one clock.
#[derive(Debug, Clone)]
pub(crate) enum Time {
    Real(std::time::Instant),
    Manual(Rc<Cell<Instant>>),
}

impl Time {
    /// The time since the start of the program.
    pub(crate) fn real() -> Self {
        Self::Real(std::time::Instant::now())
    }

    /// A clock that stands until it is moved on.
    pub(crate) fn manual() -> Self {
        Self::Manual(Rc::new(Cell::new(Instant::from_micros(1_000_000))))
    }

    pub(crate) fn read(&self) -> Instant {
        match self {
            Self::Real(start) => Instant::START + Duration::from(start.elapsed()),
            Self::Manual(now) => now.get(),
        }
    }

    /// Moves a manual clock on; that of the machine moves by itself.
    pub(crate) fn advance(&self, by: Duration) {
        if let Self::Manual(now) = self {
            now.set(now.get() + by);
        }
    }
}

impl Clock for Time {
    fn now(&mut self) -> Instant {
        self.read()
    }
}
