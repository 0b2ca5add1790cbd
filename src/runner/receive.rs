//! Received frames, from the driver or a queue to the device.

#[cfg(feature = "queue")]
use super::FrameReceiver;
use super::statistics::increment;
use super::{BusCondition, Port, Received, Runner};
use crate::frame::CanFrame;
use crate::motor::{Devices, Ingest};
use crate::time::{Clock, Instant};
use embedded_can::ErrorKind;

impl<P: Port, K: Clock, D: Devices> Runner<P, K, D> {
    /// Takes at most `budget` received frames from the driver; frames of others are dropped. Returns how many came.
    pub fn poll(&mut self, budget: usize) -> usize {
        self.poll_with(budget, |_| {})
    }

    /// Takes at most `budget` received frames from the driver and hands those of others to `unrelated`. Returns how
    /// many came.
    ///
    /// Never waits, goes on after errors, and ends: an error counts against the budget as well.
    pub fn poll_with(&mut self, budget: usize, mut unrelated: impl FnMut(&CanFrame)) -> usize {
        self.watch.receive_ran();
        let mut frames = 0;
        for _ in 0..budget {
            match self.port.try_receive() {
                Received::Frame(frame) => {
                    frames += 1;
                    let now = self.read_clock();
                    if self.ingest(&frame, now) == Ingest::Unrelated {
                        unrelated(&frame);
                    }
                }
                Received::Foreign => {
                    frames += 1;
                    increment(&mut self.statistics.received);
                    increment(&mut self.statistics.unrelated);
                }
                Received::Empty => break,
                Received::Failed(kind) => {
                    self.statistics.receive_errors.count(kind);
                    if kind == ErrorKind::Overrun {
                        let now = self.read_clock();
                        self.watch.edges.begin(BusCondition::ReceiveOverrun, now);
                    }
                }
            }
        }
        frames
    }

    /// Takes at most `budget` frames from a queue, with the times of their arrival; those of others are dropped. Returns
    /// how many came.
    #[cfg(feature = "queue")]
    pub fn poll_queue(&mut self, queue: &mut FrameReceiver<'_>, budget: usize) -> usize {
        self.poll_queue_with(queue, budget, |_| {})
    }

    /// Takes at most `budget` frames from a queue, with the times of their arrival, and hands those of others to
    /// `unrelated`. Returns how many came.
    ///
    /// Frames that the queue dropped since the last call are noted as [`lost`](super::Statistics::lost).
    ///
    /// # Examples
    /// ```
    /// use drivetrain::dji::{Bus, Config, M3508};
    /// use drivetrain::frame::CanFrame;
    /// use drivetrain::runner::{BusCondition, FrameQueue, Nb, Runner};
    /// use drivetrain::time::{Instant, ManualClock};
    /// # use drivetrain::sim::Simulation;
    /// # let world = Simulation::new(1);
    /// # let can = world.controller();
    ///
    /// let clock = ManualClock::new(Instant::from_micros(9));
    /// let mut bus = Bus::new();
    /// bus.attach(Config::<M3508>::new(1))?;
    /// let mut runner = Runner::new(Nb(can), &clock, bus);
    /// let mut queue = FrameQueue::<4>::new();
    /// let (mut interrupt, mut received) = queue.split();
    /// let frame = CanFrame::standard(0x201, [0; 8]).ok_or("not an 11-bit id")?;
    /// for at in 1..=5 {
    ///     interrupt.push(&frame, Instant::from_micros(at)); // there is room for three
    /// }
    /// assert_eq!(runner.poll_queue_with(&mut received, 16, |_| {}), 3);
    /// assert_eq!(runner.statistics().lost, 2);
    /// assert!(runner.has(BusCondition::ReceiveOverrun));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[cfg(feature = "queue")]
    pub fn poll_queue_with(
        &mut self,
        queue: &mut FrameReceiver<'_>,
        budget: usize,
        mut unrelated: impl FnMut(&CanFrame),
    ) -> usize {
        self.watch.receive_ran();
        self.note_lost(queue.take_dropped());
        let mut frames = 0;
        while frames < budget {
            let Some((frame, arrived)) = queue.pop() else { break };
            frames += 1;
            if self.ingest(&frame, arrived) == Ingest::Unrelated {
                unrelated(&frame);
            }
        }
        frames
    }

    /// Takes one frame that was received elsewhere, in an interrupt say, with the time of its arrival.
    pub fn ingest(&mut self, frame: &CanFrame, now: Instant) -> Ingest {
        increment(&mut self.statistics.received);
        self.watch.standstill.receive();
        self.meter.count(frame);
        let outcome = self.device.ingest(frame, now);
        increment(match outcome {
            Ingest::Taken => {
                self.watch.hear();
                &mut self.statistics.taken
            }
            Ingest::Unrelated => &mut self.statistics.unrelated,
            Ingest::Malformed(_) => &mut self.statistics.malformed,
        });
        outcome
    }

    /// Notes received frames that were lost before they came here: what a queue of your own dropped. 0 changes nothing.
    pub fn note_lost(&mut self, frames: u32) {
        if frames > 0 {
            self.statistics.lost = self.statistics.lost.saturating_add(frames);
            let now = self.read_clock();
            self.watch.edges.begin(BusCondition::ReceiveOverrun, now);
        }
    }
}
