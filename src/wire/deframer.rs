use core::fmt;

/// A frame that a [`Deframer`] finds in bytes: how it begins, how long it is, and what it says.
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
    /// What has to be known besides the bytes (a byte order, say); `()` for most frames.
    type Options: Clone + fmt::Debug;

    /// How many bytes of a frame tell its length, the header included: at least 1.
    const PREFIX: usize;

    /// Returns the bytes that every frame begins with; none for a protocol that marks only the end of a frame.
    fn header(options: &Self::Options) -> &[u8];

    /// Returns the length of the whole frame in bytes, from its first [`PREFIX`](Self::PREFIX) bytes; `None` when no
    /// frame can have the length that they state.
    fn length(options: &Self::Options, prefix: &[u8]) -> Option<usize>;

    /// Returns whether it says something new; `false` when its source is frozen and repeats `previous`.
    ///
    /// [`Receiver`](super::Receiver) takes only new frames for a sign of life.
    fn is_new(&self, _previous: &Self) -> bool {
        true
    }

    /// Checks a whole frame and reads it.
    ///
    /// # Errors
    /// [`Reject`] says what is wrong with the frame. After [`Reject::Foreign`] it is skipped as a whole, after any other its
    /// bytes are searched again.
    fn decode(options: &Self::Options, frame: &[u8]) -> Result<Self, Reject>;
}

/// Why bytes that began like a frame gave no value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Reject {
    /// The end of the frame is not where it should be. Only for protocols without header.
    Unframed,
    /// A length that no frame has.
    Length,
    /// The checksum does not fit.
    Checksum,
    /// The checksum fits, but this decoder does not read frames of this kind.
    Foreign,
    /// The checksum fits, but a field has a value that it cannot have. One damaged frame in 65536 looks like this by
    /// chance (16-bit checksum), with a good one inside.
    Content,
}

/// How many frames a decoder found, and what it threw away. All counts saturate.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Counts {
    /// Good frames.
    pub frames: u32,
    /// Headers followed by a length of zero, or by one too large for the protocol or the buffer; frames that ended early.
    pub length_errors: u32,
    /// Whole frames whose checksum did not fit.
    pub checksum_errors: u32,
    /// Good frames of a kind that is not read.
    pub foreign_frames: u32,
    /// Frames with a fitting checksum, or none, and an impossible value.
    pub content_errors: u32,
    /// Bytes that belonged to no good frame: noise, and what is left of damaged frames.
    pub skipped_bytes: u32,
}

/// A streaming decoder of one kind of frames, with a buffer of `N` bytes.
///
/// It takes the bytes in any portions, and finds the same frames in them however they are split. When a frame turns
/// out to be damaged, only its first byte is given up and the rest is searched again: a good frame that begins inside
/// of it (after a truncated frame, after noise that looked like a header, after a length made too long) is found.
///
/// `N` is also the longest frame that is waited for: a frame that states to be longer is refused at once.
///
/// Cost: a copy of every byte, and one checksum a frame. Damage costs at most one more checksum for each header that
/// stands in the damaged bytes. Portions are cheap; a byte that comes alone costs about ten
/// times one of a portion (`docs/figures.md` has the counts), so collect them where the serial port does not.
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
    /// How many bytes of the buffer are in use: they begin like a frame.
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

    /// Returns the next frame, and takes from `input` the bytes that it looked at. `None` when `input` is used up: the
    /// last bytes may be the beginning of a frame and are kept.
    ///
    /// Call it until it returns `None`, as in `while let Some(frame) = decoder.read(&mut input) { .. }`.
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

    /// Gives up the frame that was begun and not finished, and searches its bytes for shorter ones.
    ///
    /// For a pause on the line that no frame contains: with it, a damaged length cannot hold back the frames behind it
    /// until the bytes that it promises have come. Frames found are returned by [`read`](Self::read), so call that
    /// with an empty input afterwards.
    pub fn abandon(&mut self) {
        self.give_up(1);
    }

    /// Returns how many frames were found, and what was thrown away.
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

    /// Decides about the bytes in the buffer. Each call gives bytes up, asks for more, or finds a frame, so a loop
    /// over it ends.
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
            // `total` is at most N, so the buffer has room for all of it.
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
