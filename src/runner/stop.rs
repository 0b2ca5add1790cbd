use core::sync::atomic::{AtomicBool, Ordering};

/// An emergency stop that any context can set: put it into a `static` and set it from an interrupt.
///
/// The runner reads the stop in each tick; from that tick on every command is zero, until
/// [`Runner::clear_emergency_stop`](super::Runner::clear_emergency_stop) and arming again.
///
/// # Examples
/// ```
/// use drivetrain::runner::EmergencyStop;
///
/// static STOP: EmergencyStop = EmergencyStop::new();
/// STOP.set(); // from an interrupt
/// assert!(STOP.is_set());
/// ```
#[derive(Debug, Default)]
pub struct EmergencyStop(AtomicBool);

impl EmergencyStop {
    /// Makes an emergency stop that is not set.
    #[must_use]
    pub const fn new() -> Self {
        Self(AtomicBool::new(false))
    }

    /// Stops.
    pub fn set(&self) {
        self.0.store(true, Ordering::Release);
    }

    /// Clears the stop; stopped motors stay stopped until [`Runner::clear_emergency_stop`](super::Runner::clear_emergency_stop).
    pub fn clear(&self) {
        self.0.store(false, Ordering::Release);
    }

    /// Returns whether the stop is set.
    #[must_use]
    pub fn is_set(&self) -> bool {
        self.0.load(Ordering::Acquire)
    }
}
