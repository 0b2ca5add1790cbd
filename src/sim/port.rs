use super::can::Offer;
use super::engine::Engine;
use super::esc::Random;
use super::line::Ring;
use super::{Fault, Line, SimError};
use crate::frame::CanFrame;
use crate::time::Instant;
use core::cell::RefCell;

/// Time limit of a blocking call, in simulated time.
const PATIENCE_NS: u64 = 1_000_000_000;
/// A blocking call polls at least this often.
const NAP_NS: u64 = 100_000;

/// The driver's end of a simulated bus: three transmit mailboxes and a receive queue.
///
/// The controller implements [`embedded_can::nb::Can`] and [`embedded_can::blocking::Can`], so it can stand in for any
/// driver. Transmission begins at the earliest when time moves: frames handed over at one instant compete by their ids.
///
/// * If the mailboxes are full, `transmit` evicts and returns the pending frame of lowest priority for a frame of
///   strictly higher priority; otherwise `transmit` would block. A frame in transmission is not evicted, and frames of
///   one id keep their order.
/// * `receive` reports an overrun once, then continues with the kept frames; the newest frames are missing.
/// * The blocking calls move the time of the world until they are done, for a second at most.
///
/// # Examples
/// ```
/// use drivetrain::frame::CanFrame;
/// use drivetrain::sim::Simulation;
/// use embedded_can::nb::Can;
///
/// let world = Simulation::new(1);
/// let mut can = world.controller();
/// for id in [0x300, 0x100, 0x200] {
///     let frame = CanFrame::standard(id, [0; 8]).ok_or("id")?;
///     assert_eq!(can.transmit(&frame), Ok(None));
/// }
/// let urgent = CanFrame::standard(0x080, [0; 8]).ok_or("id")?;
/// let evicted = can.transmit(&urgent).map_err(|_| "refused")?;
/// assert_eq!(evicted.map(|frame| frame.header()), Some(0x300));
/// let late = CanFrame::standard(0x301, [0; 8]).ok_or("id")?;
/// assert_eq!(can.transmit(&late), Err(nb::Error::WouldBlock));
/// # Ok::<(), &str>(())
/// ```
#[derive(Debug)]
pub struct Controller<'a> {
    engine: &'a RefCell<Engine>,
    line: Line,
}

impl<'a> Controller<'a> {
    pub(super) const fn new(engine: &'a RefCell<Engine>, line: Line) -> Self {
        Self { engine, line }
    }

    /// Aborts the frames in the mailboxes, except a frame in transmission.
    ///
    /// embedded-can has no such call; drivers name it `abort`.
    pub fn abort_pending(&mut self) {
        self.with(|engine| engine.wire_mut(self.line).mailboxes.abort());
    }

    /// Fails where any call of the driver fails.
    fn check(&self) -> Result<(), SimError> {
        self.with(|engine| {
            let now_ns = engine.now_ns;
            let error = if engine.faults.is_active(Fault::BusOff(self.line), now_ns) {
                SimError::BusOff
            } else if engine.faults.driver_error(self.line, now_ns) {
                SimError::Scripted
            } else {
                return Ok(());
            };
            let traffic = &mut engine.wire_mut(self.line).traffic;
            traffic.errors = traffic.errors.saturating_add(1);
            Err(error)
        })
    }

    fn is_blocked(&self) -> bool {
        let blocked = Fault::WouldBlock(self.line);
        self.with(|engine| engine.faults.is_active(blocked, engine.now_ns))
    }

    fn offer(&self, frame: &CanFrame) -> Offer {
        let blocked = self.is_blocked();
        self.with(|engine| {
            let wire = engine.wire_mut(self.line);
            let offer = if blocked { Offer::Refused } else { wire.mailboxes.offer(*frame) };
            match offer {
                Offer::Taken => {}
                Offer::Replaced(_) => wire.traffic.evicted = wire.traffic.evicted.saturating_add(1),
                Offer::Refused => wire.traffic.refused = wire.traffic.refused.saturating_add(1),
            }
            offer
        })
    }

