//! Ends of commands outside of a cycle: the emergency stop, and the abort of frames pending in a controller.

use super::port::{Driver, Nb, Port, Received, Sent};
use crate::frame::CanFrame;
use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};

/// An emergency stop that any context can set: put it into a `static` and set it from an interrupt.
///
/// The runner reads the stop in each tick; from that tick on every command is zero, until
/// [`Runner::clear_emergency_stop`](super::Runner::clear_emergency_stop) and arming again. A stop set and cleared between two
/// ticks counts, and each runner with the stop needs a clear of its own: of two buses of one robot, clear both, then arm both.
///
/// The stop does not know the button. Clear it when the button is released and no longer bounces: a later edge stops again, and a
/// button that is still pressed does not.
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
pub struct EmergencyStop {
    is_set: AtomicBool,
    /// The calls of `set`: a runner notices a stop that was cleared since.
    sets: AtomicU32,
}

impl EmergencyStop {
    /// Makes an emergency stop that is not set.
    #[must_use]
    pub const fn new() -> Self {
        Self { is_set: AtomicBool::new(false), sets: AtomicU32::new(0) }
    }

    /// Stops.
    pub fn set(&self) {
        // No core without a compare-and-swap has an atomic addition. Two calls at once may count as one.
        self.sets.store(self.sets.load(Ordering::Acquire).wrapping_add(1), Ordering::Release);
        self.is_set.store(true, Ordering::Release);
    }

    /// Clears the stop alone: the motors of a runner stay stopped. A program calls
    /// [`Runner::clear_emergency_stop`](super::Runner::clear_emergency_stop) instead.
    pub fn clear(&self) {
        self.is_set.store(false, Ordering::Release);
    }

    /// Returns whether the stop is set.
    #[must_use]
    pub fn is_set(&self) -> bool {
        self.is_set.load(Ordering::Acquire)
    }

    fn sets(&self) -> u32 {
        self.sets.load(Ordering::Acquire)
    }
}

/// The stop of a runner, with the number of its sets until the last tick.
#[derive(Debug)]
pub(super) struct WatchedStop {
    stop: &'static EmergencyStop,
    seen: u32,
}

impl WatchedStop {
    pub(super) fn new(stop: &'static EmergencyStop) -> Self {
        Self { stop, seen: stop.sets() }
    }

    /// Tells whether the stop is set, or was since the last tick.
    pub(super) fn is_set(&self) -> bool {
        self.stop.is_set() || self.stop.sets() != self.seen
    }

    /// Tells whether the stop is set, or was since the last call: the caller then stops its device.
    pub(super) fn take(&mut self) -> bool {
        let is_set = self.is_set();
        if is_set {
            self.seen = self.stop.sets();
        }
        is_set
    }

