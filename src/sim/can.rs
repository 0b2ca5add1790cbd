use crate::frame::CanFrame;
use embedded_can::{Frame, Id};

/// One of the three buses of a [`Simulation`](super::Simulation).
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Line {
    /// The first bus.
    #[default]
    Can1,
    /// The second bus.
    Can2,
    /// The third bus.
    Can3,
}

/// The pause after a frame, in bits: no node may begin another frame in it.
pub const INTERMISSION_BITS: u32 = 3;

/// CRC delimiter, acknowledge slot and delimiter, end of frame: never stuffed.
const TAIL_BITS: u32 = 10;
/// x^15 + x^14 + x^10 + x^8 + x^7 + x^4 + x^3 + 1, without its highest term.
const POLYNOMIAL: u16 = 0x4599;

/// Returns the time of a frame on the bus, in bits, with its stuff bits and the pause after it.
///
/// At 1 Mbit/s a bit is a microsecond. The length depends on the content: after five equal bits, the checksum included,
/// the sender inserts a bit of the other value.
///
/// Source: Bosch CAN specification 2.0 (1991), part B, chapters 3.1 and 5.
///
/// # Examples
/// ```
/// use drivetrain::frame::CanFrame;
/// use drivetrain::sim::{frame_bits, nominal_bits, worst_case_bits};
///
/// let frame = CanFrame::standard(0x201, [0x0E, 0x16, 0, 0, 0xFF, 0xFD, 0x21, 0]).ok_or("id")?;
/// assert_eq!(nominal_bits(false, 8), 111);
/// assert_eq!(frame_bits(&frame), 120);
/// assert_eq!(worst_case_bits(false, 8), 135);
/// # Ok::<(), &str>(())
/// ```
#[must_use]
pub fn frame_bits(frame: &CanFrame) -> u32 {
    let mut bits = Bits::START_OF_FRAME;
    let remote = u32::from(frame.is_remote_frame());
    match frame.id() {
        Id::Standard(id) => {
            bits.push(u32::from(id.as_raw()), 11);
            bits.push(remote, 1);
            bits.push(0, 2); // standard id, reserved bit
        }
        Id::Extended(id) => {
            bits.push(id.as_raw() >> 18, 11);
            bits.push(0b11, 2); // substitute for the remote bit, extended id
            bits.push(id.as_raw() & 0x3_FFFF, 18);
            bits.push(remote, 1);
            bits.push(0, 2); // reserved bits
        }
    }
    bits.push(u32::from(frame.length()), 4);
    if frame.data().len() == 8 {
        bits.push_whole(u64::from_be_bytes(*frame.bytes()));
    } else {
        for byte in frame.data() {
            bits.push(u32::from(*byte), 8);
        }
    }
    bits.push(u32::from(bits.checksum()), 15);
    bits.count + bits.stuff_bits() + TAIL_BITS + INTERMISSION_BITS
}

/// Returns the length of a data frame without stuff bits, with the pause after it, in bits.
///
/// `47 + 8 n` with an 11-bit id, `67 + 8 n` with a 29-bit id. A length above 8 counts as 8; a remote frame
/// has the length 0.
///
/// # Examples
/// ```
/// use drivetrain::sim::nominal_bits;
///
/// assert_eq!((nominal_bits(false, 8), nominal_bits(true, 8)), (111, 131));
/// ```
#[must_use]
pub const fn nominal_bits(extended: bool, length: u8) -> u32 {
    stuffable_bits(extended, length) + TAIL_BITS + INTERMISSION_BITS
}

/// Returns the largest length of a data frame with stuff bits and the pause after it, in bits.
///
/// One stuff bit after the first five bits and then after every fourth: a quarter of the stuffed part less one. A
/// length above 8 counts as 8.
///
/// Source: T. Nolte, H. Hansson, C. Norström, "Minimizing CAN response-time jitter by message manipulation"
/// (2002), equation 1.
///
/// # Examples
/// ```
/// use drivetrain::sim::worst_case_bits;
///
/// assert_eq!((worst_case_bits(false, 8), worst_case_bits(true, 8)), (135, 160));
/// ```
#[must_use]
pub const fn worst_case_bits(extended: bool, length: u8) -> u32 {
    nominal_bits(extended, length) + (stuffable_bits(extended, length) - 1) / 4
}

