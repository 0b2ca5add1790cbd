//! The plain CAN frame of the core.
//!
//! A driver's own frame type is copied into a [`CanFrame`] on the way in ([`CanFrame::copy_of`]) and built from it on
//! the way out ([`CanFrame::convert`]); in between, the crate knows no driver.
//!
//! ```text
//! CanFrame = header (29-bit id, extended flag, remote flag) + length 0..=8 + data, zero beyond the length
//! ```
//!
//! ```
//! use drivetrain::frame::CanFrame;
//! use embedded_can::{Frame, StandardId};
//!
//! let id = StandardId::new(0x200).ok_or("not an 11-bit id")?;
//! let frame = CanFrame::new(id, &[0x03, 0xE8]).ok_or("more than 8 bytes")?;
//! assert_eq!(frame.data(), [0x03, 0xE8]);
//! # Ok::<(), &str>(())
//! ```
//!
//! Classic CAN only: a CAN FD frame of more than 8 bytes has no `CanFrame`.

use embedded_can::{ExtendedId, Frame, Id, StandardId};

const EXTENDED: u32 = 1 << 29;
const REMOTE: u32 = 1 << 30;
/// Bytes are missing: one comparison distinguishes a whole standard data frame from all others.
const SHORT: u32 = 1 << 31;
const ID_MASK: u32 = 0x1FFF_FFFF;

/// Returns the id with these 11 bits; a number with more bits gives the largest id.
pub(crate) fn standard_id(raw: u16) -> Id {
    StandardId::new(raw).unwrap_or(StandardId::MAX).into()
}

/// Returns the id with these 29 bits; a number with more bits gives the largest id.
pub(crate) fn extended_id(raw: u32) -> Id {
    ExtendedId::new(raw).unwrap_or(ExtendedId::MAX).into()
}

/// 0 to 8. With this bound known to the compiler, an optional frame takes the room of a frame; as a word, a frame is copied by words.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
#[repr(u32)]
enum Length {
    L0,
    L1,
    L2,
    L3,
    L4,
    L5,
    L6,
    L7,
    L8,
}

impl Length {
    const fn new(length: usize) -> Option<Self> {
        Some(match length {
            0 => Self::L0,
            1 => Self::L1,
            2 => Self::L2,
            3 => Self::L3,
            4 => Self::L4,
            5 => Self::L5,
            6 => Self::L6,
            7 => Self::L7,
            8 => Self::L8,
            _ => return None,
        })
    }
}

/// A classic CAN data or remote frame.
///
/// Takes 16 bytes on a Cortex-M4F (`docs/figures.md`).
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub struct CanFrame {
    /// Id and flags; [`SHORT`] unless there are 8 bytes.
    key: u32,
    data: [u8; 8],
    length: Length,
}

impl CanFrame {
    /// Builds a standard data frame of 8 bytes; `None` for an id above `0x7FF`.
    #[must_use]
    pub const fn standard(id: u16, data: [u8; 8]) -> Option<Self> {
        if id <= 0x7FF { Some(Self { key: id as u32, data, length: Length::L8 }) } else { None }
    }

    /// Builds a data frame of up to 8 bytes. An array of more than 8 bytes does not compile.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::frame::CanFrame;
    /// use embedded_can::StandardId;
    ///
    /// let id = StandardId::new(0x141).ok_or("not an 11-bit id")?;
    /// assert_eq!(format!("{:?}", CanFrame::of(id, [0x9A, 0x00])), "141 [2] 9A 00");
    /// # Ok::<(), &str>(())
    /// ```
    /// ```compile_fail
    /// # use drivetrain::frame::CanFrame;
    /// let frame = CanFrame::of(embedded_can::StandardId::ZERO, [0; 9]);
    /// ```
    #[must_use]
    pub fn of<const N: usize>(id: impl Into<Id>, data: [u8; N]) -> Self {
        const { assert!(N <= 8, "a classic CAN frame has at most 8 bytes") };
        let length = const {
            match Length::new(N) {
                Some(length) => length,
                None => Length::L8, // refused above
            }
        };
        let mut frame = Self { key: key_of(header_of(id.into()), length), data: [0; 8], length };
        for (place, byte) in frame.data.iter_mut().zip(data) {
            *place = byte;
        }
        frame
    }

    /// Copies a frame of any driver; `None` for a frame of more than 8 bytes.
    #[must_use]
    pub fn copy_of(frame: &impl Frame) -> Option<Self> {
        if frame.is_remote_frame() {
            Self::new_remote(frame.id(), frame.dlc())
        } else {
            Self::new(frame.id(), frame.data())
        }
    }

    /// An empty frame, to be written over.
    pub(crate) const EMPTY: Self = Self { key: SHORT, data: [0; 8], length: Length::L0 };

