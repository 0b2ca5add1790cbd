use super::can::{INTERMISSION_BITS, Line, Mailboxes, frame_bits};
use crate::frame::CanFrame;
use crate::time::Instant;
use embedded_can::{Frame, Id};

/// Sender of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Sender {
    /// The controller under test.
    Controller,
    /// A simulated motor or joint.
    Motor(super::MotorKey),
    /// Anybody else: [`Simulation::inject`](super::Simulation::inject) or a flood.
    Foreign,
}

/// A frame on the wire.
///
/// Its `Display` is a line of candump's log form.
///
/// # Examples
/// ```
/// use drivetrain::frame::CanFrame;
/// use drivetrain::sim::{Line, Simulation};
/// use drivetrain::time::Duration;
///
/// let world = Simulation::new(1);
/// let frame = CanFrame::standard(0x201, [0x0E, 0x16, 0, 0, 0xFF, 0xFD, 0x21, 0]).ok_or("id")?;
/// world.inject(Line::Can1, frame)?;
/// let mut log = String::new();
/// world.advance_with(Duration::from_millis(1), |record| log += &record.to_string());
/// assert_eq!(log, "(0.000117) can0 201#0E160000FFFD2100");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Transmission {
    /// When its last bit was over, in whole microseconds.
    pub at: Instant,
    /// The bus.
    pub line: Line,
    /// The frame.
    pub frame: CanFrame,
    /// The sender.
    pub sender: Sender,
    /// The length of the frame, with the pause after it, in bits.
    pub bits: u32,
    /// Whether the frame reached the others; `false` when a fault lost it or cut it off.
    pub delivered: bool,
}

impl core::fmt::Display for Transmission {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let micros = self.at.as_micros();
        let line = match self.line {
            Line::Can1 => "can0",
            Line::Can2 => "can1",
            Line::Can3 => "can2",
        };
        write!(f, "({}.{:06}) {line} ", micros / 1_000_000, micros % 1_000_000)?;
        match self.frame.id() {
            Id::Standard(id) => write!(f, "{:03X}#", id.as_raw())?,
            Id::Extended(id) => write!(f, "{:08X}#", id.as_raw())?,
        }
        if self.frame.is_remote_frame() {
            return write!(f, "R{}", self.frame.length());
        }
        self.frame.data().iter().try_for_each(|byte| write!(f, "{byte:02X}"))
    }
}

/// Traffic of one bus since the start of the world.
///
/// # Examples
/// ```
/// use drivetrain::sim::{Line, MotorConfig, Simulation};
/// use drivetrain::time::Duration;
///
/// let world = Simulation::new(1);
/// for id in 1..=4 {
///     world.attach(MotorConfig::m3508(id))?;
/// }
/// world.advance(Duration::from_secs(1));
/// let traffic = world.traffic(Line::Can1);
/// assert!((3_998..=4_001).contains(&traffic.frames)); // four ESCs, 1 kHz each by their own clocks
/// assert!(traffic.load() > 0.44 && traffic.load() < 0.54); // 111 to 135 bits a frame
/// # Ok::<(), drivetrain::sim::SimError>(())
/// ```
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Traffic {
    /// Bits of elapsed time.
    pub total_bits: u64,
    /// Bits of frames, each with the pause after it.
    pub busy_bits: u64,
    /// Frames on the wire.
    pub frames: u32,
    /// Frames on the wire lost by a fault.
    pub lost: u32,
    /// Feedback frames discarded by an ESC because its mailboxes were full.
    pub starved: u32,
    /// Frames that left the controller for good.
    pub sent: u32,
    /// Frames received by the controller, within its filter.
    pub heard: u32,
    /// Frames missed by the controller because its receive queue was full.
    pub overruns: u32,
    /// Frames evicted by the controller from its mailboxes.
    pub evicted: u32,
    /// Frames refused by the controller with would-block.
    pub refused: u32,
    /// Calls of the controller's driver with an error.
    pub errors: u32,
}

