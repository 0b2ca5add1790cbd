//! A row of the catalogue as a program: a function that returns its observation, or fails.

use drivetrain::motor::{Actuator, DriveProtocol};
use std::any::type_name;
use std::cell::RefCell;
use std::collections::BTreeSet;
use std::fmt::Display;

/// The name of a case, which begins with its id, and the function that drives it.
pub(crate) type Case = (&'static str, fn());

macro_rules! cases {
    ($($name:ident),* $(,)?) => { &[$((stringify!($name), $name as fn())),*] };
}
pub(crate) use cases;

/// What a case saw: the example `faults` prints it.
#[derive(Debug, Default, Clone, PartialEq, Eq)]
pub(crate) struct Seen {
    pub(crate) what: Vec<String>,
    pub(crate) ticks_to_safe: Option<u64>,
    /// The families whose motors were driven.
    pub(crate) families: BTreeSet<&'static str>,
}

thread_local! {
    static SEEN: RefCell<Seen> = RefCell::default();
}

/// Notes what was seen.
pub(crate) fn saw(what: impl Display) {
    SEEN.with_borrow_mut(|seen| seen.what.push(what.to_string()));
}

/// Notes how many ticks of 1 ms passed from a fault to the first safe frame; the longest one counts.
pub(crate) fn safe_after(ticks: u64) {
    SEEN.with_borrow_mut(|seen| seen.ticks_to_safe = seen.ticks_to_safe.max(Some(ticks)));
}

/// Returns what was noted on this thread since the last call.
pub(crate) fn take_seen() -> Seen {
    SEEN.take()
}

/// Notes the family of a motor that the case drives, by the module of its type.
pub(crate) fn drives<M: DriveProtocol>(_motor: &Actuator<M>) {
    let family = type_name::<M>().split("::").nth(1).unwrap_or_default();
    SEEN.with_borrow_mut(|seen| seen.families.insert(family));
}
