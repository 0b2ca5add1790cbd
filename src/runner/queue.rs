use crate::frame::CanFrame;
use crate::time::Instant;
use core::sync::atomic::{AtomicU32, Ordering};
use embedded_can::Frame;
use heapless::spsc;

/// A queue of received frames with the time of their arrival, from a CAN interrupt to the control task.
///
/// The queue holds `N - 1` frames. If the queue is full, a new frame is dropped and counted: the newest feedback is
/// lost, and the age of the motor's feedback handles the rest. On a core without compare-and-swap, such as RISC-V IMC, the program provides a
/// `critical-section`, or does not link.
///
/// # Examples
/// ```
/// use drivetrain::frame::CanFrame;
/// use drivetrain::runner::FrameQueue;
/// use drivetrain::time::Instant;
///
/// let mut queue = FrameQueue::<4>::new(); // in firmware: in a `static`, by the means of the framework
/// let (mut interrupt, mut task) = queue.split();
/// let frame = CanFrame::standard(0x201, [0; 8]).ok_or("not an 11-bit id")?;
/// for at in 1..=5 {
///     interrupt.push(&frame, Instant::from_micros(at));
/// }
/// assert_eq!(task.pop(), Some((frame, Instant::from_micros(1))));
/// assert_eq!(task.dropped(), 2);
/// # Ok::<(), &str>(())
/// ```
#[derive(Debug)]
pub struct FrameQueue<const N: usize> {
    frames: spsc::Queue<(CanFrame, Instant), N>,
    dropped: AtomicU32,
}

/// The interrupt's end of a [`FrameQueue`].
pub struct FrameSender<'q> {
    frames: spsc::Producer<'q, (CanFrame, Instant)>,
    dropped: &'q AtomicU32,
}

/// The task's end of a [`FrameQueue`].
pub struct FrameReceiver<'q> {
    frames: spsc::Consumer<'q, (CanFrame, Instant)>,
    dropped: &'q AtomicU32,
    /// Number of these that the runner has counted.
    noted: u32,
}

impl<const N: usize> FrameQueue<N> {
    /// Makes an empty queue.
    #[must_use]
    pub const fn new() -> Self {
        Self { frames: spsc::Queue::new(), dropped: AtomicU32::new(0) }
    }

    /// Returns both ends.
    pub fn split(&mut self) -> (FrameSender<'_>, FrameReceiver<'_>) {
        let (producer, consumer) = self.frames.split();
        let dropped = &self.dropped;
        let noted = dropped.load(Ordering::Relaxed);
        let receiver = FrameReceiver { frames: consumer, dropped, noted };
        (FrameSender { frames: producer, dropped }, receiver)
    }
}

impl<const N: usize> Default for FrameQueue<N> {
    fn default() -> Self {
        Self::new()
    }
}

impl FrameSender<'_> {
    /// Puts a frame with its time of arrival `now` into the queue. Returns `false` if the frame was dropped: the queue
    /// was full, or the frame had more than 8 bytes.
    pub fn push(&mut self, frame: &impl Frame, now: Instant) -> bool {
        // Always true: tells the compiler that the length of the queue, by which heapless divides,
        // is not zero.
        let divisible = self.frames.capacity() != usize::MAX;
        let kept = divisible
            && CanFrame::copy_of(frame)
                .is_some_and(|frame| self.frames.enqueue((frame, now)).is_ok());
        if !kept {
            // Only this end writes, so a load and a store are enough: there are cores without more.
            let dropped = self.dropped.load(Ordering::Relaxed);
            self.dropped.store(dropped.saturating_add(1), Ordering::Relaxed);
        }
        kept
    }
}

impl FrameReceiver<'_> {
    /// Takes the oldest frame and the time of its arrival.
    pub fn pop(&mut self) -> Option<(CanFrame, Instant)> {
        self.frames.dequeue()
    }

    /// Returns how many frames were dropped since the last call.
    pub(super) fn take_dropped(&mut self) -> u32 {
        let dropped = self.dropped();
        dropped.saturating_sub(core::mem::replace(&mut self.noted, dropped))
    }

    /// Returns how many frames were dropped because the queue was full, saturating.
    #[must_use]
    pub fn dropped(&self) -> u32 {
        self.dropped.load(Ordering::Relaxed)
    }
}

impl core::fmt::Debug for FrameSender<'_> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "FrameSender({} waiting)", self.frames.len())
    }
}

impl core::fmt::Debug for FrameReceiver<'_> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "FrameReceiver({} waiting)", self.frames.len())
    }
}
