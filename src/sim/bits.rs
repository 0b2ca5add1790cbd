use crate::frame::CanFrame;
use embedded_can::{Frame, Id};

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
    let mut stuffed = Stuffed::default();
    let remote = u32::from(frame.is_remote_frame());
    stuffed.field(0, 1); // start of frame
    match frame.id() {
        Id::Standard(id) => {
            stuffed.field(u32::from(id.as_raw()), 11);
            stuffed.field(remote, 1);
            stuffed.field(0, 2); // standard id, reserved bit
        }
        Id::Extended(id) => {
            stuffed.field(id.as_raw() >> 18, 11);
            stuffed.field(0b11, 2); // substitute for the remote bit, extended id
            stuffed.field(id.as_raw() & 0x3_FFFF, 18);
            stuffed.field(remote, 1);
            stuffed.field(0, 2); // reserved bits
        }
    }
    stuffed.field(u32::from(frame.length()), 4);
    for byte in frame.data() {
        stuffed.field(u32::from(*byte), 8);
    }
    let checksum = u32::from(stuffed.checksum);
    stuffed.field(checksum, 15);
    stuffed.bits + TAIL_BITS + INTERMISSION_BITS
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

/// Counts bits as sent, stuff bits included, and keeps the checksum of the bits before stuffing.
#[derive(Default)]
struct Stuffed {
    bits: u32,
    last: bool,
    run: u8,
    checksum: u16,
}

impl Stuffed {
    /// Sends the low `width` bits, the highest first.
    fn field(&mut self, value: u32, width: u32) {
        for place in (0..width).rev() {
            self.bit((value >> place) & 1 != 0);
        }
    }

    fn bit(&mut self, bit: bool) {
        let feedback = bit != (self.checksum & 0x4000 != 0);
        self.checksum = (self.checksum << 1) & 0x7FFF;
        if feedback {
            self.checksum ^= POLYNOMIAL;
        }
        self.bits += 1;
        self.run = if bit == self.last { self.run + 1 } else { 1 };
        self.last = bit;
        if self.run == 5 {
            self.bits += 1;
            self.last = !bit;
            self.run = 1;
        }
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
        let mut stuffed = Stuffed::default();
        b"123456789".iter().for_each(|byte| stuffed.field(u32::from(*byte), 8));
        assert_eq!(stuffed.checksum, 0x059E);
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
}