    fn take(&self) -> nb::Result<CanFrame, SimError> {
        let missed = self.with(|engine| engine.wire_mut(self.line).take_overrun());
        if missed {
            return Err(nb::Error::Other(SimError::Overrun));
        }
        let heard = self.with(|engine| engine.wire_mut(self.line).take_heard());
        heard.ok_or(nb::Error::WouldBlock)
    }

    /// Works on the world. No caller's code runs in `work`, so the world is never borrowed twice.
    fn with<T>(&self, work: impl FnOnce(&mut Engine) -> T) -> T {
        work(&mut self.engine.borrow_mut())
    }

    /// Moves time until `attempt` gives something.
    fn wait<T>(
        &self,
        mut attempt: impl FnMut() -> Option<Result<T, SimError>>,
    ) -> Result<T, SimError> {
        let deadline_ns = self.with(|engine| engine.now_ns.saturating_add(PATIENCE_NS));
        loop {
            if let Some(result) = attempt() {
                return result;
            }
            let waiting = self.with(|engine| {
                let limit_ns = engine.now_ns.saturating_add(NAP_NS);
                if let Some(record) = engine.run_until(limit_ns) {
                    let _full = engine.unseen.push(record);
                }
                engine.now_ns < deadline_ns
            });
            if !waiting {
                return Err(SimError::TimedOut);
            }
        }
    }
}

impl embedded_can::nb::Can for Controller<'_> {
    type Frame = CanFrame;
    type Error = SimError;

    fn transmit(&mut self, frame: &CanFrame) -> nb::Result<Option<CanFrame>, SimError> {
        self.check()?;
        match self.offer(frame) {
            Offer::Taken => Ok(None),
            Offer::Replaced(evicted) => Ok(Some(evicted)),
            Offer::Refused => Err(nb::Error::WouldBlock),
        }
    }

    fn receive(&mut self) -> nb::Result<CanFrame, SimError> {
        self.check()?;
        self.take()
    }
}

impl embedded_can::blocking::Can for Controller<'_> {
    type Frame = CanFrame;
    type Error = SimError;

    fn transmit(&mut self, frame: &CanFrame) -> Result<(), SimError> {
        self.wait(|| {
            if let Err(error) = self.check() {
                return Some(Err(error));
            }
            let line = self.line;
            let room = self.with(|engine| engine.wire(line).mailboxes.has_room());
            // Room first: a blocking driver waits and does not evict.
            (room && !self.is_blocked()).then(|| {
                self.offer(frame);
                Ok(())
            })
        })
    }

    fn receive(&mut self) -> Result<CanFrame, SimError> {
        self.wait(|| match self.check().map_err(nb::Error::Other).and_then(|()| self.take()) {
            Ok(frame) => Some(Ok(frame)),
            Err(nb::Error::Other(error)) => Some(Err(error)),
            Err(nb::Error::WouldBlock) => None,
        })
    }
}

/// Start bit, eight data bits, stop bit.
const BITS_A_BYTE: u64 = 10;
/// So many bytes are on their way at most, in the sender's buffer or on the wire.
const CAPACITY: usize = 1024;

/// One direction of a serial line: bytes take their time, and some are damaged.
///
/// # Examples
/// ```
/// use drivetrain::sim::SerialLine;
/// use drivetrain::time::Instant;
///
/// let mut line = SerialLine::new(115_200, 1);
/// assert_eq!(line.send(&[1, 2, 3], Instant::START), 3);
/// let mut bytes = [0; 8];
/// assert_eq!(line.receive(Instant::from_micros(180), &mut bytes), [1, 2]); // 86.8 us each
/// assert_eq!(line.receive(Instant::from_micros(270), &mut bytes), [3]);
/// ```
#[derive(Debug, Clone)]
pub struct SerialLine {
    byte_ns: u64,
    /// When the last byte is over.
    free_ns: u64,
    queue: Ring<(u64, u8), CAPACITY>,
    /// Probabilities for a byte.
    flipped: f32,
    dropped: f32,
    inserted: f32,
    is_cut: bool,
    random: Random,
    counts: Counts,
}