/// From the start of the frame to the end of the checksum.
const fn stuffable_bits(extended: bool, length: u8) -> u32 {
    let head = if extended { 54 } else { 34 };
    head + 8 * (if length > 8 { 8 } else { length as u32 })
}

/// Bits of a frame before stuffing: `count` of them, the last one lowest. At most 118.
struct Bits {
    value: u128,
    count: u32,
}

impl Bits {
    /// A zero.
    const START_OF_FRAME: Self = Self { value: 0, count: 1 };

    /// Appends the low `width` bits of a value.
    fn push(&mut self, value: u32, width: u32) {
        self.value = (self.value << width) | u128::from(value);
        self.count += width;
    }

    fn push_whole(&mut self, data: u64) {
        self.value = (self.value << 64) | u128::from(data);
        self.count += 64;
    }

    /// Returns the first byte with a bit of the frame, of the 16 of a value.
    const fn first_byte(&self) -> usize {
        16 - self.count.div_ceil(8) as usize
    }

    /// Returns the checksum. The zeros above the first bit leave it at zero.
    fn checksum(&self) -> u16 {
        let bytes = self.value.to_be_bytes();
        bytes.iter().skip(self.first_byte()).fold(0, |checksum, byte| {
            let [_, index] = ((checksum >> 7) ^ u16::from(*byte)).to_be_bytes();
            ((checksum << 8) & 0x7FFF) ^ CHECKSUMS.get(usize::from(index)).copied().unwrap_or(0)
        })
    }

    /// Counts the stuff bits.
    ///
    /// Bits that alternate, and end with a one before the first zero, fill the first byte: they cause none.
    fn stuff_bits(&self) -> u32 {
        let padded = self.value | (0x55 << self.count);
        let bytes = padded.to_be_bytes();
        let (mut run, mut stuffed) = (Run::START, 0);
        for byte in bytes.get(self.first_byte()..).unwrap_or_default() {
            let row = STUFFED.get(usize::from(run)).unwrap_or(&[0; 256]);
            let found = row.get(usize::from(*byte)).copied().unwrap_or(0);
            stuffed += u32::from(found >> 4);
            run = found & 0xF;
        }
        stuffed
    }
}

/// The equal bits up to now, 1 to 4, and their value.
#[derive(Clone, Copy)]
struct Run {
    bit: bool,
    length: u8,
}

impl Run {
    /// A one.
    const START: u8 = Self { bit: true, length: 1 }.number();
    const NUMBERS: usize = 10;

    const fn number(self) -> u8 {
        self.length << 1 | self.bit as u8
    }

    /// Takes one more bit; returns whether a stuff bit follows: after five equal bits, of the other value.
    const fn take(&mut self, bit: bool) -> bool {
        self.length = if bit == self.bit { self.length + 1 } else { 1 };
        self.bit = bit;
        let is_full = self.length == 5;
        if is_full {
            *self = Self { bit: !bit, length: 1 };
        }
        is_full
    }
}

/// Stuff bits of each byte after each run, times 16, and the number of the run after it.
#[expect(
    clippy::indexing_slicing,
    clippy::cast_possible_truncation,
    reason = "a constant: an index out of range does not compile, and a number of a run fits"
)]
const STUFFED: [[u8; 256]; Run::NUMBERS] = {
    let mut table = [[0; 256]; Run::NUMBERS];
    let mut number = 2;
    while number < Run::NUMBERS {
        let mut byte = 0;
        while byte < 256 {
            let mut run = Run { bit: number & 1 != 0, length: (number >> 1) as u8 };
            let (mut stuffed, mut place) = (0, 8);
            while place > 0 {
                place -= 1;
                stuffed += run.take(byte >> place & 1 != 0) as u8;
            }
            table[number][byte] = stuffed << 4 | run.number();
            byte += 1;
        }
        number += 1;
    }
    table
};

/// The checksum of each byte.
#[expect(
    clippy::indexing_slicing,
    clippy::cast_possible_truncation,
    reason = "a constant: an index out of range does not compile, and a byte fits"
)]
const CHECKSUMS: [u16; 256] = {
    let mut checksums = [0; 256];
    let mut byte = 0;
    while byte < 256 {
        let mut checksum = (byte as u16) << 7;
        let mut bit = 0;
        while bit < 8 {
            let feedback = if checksum & 0x4000 != 0 { POLYNOMIAL } else { 0 };
            checksum = ((checksum << 1) & 0x7FFF) ^ feedback;
            bit += 1;
        }
        checksums[byte] = checksum;
        byte += 1;
    }
    checksums
};