    /// [`copy_of`](Self::copy_of) in the place of this frame; returns whether there is a copy, and otherwise leaves this
    /// frame unchanged. In place: a returned frame is moved three times on its way.
    #[inline(always)]
    pub(crate) fn copy_from(&mut self, frame: &impl Frame) -> bool {
        if !frame.is_remote_frame() {
            if let Ok(data) = frame.data().try_into() {
                (self.key, self.data, self.length) = (header_of(frame.id()), data, Length::L8);
                return true;
            }
        }
        self.copy_unusual(frame)
    }

    #[cold]
    #[inline(never)]
    fn copy_unusual(&mut self, frame: &impl Frame) -> bool {
        let copy = Self::copy_of(frame);
        *self = copy.unwrap_or(*self);
        copy.is_some()
    }

    /// Builds a driver's frame with the same content; `None` when the driver's type cannot hold the content.
    #[must_use]
    pub fn convert<F: Frame>(&self) -> Option<F> {
        if self.is_remote_frame() {
            F::new_remote(self.id(), self.dlc())
        } else {
            F::new(self.id(), self.data())
        }
    }

    /// Returns the id, extended flag and remote flag as one word.
    ///
    /// At most `0x7FF` for a standard data frame, and only then: one comparison checks all three.
    #[must_use]
    pub const fn header(&self) -> u32 {
        self.key & !SHORT
    }

    /// Returns all 8 data bytes; the bytes beyond the length are zero.
    #[must_use]
    pub const fn bytes(&self) -> &[u8; 8] {
        &self.data
    }

    /// Returns the number of data bytes, or the requested length of a remote frame: 0 to 8.
    #[must_use]
    pub const fn length(&self) -> u8 {
        self.length as u8
    }

    /// Returns the [header](Self::header) of a frame of 8 bytes. Frames with fewer bytes have another key, above `0x7FF`.
    #[inline]
    pub(crate) const fn key(&self) -> u32 {
        self.key
    }

    /// Returns whether this is a standard data frame of 8 bytes.
    #[inline]
    pub(crate) const fn is_whole(&self) -> bool {
        self.key <= 0x7FF
    }

    /// [`Frame::is_remote_frame`], for `const` code.
    pub(crate) const fn is_remote(&self) -> bool {
        self.key & REMOTE != 0
    }

    /// [`Frame::is_extended`], for `const` code.
    pub(crate) const fn has_extended_id(&self) -> bool {
        self.key & EXTENDED != 0
    }

    /// Returns the bits on the wire with the pause after them: without stuff bits, and with the most stuff bits possible.
    pub(crate) const fn bits(&self) -> (u32, u32) {
        // CRC delimiter, acknowledge slot and delimiter, end of frame, and the pause of three bits.
        const UNSTUFFED_BITS: u32 = 13;
        let data = if self.is_remote() { 0 } else { 8 * self.length() as u32 };
        let stuffable = data + if self.has_extended_id() { 54 } else { 34 };
        let nominal = stuffable + UNSTUFFED_BITS;
        (nominal, nominal + (stuffable - 1) / 4)
    }

    #[inline]
    fn with_header(header: u32, data: &[u8]) -> Option<Self> {
        match data.try_into() {
            Ok(data) => Some(Self { key: header, data, length: Length::L8 }),
            Err(_) => Self::shorter(header, data),
        }
    }

    #[inline(never)]
    fn shorter(header: u32, data: &[u8]) -> Option<Self> {
        let length = Length::new(data.len())?;
        let mut frame = Self { key: key_of(header, length), data: [0; 8], length };
        frame.data.get_mut(..data.len())?.copy_from_slice(data);
        Some(frame)
    }
}

const fn key_of(header: u32, length: Length) -> u32 {
    if matches!(length, Length::L8) { header } else { header | SHORT }
}

fn header_of(id: Id) -> u32 {
    match id {
        Id::Standard(id) => u32::from(id.as_raw()),
        Id::Extended(id) => id.as_raw() | EXTENDED,
    }
}

impl Frame for CanFrame {
    fn new(id: impl Into<Id>, data: &[u8]) -> Option<Self> {
        Self::with_header(header_of(id.into()), data)
    }

    fn new_remote(id: impl Into<Id>, dlc: usize) -> Option<Self> {
        let length = Length::new(dlc)?;
        let key = key_of(header_of(id.into()) | REMOTE, length);
        Some(Self { key, data: [0; 8], length })
    }

    fn is_extended(&self) -> bool {
        self.has_extended_id()
    }

    fn is_remote_frame(&self) -> bool {
        self.is_remote()
    }