impl Traffic {
    /// Returns the share of the time in which the bus was busy, 0 to 1; 0 when no time passed.
    #[must_use]
    pub fn load(&self) -> f32 {
        if self.total_bits == 0 { 0.0 } else { self.busy_bits as f32 / self.total_bits as f32 }
    }

    /// Returns the increase since an earlier reading of the same bus.
    #[must_use]
    pub const fn since(&self, earlier: &Self) -> Self {
        Self {
            total_bits: self.total_bits.saturating_sub(earlier.total_bits),
            busy_bits: self.busy_bits.saturating_sub(earlier.busy_bits),
            frames: self.frames.saturating_sub(earlier.frames),
            lost: self.lost.saturating_sub(earlier.lost),
            starved: self.starved.saturating_sub(earlier.starved),
            sent: self.sent.saturating_sub(earlier.sent),
            heard: self.heard.saturating_sub(earlier.heard),
            overruns: self.overruns.saturating_sub(earlier.overruns),
            evicted: self.evicted.saturating_sub(earlier.evicted),
            refused: self.refused.saturating_sub(earlier.refused),
            errors: self.errors.saturating_sub(earlier.errors),
        }
    }
}

/// A frame in transmission.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Flight {
    pub(crate) frame: CanFrame,
    pub(crate) sender: Sender,
    bits: u32,
    end_ns: u64,
}

/// The longest receive queue.
const RECEIVE_CAPACITY: usize = 64;

/// One bus: the wire, the controller's mailboxes and receive queue, and the foreign node.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Wire {
    pub(crate) line: Line,
    bit_ns: u32,
    pub(crate) mailboxes: Mailboxes,
    receive: Ring<CanFrame, RECEIVE_CAPACITY>,
    receive_depth: usize,
    /// Id and mask of the acceptance filter for standard data frames.
    filter: (u16, u16),
    overrun: bool,
    pub(crate) foreign: Ring<CanFrame, 64>,
    /// Whether a frame may have become ready since the last arbitration without a winner.
    pub(crate) stirred: bool,
    flight: Option<Flight>,
    /// When the pause after the last frame is over.
    idle_ns: u64,
    pub(crate) traffic: Traffic,
}

impl Wire {
    pub(crate) const fn new(line: Line) -> Self {
        Self {
            line,
            bit_ns: 1_000,
            mailboxes: Mailboxes::new(),
            receive: Ring::new(),
            receive_depth: RECEIVE_CAPACITY,
            filter: (0, 0),
            overrun: false,
            foreign: Ring::new(),
            stirred: false,
            flight: None,
            idle_ns: 0,
            traffic: Traffic {
                total_bits: 0,
                busy_bits: 0,
                frames: 0,
                lost: 0,
                starved: 0,
                sent: 0,
                heard: 0,
                overruns: 0,
                evicted: 0,
                refused: 0,
                errors: 0,
            },
        }
    }

    pub(crate) const fn set_bit_rate(&mut self, bits_per_s: u32) {
        let bit_ns = 1_000_000_000_u32.checked_div(bits_per_s);
        self.bit_ns = match bit_ns {
            Some(0) | None => 1,
            Some(bit_ns) => bit_ns,
        };
    }

    pub(crate) fn set_receive_depth(&mut self, depth: usize) {
        self.receive_depth = depth.clamp(1, RECEIVE_CAPACITY);
    }

    pub(crate) const fn set_filter(&mut self, id: u16, mask: u16) {
        self.filter = (id, mask);
    }

    /// Returns whether the acceptance filter lets a frame through.
    fn accepts(&self, frame: &CanFrame) -> bool {
        let (id, mask) = self.filter;
        // The header of anything but a standard data frame is above all ids.
        mask == 0 || u16::try_from(frame.header()).is_ok_and(|header| header & mask == id & mask)
    }

