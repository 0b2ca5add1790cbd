//! The outbox: words in frames, and frames in turn.

use crate::frame::CanFrame;

/// One of the five command frames: four motors each.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum CommandFrame {
    /// C6x0 #1..=4.
    X200,
    /// C6x0 #5..=8 and GM6020 (voltage) #1..=4.
    X1FF,
    /// GM6020 (voltage) #5..=7.
    X2FF,
    /// GM6020 (current) #1..=4.
    X1FE,
    /// GM6020 (current) #5..=7.
    X2FE,
}

impl CommandFrame {
    /// All command frames, in the order of their index.
    pub(super) const ALL: [Self; 5] = [Self::X200, Self::X1FF, Self::X2FF, Self::X1FE, Self::X2FE];

    /// Returns the CAN id.
    pub(super) const fn id(self) -> u16 {
        match self {
            Self::X200 => 0x200,
            Self::X1FF => 0x1FF,
            Self::X2FF => 0x2FF,
            Self::X1FE => 0x1FE,
            Self::X2FE => 0x2FE,
        }
    }

    /// The ids in the order of the index, as many as there are [`Words`].
    const IDS: [u16; 8] = {
        let [a, b, c, d, e] = Self::ALL;
        [a.id(), b.id(), c.id(), d.id(), e.id(), 0, 0, 0]
    };

    const fn bit(self) -> u8 {
        1 << self as u8
    }

    pub(super) fn with_id(id: u32) -> Option<Self> {
        Self::ALL.into_iter().find(|frame| u32::from(frame.id()) == id)
    }
}

/// Swaps the bytes of two words at once.
#[inline(always)]
const fn swapped(words: [u8; 4]) -> [u8; 4] {
    u32::from_le_bytes(words).swap_bytes().rotate_left(16).to_le_bytes()
}

/// Counts the frames in a set; a Cortex-M has no instruction for this.
fn ones(frames: u8) -> u32 {
    const ONES: [u8; 32] = [
        0, 1, 1, 2, 1, 2, 2, 3, 1, 2, 2, 3, 2, 3, 3, 4, //
        1, 2, 2, 3, 2, 3, 3, 4, 2, 3, 3, 4, 3, 4, 4, 5,
    ];
    ONES.get(usize::from(frames & 31)).map_or(0, |ones| u32::from(*ones))
}

/// Place of a motor's word: a slot, 0 to 3, of a command frame.
// The compiler knows the largest value, so an index by this type needs no check.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
#[rustfmt::skip]
pub(super) enum Place {
    X200At0, X200At1, X200At2, X200At3,
    X1FFAt0, X1FFAt1, X1FFAt2, X1FFAt3,
    X2FFAt0, X2FFAt1, X2FFAt2, X2FFAt3,
    X1FEAt0, X1FEAt1, X1FEAt2, X1FEAt3,
    X2FEAt0, X2FEAt1, X2FEAt2, X2FEAt3,
    /// In no frame: a word in this place is never sent.
    Nowhere,
}

impl Place {
    #[rustfmt::skip]
    pub(super) const fn new(frame: CommandFrame, slot: u8) -> Self {
        let [a, b, c, d] = match frame {
            CommandFrame::X200 => [Self::X200At0, Self::X200At1, Self::X200At2, Self::X200At3],
            CommandFrame::X1FF => [Self::X1FFAt0, Self::X1FFAt1, Self::X1FFAt2, Self::X1FFAt3],
            CommandFrame::X2FF => [Self::X2FFAt0, Self::X2FFAt1, Self::X2FFAt2, Self::X2FFAt3],
            CommandFrame::X1FE => [Self::X1FEAt0, Self::X1FEAt1, Self::X1FEAt2, Self::X1FEAt3],
            CommandFrame::X2FE => [Self::X2FEAt0, Self::X2FEAt1, Self::X2FEAt2, Self::X2FEAt3],
        };
        match slot & 3 {
            0 => a,
            1 => b,
            2 => c,
            _ => d,
        }
    }

