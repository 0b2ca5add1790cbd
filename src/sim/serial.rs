use super::random::Random;
use super::ring::Ring;
use crate::time::Instant;

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
}