    fn id(&self) -> Id {
        if !self.has_extended_id() {
            #[expect(
                clippy::cast_possible_truncation,
                reason = "at most 0x7FF, and a flag above the lower half"
            )]
            let raw = self.key as u16;
            return Id::Standard(StandardId::new(raw).unwrap_or(StandardId::ZERO));
        }
        Id::Extended(ExtendedId::new(self.key & ID_MASK).unwrap_or(ExtendedId::ZERO))
    }

    fn dlc(&self) -> usize {
        usize::from(self.length())
    }

    fn data(&self) -> &[u8] {
        let length = if self.is_remote_frame() { 0 } else { self.dlc() };
        self.data.get(..length).unwrap_or(&[])
    }
}

/// Writes the form of candump: `201 [8] 0E 16 00 00 FF FD 21 00`.
impl core::fmt::Debug for CanFrame {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self.id() {
            Id::Standard(id) => write!(f, "{:03X} [{}]", id.as_raw(), self.length())?,
            Id::Extended(id) => write!(f, "{:08X} [{}]", id.as_raw(), self.length())?,
        }
        if self.is_remote_frame() {
            return f.write_str(" remote request");
        }
        self.data().iter().try_for_each(|byte| write!(f, " {byte:02X}"))
    }
}

#[cfg(feature = "defmt")]
impl defmt::Format for CanFrame {
    fn format(&self, f: defmt::Formatter<'_>) {
        defmt::write!(
            f,
            "{=u32:03X} [{=u8}] {=[u8]:02X}",
            self.header(),
            self.length(),
            self.data()
        );
    }
}

/// Ids of CAN frames: a header, and a mask of its significant bits.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Pattern {
    pub(crate) header: u32,
    pub(crate) mask: u32,
}

impl Pattern {
    /// No ids: a header never has all bits.
    pub(crate) const NONE: Self = Self { header: u32::MAX, mask: u32::MAX };

    pub(crate) const ANY: Self = Self { header: 0, mask: 0 };

    /// Makes the pattern of data frames whose id agrees with an id in the bits of a mask.
    pub(crate) fn of(id: Id, mask: u32) -> Self {
        let mask = mask | !ID_MASK;
        Self { header: header_of(id) & mask, mask }
    }

    pub(crate) const fn is_none(&self) -> bool {
        self.header == u32::MAX
    }

    /// Adds ids. The bits that all ids have in common stay significant.
    pub(crate) fn add(&mut self, other: Self) {
        let mask = self.mask & other.mask & !(self.header ^ other.header);
        *self = if self.is_none() { other } else { Self { header: other.header & mask, mask } };
    }

    /// Tells whether the id of a frame is among the ids.
    #[inline]
    pub(crate) const fn fits(&self, frame: &CanFrame) -> bool {
        (frame.header() ^ self.header) & self.mask == 0
    }