    pub(super) const fn same_as(self, other: Self) -> bool {
        self as u8 == other as u8
    }

    pub(super) const fn slot(self) -> u8 {
        self as u8 & 3
    }

    pub(super) const fn frame(self) -> CommandFrame {
        let [x200, x1ff, x2ff, x1fe, x2fe] = CommandFrame::ALL;
        match self as u8 >> 2 {
            0 => x200,
            1 => x1ff,
            2 => x2ff,
            3 => x1fe,
            _ => x2fe,
        }
    }
}

/// The command words, each with its low byte first, aligned for reads as 32-bit words.
///
/// The rows above the five frames are unused: [`Place::Nowhere`] needs a row, and an index has three bits.
#[derive(Debug, Clone, Copy)]
#[repr(align(4))]
struct Words([[[u8; 2]; 4]; 8]);

impl Words {
    const ZERO: Self = Self([[[0; 2]; 4]; 8]);
}

/// Waiting (*dirty*) frames, and frames with precedence because their turn is next; no frame has precedence after all were taken. Side by
/// side, so that one load tests both.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(2))]
struct Waiting([u8; 2]);

impl Waiting {
    const NONE: Self = Self([0; 2]);

    const fn is_none(self) -> bool {
        u16::from_le_bytes(self.0) == 0
    }
}

/// The command words, and the waiting frames.
///
/// A frame waits (is *dirty*) after an update with a non-zero word in the frame, or with its last non-zero word turned to zero. A frame of
/// zeros is repeated only as a keep-alive. The newest words supersede older words that were not sent.
#[derive(Debug, Clone, Copy)]
pub(super) struct Outbox {
    words: Words,
    in_use: u8,
    ever_used: u8,
    /// Frames with a non-zero word in the last update, and frames to be sent with the next update in any case.
    active: u8,
    waiting: Waiting,
    /// Whether a frame was refused or evicted since the last update.
    came_back: bool,
    keep_alive_us: u32,
    kept_alive: u32,
    pub(super) packed: u32,
    pub(super) superseded: u32,
}

impl Outbox {
    pub(super) const fn new() -> Self {
        Self {
            words: Words::ZERO,
            in_use: 0,
            ever_used: 0,
            active: 0,
            waiting: Waiting::NONE,
            came_back: false,
            keep_alive_us: 10_000,
            kept_alive: 0,
            packed: 0,
            superseded: 0,
        }
    }

    pub(super) const fn set_keep_alive(&mut self, period_us: u32) {
        self.keep_alive_us = period_us;
    }

    pub(super) const fn frames_in_use(&self) -> u32 {
        self.in_use.count_ones()
    }

    /// Returns the number of frames in use, including this one.
    pub(super) const fn frames_in_use_with(&self, frame: CommandFrame) -> u32 {
        (self.in_use | frame.bit()).count_ones()
    }

    /// Sends this frame from now on: the first time with the next update, regardless of its words.
    pub(super) const fn open(&mut self, frame: CommandFrame) {
        self.in_use |= frame.bit();
        self.active |= frame.bit();
        self.ever_used |= frame.bit();
    }

    /// Sends this frame once more, and then no longer.
    pub(super) fn close(&mut self, frame: CommandFrame) {
        self.in_use &= !frame.bit();
        self.active &= !frame.bit();
        self.mark(frame.bit());
    }

    #[inline(always)]
    pub(super) fn put(&mut self, place: Place, raw: i16) {
        if let Some(word) = self.words.0.as_flattened_mut().get_mut(place as usize) {
            *word = raw.to_le_bytes();
        }
    }

    /// Returns the last word for a motor.
    #[inline(always)]
    pub(super) fn get(&self, place: Place) -> i16 {
        let word = self.words.0.as_flattened().get(place as usize);
        word.map_or(0, |word| i16::from_le_bytes(*word))
    }

    /// Tells whether a frame is sent.
    pub(super) const fn is_in_use(&self, frame: CommandFrame) -> bool {
        self.in_use & frame.bit() != 0
    }