/// Result of handing a frame to full or free mailboxes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Offer {
    Taken,
    /// The frame took the place of this frame, which was not in transmission.
    Replaced(CanFrame),
    /// Full, and no pending frame has a lower priority.
    Refused,
}

#[derive(Debug, Clone, Copy)]
struct Pending {
    frame: CanFrame,
    rank: u32,
    order: u64,
    in_transmission: bool,
}

/// The three transmit mailboxes of a CAN controller.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Mailboxes {
    slots: [Option<Pending>; 3],
    order: u64,
    /// The rank of the frame for the next arbitration.
    front: Option<u32>,
}

/// Returns the rank of a frame in an arbitration, the lowest first: the fields of the wire, from the id to the remote bit.
pub(crate) fn rank(frame: &CanFrame) -> u32 {
    let remote = u32::from(frame.is_remote_frame());
    match frame.id() {
        Id::Standard(id) => (u32::from(id.as_raw()) << 20) | remote,
        Id::Extended(id) => {
            let (base, rest) = (id.as_raw() >> 18, id.as_raw() & 0x3_FFFF);
            (base << 20) | (1 << 19) | (rest << 1) | remote
        }
    }
}

impl Pending {
    /// Returns the place among the frames of one node: frames of one rank in the order of arrival.
    const fn place(&self) -> (u32, u64) {
        (self.rank, self.order)
    }
}

impl Mailboxes {
    pub(crate) const fn new() -> Self {
        Self { slots: [None; 3], order: 0, front: None }
    }

    /// Takes a frame as `embedded_can::nb::Can::transmit` requires: frames of one id keep their order, and full
    /// mailboxes evict their lowest priority for a frame of strictly higher priority.
    pub(crate) fn offer(&mut self, frame: CanFrame) -> Offer {
        let rank = rank(&frame);
        let pending = Pending { frame, rank, order: self.order, in_transmission: false };
        if let Some(free) = self.slots.iter_mut().find(|slot| slot.is_none()) {
            *free = Some(pending);
            self.order += 1;
            self.front = Some(self.front.map_or(rank, |front| front.min(rank)));
            return Offer::Taken;
        }
        // The last place: the lowest priority, and the youngest among equal ids.
        let lowest = self
            .slots
            .iter_mut()
            .flatten()
            .filter(|slot| !slot.in_transmission)
            .max_by_key(|slot| slot.place());
        match lowest {
            Some(slot) if rank < slot.rank => {
                let evicted = slot.frame;
                *slot = pending;
                self.order += 1;
                self.front = self.first();
                Offer::Replaced(evicted)
            }
            _ => Offer::Refused,
        }
    }

    /// Returns the frame for the next arbitration.
    pub(crate) fn candidate(&self) -> Option<&CanFrame> {
        self.next().map(|slot| &slot.frame)
    }

    /// Returns the rank of this frame, which each arbitration of the bus compares.
    pub(crate) const fn rank(&self) -> Option<u32> {
        self.front
    }

    fn first(&self) -> Option<u32> {
        self.slots.iter().flatten().map(|slot| slot.rank).min()
    }

    fn next(&self) -> Option<&Pending> {
        self.slots.iter().flatten().min_by_key(|slot| slot.place())
    }

    pub(crate) const fn is_empty(&self) -> bool {
        self.front.is_none()
    }

    pub(crate) fn has_room(&self) -> bool {
        self.slots.iter().any(Option::is_none)
    }

    /// Returns and marks the candidate: it can no longer be evicted.
    pub(crate) fn begin(&mut self) -> Option<CanFrame> {
        let slot = self.slots.iter_mut().flatten().min_by_key(|slot| slot.place())?;
        slot.in_transmission = true;
        Some(slot.frame)
    }

    /// Frees the mailbox of the frame in transmission.
    pub(crate) fn finish(&mut self) {
        for slot in &mut self.slots {
            if slot.is_some_and(|pending| pending.in_transmission) {
                *slot = None;
            }
        }
        self.front = self.first();
    }

    /// Treats the frame in transmission as pending.
    pub(crate) fn give_up(&mut self) {
        for slot in self.slots.iter_mut().flatten() {
            slot.in_transmission = false;
        }
    }