    /// Tells whether a frame can fit both patterns.
    pub(crate) const fn meets(&self, other: &Self) -> bool {
        (self.header ^ other.header) & self.mask & other.mask == 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::format;
    use std::vec::Vec;

    fn standard(raw: u16) -> StandardId {
        StandardId::new(raw).unwrap()
    }

    /// Counted on ISO 11898-1: 44 bits and 64 without data, 3 of a pause, and a stuff bit after the fifth bit and each fourth from then on, as
    /// Davis, Burns, Bril and Lukkien (2007) bound it: 135 and 160 with eight bytes.
    #[test]
    fn a_frame_has_the_bits_of_the_standard() {
        let long = ExtendedId::new(0x201).unwrap();
        for (length, short, extended) in
            [(0, (47, 55), (67, 80)), (1, (55, 65), (75, 90)), (8, (111, 135), (131, 160))]
        {
            let data = &[0; 8][..length];
            assert_eq!(CanFrame::new(standard(0x201), data).unwrap().bits(), short);
            assert_eq!(CanFrame::new(long, data).unwrap().bits(), extended);
            // No data, whatever the length says.
            assert_eq!(CanFrame::new_remote(standard(0x201), length).unwrap().bits(), (47, 55));
            assert_eq!(CanFrame::new_remote(long, length).unwrap().bits(), (67, 80));
        }
    }

    #[test]
    fn every_length_up_to_eight_is_kept_and_nine_is_refused() {
        let bytes = [1, 2, 3, 4, 5, 6, 7, 8, 9];
        for length in 0..=8 {
            let frame = CanFrame::new(standard(0x201), &bytes[..length]).unwrap();
            assert_eq!((frame.dlc(), frame.data()), (length, &bytes[..length]));
            assert!(frame.bytes()[length..].iter().all(|byte| *byte == 0));
            assert_eq!((frame.header(), frame.is_whole()), (0x201, length == 8));
            assert_eq!(frame.key() == frame.header(), length == 8);
            let remote = CanFrame::new_remote(standard(0x201), length).unwrap();
            assert_eq!((remote.dlc(), remote.data()), (length, &[][..]));
        }
        assert_eq!(CanFrame::new(standard(0x201), &bytes), None);
        assert_eq!(CanFrame::new_remote(standard(0x201), 9), None);
        assert_eq!(CanFrame::new_remote(standard(0x201), usize::MAX), None);
    }

    #[test]
    fn one_number_in_two_id_spaces_is_two_ids() {
        let standard = CanFrame::new(standard(0x201), &[]).unwrap();
        let extended = CanFrame::new(ExtendedId::new(0x201).unwrap(), &[]).unwrap();
        assert_ne!(standard.id(), extended.id());
        assert!(standard.header() <= 0x7FF);
        assert!(extended.header() > 0x7FF);
        assert!(CanFrame::new_remote(standard.id(), 8).unwrap().header() > 0x7FF);
    }

    #[test]
    fn ids_survive_at_both_ends_of_their_range() {
        for raw in [0, 1, 0x7FF] {
            let id = Id::Standard(StandardId::new(raw).unwrap());
            assert_eq!(CanFrame::new(id, &[]).unwrap().id(), id);
        }
        for raw in [0, 1, 0x7FF, 0x800, 0x1FFF_FFFF] {
            let id = Id::Extended(ExtendedId::new(raw).unwrap());
            assert_eq!(CanFrame::new(id, &[]).unwrap().id(), id);
        }
        assert_eq!(CanFrame::standard(0x800, [0; 8]), None);
    }

    #[test]
    fn copies_and_conversions_are_equal() {
        let data = CanFrame::standard(0x1FF, [1, 2, 3, 4, 5, 6, 7, 8]).unwrap();
        let remote = CanFrame::new_remote(ExtendedId::MAX, 3).unwrap();
        let long = CanFrame::new_remote(ExtendedId::MAX, 8).unwrap();
        for (frame, is_extended) in [(data, false), (remote, true), (long, true)] {
            assert_eq!(CanFrame::copy_of(&frame), Some(frame));
            let mut copy = CanFrame::standard(0x123, [9; 8]).unwrap();
            assert!(copy.copy_from(&frame));
            assert_eq!((copy, copy.is_extended()), (frame, is_extended));
            assert_eq!(frame.convert::<CanFrame>(), Some(frame));
        }
    }

    /// A request of a driver that leaves the data of an older frame in its buffer.
    struct Careless;

    impl Frame for Careless {
        fn new(_: impl Into<Id>, _: &[u8]) -> Option<Self> {
            None
        }
        fn new_remote(_: impl Into<Id>, _: usize) -> Option<Self> {
            Some(Self)
        }
        fn is_extended(&self) -> bool {
            false
        }
        fn is_remote_frame(&self) -> bool {
            true
        }
        fn id(&self) -> Id {
            standard(0x201).into()
        }
        fn dlc(&self) -> usize {
            8
        }
        fn data(&self) -> &[u8] {
            &[1; 8]
        }
    }

    #[test]
    fn the_copy_of_a_request_has_no_data() {
        let mut copy = CanFrame::standard(0x123, [9; 8]).unwrap();
        assert!(copy.copy_from(&Careless));
        assert_eq!(Some(copy), CanFrame::new_remote(standard(0x201), 8));
    }

    #[test]
    fn debug_is_the_form_of_candump() {
        let frame = CanFrame::new(standard(0x201), &[0x0E, 0x16]).unwrap();
        assert_eq!(format!("{frame:?}"), "201 [2] 0E 16");
        let remote = CanFrame::new_remote(ExtendedId::new(0x12).unwrap(), 1).unwrap();
        assert_eq!(format!("{remote:?}"), "00000012 [1] remote request");
    }

    #[test]
    fn a_pattern_fits_the_ids_that_have_the_bits_of_all_its_ids_in_common() {
        let id = |raw| Id::from(StandardId::new(raw).unwrap());
        let pattern = |raw| Pattern::of(id(raw), 0x7FF);
        let fits = |pattern: &Pattern| -> Vec<u16> {
            (0..0x7FF).filter(|raw| pattern.fits(&CanFrame::of(id(*raw), [0; 8]))).collect()
        };
        let mut two = Pattern::NONE;
        assert!(fits(&two).is_empty());
        two.add(pattern(0x201));
        assert_eq!(fits(&two), [0x201]);
        two.add(pattern(0x203));
        assert_eq!(fits(&two), [0x201, 0x203]);
        assert!(two.meets(&pattern(0x203)) && pattern(0x203).meets(&two));
        assert!(!two.meets(&pattern(0x205)) && !Pattern::NONE.meets(&two));
        assert!(Pattern::ANY.meets(&two));
        assert_eq!(fits(&Pattern::of(id(0x201), 0x7F0)).len(), 16);
        let remote = CanFrame::new_remote(id(0x201), 8).unwrap();
        assert!(!two.fits(&remote) && !Pattern::NONE.fits(&remote));
    }
}