    /// Sets every word to zero, and marks every frame in use to be sent.
    pub(super) fn clear(&mut self) {
        self.words = Words::ZERO;
        let due = core::mem::take(&mut self.active);
        self.mark(due | self.in_use);
    }

    /// Marks every frame in use to be sent with this update, if the keep-alive is due. Returns the time until the next, in µs.
    pub(super) fn keep_alive(&mut self, now: u32) -> u32 {
        let since = now.wrapping_sub(self.kept_alive);
        if since < self.keep_alive_us {
            return self.keep_alive_us - since;
        }
        self.kept_alive = now;
        self.active |= self.in_use;
        self.keep_alive_us
    }

    /// Marks the frames that this update made ready.
    #[inline(always)]
    pub(super) fn finish_update(&mut self) {
        let mut active = 0;
        for (frame, words) in CommandFrame::ALL.iter().zip(&self.words.0) {
            if self.in_use < frame.bit() {
                break; // nor is any after it
            }
            if *words != [[0; 2]; 4] {
                active |= frame.bit();
            }
        }
        let due = active | core::mem::replace(&mut self.active, active);
        self.mark(due);
    }

    #[inline(always)]
    fn mark(&mut self, frames: u8) {
        self.packed = self.packed.wrapping_add(ones(frames));
        if self.waiting.is_none() {
            self.waiting.0[0] = frames;
        } else {
            self.keep_turns(frames);
        }
    }

    /// Keeps the turns of the frames until all are taken, because frames still wait or a frame came back: no frame starves.
    #[cold]
    #[inline(never)]
    fn keep_turns(&mut self, frames: u8) {
        let [dirty, mut ahead] = self.waiting.0;
        self.superseded = self.superseded.wrapping_add(ones(frames & dirty));
        let came_back = core::mem::take(&mut self.came_back);
        if dirty == 0 && !came_back {
            ahead = 0;
        } else if ahead == 0 {
            ahead = dirty | dirty.wrapping_neg();
        }
        self.waiting.0 = [dirty | frames, ahead];
    }

    /// Takes the next waiting frame: in the order of the index while each update finds all frames taken, and otherwise in turns.
    #[inline]
    pub(super) fn next(&mut self) -> Option<CanFrame> {
        let dirty = self.waiting.0[0];
        if dirty == 0 {
            return None;
        }
        let index = if self.waiting.0[1] == 0 {
            self.waiting.0[0] = dirty & (dirty - 1);
            dirty.trailing_zeros() & 7
        } else {
            self.next_in_turn()
        };
        let (id, words) =
            (*CommandFrame::IDS.get(index as usize)?, self.words.0.get(index as usize)?);
        let [[a, b], [c, d], [e, f], [g, h]] = *words;
        let [a, b, c, d] = swapped([a, b, c, d]);
        let [e, f, g, h] = swapped([e, f, g, h]);
        CanFrame::standard(id, [a, b, c, d, e, f, g, h])
    }

    /// Takes the waiting frame after the previous one off the list, and returns its index.
    #[cold]
    #[inline(never)]
    fn next_in_turn(&mut self) -> u32 {
        let [dirty, ahead] = self.waiting.0;
        let first = dirty & ahead;
        let index = if first == 0 { dirty } else { first }.trailing_zeros() & 7;
        let bit = 1_u8 << index;
        self.waiting.0 = [dirty & !bit, (bit << 1).wrapping_neg()];
        index
    }

    /// Requeues a frame that was refused or evicted. The frame waits for the next update, which replaces its words, so a caller's loop
    /// ends; the frame then goes first.
    pub(super) fn requeue(&mut self, header: u32) -> bool {
        match CommandFrame::with_id(header) {
            Some(frame) if self.ever_used & frame.bit() != 0 => {
                self.active |= frame.bit();
                self.superseded = self.superseded.wrapping_add(1);
                self.waiting.0[1] = frame.bit().wrapping_neg();
                self.came_back = true;
                true
            }
            _ => false,
        }
    }