    pub(crate) const fn traffic(&self, now_ns: u64) -> Traffic {
        Traffic { total_bits: now_ns / self.bit_ns as u64, ..self.traffic }
    }

    /// Returns when the frame in transmission has ended.
    pub(crate) fn flight_end(&self) -> Option<u64> {
        self.flight.map(|flight| flight.end_ns)
    }

    /// Returns the time of the next arbitration; `None` during a frame, and without a frame that may be ready. A controller that
    /// takes part again has had its frames ready before.
    pub(crate) fn arbitration(&self, is_connected: impl Fn() -> bool) -> Option<u64> {
        let may_be_ready = self.stirred || !self.mailboxes.is_empty() && is_connected();
        (self.flight.is_none() && may_be_ready).then_some(self.idle_ns)
    }

    /// Puts the winner of an arbitration on the wire.
    pub(crate) fn begin(&mut self, frame: CanFrame, sender: Sender, now_ns: u64) {
        let bits = frame_bits(&frame);
        let bit_ns = u64::from(self.bit_ns);
        self.idle_ns = now_ns + u64::from(bits) * bit_ns;
        let end_ns = now_ns + u64::from(bits - INTERMISSION_BITS) * bit_ns;
        self.flight = Some(Flight { frame, sender, bits, end_ns });
    }

    /// Removes the frame in transmission from the wire, and counts it.
    pub(crate) fn finish(&mut self, now_ns: u64, delivered: bool) -> Option<Transmission> {
        let Flight { frame, sender, bits, .. } = self.flight.take()?;
        self.traffic.busy_bits += u64::from(bits);
        self.traffic.frames = self.traffic.frames.saturating_add(1);
        if !delivered {
            self.traffic.lost = self.traffic.lost.saturating_add(1);
        }
        let at = Instant::from_micros(now_ns / 1_000);
        Some(Transmission { at, line: self.line, frame, sender, bits, delivered })
    }

    pub(crate) const fn flight(&self) -> Option<Flight> {
        self.flight
    }

    /// Gives a frame to the controller.
    pub(crate) fn hear(&mut self, frame: CanFrame) {
        if !self.accepts(&frame) {
            return;
        }
        if self.receive.len() >= self.receive_depth || self.receive.push(frame).is_err() {
            self.traffic.overruns = self.traffic.overruns.saturating_add(1);
            self.overrun = true;
        } else {
            self.traffic.heard = self.traffic.heard.saturating_add(1);
        }
    }

    /// Reports missed frames once.
    pub(crate) const fn take_overrun(&mut self) -> bool {
        core::mem::replace(&mut self.overrun, false)
    }

    /// Takes a frame received by the controller.
    pub(crate) fn take_heard(&mut self) -> Option<CanFrame> {
        self.receive.pop()
    }
}

/// A queue of at most `N` values, first in, first out.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Ring<T, const N: usize> {
    slots: [Option<T>; N],
    first: usize,
    length: usize,
}

impl<T: Copy, const N: usize> Ring<T, N> {
    pub(crate) const fn new() -> Self {
        Self { slots: [None; N], first: 0, length: 0 }
    }

    pub(crate) const fn len(&self) -> usize {
        self.length
    }

    /// Appends a value; returns it when the queue is full.
    pub(crate) fn push(&mut self, value: T) -> Result<(), T> {
        if self.length >= N {
            return Err(value);
        }
        match self.slots.get_mut((self.first + self.length) % N) {
            Some(slot) => *slot = Some(value),
            None => return Err(value),
        }
        self.length += 1;
        Ok(())
    }

    /// Returns the first value without removing it.
    pub(crate) fn peek(&self) -> Option<T> {
        self.slots.get(self.first).copied().flatten()
    }

    /// Takes out the first value.
    pub(crate) fn pop(&mut self) -> Option<T> {
        let value = self.slots.get_mut(self.first)?.take()?;
        self.first = (self.first + 1) % N;
        self.length -= 1;
        Some(value)
    }
}
