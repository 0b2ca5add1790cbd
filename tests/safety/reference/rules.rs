//! The differences between devices, and the choices of a program.

use super::{Opens, Rivals};
use drivetrain::motor::Reaction;
use drivetrain::time::Duration;

/// What one motor differs in from the next.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Rules {
    /// It has feedback, which is late after so long.
    pub(crate) late_us: Option<u64>,
    /// It takes targets again after a recovery.
    pub(crate) resumes: bool,
    /// Its updates have a time step.
    pub(crate) has_steps: bool,
    /// Its device looks at one motor in each update.
    pub(crate) takes_turns: bool,
    /// A request to arm is granted by the next update.
    pub(crate) arms_later: bool,
    /// Its drive is asked for settings and enabled first: until it is driven it may
    /// rest where the reference drives, and it may refuse to be armed.
    pub(crate) is_prepared: bool,
    /// So many unread edges have an order and a time of their own.
    pub(crate) room: usize,
    /// A motor that was lost no longer knows its zero, and trips if no update noticed that.
    pub(crate) loses_zero: bool,
    pub(crate) opens: Opens,
    /// The output opens anew also after rest without a target.
    pub(crate) opens_again: bool,
    /// An output is exact within this.
    pub(crate) resolution: f64,
    pub(crate) rivals: Rivals,
}

/// The choices of a program, for each motor of a device.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Setup {
    pub(crate) opening: Duration,
    pub(crate) on_rival: Reaction,
}

/// Why arming is refused.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Refusal {
    Stopped,
    Missing,
    SecondMaster,
    /// A setting of the drive, of which the reference knows nothing.
    Setting,
    NotReleased,
}

/// The least and the most output of a motor that is driven.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Bounds {
    pub(crate) least: f64,
    pub(crate) most: f64,
}