    /// Marks a frame that found no place; the frame goes first, with its newest words. An older one than the frame that waits is
    /// superseded.
    pub(super) fn put_back(&mut self, header: u32) -> bool {
        match CommandFrame::with_id(header) {
            Some(frame) if self.in_use & frame.bit() != 0 => {
                let [dirty, _] = self.waiting.0;
                self.superseded = self.superseded.wrapping_add(ones(dirty & frame.bit()));
                self.waiting.0 = [dirty | frame.bit(), frame.bit().wrapping_neg()];
                true
            }
            _ => false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use embedded_can::Frame;
    use proptest::prelude::*;
    use std::vec::Vec;

    fn ids(outbox: &mut Outbox) -> Vec<u32> {
        core::iter::from_fn(|| outbox.next()).map(|frame| frame.header()).collect()
    }

    fn outbox(frames: &[CommandFrame]) -> Outbox {
        let mut outbox = Outbox::new();
        frames.iter().for_each(|frame| outbox.open(*frame));
        outbox.set_keep_alive(u32::MAX);
        outbox
    }

    #[test]
    fn a_frame_of_zeros_is_sent_once_and_then_as_a_keep_alive_only() {
        let mut outbox = outbox(&[CommandFrame::X200]);
        outbox.set_keep_alive(5_000);
        outbox.put(Place::new(CommandFrame::X200, 1), 100);
        outbox.keep_alive(1_000);
        outbox.finish_update();
        assert_eq!(ids(&mut outbox), [0x200]);
        outbox.put(Place::new(CommandFrame::X200, 1), 0);
        let sent: Vec<usize> = (2..12)
            .map(|ms| {
                outbox.keep_alive(ms * 1_000);
                outbox.finish_update();
                ids(&mut outbox).len()
            })
            .collect();
        assert_eq!(sent, [1, 0, 0, 1, 0, 0, 0, 0, 1, 0]);
    }

    #[test]
    fn a_returned_frame_waits_for_the_next_update_and_goes_first() {
        let mut outbox = outbox(&[CommandFrame::X200, CommandFrame::X1FF, CommandFrame::X2FE]);
        for frame in [CommandFrame::X200, CommandFrame::X1FF, CommandFrame::X2FE] {
            outbox.put(Place::new(frame, 0), 1);
        }
        outbox.finish_update();
        assert_eq!(ids(&mut outbox), [0x200, 0x1FF, 0x2FE]);
        assert!(outbox.requeue(0x1FF));
        assert_eq!(outbox.next(), None);
        outbox.finish_update();
        assert_eq!(ids(&mut outbox), [0x1FF, 0x2FE, 0x200]);
        assert!(!outbox.requeue(0x1FE), "not ours");
        assert!(!outbox.requeue(0x8000_0200), "extended");
    }

    #[test]
    fn a_frame_that_found_no_place_goes_first_with_the_newest_words() {
        let mut outbox = outbox(&[CommandFrame::X200, CommandFrame::X1FF]);
        for frame in [CommandFrame::X200, CommandFrame::X1FF] {
            outbox.put(Place::new(frame, 0), 1);
        }
        outbox.finish_update();
        assert_eq!(outbox.next().map(|frame| frame.header()), Some(0x200));
        assert!(outbox.put_back(0x200));
        assert_eq!((ids(&mut outbox), outbox.superseded), (std::vec![0x200, 0x1FF], 0));
        outbox.finish_update();
        assert!(outbox.put_back(0x1FF), "an older one than the frame that waits");
        assert_eq!((ids(&mut outbox), outbox.superseded), (std::vec![0x1FF, 0x200], 1));
        assert!(!outbox.put_back(0x2FF), "not in use");
        assert!(!outbox.put_back(0x8000_0200), "extended");
        assert_eq!(outbox.next(), None);
    }

    #[test]
    fn where_only_some_frames_are_taken_in_each_update_all_have_their_turn() {
        let frames = [CommandFrame::X200, CommandFrame::X1FF, CommandFrame::X2FE];
        for (taken, refused) in [(1, 0), (2, 0), (1, 1), (2, 1)] {
            let mut outbox = outbox(&frames);
            let mut sent = Vec::new();
            for round in 1..=30 {
                frames.iter().for_each(|frame| outbox.put(Place::new(*frame, 0), round));
                outbox.finish_update();
                sent.extend((0..taken).filter_map(|_| outbox.next()).map(|frame| frame.header()));
                for _ in 0..refused {
                    let frame = outbox.next().unwrap();
                    assert!(outbox.requeue(frame.header()));
                }
            }
            for frame in frames {
                let of = sent.iter().filter(|id| **id == u32::from(frame.id())).count();
                assert_eq!(of, 10 * taken, "{frame:?} of {taken} and {refused}");
            }
        }
    }

    #[test]
    fn a_frame_that_was_not_taken_is_superseded_by_the_newest_words() {
        let mut outbox = outbox(&[CommandFrame::X200]);
        for raw in [1, 2, 3] {
            outbox.put(Place::new(CommandFrame::X200, 0), raw);
            outbox.finish_update();
        }
        assert_eq!(outbox.next().map(|frame| frame.data()[..2].to_vec()), Some(std::vec![0, 3]));
        assert_eq!((outbox.packed, outbox.superseded), (3, 2));
    }

    #[test]
    fn a_place_tells_its_frame_and_its_slot() {
        for frame in CommandFrame::ALL {
            for slot in 0..4 {
                let place = Place::new(frame, slot);
                assert_eq!((place.frame(), place.slot()), (frame, slot));
            }
        }
    }

    #[test]
    fn frames_in_use_are_counted_and_told() {
        let mut outbox = outbox(&[CommandFrame::X200, CommandFrame::X2FF]);
        assert_eq!(outbox.frames_in_use(), 2);
        assert_eq!(
            CommandFrame::ALL.map(|frame| outbox.frames_in_use_with(frame)),
            [2, 3, 2, 3, 3]
        );
        outbox.close(CommandFrame::X200);
        let in_use = CommandFrame::ALL.map(|frame| outbox.is_in_use(frame));
        assert_eq!(in_use, [false, false, true, false, false]);
    }

    #[test]
    fn a_cleared_frame_is_sent_with_zeros_also_when_it_was_silent() {
        let mut outbox = outbox(&[CommandFrame::X200, CommandFrame::X1FF]);
        let moving = Place::new(CommandFrame::X200, 3);
        outbox.put(moving, -7);
        assert_eq!(outbox.get(moving), -7);
        for _ in 0..3 {
            outbox.finish_update();
            ids(&mut outbox);
        }
        outbox.clear();
        assert_eq!(outbox.get(moving), 0);
        assert_eq!(ids(&mut outbox), [0x200, 0x1FF]);
    }

    #[test]
    fn a_keep_alive_tells_when_it_is_due_again() {
        let mut outbox = outbox(&[CommandFrame::X200]);
        outbox.set_keep_alive(5_000);
        let due = [5_000, 5_001, 9_999, 10_000, 12_000].map(|now| outbox.keep_alive(now));
        assert_eq!(due, [5_000, 4_999, 1, 5_000, 3_000]);
    }

    proptest! {
        /// Law: every word stands in its slot, big-endian, and nothing else does.
        #[test]
        fn words_stand_in_their_slots(words: [[i16; 4]; 5]) {
            let mut outbox = outbox(&CommandFrame::ALL);
            for (frame, words) in CommandFrame::ALL.iter().zip(&words) {
                for (slot, word) in (0..).zip(words) {
                    outbox.put(Place::new(*frame, slot), *word);
                }
            }
            outbox.finish_update();
            outbox.mark(0b1_1111);
            let mut seen = 0;
            while let Some(frame) = outbox.next() {
                let index = CommandFrame::ALL.iter().position(|known| u32::from(known.id()) == frame.header()).unwrap();
                let decoded: Vec<i16> = frame.data().chunks(2).map(|word| i16::from_be_bytes([word[0], word[1]])).collect();
                prop_assert_eq!(&decoded[..], &words[index][..]);
                seen += 1;
            }
            prop_assert_eq!(seen, 5);
        }
    }
}