    /// Removes all frames except a frame in transmission.
    pub(crate) fn abort(&mut self) {
        for slot in &mut self.slots {
            if slot.is_some_and(|pending| !pending.in_transmission) {
                *slot = None;
            }
        }
        self.front = self.first();
    }

    /// Empties all mailboxes.
    pub(crate) fn clear(&mut self) {
        self.slots = [None; 3];
        self.front = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use embedded_can::{ExtendedId, StandardId};
    use proptest::prelude::*;
    use std::string::String;

    fn standard(id: u16, data: &[u8]) -> CanFrame {
        CanFrame::new(StandardId::new(id).unwrap(), data).unwrap()
    }

    /// The same by another way: a string of digits, long division, and a search for runs.
    fn bits_by_long_division(frame: &CanFrame) -> usize {
        let mut digits = match frame.id() {
            Id::Standard(id) => {
                let remote = u8::from(frame.is_remote_frame());
                std::format!("0{:011b}{remote}00{:04b}", id.as_raw(), frame.dlc())
            }
            Id::Extended(id) => {
                let raw = std::format!("{:029b}", id.as_raw());
                let remote = u8::from(frame.is_remote_frame());
                let (base, rest) = raw.split_at(11);
                std::format!("0{base}11{rest}{remote}00{:04b}", frame.dlc())
            }
        };
        frame.data().iter().for_each(|byte| digits += &std::format!("{byte:08b}"));
        let mut dividend: std::vec::Vec<u8> = digits.bytes().map(|digit| digit - b'0').collect();
        dividend.extend([0; 15]);
        let divisor = *b"\x01\x01\0\0\0\x01\0\x01\x01\0\0\x01\x01\0\0\x01";
        for start in 0..digits.len() {
            if dividend[start] == 1 {
                for (place, digit) in divisor.iter().enumerate() {
                    dividend[start + place] ^= digit;
                }
            }
        }
        let rest = &dividend[digits.len()..];
        digits.extend(rest.iter().map(|digit| char::from(b'0' + digit)));
        let mut out = String::new();
        for digit in digits.chars() {
            out.push(digit);
            if out.ends_with("00000") {
                out.push('1');
            } else if out.ends_with("11111") {
                out.push('0');
            }
        }
        out.len() + 13
    }

    #[test]
    fn a_frame_of_zeros_by_hand() {
        // 19 zeros, a checksum of 15 zeros: a stuff bit after the 5th, 10th, ... 30th of 34 zeros.
        assert_eq!(frame_bits(&standard(0, &[])), 34 + 6 + 13);
    }

    #[test]
    fn a_remote_frame_is_as_long_as_one_without_data() {
        // 0 10101010101 100 1000: no run of five before the checksum.
        let remote = CanFrame::new_remote(StandardId::new(0x555).unwrap(), 8).unwrap();
        assert!((47..=49).contains(&frame_bits(&remote)));
    }

    #[test]
    fn the_checksum_is_the_one_of_the_catalogue() {
        // CRC-15/CAN of "123456789" is 0x059E.
        let mut bits = Bits::START_OF_FRAME;
        b"123456789".iter().for_each(|byte| bits.push(u32::from(*byte), 8));
        assert_eq!(bits.checksum(), 0x059E);
    }

    #[test]
    fn lengths_without_stuffing_are_those_of_the_frame_formats() {
        assert_eq!((nominal_bits(false, 0), nominal_bits(true, 0)), (47, 67));
        assert_eq!((worst_case_bits(false, 0), worst_case_bits(true, 0)), (55, 80));
        assert_eq!(nominal_bits(false, 200), nominal_bits(false, 8));
    }

    proptest! {
        #[test]
        fn stuffing_agrees_with_long_division_and_stays_between_the_bounds(
            raw in 0..=0x1FFF_FFFFu32,
            extended: bool,
            remote: bool,
            sparse: bool,
            bytes in proptest::collection::vec(any::<u8>(), 0..=8),
        ) {
            let data: std::vec::Vec<u8> =
                bytes.iter().map(|byte| if sparse { 0xF8 * (byte & 1) } else { *byte }).collect();
            let id = if extended {
                Id::Extended(ExtendedId::new(raw).unwrap())
            } else {
                Id::Standard(StandardId::new((raw & 0x7FF) as u16).unwrap())
            };
            let frame = if remote {
                CanFrame::new_remote(id, data.len()).unwrap()
            } else {
                CanFrame::new(id, &data).unwrap()
            };
            let bits = frame_bits(&frame);
            let length = u8::try_from(frame.data().len()).unwrap();
            prop_assert_eq!(bits as usize, bits_by_long_division(&frame));
            prop_assert!(nominal_bits(extended, length) <= bits);
            prop_assert!(bits <= worst_case_bits(extended, length));
        }
    }

    fn frame(id: u16, tag: u8) -> CanFrame {
        CanFrame::standard(id, [tag; 8]).unwrap()
    }

    fn filled(ids: [u16; 3]) -> Mailboxes {
        let mut mailboxes = Mailboxes::new();
        for id in ids {
            assert_eq!(mailboxes.offer(frame(id, 0)), Offer::Taken);
        }
        mailboxes
    }

    fn sent(mailboxes: &mut Mailboxes) -> std::vec::Vec<CanFrame> {
        std::iter::from_fn(|| {
            let candidate = mailboxes.candidate().copied();
            mailboxes.begin();
            mailboxes.finish();
            candidate
        })
        .collect()
    }

    #[test]
    fn the_lowest_id_goes_first() {
        let mut mailboxes = filled([0x300, 0x100, 0x200]);
        let order = [frame(0x100, 0), frame(0x200, 0), frame(0x300, 0)];
        assert_eq!(sent(&mut mailboxes), order);
    }

    #[test]
    fn equal_ids_go_in_the_order_of_arrival() {
        let mut mailboxes = Mailboxes::new();
        let order = [frame(0x200, 1), frame(0x200, 2), frame(0x200, 3)];
        for frame in order {
            assert_eq!(mailboxes.offer(frame), Offer::Taken);
        }
        assert_eq!(mailboxes.offer(frame(0x200, 4)), Offer::Refused);
        assert_eq!(sent(&mut mailboxes), order);
    }

    #[test]
    fn a_higher_priority_evicts_the_lowest_and_an_equal_or_lower_priority_is_refused() {
        let mut mailboxes = filled([0x300, 0x100, 0x200]);
        assert_eq!(mailboxes.offer(frame(0x300, 1)), Offer::Refused);
        assert_eq!(mailboxes.offer(frame(0x301, 1)), Offer::Refused);
        assert_eq!(mailboxes.offer(frame(0x2FF, 1)), Offer::Replaced(frame(0x300, 0)));
        let order = [frame(0x100, 0), frame(0x200, 0), frame(0x2FF, 1)];
        assert_eq!(sent(&mut mailboxes), order);
    }

    #[test]
    fn of_equal_ids_the_youngest_is_evicted() {
        let mut mailboxes = Mailboxes::new();
        for tag in 1..=3 {
            assert_eq!(mailboxes.offer(frame(0x200, tag)), Offer::Taken);
        }
        assert_eq!(mailboxes.offer(frame(0x1FF, 9)), Offer::Replaced(frame(0x200, 3)));
        assert_eq!(sent(&mut mailboxes), [frame(0x1FF, 9), frame(0x200, 1), frame(0x200, 2)]);
    }

    #[test]
    fn a_frame_in_transmission_is_not_evicted_and_not_overtaken() {
        let mut mailboxes = filled([0x300, 0x300, 0x300]);
        mailboxes.begin();
        assert_eq!(mailboxes.offer(frame(0x100, 1)), Offer::Replaced(frame(0x300, 0)));
        assert_eq!(mailboxes.offer(frame(0x100, 2)), Offer::Replaced(frame(0x300, 0)));
        assert_eq!(mailboxes.offer(frame(0x100, 3)), Offer::Refused);
        assert_eq!(mailboxes.offer(frame(0x0FF, 4)), Offer::Replaced(frame(0x100, 2)));
        mailboxes.finish();
        assert_eq!(sent(&mut mailboxes), [frame(0x0FF, 4), frame(0x100, 1)]);
    }

    #[test]
    fn remote_loses_to_data_and_extended_to_standard_of_the_same_base() {
        let id = StandardId::new(0x200).unwrap();
        let remote = CanFrame::new_remote(id, 8).unwrap();
        let extended = CanFrame::new(ExtendedId::new(0x200 << 18).unwrap(), &[]).unwrap();
        let mut mailboxes = Mailboxes::new();
        for frame in [extended, remote, frame(0x200, 0)] {
            assert_eq!(mailboxes.offer(frame), Offer::Taken);
        }
        assert_eq!(sent(&mut mailboxes), [frame(0x200, 0), remote, extended]);
    }
}
