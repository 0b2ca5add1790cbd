use core::fmt;

/// A kind of frame for a [`Deframer`]: its beginning, its length, and its content.
///
/// The [`Deframer`] supplies everything else.
///
/// # Examples
/// A frame of a mark, a length, so many data bytes and their sum:
/// ```
/// use drivetrain::wire::{Decode, Deframer, Reject};
///
/// #[derive(Debug, PartialEq)]
/// struct Sum(u8);
///
/// impl Decode for Sum {
///     type Options = ();
///     const PREFIX: usize = 2;
///     fn header(_: &()) -> &[u8] { &[0x7E] }
///     fn length(_: &(), prefix: &[u8]) -> Option<usize> {
///         prefix.get(1).filter(|length| **length > 0).map(|length| usize::from(*length) + 3)
///     }
///     fn decode(_: &(), frame: &[u8]) -> Result<Self, Reject> {
///         let (sum, data) = frame[2..].split_last().ok_or(Reject::Length)?;
///         if data.iter().sum::<u8>() == *sum { Ok(Self(*sum)) } else { Err(Reject::Checksum) }
///     }
/// }
///
/// let mut decoder = Deframer::<Sum, 16>::new();
/// let mut bytes = &[0x7E, 0x7E, 2, 30, 12, 42][..]; // a mark too many
/// assert_eq!(decoder.read(&mut bytes), Some(Sum(42)));
/// ```
pub trait Decode: Sized {
    /// Parameters besides the bytes (for example a byte order); `()` for most frames.
    type Options: Clone + fmt::Debug;

    /// How many bytes of a frame tell its length, the header included: at least 1.
    const PREFIX: usize;

    /// Returns the first bytes of every frame; an empty slice if the protocol marks only the end of a frame.
    fn header(options: &Self::Options) -> &[u8];

    /// Returns the length of the whole frame in bytes, from its first [`PREFIX`](Self::PREFIX) bytes; `None` for an
    /// impossible length.
    fn length(options: &Self::Options, prefix: &[u8]) -> Option<usize>;

    /// Returns whether the frame is new; `false` when its source is frozen and repeats `previous`.
    ///
    /// [`Receiver`](super::Receiver) takes only new frames for a sign of life.
    fn is_new(&self, _previous: &Self) -> bool {
        true
    }

    /// Checks a whole frame and reads it.
    ///
    /// # Errors
    /// [`Reject`] names the fault of the frame. After [`Reject::Foreign`] the frame is skipped as a whole, otherwise its
    /// bytes are searched again.
    fn decode(options: &Self::Options, frame: &[u8]) -> Result<Self, Reject>;
}

/// Reason for which bytes with the beginning of a frame gave no value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Reject {
    /// The end of the frame is missing at its place. Only for protocols without header.
    Unframed,
    /// An impossible length.
    Length,
    /// The checksum does not fit.
    Checksum,
    /// The checksum fits, but this decoder does not read frames of this kind.
    Foreign,
    /// The checksum fits, but a field has an impossible value. One damaged frame in 65536 looks like this by chance
    /// (16-bit checksum), with a good frame inside.
    Content,
}

/// Counts of a decoder: frames, and discarded bytes. All counts saturate.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Counts {
    /// Good frames.
    pub frames: u32,
    /// Headers followed by a length of zero, or by a length too large for the protocol or the buffer; frames that ended
    /// early.
    pub length_errors: u32,
    /// Whole frames whose checksum did not fit.
    pub checksum_errors: u32,
    /// Good frames of a kind that is not read.
    pub foreign_frames: u32,
    /// Frames with a fitting checksum, or none, and an impossible value.
    pub content_errors: u32,
    /// Bytes outside of good frames: noise, and the rest of damaged frames.
    pub skipped_bytes: u32,
}

/// A streaming decoder of one kind of frames, with a buffer of `N` bytes.
///
/// The decoder takes bytes in any portions, and finds the same frames for any split. When a frame turns out to be
/// damaged, only its first byte is discarded and the rest is searched again: the decoder finds a good frame that begins
/// inside (after a truncated frame, after noise that looked like a header, after a length made too long).
///
/// `N` is also the length limit of a frame: a frame with a longer stated length is refused at once.
///
/// Cost: a copy of every byte, and one checksum a frame. Damage costs at most one more checksum for each header in the
/// damaged bytes. Portions are cheap; a single byte costs about ten times a byte of a portion (`docs/figures.md` has
/// the counts), so collect bytes if the serial port does not.
///
/// # Examples
/// ```
/// use drivetrain::wire::{Deframer, feetech};
///
/// let mut decoder = Deframer::<feetech::Status, 64>::new();
/// for byte in [0xFF, 0xFF, 0x01, 0x02, 0x00] {
///     assert_eq!(decoder.read(&mut &[byte][..]), None);
/// }
/// assert!(decoder.read(&mut &[0xFC][..]).is_some());
/// ```
#[derive(Clone)]
pub struct Deframer<F: Decode, const N: usize> {
    options: F::Options,
    buffer: [u8; N],
    /// Number of bytes in use in the buffer: the beginning of a frame.
    length: usize,
    /// How many bytes are needed before there is anything to decide.
    wanted: usize,
    counts: Counts,
}

impl<F: Decode<Options = ()>, const N: usize> Deframer<F, N> {
    /// Starts with an empty buffer, for frames without options.
    #[must_use]
    pub const fn new() -> Self {
        Self::with_options(())
    }
}

impl<F: Decode<Options = ()>, const N: usize> Default for Deframer<F, N> {
    fn default() -> Self {
        Self::new()
    }
}

