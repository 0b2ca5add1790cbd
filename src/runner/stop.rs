//! An emergency stop, and a driver that can abort the frames pending in its controller.

use super::port::{Driver, Received, Sent};
use super::{Nb, Port};
use crate::frame::CanFrame;
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

/// A CAN driver that can abort frames pending in its controller, as bxCAN, FDCAN and MCP2515 allow.
///
/// `embedded-can` has no such call. Without it, if the plug is pulled while the motors are driven, a frame with the old
/// currents stays in each mailbox and leaves when the bus is back. Implement the trait for the newtype around the driver, and
/// give the runner `NbAbort(Nb(driver))`.
pub trait AbortPending: embedded_can::nb::Can {
    /// Aborts the transmission of all pending frames, and hands each aborted frame to `back`. Does not wait.
    ///
    /// A frame on the wire at that moment may still arrive; if the controller cannot tell, the frame is handed over too.
    /// Frames in a queue of the driver count as pending as well.
    fn abort_pending(&mut self, back: impl FnMut(Self::Frame));
}

/// A driver that implements [`AbortPending`]: as [`Nb`], and no command older than one period waits in the controller.
///
/// Before each update, every frame not sent since the tick before is called back. Frames of the device are offered again with the
/// values of this update. Frames of others are not offered again: they go to the closure of
/// [`Runner::tick_with`](super::Runner::tick_with), as evicted frames do. A bus that sends nothing for 100 ms is down, as if the
/// driver refused every frame.
///
/// # Examples
/// The plug is out for 5 ms while the current changes: with `Nb`, each mailbox would send an old frame afterwards.
/// ```
/// use drivetrain::dji::{Bus, Config, M3508};
/// use drivetrain::frame::CanFrame;
/// use drivetrain::runner::{AbortPending, Nb, NbAbort, Runner};
/// use drivetrain::time::{Duration, Instant, ManualClock};
/// # use embedded_can::ErrorKind;
///
/// /// A controller whose plug is out: nothing ever leaves.
/// #[derive(Default)]
/// struct Unplugged(Vec<CanFrame>);
/// # impl embedded_can::nb::Can for Unplugged {
/// #     type Frame = CanFrame;
/// #     type Error = ErrorKind;
/// #     fn transmit(&mut self, frame: &CanFrame) -> nb::Result<Option<CanFrame>, ErrorKind> {
/// #         if self.0.len() == 3 { return Err(nb::Error::WouldBlock); }
/// #         self.0.push(*frame);
/// #         Ok(None)
/// #     }
/// #     fn receive(&mut self) -> nb::Result<CanFrame, ErrorKind> { Err(nb::Error::WouldBlock) }
/// # }
/// impl AbortPending for Unplugged {
///     fn abort_pending(&mut self, back: impl FnMut(CanFrame)) {
///         self.0.drain(..).for_each(back);
///     }
/// }
///
/// let clock = ManualClock::new(Instant::START);
/// let mut bus = Bus::new();
/// bus.attach(Config::<M3508>::new(1))?;
/// let mut runner = Runner::new(NbAbort(Nb(Unplugged::default())), &clock, bus);
/// for _ in 0..5 {
///     clock.advance(Duration::from_millis(1));
///     runner.poll(16);
///     if let Some(tick) = runner.due() {
///         runner.tick(tick);
///     }
/// }
/// assert_eq!(runner.port_mut().0.0.0.len(), 1); // that of the last tick
/// assert_eq!(runner.statistics().evicted, 4);
/// # Ok::<(), drivetrain::dji::AttachError>(())
/// ```
#[derive(Debug, Clone, Copy)]
pub struct NbAbort<C>(pub Nb<C>);

impl<C: AbortPending> Port for NbAbort<C> {}

impl<C: AbortPending> Driver for NbAbort<C> {
    #[inline(always)]
    fn try_send(&mut self, frame: &CanFrame, evicted: &mut CanFrame) -> Sent {
        self.0.try_send(frame, evicted)
    }

    #[inline]
    fn try_receive(&mut self, frame: &mut CanFrame) -> Received {
        self.0.try_receive(frame)
    }

    fn call_back(&mut self, mut back: impl FnMut(Option<CanFrame>)) {
        self.0.0.abort_pending(|frame| back(CanFrame::copy_of(&frame)));
    }
}