    pub(super) fn clear(&self) {
        self.stop.clear();
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
/// use core::cell::Cell;
/// use drivetrain::time::{Duration, Instant};
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
/// let clock = Cell::new(Instant::START);
/// let mut bus = Bus::new();
/// bus.attach(Config::<M3508>::new(1))?;
/// let mut runner = Runner::new(NbAbort(Nb(Unplugged::default())), &clock, bus);
/// for _ in 0..5 {
///     clock.set(clock.get() + Duration::from_millis(1));
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dji::{Bus, Config, M3508};
    use crate::runner::Runner;
    use crate::time::{Duration, Instant, Tick};
    use crate::units::Current;
    use core::cell::Cell;
    use embedded_can::ErrorKind;
    use std::vec::Vec;

    fn frame(id: u16, data: [u8; 8]) -> CanFrame {
        CanFrame::standard(id, data).unwrap()
    }

    /// Holds three frames and sends none, until its plug is back.
    #[derive(Default)]
    struct Mailboxes {
        waiting: Vec<CanFrame>,
        left: Vec<CanFrame>,
        feedback: Option<CanFrame>,
        is_plugged: bool,
    }

    impl Mailboxes {
        /// A millisecond of the bus.
        fn run(&mut self) {
            if self.is_plugged {
                self.left.append(&mut self.waiting);
                self.feedback = Some(frame(0x201, [0; 8]));
            }
        }
    }

    impl embedded_can::nb::Can for Mailboxes {
        type Frame = CanFrame;
        type Error = ErrorKind;

        fn transmit(&mut self, frame: &CanFrame) -> nb::Result<Option<CanFrame>, ErrorKind> {
            if self.waiting.len() == 3 {
                return Err(nb::Error::WouldBlock);
            }
            self.waiting.push(*frame);
            Ok(None)
        }

        fn receive(&mut self) -> nb::Result<CanFrame, ErrorKind> {
            self.feedback.take().ok_or(nb::Error::WouldBlock)
        }
    }

    impl AbortPending for Mailboxes {
        fn abort_pending(&mut self, back: impl FnMut(CanFrame)) {
            self.waiting.drain(..).for_each(back);
        }
    }

    /// Drives with a current that counts up each millisecond; the plug is out from 20 ms on, for a while. Returns the words that left
    /// when the plug was back, the number of ticks when the bus was down first, and the runner.
    fn pulled<P: Port>(
        port: impl Fn(Mailboxes) -> P,
        mailboxes: impl Fn(&mut P) -> &mut Mailboxes,
        out_ms: u64,
    ) -> (Vec<i16>, Option<u64>) {
        let clock = Cell::new(Instant::START);
        let mut bus = Bus::new();
        let wheel = bus.attach(Config::<M3508>::at_once(1)).unwrap();
        let mut runner =
            Runner::new(port(Mailboxes { is_plugged: true, ..Mailboxes::default() }), &clock, bus);
        let mut down = None;
        for ms in 1..=20 + out_ms {
            clock.set(clock.get() + Duration::from_millis(1));
            mailboxes(runner.port_mut()).is_plugged = ms < 20;
            mailboxes(runner.port_mut()).run();
            runner.poll(8);
            let tick = runner.due().unwrap();
            if ms == 10 {
                runner.arm(tick).unwrap();
            }
            let amperes = ms as f32 * 0.1;
            _ = runner.device_mut().set_current(wheel, Current::from_amperes(amperes));
            runner.tick(tick);
            if runner.is_bus_down() {
                down = down.or(Some(ms - 20));
            }
        }
        let can = mailboxes(runner.port_mut());
        can.left.clear();
        can.is_plugged = true;
        can.run();
        let word = |frame: &CanFrame| i16::from_be_bytes([frame.bytes()[0], frame.bytes()[1]]);
        (can.left.iter().map(word).collect(), down)
    }

    #[test]
    fn without_an_abort_a_pulled_plug_leaves_a_stale_frame_a_mailbox() {
        let (left, down) = pulled(Nb, |port| &mut port.0, 150);
        assert_eq!(left.len(), 3);
        assert!(left.iter().all(|word| *word != 0), "of 2.0, 2.1 and 2.2 A");
        assert!(down.is_some());
    }

    #[test]
    fn with_an_abort_frames_after_a_pulled_plug_are_of_the_last_tick() {
        let (left, down) = pulled(|can| NbAbort(Nb(can)), |port| &mut port.0.0, 150);
        assert_eq!(left, [0], "zeros, once");
        assert!(
            down.is_some_and(|ms| (100..=102).contains(&ms)),
            "a bus that sends nothing is down: {down:?}"
        );
        // Shorter than the time until feedback is lost: the current of the last tick, 2.5 A, of 20 A in
        // 16384.
        assert_eq!(
            pulled(|can| NbAbort(Nb(can)), |port| &mut port.0.0, 5),
            (std::vec![2048], None)
        );
    }

    #[test]
    fn frames_of_others_that_are_called_back_are_handed_over() {
        let clock = Cell::new(Instant::START);
        let mut runner = Runner::new(NbAbort(Nb(Mailboxes::default())), &clock, Bus::new());
        embedded_can::nb::Can::transmit(&mut runner.port_mut().0.0, &frame(0x123, [7; 8])).unwrap();
        let mut others = Vec::new();
        runner
            .tick_with(Tick::new(Instant::from_micros(1_000), 0.001), |frame| others.push(*frame));
        assert_eq!(others, [frame(0x123, [7; 8])]);
        assert_eq!(runner.statistics().evicted_unrelated, 1);
    }
}