impl<F: Decode, const N: usize> Deframer<F, N> {
    /// Starts with an empty buffer.
    #[must_use]
    pub const fn with_options(options: F::Options) -> Self {
        const { assert!(F::PREFIX > 0 && F::PREFIX <= N, "the buffer is too small for any frame") };
        Self { options, buffer: [0; N], length: 0, wanted: F::PREFIX, counts: Counts::new() }
    }

    /// Returns the next frame, and removes the bytes read from `input`. `None` when `input` is used up: the last bytes
    /// may be the beginning of a frame and are kept.
    ///
    /// Call this until `None`, as in `while let Some(frame) = decoder.read(&mut input) { .. }`.
    ///
    /// Costs 1205 instructions on a Cortex-M4F, for a frame of a HiPNUC of 82 bytes (`docs/figures.md`).
    #[must_use]
    pub fn read(&mut self, input: &mut &[u8]) -> Option<F> {
        loop {
            self.fill(input);
            if self.length < self.wanted {
                return None;
            }
            if let Some(frame) = self.step() {
                return Some(frame);
            }
        }
    }

    /// Discards an unfinished frame, and searches its bytes for shorter frames.
    ///
    /// For a pause on the line, which no frame contains: a damaged length then cannot hold back the following frames
    /// until the stated number of bytes has come. Frames found are returned by [`read`](Self::read), so call `read`
    /// with an empty input afterwards.
    pub fn abandon(&mut self) {
        self.give_up(1);
    }

    /// Returns the counts of frames and of discarded bytes.
    #[must_use]
    pub const fn counts(&self) -> Counts {
        self.counts
    }

    /// Returns the options of the frames.
    #[must_use]
    pub const fn options(&self) -> &F::Options {
        &self.options
    }

    /// Copies as many bytes as are needed for the next decision, or as there are.
    fn fill(&mut self, input: &mut &[u8]) {
        let missing = self.wanted.saturating_sub(self.length).min(input.len());
        let Some((taken, rest)) = input.split_at_checked(missing) else { return };
        let place = self.buffer.get_mut(self.length..).and_then(|free| free.get_mut(..missing));
        if let Some(place) = place {
            place.copy_from_slice(taken);
            self.length += missing;
            *input = rest;
        }
    }

    /// Decides about the bytes in the buffer. Each call discards bytes, asks for more, or finds a frame, so a loop over
    /// it ends.
    fn step(&mut self) -> Option<F> {
        let bytes = self.buffer.get(..self.length).unwrap_or(&[]);
        let noise = noise_before(bytes, F::header(&self.options));
        if noise > 0 {
            self.give_up(noise);
            self.wanted = F::PREFIX;
            return None;
        }
        let Some(prefix) = bytes.get(..F::PREFIX) else {
            self.wanted = F::PREFIX;
            return None;
        };
        let total =
            F::length(&self.options, prefix).filter(|total| (F::PREFIX..=N).contains(total));
        let Some(total) = total else {
            self.reject(Reject::Length, 1);
            return None;
        };
        let Some(frame) = bytes.get(..total) else {
            // `total` is at most N, so the buffer has room for the whole frame.
            self.wanted = total;
            return None;
        };
        match F::decode(&self.options, frame) {
            Ok(frame) => {
                count(&mut self.counts.frames, 1);
                self.discard(total);
                Some(frame)
            }
            Err(reject) => {
                self.reject(reject, total);
                None
            }
        }
    }

    fn reject(&mut self, reject: Reject, total: usize) {
        match reject {
            Reject::Unframed => {}
            Reject::Length => count(&mut self.counts.length_errors, 1),
            Reject::Checksum => count(&mut self.counts.checksum_errors, 1),
            Reject::Foreign => count(&mut self.counts.foreign_frames, 1),
            Reject::Content => count(&mut self.counts.content_errors, 1),
        }
        match reject {
            Reject::Foreign => self.discard(total),
            Reject::Unframed | Reject::Length | Reject::Checksum | Reject::Content => {
                self.give_up(1);
            }
        }
    }

    fn give_up(&mut self, length: usize) {
        let length = length.min(self.length);
        count(&mut self.counts.skipped_bytes, u32::try_from(length).unwrap_or(u32::MAX));
        self.discard(length);
    }

    /// Takes `count` bytes off the front of the buffer.
    fn discard(&mut self, count: usize) {
        self.wanted = F::PREFIX;
        let used = self.buffer.get_mut(..self.length).unwrap_or_default();
        if count < used.len() {
            used.copy_within(count.., 0);
            self.length = used.len() - count;
        } else {
            self.length = 0; // a frame that came whole: nothing to move
        }
    }
}

impl<F: Decode, const N: usize> fmt::Debug for Deframer<F, N> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Deframer")
            .field("options", &self.options)
            .field("buffered", &self.length)
            .field("counts", &self.counts)
            .finish_non_exhaustive()
    }
}

impl Counts {
    pub(super) const fn new() -> Self {
        Self {
            frames: 0,
            length_errors: 0,
            checksum_errors: 0,
            foreign_frames: 0,
            content_errors: 0,
            skipped_bytes: 0,
        }
    }
}

pub(super) fn count(counter: &mut u32, more: u32) {
    *counter = counter.saturating_add(more);
}

/// Returns how many bytes stand before the first place where the header is, or could be when more bytes come.
fn noise_before(bytes: &[u8], header: &[u8]) -> usize {
    (0..bytes.len())
        .find(|start| {
            let rest = bytes.get(*start..).unwrap_or(&[]);
            rest.iter().zip(header).all(|(byte, expected)| byte == expected)
        })
        .unwrap_or(bytes.len())
}