/// Counts of a line.
#[derive(Debug, Default, Clone, Copy)]
struct Counts {
    sent: u32,
    received: u32,
    flipped: u32,
    lost: u32,
    inserted: u32,
}

impl SerialLine {
    /// Takes the baud rate, 8 data bits and no parity, and a seed for its noise; quiet at first.
    #[must_use]
    pub fn new(baud: u32, seed: u64) -> Self {
        Self {
            byte_ns: (BITS_A_BYTE * 1_000_000_000) / u64::from(baud.max(1)),
            free_ns: 0,
            queue: Ring::new(),
            flipped: 0.0,
            dropped: 0.0,
            inserted: 0.0,
            is_cut: false,
            random: Random::new(seed, 1 << 41),
            counts: Counts::default(),
        }
    }

    /// Sets the probability of a wrong bit in a byte, from now on: 0 to 1, by default 0.
    pub const fn set_flipped(&mut self, probability: f32) {
        self.flipped = probability;
    }

    /// Sets the probability of a missing byte, from now on: 0 to 1, by default 0.
    pub const fn set_dropped(&mut self, probability: f32) {
        self.dropped = probability;
    }

    /// Sets the probability of a random byte before a byte, from now on: 0 to 1, by default 0.
    pub const fn set_inserted(&mut self, probability: f32) {
        self.inserted = probability;
    }

    /// Cuts or mends the line: bytes sent while the line is cut are lost.
    pub const fn set_cut(&mut self, is_cut: bool) {
        self.is_cut = is_cut;
    }

    /// Sends bytes; returns how many there was room for.
    pub fn send(&mut self, bytes: &[u8], now: Instant) -> usize {
        self.free_ns = self.free_ns.max(now.as_micros().saturating_mul(1_000));
        for (done, byte) in bytes.iter().enumerate() {
            // Room for the byte, and for a byte of noise.
            if self.queue.len() + 2 > CAPACITY {
                return done;
            }
            self.send_byte(*byte);
        }
        bytes.len()
    }

    fn send_byte(&mut self, byte: u8) {
        let counts = &mut self.counts;
        counts.sent = counts.sent.saturating_add(1);
        self.free_ns += self.byte_ns;
        if self.is_cut || self.random.chance(self.dropped) {
            counts.lost = counts.lost.saturating_add(1);
            return;
        }
        if self.random.chance(self.inserted) {
            counts.inserted = counts.inserted.saturating_add(1);
            let [stray, ..] = self.random.next_u32().to_le_bytes();
            _ = self.queue.push((self.free_ns, stray));
        }
        let flips = self.random.chance(self.flipped);
        let wrong = if flips { 1 << self.random.below(8) } else { 0 };
        counts.flipped = counts.flipped.saturating_add(u32::from(flips));
        _ = self.queue.push((self.free_ns, byte ^ wrong));
    }

    /// Takes the bytes that arrived until `now`, up to the length of `out`; returns them.
    pub fn receive<'a>(&mut self, now: Instant, out: &'a mut [u8]) -> &'a [u8] {
        let now_ns = now.as_micros().saturating_mul(1_000);
        let mut length = 0;
        for place in out.iter_mut() {
            let Some((_, byte)) = self.queue.peek().filter(|(at_ns, _)| *at_ns <= now_ns) else {
                break;
            };
            _ = self.queue.pop();
            *place = byte;
            length += 1;
        }
        self.counts.received =
            self.counts.received.saturating_add(u32::try_from(length).unwrap_or(u32::MAX));
        out.get(..length).unwrap_or(&[])
    }

    /// Returns how many bytes were sent, damaged and lost ones too. Saturates, as all counts do.
    #[must_use]
    pub const fn sent(&self) -> u32 {
        self.counts.sent
    }

    /// Returns how many bytes came out.
    #[must_use]
    pub const fn received(&self) -> u32 {
        self.counts.received
    }

    /// Returns how many bytes had a wrong bit.
    #[must_use]
    pub const fn flipped(&self) -> u32 {
        self.counts.flipped
    }

    /// Returns how many bytes are missing: dropped, or sent while the line was cut.
    #[must_use]
    pub const fn lost(&self) -> u32 {
        self.counts.lost
    }

    /// Returns the number of received bytes that were never sent.
    #[must_use]
    pub const fn inserted(&self) -> u32 {
        self.counts.inserted
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim::{Sender, Simulation, Transmission};
    use crate::time::{Duration, Instant};
    use embedded_can::Frame as _;
    use embedded_can::nb::Can as _;
    use std::vec::Vec;

    fn frame(id: u16, tag: u8) -> CanFrame {
        CanFrame::standard(id, [tag; 8]).unwrap()
    }

    fn run(world: &Simulation, micros: u64) -> Vec<Transmission> {
        let mut records = Vec::new();
        world.advance_with(Duration::from_micros(micros), |record| records.push(*record));
        records
    }

    fn frames(records: &[Transmission]) -> Vec<CanFrame> {
        records.iter().map(|record| record.frame).collect()
    }

    #[test]
    fn frames_of_one_instant_leave_in_the_order_of_their_ids() {
        let world = Simulation::new(1);
        let mut can = world.controller();
        for id in [0x300, 0x100, 0x200] {
            assert_eq!(can.transmit(&frame(id, 0)), Ok(None));
        }
        world.inject(Line::Can1, frame(0x150, 0)).unwrap();
        let records = run(&world, 1_000);
        assert_eq!(
            frames(&records),
            [frame(0x100, 0), frame(0x150, 0), frame(0x200, 0), frame(0x300, 0)]
        );
        assert_eq!(records[1].sender, Sender::Foreign);
    }

    #[test]
    fn a_frame_on_the_wire_is_not_interrupted_by_a_more_urgent_one() {
        let world = Simulation::new(1);
        let mut can = world.controller();
        assert_eq!(can.transmit(&frame(0x300, 0)), Ok(None));
        run(&world, 50);
        assert_eq!(can.transmit(&frame(0x100, 0)), Ok(None));
        assert_eq!(frames(&run(&world, 400)), [frame(0x300, 0), frame(0x100, 0)]);
    }

    #[test]
    fn frames_follow_each_other_after_exactly_their_bits_and_the_pause() {
        for (bits_per_s, bit_us) in [(1_000_000, 1), (500_000, 2), (250_000, 4)] {
            let world = Simulation::new(1).with_bit_rate(Line::Can1, bits_per_s);
            let mut can = world.controller();
            for tag in 1..=3 {
                assert_eq!(can.transmit(&frame(0x200, tag)), Ok(None));
            }
            let records = run(&world, 2_000);
            let mut end_bits = 0;
            for record in &records {
                end_bits += u64::from(record.bits);
                assert_eq!(record.bits, crate::sim::frame_bits(&record.frame));
                assert_eq!(record.at.as_micros(), (end_bits - 3) * bit_us);
            }
            let traffic = world.traffic(Line::Can1);
            assert_eq!((traffic.frames, traffic.busy_bits, traffic.sent), (3, end_bits, 3));
            assert_eq!(traffic.total_bits, 2_000 / bit_us);
        }
    }

    #[test]
    fn an_evicted_frame_comes_back_and_never_leaves() {
        let world = Simulation::new(1);
        let mut can = world.controller();
        for id in [0x201, 0x202, 0x203] {
            assert_eq!(can.transmit(&frame(id, 0)), Ok(None));
        }
        run(&world, 10); // 0x201 is on the wire
        assert_eq!(can.transmit(&frame(0x100, 0)), Ok(Some(frame(0x203, 0))));
        assert_eq!(can.transmit(&frame(0x200, 0)), Ok(Some(frame(0x202, 0))));
        assert_eq!(can.transmit(&frame(0x200, 1)), Err(nb::Error::WouldBlock));
        let order = [frame(0x201, 0), frame(0x100, 0), frame(0x200, 0)];
        assert_eq!(frames(&run(&world, 1_000)), order);
        let traffic = world.traffic(Line::Can1);
        assert_eq!((traffic.evicted, traffic.refused), (2, 1));
    }

    #[test]
    fn the_controller_does_not_hear_itself_and_the_buses_do_not_hear_each_other() {
        let world = Simulation::new(1);
        let (mut can1, mut can2) = (world.controller(), world.controller_on(Line::Can2));
        assert_eq!(can1.transmit(&frame(0x100, 0)), Ok(None));
        world.inject(Line::Can2, frame(0x101, 0)).unwrap();
        assert_eq!(run(&world, 1_000).len(), 2);
        assert_eq!(can1.receive(), Err(nb::Error::WouldBlock));
        assert_eq!(can2.receive(), Ok(frame(0x101, 0)));
    }

    #[test]
    fn a_full_receive_queue_keeps_the_old_counts_the_new_and_says_so_once() {
        let world = Simulation::new(1).with_receive_depth(Line::Can1, 3);
        let mut can = world.controller();
        for tag in 0..5 {
            world.inject(Line::Can1, frame(0x400, tag)).unwrap();
        }
        run(&world, 1_000);
        assert_eq!(can.receive(), Err(nb::Error::Other(SimError::Overrun)));
        for tag in 0..3 {
            assert_eq!(can.receive(), Ok(frame(0x400, tag)));
        }
        assert_eq!(can.receive(), Err(nb::Error::WouldBlock));
        let traffic = world.traffic(Line::Can1);
        assert_eq!((traffic.heard, traffic.overruns), (3, 2));
    }

    #[test]
    fn a_filter_keeps_out_other_ids_and_other_kinds_of_frame() {
        let world = Simulation::new(1).with_filter(Line::Can1, 0x200, 0x7F8);
        let extended = embedded_can::ExtendedId::new(0x201).unwrap();
        let remote = CanFrame::new_remote(frame(0x201, 0).id(), 8).unwrap();
        for frame in
            [frame(0x208, 0), CanFrame::new(extended, &[]).unwrap(), remote, frame(0x207, 1)]
        {
            world.inject(Line::Can1, frame).unwrap();
        }
        run(&world, 1_000);
        assert_eq!(world.controller().receive(), Ok(frame(0x207, 1)));
        assert_eq!(world.controller().receive(), Err(nb::Error::WouldBlock));
        assert_eq!(world.traffic(Line::Can1).heard, 1);
    }

    #[test]
    fn blocking_calls_move_time_until_they_are_done() {
        use embedded_can::blocking::Can;
        let world = Simulation::new(1);
        let mut can = world.controller();
        for tag in 0..4 {
            assert_eq!(Can::transmit(&mut can, &frame(0x200, tag)), Ok(()));
        }
        let waited = world.now();
        assert!((108..=135).contains(&waited.as_micros()), "{waited:?}: one frame");
        assert_eq!(run(&world, 1_000).len(), 4); // also the one that passed meanwhile
        world.inject(Line::Can1, frame(0x300, 9)).unwrap();
        assert_eq!(Can::receive(&mut can), Ok(frame(0x300, 9)));
        let before = world.now();
        assert_eq!(Can::receive(&mut can), Err(SimError::TimedOut));
        assert_eq!(world.now().since(before), Duration::from_secs(1));
    }

    #[test]
    fn bus_off_is_an_error_and_afterwards_the_mailboxes_send_what_they_hold() {
        let world = Simulation::new(1);
        let mut can = world.controller();
        let window = Instant::from_micros(1_000)..Instant::from_micros(5_000);
        world.fault(Fault::BusOff(Line::Can1), window).unwrap();
        run(&world, 950);
        assert_eq!(can.transmit(&frame(0x200, 1)), Ok(None));
        let cut_off = run(&world, 2_050);
        assert_eq!(frames(&cut_off), [frame(0x200, 1)]);
        assert!(!cut_off[0].delivered && world.traffic(Line::Can1).sent == 0);
        let off = Err(nb::Error::Other(SimError::BusOff));
        assert_eq!(can.transmit(&frame(0x200, 2)), off.map(Some));
        world.inject(Line::Can1, frame(0x400, 0)).unwrap();
        assert_eq!(frames(&run(&world, 1_900)), [frame(0x400, 0)]); // which it does not hear
        let records = run(&world, 1_000);
        assert_eq!(frames(&records), [frame(0x200, 1)]);
        assert_eq!(records[0].at.as_micros(), 5_000 + u64::from(records[0].bits) - 3);
        assert_eq!(can.receive(), Err(nb::Error::WouldBlock));
        assert_eq!(world.traffic(Line::Can1).errors, 1);
    }

    #[test]
    fn without_a_cable_the_mailboxes_fill_and_can_be_emptied_by_hand() {
        let world = Simulation::new(1);
        let mut can = world.controller();
        world.fault(Fault::Unplugged(Line::Can1), ..Instant::from_micros(5_000)).unwrap();
        for tag in 0..3 {
            assert_eq!(can.transmit(&frame(0x200, tag)), Ok(None));
            run(&world, 1_000);
        }
        assert_eq!(can.transmit(&frame(0x200, 3)), Err(nb::Error::WouldBlock));
        can.abort_pending();
        assert_eq!(can.transmit(&frame(0x200, 4)), Ok(None));
        assert_eq!(frames(&run(&world, 10_000)), [frame(0x200, 4)]);
    }

    #[test]
    fn a_scripted_driver_blocks_or_fails_in_its_window_only() {
        let world = Simulation::new(1);
        let mut can = world.controller();
        let (first, second) = (Instant::from_micros(100), Instant::from_micros(200));
        let errors = Fault::DriverErrors { line: Line::Can1, probability: 1.0 };
        world.fault(Fault::WouldBlock(Line::Can1), ..first).unwrap();
        world.fault(errors, first..second).unwrap();
        assert_eq!(can.transmit(&frame(0x200, 0)), Err(nb::Error::WouldBlock));
        run(&world, 100);
        let scripted = nb::Error::Other(SimError::Scripted);
        assert_eq!(can.transmit(&frame(0x200, 0)), Err(scripted));
        assert_eq!(can.receive(), Err(scripted));
        run(&world, 100);
        assert_eq!(can.transmit(&frame(0x200, 0)), Ok(None));
    }

    fn through(line: &mut SerialLine, bytes: usize) -> u32 {
        let (mut now, mut out) = (0, [0; 64]);
        for _ in 0..bytes / 10 {
            assert_eq!(line.send(&[0x55; 10], Instant::from_micros(now)), 10);
            now += 1_000;
            while !line.receive(Instant::from_micros(now), &mut out).is_empty() {}
        }
        line.received()
    }

    #[test]
    fn bytes_add_up_under_any_noise() {
        let mut line = SerialLine::new(115_200, 3);
        line.set_flipped(0.1);
        line.set_dropped(0.05);
        line.set_inserted(0.02);
        let received = through(&mut line, 100_000);
        let counts = line.counts;
        assert_eq!((counts.sent, received), (100_000, 100_000 - counts.lost + counts.inserted));
        assert!(counts.flipped.abs_diff(9_500) < 400 && counts.lost.abs_diff(5_000) < 300);
    }

    #[test]
    fn a_cut_line_swallows_and_a_full_one_refuses() {
        let mut line = SerialLine::new(9_600, 1);
        line.set_cut(true);
        assert_eq!(through(&mut line, 100), 0);
        line.set_cut(false);
        assert_eq!(line.send(&[0; 2_000], Instant::from_micros(10_000)), CAPACITY - 1);
    }

    #[test]
    fn values_come_out_in_order_through_many_wraps() {
        let mut ring = Ring::<u32, 3>::new();
        let mut expected = 0;
        for value in 0..100 {
            if ring.len() == 3 {
                assert_eq!(ring.push(999), Err(999));
                assert_eq!((ring.peek(), ring.pop()), (Some(expected), Some(expected)));
                expected += 1;
            }
            assert_eq!(ring.push(value), Ok(()));
        }
        assert_eq!(
            [ring.pop(), ring.pop(), ring.pop(), ring.pop()],
            [Some(97), Some(98), Some(99), None]
        );
    }
}
